//! Sitting down, seated, getting up.

use glam::{Quat, Vec3};

use super::{DescentStyle, RisingStyle, SeatedStyle, StyleValues, hips_yaw, lean, speeds, turned};
use crate::action::ActionLabel;
use crate::library::Segment;
use crate::library::contact::runs;
use crate::motion::{FRAME_RATE, Joint, Pose};

/// A pelvis that goes less far up or down neither sits down nor gets up, metres.
const LEAST_WAY: f32 = 0.1;
/// A descent or rise is between these parts of the pelvis's way.
const WAY: (f32, f32) = (0.05, 0.95);
/// What happens in so many frames before a descent leads to it; of fewer than the others nothing is said.
const BEFORE: (usize, usize) = (75, 30);
/// Faster than this someone has walked, m/s; slower than this one all but stands.
const WALKED: f32 = 0.5;
const STILL: f32 = 0.1;
/// Of shorter stretches of sitting no speed is told, frames.
const SEATED: usize = 10;
/// Frames of which the fastest sink is a mean.
const SINK: usize = 3;
/// Further than it leant least in the second before a descent the trunk leans, degrees.
const LEANS: f32 = 10.0;
/// Frames after a descent in which arms still settle.
const SETTLES: usize = 10;

impl StyleValues {
    pub(super) fn sit(&mut self, poses: &[Pose], segments: &[Segment]) {
        for segment in segments {
            let (first, end) = (segment.first, segment.end.min(poses.len()));
            let complete = segment.complete.min(poses.len().saturating_sub(1));
            match segment.label {
                ActionLabel::Sit => self.descent.add(descent(poses, first, complete).unwrap_or_default()),
                ActionLabel::SeatedIdle if first < end => self.seated.add(seated(&poses[first..end])),
                ActionLabel::StandUp => {
                    self.rising
                        .add(rising(poses.get(first..=complete).unwrap_or_default()).unwrap_or_default());
                }
                _ => {}
            }
        }
    }
}

/// From when to when the pelvis goes from a twentieth to 95 % of its way, `up` or down.
fn moving(poses: &[Pose], up: bool) -> Option<(usize, usize)> {
    let z = |pose: &Pose| pose.positions[0].z;
    let (first, last) = (z(poses.first()?), z(poses.last()?));
    if (if up { last - first } else { first - last }) < LEAST_WAY {
        return None;
    }
    let part = |pose: &Pose| (z(pose) - first) / (last - first);
    let to = poses.iter().position(|pose| part(pose) > WAY.1)?;
    // Who still walks bobs: the last frame that is high counts.
    let from = poses[..to].iter().rposition(|pose| part(pose) <= WAY.0).map_or(0, |frame| frame + 1);
    Some((from, to))
}

fn descent(poses: &[Pose], first: usize, complete: usize) -> Option<DescentStyle> {
    let down = poses.get(first..=complete)?;
    let (from, to) = moving(down, false)?;
    let way = &down[from..=to];
    let sink = |w: &[Pose]| (w[0].positions[0].z - w[SINK].positions[0].z) * FRAME_RATE / SINK as f32;
    let moved = |foot: Joint| {
        let place = |pose: &Pose| pose.position(foot).truncate();
        way.iter().map(|pose| place(pose).distance(place(&way[0]))).fold(0.0, f32::max)
    };
    let leans: Vec<f32> = down.iter().map(lean).collect();
    let deepest = (0..down.len()).max_by(|&a, &b| leans[a].total_cmp(&leans[b]))?;
    let least =
        leans[from.saturating_sub(FRAME_RATE as usize)..=from].iter().copied().fold(f32::MAX, f32::min);
    let leant = leans[..=deepest].iter().rposition(|lean| *lean <= least + LEANS).filter(|&l| l < deepest);
    let height = |frame: usize| down[frame].positions[0].z;
    let sunk = (height(0) - height(deepest)) / (height(0) - height(down.len() - 1));
    let lifted = |pose: &Pose| {
        let of = |upper: Joint, lower: Joint| {
            (pose.position(lower) - pose.position(upper)).angle_between(Vec3::NEG_Z).to_degrees()
        };
        of(Joint::LeftArm, Joint::LeftForeArm).max(of(Joint::RightArm, Joint::RightForeArm))
    };
    let begins = first + from;
    let ends = first + to;
    let before = &poses[begins.saturating_sub(BEFORE.0)..=begins];
    let is_long = before.len() > BEFORE.1;
    let walked_at = speeds(&poses[..=begins], 1, false).into_iter().position(|speed| speed > WALKED);
    Some(DescentStyle {
        turn_before_degrees: is_long.then(|| turned(before)),
        still_before_s: walked_at.filter(|_| is_long).map(|walked| {
            let still: Vec<bool> =
                speeds(&poses[walked.max(begins.saturating_sub(BEFORE.0))..=begins], 1, false)
                    .into_iter()
                    .map(|speed| speed < STILL)
                    .collect();
            let longest = runs(&still, true).into_iter().map(|(first, end)| end - first).max();
            longest.unwrap_or(0) as f32 / FRAME_RATE
        }),
        descent_s: Some((to - from) as f32 / FRAME_RATE),
        lean_degrees: Some(leans[deepest]),
        lean_leads_s: leant.map(|leant| (from as f32 - (leant + 1) as f32) / FRAME_RATE),
        sunk_at_lean_percent: Some(100.0 * sunk),
        lean_at_seat_degrees: Some(leans[to]),
        upper_arm_degrees: poses[begins..(ends + SETTLES).min(poses.len())]
            .iter()
            .map(lifted)
            .max_by(f32::total_cmp),
        fastest_sink_m_per_s: down.windows(SINK + 1).map(sink).max_by(f32::total_cmp),
        feet_move_cm: Some(100.0 * moved(Joint::LeftToe).max(moved(Joint::RightToe))),
        pelvis_turns_degrees: Some(turned(way)),
    })
}

fn seated(poses: &[Pose]) -> SeatedStyle {
    let middle = &poses[poses.len() / 2];
    let local = |joint: Joint| {
        Quat::from_rotation_z(-hips_yaw(middle)) * (middle.position(joint) - middle.positions[0])
    };
    let (left, right) = (local(Joint::LeftFoot), local(Joint::RightFoot));
    let speed_of = |joints: &[Joint]| {
        let seconds = (poses.len() - 1) as f32 / FRAME_RATE;
        let way = |joint: &Joint| {
            poses.windows(2).map(|w| w[1].position(*joint).distance(w[0].position(*joint))).sum::<f32>()
        };
        100.0 * joints.iter().map(way).sum::<f32>() / joints.len() as f32 / seconds
    };
    let speed = |joints: &[Joint]| (poses.len() >= SEATED).then(|| speed_of(joints));
    SeatedStyle {
        trunk_degrees: Some(lean(middle)),
        feet_fore_aft_cm: Some(100.0 * (left.y - right.y).abs()),
        ankles_apart_cm: Some(100.0 * (left - right).truncate().length()),
        knees_apart_cm: Some(100.0 * local(Joint::LeftLeg).distance(local(Joint::RightLeg))),
        wrists_cm_per_s: speed(&Joint::HANDS),
        head_cm_per_s: speed(&[Joint::Head]),
        knees_cm_per_s: speed(&[Joint::LeftLeg, Joint::RightLeg]),
    }
}

fn rising(poses: &[Pose]) -> Option<RisingStyle> {
    let (from, to) = moving(poses, true)?;
    Some(RisingStyle {
        rise_s: Some((to - from) as f32 / FRAME_RATE),
        lean_degrees: poses.iter().map(lean).max_by(f32::total_cmp),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::style::Style;
    use crate::motion::Posture;

    /// One walks at 1 m/s for 60 frames, stands still for `still`, turns by 0.3 and sinks by 0.4 m in 40 frames, and sits for 30.
    fn walk_and_sit(still: usize) -> (Vec<Pose>, [Segment; 3]) {
        let sinks = 60 + still;
        let count = sinks + 40 + 30;
        let pose = |frame: usize| {
            let mut posture = Posture::default();
            let down = (frame.max(sinks) - sinks).min(40) as f32 / 40.0;
            posture.root_position.y = -(frame.min(60) as f32) / 30.0;
            posture.root_position.z -= 0.4 * down;
            posture.rotations[0] = Quat::from_rotation_z(0.3 * down);
            posture.rotations[Joint::Spine.index()] = Quat::from_rotation_x(down * (1.0 - down));
            posture.pose()
        };
        let at = |label, first, end, complete| Segment { label, first, end, complete };
        let segments = [
            at(ActionLabel::Walk, 0, 50, 49),
            at(ActionLabel::Sit, 50, sinks + 41, sinks + 40),
            at(ActionLabel::SeatedIdle, sinks + 41, count, count - 1),
        ];
        ((0..count).map(pose).collect(), segments)
    }

    /// The lean half-way down: all over the lowest joint of the spine, 43 cm up to the neck and 1 cm back, is bent by 0.25.
    fn leaning() -> f32 {
        let (sin, cos) = 0.25f32.sin_cos();
        (0.43 * sin - 0.01 * cos - 0.01).atan2(0.10 + 0.43 * cos + 0.01 * sin).to_degrees()
    }

    fn figures(poses: &[Pose], segments: &[Segment]) -> crate::figures::StyleFigures {
        let mut values: Style<Vec<f32>> = Style::default();
        values.sit(poses, segments);
        values.medians()
    }

    #[test]
    fn a_sit_by_hand() {
        let (poses, segments) = walk_and_sit(20);
        let found = figures(&poses, &segments).descent;
        let near = |value: Option<f32>, expected: f32| {
            assert!((value.expect("a value") - expected).abs() < 1e-2, "{value:?} {expected}");
        };
        // From the third of 40 frames, the first over a twentieth, to the 39th, the first over 95 %.
        near(found.descent_s, 36.0 / 30.0);
        near(found.fastest_sink_m_per_s, 0.3);
        near(found.pelvis_turns_degrees, (0.3f32 * 36.0 / 40.0).to_degrees());
        // 20 frames still, and the first ones of the sink are slower than 10 cm/s nowhere: it is 30 cm/s.
        near(found.still_before_s, 20.0 / 30.0);
        near(found.turn_before_degrees, (0.3f32 * 3.0 / 40.0).to_degrees());
        near(found.lean_degrees, leaning());
        // Half-way down it leans most. Upright it leans back by 2.2°, and forwards by 7.8° once the spine is bent by 0.2145: in the
        // 13th of the 40 frames, ten after the third.
        near(found.sunk_at_lean_percent, 50.0);
        near(found.lean_leads_s, -10.0 / 30.0);
        near(found.lean_at_seat_degrees, lean(&poses[119]));
        near(found.upper_arm_degrees, 90.0);
        near(figures(&walk_and_sit(0).0, &walk_and_sit(0).1).descent.still_before_s, 0.0);
        // Who never walked does not stand still on the way, and of what was hardly seen nothing is said.
        let standing =
            figures(&poses[62..], &[Segment { first: 0, end: 59, complete: 58, ..segments[1] }]).descent;
        assert_eq!((standing.still_before_s, standing.turn_before_degrees), (None, None));
        assert!(standing.descent_s.is_some());
    }

    #[test]
    fn bobbing_while_one_walks_is_no_descent() {
        let (mut poses, segments) = walk_and_sit(20);
        // The pelvis dips by 5 cm on the way.
        poses[52..56].iter_mut().for_each(|pose| pose.positions[0].z -= 0.05);
        assert!((figures(&poses, &segments).descent.descent_s.expect("a sit") - 1.2).abs() < 1e-3);
        // What sinks by less than 10 cm is no sit.
        let squat = Segment { label: ActionLabel::Sit, first: 50, end: 57, complete: 54 };
        assert_eq!(figures(&poses, &[squat]).descent, DescentStyle::default());
    }

    #[test]
    fn sitting_by_hand() {
        let (mut poses, segments) = walk_and_sit(20);
        for (frame, pose) in poses.iter_mut().enumerate() {
            // The pelvis has turned by 0.3: along there.
            let ahead = Quat::from_rotation_z(0.3) * glam::Vec3::NEG_Y;
            pose.positions[Joint::LeftFoot.index()] += 0.12 * ahead;
            pose.positions[Joint::Head.index()].z += 0.001 * frame as f32;
        }
        let found = figures(&poses, &segments).seated;
        let near = |value: Option<f32>, expected: f32| {
            assert!((value.expect("a value") - expected).abs() < 1e-2, "{value:?} {expected}");
        };
        near(found.feet_fore_aft_cm, 12.0);
        near(found.ankles_apart_cm, 19f32.hypot(12.0));
        near(found.knees_apart_cm, 19.0);
        near(found.head_cm_per_s, 3.0);
        near(found.wrists_cm_per_s, 0.0);
        near(found.knees_cm_per_s, 0.0);
        // One frame shows a pose and no speed; none shows nothing.
        let last = figures(&poses, &[Segment { first: 149, end: 150, ..segments[2] }]).seated;
        near(last.feet_fore_aft_cm, 12.0);
        assert_eq!(last.head_cm_per_s, None);
        let nothing = Segment { first: 150, end: 150, ..segments[2] };
        assert_eq!(figures(&poses, &[nothing]).seated, SeatedStyle::default());
    }

    #[test]
    fn getting_up_by_hand() {
        let (mut poses, _) = walk_and_sit(20);
        poses.reverse();
        let up = Segment { label: ActionLabel::StandUp, first: 30, end: 75, complete: 70 };
        let found = figures(&poses, &[up]).rising;
        assert!((found.rise_s.expect("a rise") - 35.0 / 30.0).abs() < 0.04, "{found:?}");
        assert!((found.lean_degrees.expect("a lean") - leaning()).abs() < 1e-2, "{found:?}");
        // Down is not up.
        assert_eq!(
            figures(&walk_and_sit(20).0, &[Segment { first: 80, end: 121, complete: 120, ..up }]).rising,
            RisingStyle::default()
        );
    }
}

//! On foot: straight walking, the way as a whole, the first step.

use std::ops::Range;

use glam::{Quat, Vec2, Vec3};

use super::{
    StartStyle, StyleValues, WalkingStyle, WayStyle, deviation, facing, hips_yaw, lean, mean, range, speeds,
    turned, yaw_across,
};
use crate::library::contact::runs;
use crate::math::rotation::{wrap_angle, yaw};
use crate::motion::{FRAME_RATE, Joint, Pose};

/// Frames of a stretch of walking that is measured: about a stride.
const STRIDE: usize = 36;
/// Walking is at least so fast, m/s, …
const WALKING: f32 = 0.4;
/// … never slower than this part of its mean, …
const EVEN: f32 = 0.55;
/// … straight, degrees …
const STRAIGHT: f32 = 30.0;
/// … and forwards: the cosine between facing and way.
const FORWARDS: f32 = 0.9;
/// Someone who is faster than this is on the way, m/s.
const UNDER_WAY: f32 = 0.3;
/// The variation of fewer frames tells nothing.
const LONG_ENOUGH: usize = 30;
/// Frames over which speeds and turns are means.
const SMOOTHED: usize = 5;
/// Who turns faster than this turns, degrees a second, a mean of so many frames.
const TURNING: (f32, usize) = (45.0, 9);
/// Someone stands whose pelvis gets no farther than this in so many frames, metres.
const STILL: (f32, usize) = (0.02, 4);
/// A foot has left where its ankle is so far from where it stood, metres.
const LEFT: f32 = 0.03;
/// A shift has begun with this part of it.
const BEGUN: f32 = 0.15;

impl StyleValues {
    pub(super) fn walk(&mut self, poses: &[Pose], on_foot: &[bool]) {
        let all: Vec<Range<usize>> = runs(on_foot, true).into_iter().map(|(first, end)| first..end).collect();
        for first in (0..poses.len().saturating_sub(STRIDE)).step_by(STRIDE / 2) {
            if on_foot[first..first + STRIDE].iter().all(|on_foot| *on_foot)
                && let Some(one) = stride(&poses[first..first + STRIDE])
            {
                self.walking.add(one);
            }
        }
        let stretches: Vec<&[Pose]> = all.into_iter().map(|run| &poses[run]).collect();
        self.way.add(way(&stretches));
        if let Some(start) = start(poses, on_foot) {
            self.start.add(start);
        }
    }
}

fn stride(poses: &[Pose]) -> Option<WalkingStyle> {
    let place = |pose: &Pose| pose.positions[0].truncate();
    let way = place(&poses[STRIDE - 1]) - place(&poses[0]);
    let speed = way.length() * FRAME_RATE / (STRIDE - 1) as f32;
    let slowest = speeds(poses, 1, true).into_iter().fold(f32::INFINITY, f32::min);
    let ahead = way.normalize_or_zero();
    let turned = turned(poses);
    let faces = facing(&poses[STRIDE / 2]).truncate();
    if speed < WALKING || slowest < EVEN * speed || turned > STRAIGHT || faces.dot(ahead) < FORWARDS {
        return None;
    }
    let side = Vec2::new(-ahead.y, ahead.x);
    let in_pelvis = |joint: Joint, axis: Vec3| {
        let local = |p: &Pose| Quat::from_rotation_z(-hips_yaw(p)) * (p.position(joint) - p.positions[0]);
        100.0 * range(poses.iter().map(|p| local(p).dot(axis)))
    };
    let along = |joint: Joint| {
        100.0 * range(poses.iter().map(|p| (p.position(joint) - p.positions[0]).truncate().dot(ahead)))
    };
    let speed_deviation = |joint: Joint| {
        let step = |pair: &[Pose]| pair[1].position(joint).distance(pair[0].position(joint)) * FRAME_RATE;
        100.0 * deviation(&poses.windows(2).map(step).collect::<Vec<_>>())
    };
    let counter = poses
        .iter()
        .map(|p| wrap_angle(yaw_across(p, Joint::LeftArm, Joint::RightArm) - hips_yaw(p)).to_degrees());
    let both = |of: &dyn Fn(Joint) -> f32, joints: [Joint; 2]| 0.5 * (of(joints[0]) + of(joints[1]));
    let mean_of = |of: fn(&Pose) -> f32| mean(&poses.iter().map(of).collect::<Vec<_>>());
    let beside: Vec<f32> = poses.iter().map(|p| p.position(Joint::Neck).truncate().dot(side)).collect();
    Some(WalkingStyle {
        speed_m_per_s: Some(speed),
        neck_sideways_cm: Some(100.0 * detrended_range(&beside)),
        head_bob_cm: Some(100.0 * range(poses.iter().map(|p| p.position(Joint::Head).z))),
        head_up_cm: Some(in_pelvis(Joint::Head, Vec3::Z)),
        shoulders_degrees: Some(range(counter)),
        pelvis_degrees: Some(turned),
        head_pitch_degrees: Some(mean_of(head_pitch)),
        wrist_fore_aft_cm: Some(both(&along, Joint::HANDS)),
        wrist_sideways_cm: Some(both(&|j| in_pelvis(j, Vec3::X), Joint::HANDS)),
        elbow_sideways_cm: Some(both(&|j| in_pelvis(j, Vec3::X), [Joint::LeftForeArm, Joint::RightForeArm])),
        head_speed_sd_cm_per_s: Some(speed_deviation(Joint::Head)),
        neck_speed_sd_cm_per_s: Some(speed_deviation(Joint::Neck)),
        shoulder_speed_sd_cm_per_s: Some(both(&speed_deviation, [Joint::LeftArm, Joint::RightArm])),
        neck_fore_aft_cm: Some(in_pelvis(Joint::Neck, Vec3::Y)),
        knee_up_cm: Some(both(&|j| in_pelvis(j, Vec3::Z), [Joint::LeftLeg, Joint::RightLeg])),
        trunk_lean_degrees: Some(mean_of(lean)),
    })
}

/// The pitch of the head against its rest, degrees; down is negative.
fn head_pitch(pose: &Pose) -> f32 {
    let gaze = pose.rotation(Joint::Head) * Vec3::NEG_Y;
    gaze.z.clamp(-1.0, 1.0).asin().to_degrees()
}

/// The range of what a straight line does not explain of the values.
fn detrended_range(values: &[f32]) -> f32 {
    let (middle, mean) = (0.5 * (values.len() as f32 - 1.0), mean(values));
    let (mut up, mut down) = (0.0, 0.0);
    for (i, v) in values.iter().enumerate() {
        let t = i as f32 - middle;
        up += t * (v - mean);
        down += t * t;
    }
    range(values.iter().enumerate().map(|(i, v)| v - mean - up / down * (i as f32 - middle)))
}

fn way(stretches: &[&[Pose]]) -> WayStyle {
    let under_way: Vec<f32> = stretches
        .iter()
        .flat_map(|poses| speeds(poses, SMOOTHED, true))
        .filter(|speed| *speed > UNDER_WAY)
        .collect();
    let rates = |frames: usize| stretches.iter().flat_map(move |poses| turn_rates(poses, frames));
    let fastest = rates(SMOOTHED).map(|(_, rate)| rate.abs()).max_by(f32::total_cmp);
    let mut leads: Vec<f32> = rates(TURNING.1)
        .filter(|(_, rate)| rate.abs() > TURNING.0)
        .map(|(middle, rate)| {
            let ahead = wrap_angle(yaw(middle.rotation(Joint::Head)) - yaw(middle.rotations[0]));
            rate.signum() * ahead.to_degrees()
        })
        .collect();
    leads.sort_unstable_by(f32::total_cmp);
    WayStyle {
        speed_variation: (under_way.len() >= LONG_ENOUGH).then(|| deviation(&under_way) / mean(&under_way)),
        fastest_turn_degrees_per_s: fastest,
        head_leads_degrees: leads.get(leads.len() / 2).copied(),
    }
}

/// How fast the pelvis turns over so many frames, degrees a second, with the pose in their middle.
fn turn_rates(poses: &[Pose], frames: usize) -> Vec<(&Pose, f32)> {
    let facing: Vec<f32> = poses.iter().map(|pose| yaw(pose.rotations[0])).collect();
    let turned = |w: &[f32]| w.windows(2).map(|pair| wrap_angle(pair[1] - pair[0])).sum::<f32>();
    let rate = |w: &[f32]| turned(w).to_degrees() * FRAME_RATE / frames as f32;
    facing.windows(frames + 1).enumerate().map(|(first, w)| (&poses[first + frames / 2], rate(w))).collect()
}

/// The first step of who stands at first; a foot that is set while sitting shifts no weight.
fn start(poses: &[Pose], on_foot: &[bool]) -> Option<StartStyle> {
    let (first, soon) = (poses.first()?, poses.get(STILL.1 - 1)?);
    if first.positions[0].distance(soon.positions[0]) > STILL.0 {
        return None;
    }
    let foot = |pose: &Pose, side: usize| pose.position(Joint::FEET[side]).truncate();
    let gone = |frame: usize, side: usize| foot(&poses[frame], side).distance(foot(first, side)) > LEFT;
    let (left, side) =
        (0..poses.len()).find_map(|f| (0..2).find(|side| gone(f, *side)).map(|side| (f, side)))?;
    if !on_foot[..=left].iter().all(|on_foot| *on_foot) {
        return None;
    }
    let towards = (foot(first, 1 - side) - foot(first, side)).normalize_or_zero();
    let shift = |frame: usize| (poses[frame].positions[0] - first.positions[0]).truncate().dot(towards);
    let most = shift(left);
    let begun = (0..left).rev().find(|frame| shift(*frame) < BEGUN * most).filter(|_| most > 0.0);
    Some(StartStyle {
        weight_shift_cm: Some(100.0 * most),
        shift_s: begun.map(|begun| (left - begun) as f32 / FRAME_RATE),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Posture;

    /// So many frames at rest, each changed by `change`, in which one walks along −Y at `speed` m/s.
    fn walk(frames: usize, speed: impl Fn(usize) -> f32, change: impl Fn(usize, &mut Posture)) -> Vec<Pose> {
        let mut y = 0.0;
        (0..frames)
            .map(|frame| {
                let mut posture = Posture::default();
                change(frame, &mut posture);
                posture.root_position.y = y;
                y -= speed(frame) / FRAME_RATE;
                posture.pose()
            })
            .collect()
    }

    fn turn(posture: &mut Posture, joint: Joint, rotation: Quat) {
        posture.rotations[joint.index()] = rotation;
    }

    #[test]
    fn a_stride_by_hand() {
        let poses = walk(
            STRIDE,
            |_| 1.0,
            |frame, posture| {
                let (odd, sign) = (frame % 2, if frame % 2 == 0 { 1.0 } else { -1.0 });
                posture.root_position.z += 0.02 * odd as f32;
                turn(posture, Joint::Head, Quat::from_rotation_x(0.2));
                turn(posture, Joint::Spine, Quat::from_rotation_z(0.1 * sign));
                turn(posture, Joint::LeftForeArm, Quat::from_rotation_z(0.3 * odd as f32));
            },
        );
        let found = stride(&poses).expect("a stride");
        let near = |value: Option<f32>, expected: f32| {
            assert!((value.expect("a value") - expected).abs() < 1e-2, "{value:?} {expected}");
        };
        near(found.speed_m_per_s, 1.0);
        near(found.head_bob_cm, 2.0);
        near(found.head_up_cm, 0.0);
        near(found.head_pitch_degrees, -0.2f32.to_degrees());
        near(found.shoulders_degrees, 0.2f32.to_degrees());
        near(found.pelvis_degrees, 0.0);
        near(found.trunk_lean_degrees, lean(&poses[0]));
        // Both wrists are 73.6 cm beside a line through the spine that turns by 0.2; bending the left elbow draws it in.
        let wrist = |angle: f32, bend: f32| {
            let elbow = Vec2::from_angle(angle) * 0.458;
            elbow + Vec2::from_angle(angle + bend) * 0.278
        };
        let left = (wrist(0.1, 0.0).y - wrist(-0.1, 0.3).y).abs();
        let right = (wrist(0.1, 0.0).y - wrist(-0.1, 0.0).y).abs();
        // The spine's joint is a centimetre behind the pelvis: both ends of the range alike.
        near(found.wrist_fore_aft_cm, 50.0 * (left + right));
        let across = (wrist(0.1, 0.0).x - wrist(-0.1, 0.3).x).abs();
        near(found.wrist_sideways_cm, 50.0 * across);
    }

    #[test]
    fn only_straight_even_walking_forwards_is_a_stride() {
        let at = |speed: f32, change: fn(usize, &mut Posture)| stride(&walk(STRIDE, |_| speed, change));
        assert!(at(1.0, |_, _| {}).is_some());
        assert!(at(0.3, |_, _| {}).is_none());
        assert!(at(-1.0, |_, _| {}).is_none());
        let turning =
            |frame: usize, p: &mut Posture| turn(p, Joint::Hips, Quat::from_rotation_z(0.02 * frame as f32));
        assert!(at(1.0, turning).is_none());
        assert!(stride(&walk(STRIDE, |frame| if frame == 9 { 0.4 } else { 1.0 }, |_, _| {})).is_none());
    }

    #[test]
    fn a_straight_line_is_no_range() {
        let line: Vec<f32> = (0..20).map(|i| 3.0 + 0.5 * i as f32).collect();
        assert!(detrended_range(&line) < 1e-5);
        // A zigzag about a line, symmetric about its middle, is left as it is.
        let zigzag: Vec<f32> =
            (0..21).map(|i| 0.5 * i as f32 + if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!((detrended_range(&zigzag) - 2.0).abs() < 1e-4);
    }

    #[test]
    fn the_way_by_hand() {
        let half = |frame: usize| if frame < 60 { 1.0 } else { 0.5 };
        let turning = |frame: usize, posture: &mut Posture| {
            // 60°/s in frames 30 to 50, the head 0.15 ahead of the pelvis.
            turn(posture, Joint::Hips, Quat::from_rotation_z(2f32.to_radians() * frame.clamp(30, 50) as f32));
            turn(posture, Joint::Head, Quat::from_rotation_z(0.15));
        };
        let poses = walk(120, half, turning);
        let found = way(&[&poses]);
        assert!((found.speed_variation.expect("a way") - 1.0 / 3.0).abs() < 0.01, "{found:?}");
        assert!((found.fastest_turn_degrees_per_s.expect("a turn") - 60.0).abs() < 1e-2, "{found:?}");
        assert!((found.head_leads_degrees.expect("a turn") - 0.15f32.to_degrees()).abs() < 1e-2, "{found:?}");
        // A head that looks back when one turns the other way does not lead.
        let other = walk(120, half, |frame, posture| {
            turning(120 - frame, posture);
        });
        assert!(way(&[&other]).head_leads_degrees.expect("a turn") < 0.0);
        let straight = way(&[&walk(20, |_| 1.0, |_, _| {})]);
        assert_eq!((straight.speed_variation, straight.head_leads_degrees), (None, None));
        assert_eq!(way(&[]), WayStyle::default());
    }

    /// The pelvis moves by `shift` to the left foot from frame 10 to 20, and the right foot leaves at frame 22.
    fn first_step(shift: f32) -> Vec<Pose> {
        let mut poses = vec![crate::motion::Posture::default().pose(); 40];
        for (frame, pose) in poses.iter_mut().enumerate() {
            pose.positions[0].x += shift * (frame.clamp(10, 20) - 10) as f32 / 10.0;
            pose.positions[Joint::RightFoot.index()].y -= 0.05 * frame.saturating_sub(21) as f32;
        }
        poses
    }

    #[test]
    fn a_first_step_by_hand() {
        let poses = first_step(0.05);
        let on_foot = vec![true; poses.len()];
        let found = start(&poses, &on_foot).expect("a start");
        assert!((found.weight_shift_cm.expect("a shift") - 5.0).abs() < 1e-3, "{found:?}");
        // At frame 11 a tenth of the shift is made, at 12 a fifth.
        assert!((found.shift_s.expect("a shift") - 11.0 / 30.0).abs() < 1e-5, "{found:?}");
        let away = start(&first_step(-0.02), &on_foot).expect("a start");
        assert!(away.weight_shift_cm.expect("a shift") < 0.0 && away.shift_s.is_none());
        // Who walks at first does not set off, and who is not on foot does not either.
        let mut gliding = first_step(0.05);
        gliding.iter_mut().enumerate().for_each(|(i, pose)| pose.positions[0].y -= 0.01 * i as f32);
        assert!(start(&gliding, &on_foot).is_none());
        assert!(start(&poses, &[false; 40]).is_none());
        assert!(start(&vec![poses[0]; 40], &on_foot).is_none());
    }
}

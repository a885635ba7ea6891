//! How people of a library walk and sit, measured the same way on captures and on what is made by rule.

use oncue::ActionLabel;
use oncue::glam::{Quat, Vec2, Vec3};
use oncue::library::Clip;
use oncue::motion::{FRAME_RATE, Joint, Pose, Posture};

/// One figure of a library: what it says and its values, one a stretch or clip.
pub struct Row {
    pub name: &'static str,
    pub values: Vec<f32>,
}

impl Row {
    /// The tenth, half and nine tenths of the values.
    pub fn spread(&self) -> Option<[f32; 3]> {
        let mut sorted = self.values.clone();
        sorted.sort_by(f32::total_cmp);
        let at =
            |part: f32| sorted.get((part * sorted.len().saturating_sub(1) as f32).round() as usize).copied();
        Some([at(0.1)?, at(0.5)?, at(0.9)?])
    }
}

/// Frames of a stretch of walking that is measured: about a stride.
const STRIDE: usize = 36;

/// A trunk's lean from upright towards where the pelvis faces, degrees.
fn lean(pose: &Pose) -> f32 {
    let trunk = pose.position(Joint::Neck) - pose.position(Joint::Hips);
    let facing = Quat::from_rotation_z(pose_yaw(pose)) * Vec3::NEG_Y;
    trunk.dot(facing).atan2(trunk.z).to_degrees()
}

/// Yaw of the line between the hips, radians.
fn pose_yaw(pose: &Pose) -> f32 {
    yaw_of(pose, Joint::LeftUpLeg, Joint::RightUpLeg)
}

fn yaw_of(pose: &Pose, left: Joint, right: Joint) -> f32 {
    let across = pose.position(left) - pose.position(right);
    across.y.atan2(across.x)
}

fn wrapped(angle: f32) -> f32 {
    (angle + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI
}

fn range(values: impl Iterator<Item = f32>) -> f32 {
    let (least, most) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    (most - least).max(0.0)
}

fn deviation(values: &[f32]) -> f32 {
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()
}

/// The pitch of the head against its rest, degrees; down is negative.
fn head_pitch(pose: &Pose) -> f32 {
    let gaze = pose.rotation(Joint::Head) * Vec3::NEG_Y;
    gaze.z.clamp(-1.0, 1.0).asin().to_degrees()
}

/// Figures of straight, even walking: one value for each stretch of a stride, half a stride apart.
pub fn walking(clips: &[&Clip]) -> Vec<Row> {
    const NAMES: [&str; 16] = [
        "speed m/s",
        "neck sideways cm",
        "head bob cm",
        "head up in pelvis cm",
        "shoulders/pelvis °",
        "pelvis turn °",
        "head pitch °",
        "wrist fore-aft cm",
        "wrist sideways cm",
        "elbow sideways cm",
        "sd head speed cm/s",
        "sd neck speed cm/s",
        "sd shoulder speed cm/s",
        "neck forward in pelvis cm",
        "knee up cm",
        "trunk lean °",
    ];
    let mut rows: Vec<Row> = NAMES.iter().map(|name| Row { name, values: Vec::new() }).collect();
    for clip in clips {
        let poses: Vec<Pose> = clip.motion.postures.iter().map(Posture::pose).collect();
        for first in (0..poses.len().saturating_sub(STRIDE)).step_by(STRIDE / 2) {
            let stretch = &poses[first..first + STRIDE];
            let Some(values) = stride(stretch) else { continue };
            rows.iter_mut().zip(values).for_each(|(row, value)| row.values.push(value));
        }
    }
    rows
}

fn stride(poses: &[Pose]) -> Option<[f32; 16]> {
    let place = |pose: &Pose| pose.position(Joint::Hips).truncate();
    let way = place(&poses[STRIDE - 1]) - place(&poses[0]);
    let speed = way.length() * FRAME_RATE / (STRIDE - 1) as f32;
    let slowest =
        poses.windows(2).map(|w| place(&w[1]).distance(place(&w[0])) * FRAME_RATE).fold(9.0, f32::min);
    let ahead = way.normalize_or_zero();
    let turned = range(poses.iter().map(|p| wrapped(pose_yaw(p) - pose_yaw(&poses[0])).to_degrees()));
    let facing = Vec2::from_angle(pose_yaw(&poses[STRIDE / 2])).rotate(Vec2::NEG_Y);
    if speed < 0.4 || slowest < 0.55 * speed || turned > 30.0 || facing.dot(ahead) < 0.9 {
        return None;
    }
    let side = Vec2::new(-ahead.y, ahead.x);
    // What a straight line does not explain of how far a joint is beside the way.
    let beside = |joint: Joint| {
        let at: Vec<f32> = poses.iter().map(|p| p.position(joint).truncate().dot(side)).collect();
        detrended_range(&at)
    };
    let in_pelvis = |joint: Joint, axis: Vec3| {
        let local =
            |p: &Pose| Quat::from_rotation_z(-pose_yaw(p)) * (p.position(joint) - p.position(Joint::Hips));
        range(poses.iter().map(|p| local(p).dot(axis)))
    };
    let along = |joint: Joint| {
        let to = |p: &Pose| (p.position(joint) - p.position(Joint::Hips)).truncate();
        (range(poses.iter().map(|p| to(p).dot(ahead))), range(poses.iter().map(|p| to(p).dot(side))))
    };
    let speed_deviation = |joint: Joint| {
        let speeds: Vec<f32> = poses
            .windows(2)
            .map(|w| w[1].position(joint).distance(w[0].position(joint)) * FRAME_RATE)
            .collect();
        100.0 * deviation(&speeds)
    };
    let counter = range(
        poses.iter().map(|p| wrapped(yaw_of(p, Joint::LeftArm, Joint::RightArm) - pose_yaw(p)).to_degrees()),
    );
    let both = |f: &dyn Fn(Joint) -> f32, joints: [Joint; 2]| 0.5 * (f(joints[0]) + f(joints[1]));
    let mean = |f: &dyn Fn(&Pose) -> f32| poses.iter().map(f).sum::<f32>() / STRIDE as f32;
    let bob: Vec<f32> = poses.iter().map(|p| p.position(Joint::Head).z).collect();
    Some([
        speed,
        100.0 * beside(Joint::Neck),
        100.0 * range(bob.into_iter()),
        100.0 * in_pelvis(Joint::Head, Vec3::Z),
        counter,
        turned,
        mean(&head_pitch),
        100.0 * both(&|j| along(j).0, Joint::HANDS),
        100.0 * both(&|j| in_pelvis(j, Vec3::X), Joint::HANDS),
        100.0 * both(&|j| in_pelvis(j, Vec3::X), [Joint::LeftForeArm, Joint::RightForeArm]),
        speed_deviation(Joint::Head),
        speed_deviation(Joint::Neck),
        both(&speed_deviation, [Joint::LeftArm, Joint::RightArm]),
        100.0 * in_pelvis(Joint::Neck, Vec3::Y),
        100.0 * both(&|j| in_pelvis(j, Vec3::Z), [Joint::LeftLeg, Joint::RightLeg]),
        mean(&lean),
    ])
}

fn detrended_range(values: &[f32]) -> f32 {
    let n = values.len() as f32;
    let (middle, mean) = (0.5 * (n - 1.0), values.iter().sum::<f32>() / n);
    let (mut up, mut down) = (0.0, 0.0);
    for (i, v) in values.iter().enumerate() {
        let t = i as f32 - middle;
        up += t * (v - mean);
        down += t * t;
    }
    range(values.iter().enumerate().map(|(i, v)| v - mean - up / down * (i as f32 - middle)))
}

/// Figures of sitting down, seated and getting up; one value a clip that shows it.
pub fn sitting(clips: &[&Clip]) -> Vec<Row> {
    const NAMES: [&str; 14] = [
        "descent s",
        "peak lean down °",
        "fastest sink m/s",
        "feet move down cm",
        "pelvis turns down °",
        "trunk seated °",
        "feet fore-aft cm",
        "ankles apart cm",
        "knees apart cm",
        "wrists seated cm/s",
        "head seated cm/s",
        "knees seated cm/s",
        "rise s",
        "peak lean up °",
    ];
    let mut rows: Vec<Row> = NAMES.iter().map(|name| Row { name, values: Vec::new() }).collect();
    for clip in clips {
        let poses: Vec<Pose> = clip.motion.postures.iter().map(Posture::pose).collect();
        for segment in &clip.segments {
            match segment.label {
                ActionLabel::Sit => down(&poses, segment.first, segment.complete, &mut rows),
                ActionLabel::SeatedIdle => seated(&poses[segment.first..segment.end], &mut rows),
                ActionLabel::StandUp => {
                    let (first, end) = (segment.first, (segment.complete + 1).min(poses.len()));
                    let Some((from, to)) = moving(&poses[first..end], 1.0) else { continue };
                    rows[12].values.push((to - from) as f32 / FRAME_RATE);
                    rows[13].values.push(poses[first..end].iter().map(lean).fold(-90.0, f32::max));
                }
                _ => {}
            }
        }
    }
    rows
}

/// From when to when the pelvis goes from a twentieth to 95 % of its way (`sign` 1 up, −1 down).
fn moving(poses: &[Pose], sign: f32) -> Option<(usize, usize)> {
    let z = |pose: &Pose| pose.position(Joint::Hips).z;
    let (first, last) = (z(poses.first()?), z(poses.last()?));
    let part = |pose: &Pose| (z(pose) - first) / (last - first);
    if (last - first) * sign < 0.1 {
        return None;
    }
    let from = poses.iter().position(|p| part(p) > 0.05)?;
    Some((from, poses.iter().position(|p| part(p) > 0.95)?))
}

fn down(poses: &[Pose], first: usize, complete: usize, rows: &mut [Row]) {
    let Some((from, to)) = moving(&poses[first..=complete], -1.0) else { return };
    let (from, to) = (first + from, first + to);
    let way = &poses[from..=to];
    let z = |pose: &Pose| pose.position(Joint::Hips).z;
    rows[0].values.push((to - from) as f32 / FRAME_RATE);
    rows[1].values.push(poses[first..=complete].iter().map(lean).fold(-90.0, f32::max));
    let sink = poses[first..=complete].windows(4).map(|w| (z(&w[0]) - z(&w[3])) * FRAME_RATE / 3.0);
    rows[2].values.push(sink.fold(0.0, f32::max));
    let moved = |foot: Joint| {
        let at = |p: &Pose| p.position(foot).truncate();
        way.iter().map(|p| at(p).distance(at(&way[0]))).fold(0.0, f32::max)
    };
    rows[3].values.push(100.0 * moved(Joint::LeftToe).max(moved(Joint::RightToe)));
    rows[4].values.push(range(way.iter().map(|p| wrapped(pose_yaw(p) - pose_yaw(&way[0])).to_degrees())));
}

fn seated(poses: &[Pose], rows: &mut [Row]) {
    if poses.len() < 10 {
        return;
    }
    let middle = &poses[poses.len() / 2];
    let local = |joint: Joint| {
        Quat::from_rotation_z(-pose_yaw(middle)) * (middle.position(joint) - middle.position(Joint::Hips))
    };
    let (left, right) = (local(Joint::LeftFoot), local(Joint::RightFoot));
    rows[5].values.push(lean(middle));
    rows[6].values.push(100.0 * (left.y - right.y).abs());
    rows[7].values.push(100.0 * (left - right).truncate().length());
    rows[8].values.push(100.0 * local(Joint::LeftLeg).distance(local(Joint::RightLeg)));
    let speed = |joints: &[Joint]| {
        let seconds = (poses.len() - 1) as f32 / FRAME_RATE;
        let way = |joint: Joint| {
            poses.windows(2).map(|w| w[1].position(joint).distance(w[0].position(joint))).sum::<f32>()
        };
        100.0 * joints.iter().map(|j| way(*j)).sum::<f32>() / joints.len() as f32 / seconds
    };
    rows[9].values.push(speed(&Joint::HANDS));
    rows[10].values.push(speed(&[Joint::Head]));
    rows[11].values.push(speed(&[Joint::LeftLeg, Joint::RightLeg]));
}

/// Figures of starts out of standing: one value for each first step of a clip.
pub fn starting(clips: &[&Clip]) -> Vec<Row> {
    let mut rows: Vec<Row> = ["weight shift cm", "shift to lift-off s"]
        .into_iter()
        .map(|name| Row { name, values: Vec::new() })
        .collect();
    for clip in clips {
        let poses: Vec<Pose> = clip.motion.postures.iter().map(Posture::pose).collect();
        let Some(start) = poses.first() else { continue };
        let foot = |pose: &Pose, side: usize| pose.position(Joint::FEET[side]).truncate();
        let gone = |frame: usize, side: usize| foot(&poses[frame], side).distance(foot(start, side)) > 0.03;
        let Some((lift, side)) = (0..poses.len()).find_map(|f| (0..2).find(|s| gone(f, *s)).map(|s| (f, s)))
        else {
            continue;
        };
        // A foot that is set while sitting shifts no weight.
        if lift < 15 || poses[lift].position(Joint::Hips).z < 0.85 {
            continue;
        }
        // Towards the standing foot, from the middle of the feet.
        let towards = (foot(start, 1 - side) - foot(start, side)).normalize_or_zero();
        let shift =
            |f: usize| (poses[f].position(Joint::Hips) - start.position(Joint::Hips)).truncate().dot(towards);
        let most = shift(lift);
        let Some(begun) = (0..lift).rev().find(|f| shift(*f) < 0.15 * most) else { continue };
        rows[0].values.push(100.0 * most);
        rows[1].values.push((lift - begun) as f32 / FRAME_RATE);
    }
    rows
}

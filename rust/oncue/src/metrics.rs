//! What the paper measures (section 4.1), as the released code computes it, and stricter readings beside it.

use std::collections::BTreeMap;

use glam::Vec2;
use serde::{Deserialize, Serialize};

use crate::action::ActionLabel;
use crate::action::ActionType;
use crate::cue::ActionCue;
use crate::library::{Clip, MotionLibrary};
use crate::math::rotation::{angle_between, wrap_angle};
use crate::motion::skeleton::TOE_HEIGHT;
use crate::motion::speed::{accelerations, joint_turns};
use crate::motion::{BODY_BOXES, FRAME_RATE, JOINT_COUNT, Joint, Limb, Motion, Pose, Posture};
use crate::scene::SceneIndex;

/// How well the feet stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FootFigures {
    /// The paper's "foot contact": a foot is in contact while it moves less than 2 cm a frame or slower than
    /// the other; its distance from where that window began, mean over the windows that end again, cm.
    pub contact_cm: f32,
    /// Mean step of a foot between frames while it is planted (c = 1), cm a frame.
    pub skate_cm: f32,
    /// The largest such step, cm.
    pub worst_skate_cm: f32,
    /// Mean step of a foot while its sole is within 1 cm of the floor, cm a frame: blind to what c says.
    pub low_skate_cm: f32,
    /// How far the lowest foot point sinks under the floor, cm.
    pub sink_cm: f32,
}

/// How often the body is in the scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PenetrationFigures {
    /// The paper's "penetration": share of frames with at least 10 leg or 7 arm crossings, percent.
    pub percent: f32,
    /// The same for legs and arms alone.
    pub legs_percent: f32,
    /// The same for the arms alone, percent.
    pub arms_percent: f32,
    /// Share of frames in which any box of the whole body crosses the scene (what carries pelvis and thighs, no
    /// higher than the seat, is not counted once the person sits down), percent.
    pub whole_body_percent: f32,
    /// Share of frames in which each part does so, percent: leg, arm, foot, torso, head.
    pub parts_percent: BTreeMap<Limb, f32>,
}

/// How a cue was met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    /// The cue's name.
    pub cue: String,
    /// What the cue asked for.
    pub action_type: ActionType,
    /// Frame (30 Hz) at which it was measured.
    pub frame: usize,
    /// Pelvis joint to q_root, cm (for a stop on the floor plane).
    pub pelvis_cm: f32,
    /// Facing, degrees.
    pub facing_degrees: f32,
    /// Ankle to each given foot cue on the floor plane, cm.
    pub feet_cm: [Option<f32>; 2],
    /// Within 10 cm and 20°.
    pub met: bool,
}

/// A cue is met when the pelvis is nearer than this to its place, metres, and its facing, radians (LAMA, supplementary: the
/// robustness test's 10 cm and 20°).
pub const MET_DISTANCE: f32 = 0.10;
/// See [`MET_DISTANCE`].
pub const MET_FACING: f32 = 20f32.to_radians();

/// Whether a pelvis so far from its place (metres) and its facing (radians) meets its cue.
pub fn is_met(distance: f32, facing: f32) -> bool {
    distance < MET_DISTANCE && facing < MET_FACING
}

/// Whether a frame counts as penetrating: so many crossings of the legs or of the arms (LAMA, section 4.1: 10 and 7).
pub fn is_penetrating(legs: u32, arms: u32) -> bool {
    legs >= PENETRATING_LEGS || arms >= PENETRATING_ARMS
}

/// Crossings of the legs from which a frame counts as penetrating.
pub const PENETRATING_LEGS: u32 = 10;
/// The same of the arms.
pub const PENETRATING_ARMS: u32 = 7;

/// Residual of `cue` at `frame` of `motion`.
pub fn residual(cue: &ActionCue, motion: &Motion, frame: usize) -> Option<Residual> {
    let posture = motion.postures.get(frame)?;
    let pose = posture.pose();
    let root = posture.root_position;
    let pelvis = cue.pelvis_distance(root);
    let facing = wrap_angle(posture.planar().yaw - cue.yaw).abs();
    let feet = [0, 1].map(|side| {
        let at = pose.position(Joint::FEET[side]).truncate();
        cue.feet[side].map(|foot| 100.0 * at.distance(foot.truncate()))
    });
    Some(Residual {
        cue: cue.name.clone(),
        action_type: cue.action_type,
        frame,
        pelvis_cm: 100.0 * pelvis,
        facing_degrees: facing.to_degrees(),
        feet_cm: feet,
        met: is_met(pelvis, facing),
    })
}

/// Foot figures of a motion on a floor `floor` metres high.
pub fn foot_figures(motion: &Motion, floor: f32) -> FootFigures {
    let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
    let count = poses.len();
    if count < 2 {
        return FootFigures::default();
    }
    let toe = |frame: usize, side: usize| poses[frame].position(Joint::TOES[side]);
    let step =
        |frame: usize, side: usize| toe(frame, side).truncate().distance(toe(frame - 1, side).truncate());
    let mut figures = FootFigures::default();
    let mut contact = ContactError::default();
    let (mut planted, mut low) = (Mean::default(), Mean::default());
    for frame in 1..count {
        let toes = |frame: usize| [0, 1].map(|side| toe(frame, side).truncate());
        contact.add(toes(frame - 1), toes(frame));
        for side in 0..2 {
            let cm = 100.0 * step(frame, side);
            if motion.contacts[frame][side] >= 1.0 && motion.contacts[frame - 1][side] >= 1.0 {
                planted.add(cm);
                figures.worst_skate_cm = figures.worst_skate_cm.max(cm);
            }
            if (toe(frame, side).z - floor - TOE_HEIGHT).abs() < 0.01 {
                low.add(cm);
            }
        }
    }
    for pose in &poses {
        for side in 0..2 {
            let toe = pose.position(Joint::TOES[side]).z - floor - TOE_HEIGHT;
            figures.sink_cm = figures.sink_cm.max(-100.0 * toe);
        }
    }
    figures.contact_cm = 100.0 * contact.mean();
    figures.skate_cm = planted.get();
    figures.low_skate_cm = low.get();
    figures
}

impl MotionLibrary {
    /// Foot figures of the library's own walking, mean over the clips that walk, weighted by their length: what a motion
    /// made from it can be measured against.
    pub fn foot_figures(&self) -> FootFigures {
        let walks = |clip: &&Clip| {
            let walking = clip.segments.iter().filter(|s| s.label == ActionLabel::Walk);
            2 * walking.map(|s| s.end - s.first).sum::<usize>() > clip.motion.len()
        };
        let (mut sum, mut frames) = (FootFigures::default(), 0.0f32);
        for clip in self.clips.iter().filter(walks) {
            let (figures, n) = (foot_figures(&clip.motion, 0.0), clip.motion.len() as f32);
            frames += n;
            sum.contact_cm += n * figures.contact_cm;
            sum.skate_cm += n * figures.skate_cm;
            sum.low_skate_cm += n * figures.low_skate_cm;
            sum.worst_skate_cm = sum.worst_skate_cm.max(figures.worst_skate_cm);
            sum.sink_cm = sum.sink_cm.max(figures.sink_cm);
        }
        let n = frames.max(1.0);
        FootFigures {
            contact_cm: sum.contact_cm / n,
            skate_cm: sum.skate_cm / n,
            low_skate_cm: sum.low_skate_cm / n,
            ..sum
        }
    }
}

/// The paper's "foot contact" of a motion, frame by frame; see [`FootFigures::contact_cm`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ContactError {
    windows: [Window; 2],
    sum: f64,
    count: usize,
}

/// The frames in which a foot is in contact: where they began, and the distances from there, summed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Window {
    origin: Option<Vec2>,
    sum: f32,
    count: usize,
}

impl ContactError {
    /// One frame on: the toes on the floor plane, in the frame before and now, metres.
    pub fn add(&mut self, before: [Vec2; 2], now: [Vec2; 2]) {
        let step = [0, 1].map(|side| before[side].distance(now[side]));
        for side in 0..2 {
            let touches = step[side] < 0.02 || step[side] < step[1 - side];
            let window = &mut self.windows[side];
            if touches {
                let origin = *window.origin.get_or_insert(now[side]);
                window.sum += now[side].distance(origin);
                window.count += 1;
            } else {
                self.sum += f64::from(window.sum);
                self.count += window.count;
                *window = Window::default();
            }
        }
    }

    /// Mean over the windows that ended again, metres.
    pub fn mean(&self) -> f32 {
        if self.count == 0 { 0.0 } else { (self.sum / self.count as f64) as f32 }
    }
}

/// How fast a motion is, beside the library that it was made from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SpeedFigures {
    /// The fastest turn of any joint over the 99.9th percentile of that joint's turns in the library; above 1 the
    /// motion turns a joint faster than the library does but in one frame of a thousand.
    pub joint_ratio: f32,
    /// The joint that turned so, and by how many degrees in one frame.
    pub fastest_joint: Option<Joint>,
    /// The fastest turn of any joint, degrees a frame.
    pub fastest_degrees: f32,
    /// Turns that are faster than that percentile, % of the turns of all joints; 0.1 of the library's own are.
    pub faster_percent: f32,
    /// The same for the joints' accelerations in the world, in which a transition that can be seen shows: the largest over
    /// the 99.9th percentile of that joint's in the library, the joint, its m/s², and the share above that percentile, %.
    pub acceleration_ratio: f32,
    /// The joint that is accelerated hardest beside the library's own.
    pub hardest_joint: Option<Joint>,
    /// Its acceleration, m/s².
    pub hardest_acceleration: f32,
    /// Share of the frames in which any joint is accelerated harder than the library's 99.9th percentile, percent.
    pub harder_percent: f32,
    /// Mean planar speed while walking (over 0.3 m/s), m/s, and the fastest.
    pub walking: f32,
    /// The fastest of them.
    pub fastest: f32,
}

/// Speed figures of a motion; `library` and `library_accelerations`: [`joint_turns`] and its twin for accelerations, of the
/// library at 99.9 %.
pub fn speed_figures(
    motion: &Motion,
    library: &[f32; JOINT_COUNT],
    library_accelerations: &[f32; JOINT_COUNT],
) -> SpeedFigures {
    let postures = &motion.postures;
    let mut figures = SpeedFigures::default();
    let most = joint_turns(postures.iter().copied().zip(postures.iter().skip(1).copied()), 1.0);
    for (joint, (most, usual)) in Joint::ALL.into_iter().zip(most.iter().zip(library)) {
        let ratio = most / usual.max(1e-4);
        if ratio > figures.joint_ratio {
            figures.joint_ratio = ratio;
            figures.fastest_joint = Some(joint);
            figures.fastest_degrees = most.to_degrees();
        }
    }
    let mut walking = Mean::default();
    let mut faster = 0usize;
    for pair in postures.windows(2) {
        let turns = pair[0].rotations.iter().zip(&pair[1].rotations).map(|(a, b)| angle_between(*a, *b));
        faster += turns.zip(library).filter(|(turn, usual)| turn > usual).count();
        let step = pair[0].root_position.truncate().distance(pair[1].root_position.truncate());
        let speed = step * FRAME_RATE;
        figures.fastest = figures.fastest.max(speed);
        if speed > 0.3 {
            walking.add(speed);
        }
    }
    figures.walking = walking.get();
    let turns = JOINT_COUNT * postures.len().saturating_sub(1);
    figures.faster_percent = 100.0 * faster as f32 / turns.max(1) as f32;
    figures.accelerate(motion, library_accelerations);
    figures
}

impl SpeedFigures {
    fn accelerate(&mut self, motion: &Motion, library: &[f32; JOINT_COUNT]) {
        let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
        let (mut harder, mut count) = (0usize, 0usize);
        for w in poses.windows(3) {
            let hard = accelerations([&w[0].positions, &w[1].positions, &w[2].positions]);
            for (joint, (hard, usual)) in Joint::ALL.into_iter().zip(hard.into_iter().zip(library)) {
                let ratio = hard / usual.max(1e-2);
                count += 1;
                harder += usize::from(ratio > 1.0);
                if ratio > self.acceleration_ratio {
                    self.acceleration_ratio = ratio;
                    self.hardest_joint = Some(joint);
                    self.hardest_acceleration = hard;
                }
            }
        }
        self.harder_percent = 100.0 * harder as f32 / count.max(1) as f32;
    }
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f32) {
        self.sum += f64::from(value);
        self.count += 1;
    }

    fn get(&self) -> f32 {
        if self.count == 0 { 0.0 } else { (self.sum / self.count as f64) as f32 }
    }
}

/// Penetration of a motion. `ignore_below`: crossings lower than this over `floor` are not counted, metres.
/// `seat`: the frame from which the person sits down, and the height of the seat that carries pelvis and thighs then.
pub fn penetration_figures(
    motion: &Motion,
    scene: &SceneIndex,
    floor: f32,
    ignore_below: f32,
    seat: Option<(usize, f32)>,
) -> PenetrationFigures {
    let (mut both, mut legs, mut arms, mut body) = (0, 0, 0, 0);
    let mut parts: BTreeMap<Limb, usize> = BTreeMap::new();
    for (frame, posture) in motion.postures.iter().enumerate() {
        let above = floor + ignore_below;
        let pose = posture.pose();
        // The paper's measure leaves nothing out; the seat is left out of the whole body's alone.
        let all = scene.body_intersections(&pose, above);
        let counts = match seat.filter(|(from, _)| frame >= *from) {
            Some((_, seat)) => scene.seated_intersections(&pose, above, seat),
            None => all,
        };
        let of = |limb: Limb| -> u32 {
            BODY_BOXES.iter().zip(&all).filter(|(b, _)| b.limb == limb).map(|(_, c)| c).sum()
        };
        let (in_legs, in_arms) = (of(Limb::Leg) >= PENETRATING_LEGS, of(Limb::Arm) >= PENETRATING_ARMS);
        legs += usize::from(in_legs);
        arms += usize::from(in_arms);
        both += usize::from(in_legs || in_arms);
        let mut touching: Vec<Limb> = BODY_BOXES
            .iter()
            .zip(&counts)
            .filter(|(_, count)| **count > 0)
            .map(|(node, _)| node.limb)
            .collect();
        touching.dedup();
        body += usize::from(!touching.is_empty());
        touching.into_iter().for_each(|limb| *parts.entry(limb).or_default() += 1);
    }
    let percent = |n: usize| 100.0 * n as f32 / motion.len().max(1) as f32;
    PenetrationFigures {
        parts_percent: parts.into_iter().map(|(limb, n)| (limb, percent(n))).collect(),
        percent: percent(both),
        legs_percent: percent(legs),
        arms_percent: percent(arms),
        whole_body_percent: percent(body),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::speed::joint_accelerations;
    use glam::Vec3;

    fn sliding(step: f32, frames: usize) -> Motion {
        let mut motion = Motion::default();
        for frame in 0..frames {
            let mut posture = Posture::default();
            posture.root_position.y -= step * frame as f32;
            motion.postures.push(posture);
            motion.contacts.push([1.0, 1.0]);
        }
        motion
    }

    #[test]
    fn a_gliding_figure_skates_by_its_speed() {
        let figures = foot_figures(&sliding(0.01, 30), 0.0);
        assert!((figures.skate_cm - 1.0).abs() < 1e-3, "{figures:?}");
        assert!((figures.low_skate_cm - 1.0).abs() < 1e-3);
        // The paper's reading is blind to a foot that slides for ever: its window never ends.
        assert_eq!(figures.contact_cm, 0.0);
    }

    #[test]
    fn paper_contact_by_hand() {
        // 1 cm a frame for four frames, then a leap of 5 cm with both feet: windows end at the leap.
        let mut motion = sliding(0.01, 5);
        let mut last = motion.postures[4];
        last.root_position.y -= 0.05;
        motion.postures.push(last);
        motion.contacts.push([0.0; 2]);
        // Distances to the first frame of the window (frame 1): 0, 1, 2, 3 cm.
        assert!((foot_figures(&motion, 0.0).contact_cm - 1.5).abs() < 1e-3);
    }

    #[test]
    fn speeds_by_hand() {
        // 1 cm a frame is 0.3 m/s; the left knee turns by 0.1 rad in one frame of four.
        let mut motion = sliding(0.02, 5);
        for posture in &mut motion.postures[3..] {
            posture.rotations[Joint::LeftLeg.index()] = glam::Quat::from_rotation_x(0.1);
        }
        let turns = joint_turns(motion.postures.windows(2).map(|w| (w[0], w[1])), 1.0);
        assert!((turns[Joint::LeftLeg.index()] - 0.1).abs() < 1e-5 && turns[0] < 1e-5);
        let figures = speed_figures(&motion, &[0.05; JOINT_COUNT], &[9.0; JOINT_COUNT]);
        assert!((figures.joint_ratio - 2.0).abs() < 1e-3 && figures.fastest_joint == Some(Joint::LeftLeg));
        let faster = 100.0 / (JOINT_COUNT * (motion.len() - 1)) as f32;
        assert!((figures.faster_percent - faster).abs() < 1e-5, "{}", figures.faster_percent);
        assert!((figures.walking - 0.6).abs() < 1e-3 && (figures.fastest - 0.6).abs() < 1e-3);
    }

    #[test]
    fn accelerations_by_hand() {
        // At rest, then 2 cm a frame: in one frame of three 0.02 m · (30 Hz)² = 18 m/s².
        let mut motion = sliding(0.02, 4);
        motion.postures.insert(0, motion.postures[0]);
        motion.contacts.push([1.0; 2]);
        let most = joint_accelerations([&motion].into_iter(), 1.0);
        assert!(most.iter().all(|a| (a - 18.0).abs() < 0.01), "{most:?}");
        let figures = speed_figures(&motion, &[1.0; JOINT_COUNT], &[9.0; JOINT_COUNT]);
        assert!((figures.acceleration_ratio - 2.0).abs() < 1e-3);
        assert!((figures.hardest_acceleration - 18.0).abs() < 0.01 && figures.hardest_joint.is_some());
        assert!((figures.harder_percent - 100.0 / 3.0).abs() < 1e-3);
    }

    #[test]
    fn residual_by_hand() {
        let cue = ActionCue {
            name: "Sofa".into(),
            action_type: ActionType::Sit,
            position: Vec3::new(0.03, 0.04, crate::motion::skeleton::REST_HIPS_HEIGHT),
            yaw: 0.1,
            feet: [Some(Vec3::new(0.095, 0.0, 0.0)), None],
        };
        let r = residual(&cue, &sliding(0.0, 1), 0).expect("one frame");
        assert!((r.pelvis_cm - 5.0).abs() < 1e-3 && (r.facing_degrees - 5.729_578).abs() < 1e-3);
        assert!(r.feet_cm[0].expect("given") < 1e-3 && r.feet_cm[1].is_none() && r.met);
    }
}

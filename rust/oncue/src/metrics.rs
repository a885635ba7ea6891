//! What the paper measures (section 4.1), as the released code computes it, and stricter readings beside it.

use std::collections::BTreeMap;

use glam::Vec2;
use serde::{Deserialize, Serialize};

use crate::action::ActionLabel;
use crate::cue::{ActionCue, CueKind, PassCue};
use crate::library::{Clip, MotionLibrary};
use crate::math::rotation::{angle_between, wrap_angle};
use crate::motion::skeleton::TOE_HEIGHT;
use crate::motion::speed::{accelerations, joint_turns};
use crate::motion::{BODY_BOXES, FRAME_RATE, JOINT_COUNT, Joint, Limb, Motion, Pose, Posture};
use crate::scene::{MovingObject, SceneIndex};
use crate::seats::Seats;

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
    pub action_type: CueKind,
    /// Frame (30 Hz) at which it was measured.
    pub frame: usize,
    /// Pelvis joint to q_root, cm (for a stop and a pass on the floor plane).
    pub pelvis_cm: f32,
    /// Facing, degrees; 0 for a pass, which asks for none.
    pub facing_degrees: f32,
    /// Ankle to each given foot cue on the floor plane, cm.
    pub feet_cm: [Option<f32>; 2],
    /// Within 10 cm and 20°; a pass within 15 cm.
    pub met: bool,
}

/// A cue is met when the pelvis is nearer than this to its place, metres, and its facing, radians (LAMA, supplementary: the
/// robustness test's 10 cm and 20°).
pub const MET_DISTANCE: f32 = 0.10;
/// See [`MET_DISTANCE`].
pub const MET_FACING: f32 = 20f32.to_radians();

/// A waypoint is passed when the pelvis comes nearer to it than this on the floor plane, metres.
pub const PASS_DISTANCE: f32 = 0.15;

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
        action_type: cue.action_type.into(),
        frame,
        pelvis_cm: 100.0 * pelvis,
        facing_degrees: facing.to_degrees(),
        feet_cm: feet,
        met: is_met(pelvis, facing),
    })
}

/// How waypoints are passed in the frames `first..=last` of a motion: each on the frame on which the pelvis is nearest to it, as far as
/// they are passed in their order (the frames of least squared distances).
pub fn passed(passes: &[PassCue], motion: &Motion, first: usize, last: usize) -> Vec<Residual> {
    let end = (last + 1).min(motion.len());
    let roots: Vec<Vec2> =
        motion.postures[first.min(end)..end].iter().map(|p| p.root_position.truncate()).collect();
    if roots.is_empty() {
        return Vec::new();
    }
    // Of each waypoint and frame: the least sum of squares with which it can be passed by then, and the frame on which it is.
    let mut best: Vec<Vec<(f32, usize)>> = Vec::new();
    for pass in passes {
        let mut row: Vec<(f32, usize)> = Vec::with_capacity(roots.len());
        for (frame, root) in roots.iter().enumerate() {
            let before = best.last().map_or(0.0, |row| row[frame].0);
            let here = (before + root.distance_squared(pass.place()), frame);
            row.push(row.last().copied().filter(|earlier| earlier.0 <= here.0).unwrap_or(here));
        }
        best.push(row);
    }
    let mut frame = roots.len() - 1;
    let mut found: Vec<Residual> = passes
        .iter()
        .zip(&best)
        .rev()
        .map(|(pass, row)| {
            frame = row[frame].1;
            let away = roots[frame].distance(pass.place());
            Residual {
                cue: pass.name.clone(),
                action_type: CueKind::Pass,
                frame: first + frame,
                pelvis_cm: 100.0 * away,
                facing_degrees: 0.0,
                feet_cm: [None; 2],
                met: away < PASS_DISTANCE,
            }
        })
        .collect();
    found.reverse();
    found
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
/// `seats`: what carries pelvis and thighs, and when.
pub fn penetration_figures(
    motion: &Motion,
    scene: &SceneIndex,
    floor: f32,
    ignore_below: f32,
    seats: &Seats,
) -> PenetrationFigures {
    penetration_among(motion, scene, &[], floor, ignore_below, seats)
}

/// The same, also in what moves: each with how many frames later it is where it is met.
pub fn penetration_among(
    motion: &Motion,
    scene: &SceneIndex,
    moving: &[(&[MovingObject], usize)],
    floor: f32,
    ignore_below: f32,
    seats: &Seats,
) -> PenetrationFigures {
    let (mut both, mut legs, mut arms, mut body) = (0, 0, 0, 0);
    let mut parts: BTreeMap<Limb, usize> = BTreeMap::new();
    for (frame, posture) in motion.postures.iter().enumerate() {
        let above = floor + ignore_below;
        let pose = posture.pose();
        // The paper's measure leaves nothing out; the seat is left out of the whole body's alone.
        let mut all = scene.body_intersections(&pose, above);
        let sits = seats.at(frame);
        let mut counts = sits.map_or(all, |seat| scene.seated_intersections(&pose, above, seat));
        for (object, wait) in moving.iter().flat_map(|(all, wait)| all.iter().map(move |one| (one, wait))) {
            let more = object.body_intersections(&pose, frame + wait, above);
            for (i, node) in BODY_BOXES.iter().enumerate() {
                all[i] += more[i];
                // The seat may be what has moved.
                counts[i] += if sits.is_some() && node.is_carried() { 0 } else { more[i] };
            }
        }
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
    use crate::action::ActionType;
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
    fn waypoints_are_passed_in_their_order() {
        // Out along X for 100 frames of 2 cm and back again.
        let postures = (0..200).map(|i| {
            let x = 0.02 * if i < 100 { i } else { 199 - i } as f32;
            Posture { root_position: Vec3::new(x, 0.0, 0.9), ..Posture::default() }
        });
        let motion = Motion { postures: postures.collect(), contacts: vec![[0.0; 2]; 200] };
        let by = |name: &str, x: f32, y: f32| PassCue { name: name.into(), position: Vec3::new(x, y, 0.0) };
        let told = |passes: &[PassCue], first: usize, last: usize| -> Vec<(usize, i32, bool)> {
            let found = passed(passes, &motion, first, last);
            assert!(found.iter().zip(passes).all(|(r, p)| r.cue == p.name && r.action_type == CueKind::Pass));
            found.iter().map(|r| (r.frame, r.pelvis_cm.round() as i32, r.met)).collect()
        };
        let (near, far) = (by("near", 0.5, 0.1), by("far", 1.9, -0.14));
        assert_eq!(told(&[near.clone(), far.clone()], 0, 199), [(25, 10, true), (95, 14, true)]);
        // The other way round the nearer one is passed on the way back.
        assert_eq!(told(&[far.clone(), near.clone()], 0, 199), [(95, 14, true), (174, 10, true)]);
        // In the frames that are asked about, and no others.
        assert_eq!(told(std::slice::from_ref(&near), 0, 10), [(10, 32, false)]);
        assert_eq!(told(&[near, by("aside", 0.0, 0.16)], 150, 999), [(174, 10, true), (199, 16, false)]);
        assert!(told(&[], 0, 199).is_empty());
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

    /// Four frames, 2 m apart, in the rest pose: nothing, both shins through a board, one shin, an arm through a pane.
    fn four_frames() -> (Motion, SceneIndex) {
        let mut motion = Motion::default();
        for frame in 0..4 {
            let mut posture = Posture::default();
            posture.root_position.x = 2.0 * frame as f32;
            motion.postures.push(posture);
            motion.contacts.push([1.0; 2]);
        }
        let scene = crate::test_world::scene(&[
            ([-1.0, -1.0, -0.1], [8.0, 1.0, 0.0]),
            ([1.8, -0.3, 0.30], [2.2, 0.3, 0.32]),
            ([4.0, -0.3, 0.30], [4.2, 0.3, 0.32]),
            ([6.4, -0.3, 1.2], [6.42, 0.3, 1.6]),
        ]);
        (motion, scene)
    }

    #[test]
    fn penetration_by_hand() {
        let (motion, scene) = four_frames();
        // Four upright edges of a shin cross a board's top and bottom: 8 for a leg, 16 for both, of the 10 that count.
        // Four edges of an arm along x cross a pane's two faces: 8, of the 7 that count.
        let crossings: Vec<u32> =
            motion.postures.iter().map(|p| scene.body_intersections(&p.pose(), 0.1).iter().sum()).collect();
        assert_eq!(crossings, [0, 16, 8, 8]);
        let figures = penetration_figures(&motion, &scene, 0.0, 0.1, &Seats::default());
        assert_eq!((figures.percent, figures.legs_percent, figures.arms_percent), (50.0, 25.0, 25.0));
        assert_eq!(figures.whole_body_percent, 75.0);
        assert_eq!(figures.parts_percent, BTreeMap::from([(Limb::Leg, 50.0), (Limb::Arm, 25.0)]));
        // Higher up than the boards nothing of the legs counts.
        let figures = penetration_figures(&motion, &scene, 0.3, 0.1, &Seats::default());
        assert_eq!((figures.percent, figures.legs_percent, figures.whole_body_percent), (25.0, 0.0, 25.0));
        assert_eq!(penetration_figures(&motion, &scene, 0.0, 0.4, &Seats::default()), figures);
        assert_eq!(penetration_figures(&Motion::default(), &scene, 0.0, 0.1, &Seats::default()).percent, 0.0);
        assert!(is_penetrating(10, 0) && is_penetrating(0, 7) && !is_penetrating(9, 6));
    }

    #[test]
    fn a_seat_carries_from_when_one_sits_down() {
        // Boards through both thighs in two frames of three.
        let (mut motion, _) = four_frames();
        motion.postures.truncate(3);
        motion.contacts.truncate(3);
        let scene = crate::test_world::scene(&[
            ([-1.0, -1.0, -0.1], [8.0, 1.0, 0.0]),
            ([1.8, -0.3, 0.70], [2.2, 0.3, 0.72]),
            ([3.8, -0.3, 0.70], [4.2, 0.3, 0.72]),
        ]);
        let whole = |seats| penetration_figures(&motion, &scene, 0.0, 0.1, &seats).whole_body_percent;
        close(whole(Seats::default()), 200.0 / 3.0);
        close(whole(Seats::taken(0, 0.70)), 0.0);
        close(whole(Seats::taken(2, 0.70)), 100.0 / 3.0);
        close(whole(Seats::taken(3, 0.70)), 200.0 / 3.0);
        // A lower seat does not carry what lies higher, and the paper's measure leaves nothing out.
        close(whole(Seats::taken(0, 0.60)), 200.0 / 3.0);
        close(
            penetration_figures(&motion, &scene, 0.0, 0.1, &Seats::taken(0, 0.70)).legs_percent,
            200.0 / 3.0,
        );
    }

    #[test]
    fn what_moves_counts_where_it_stands_on_the_frame() {
        let (mut motion, _) = four_frames();
        motion.postures.truncate(3);
        motion.contacts.truncate(3);
        let scene = crate::test_world::scene(&[([-1.0, -1.0, -0.1], [8.0, 1.0, 0.0])]);
        // The board through both thighs of the second frame, which comes from above and is there on its frame `at`.
        let board = |at: usize| {
            let (lo, hi) = (Vec3::new(1.8, -0.3, 0.70), Vec3::new(2.2, 0.3, 0.72));
            let corner =
                |i: usize| Vec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), hi, lo);
            let triangles =
                [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]];
            let ends = [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]];
            let triangles: Vec<[u32; 3]> = triangles.into_iter().chain(ends).collect();
            let pose = |frame: usize| (Vec3::Z * if frame == at { 0.0 } else { 9.0 }, glam::Quat::IDENTITY);
            let poses: Vec<_> = (0..at + 2).map(pose).collect();
            let corners: Vec<Vec3> = (0..8).map(corner).collect();
            MovingObject::build("Board", &corners, &triangles, &poses, &crate::Progress::new())
                .expect("a board")
        };
        let whole = |at: usize, wait: usize, seats| {
            penetration_among(&motion, &scene, &[(&[board(at)], wait)], 0.0, 0.1, &seats).whole_body_percent
        };
        close(whole(1, 0, Seats::default()), 100.0 / 3.0);
        close(whole(0, 0, Seats::default()), 0.0);
        close(whole(2, 0, Seats::default()), 0.0);
        // Who waits comes there later.
        close(whole(4, 3, Seats::default()), 100.0 / 3.0);
        close(whole(1, 3, Seats::default()), 0.0);
        // Thighs may lie on what has moved, once one sits.
        close(whole(1, 0, Seats::taken(0, 0.70)), 0.0);
        close(whole(1, 0, Seats::taken(2, 0.70)), 100.0 / 3.0);
        let legs = penetration_among(&motion, &scene, &[(&[board(1)], 0)], 0.0, 0.1, &Seats::taken(0, 0.70))
            .legs_percent;
        close(legs, 100.0 / 3.0);
        // What lies on the floor is stepped over.
        close(
            penetration_among(&motion, &scene, &[(&[board(1)], 0)], 0.7, 0.1, &Seats::default())
                .whole_body_percent,
            0.0,
        );
    }

    fn close(a: f32, b: f32) {
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }

    #[test]
    fn feet_by_hand() {
        // One slides by 1 cm, then 3 cm, then both lift off by 2 cm and fly 5 cm, and the floor is 1 cm higher than the rest pose's.
        let mut motion = Motion::default();
        for (y, z, contact) in
            [(0.0, 0.01, 1.0), (-0.01, 0.01, 1.0), (-0.04, 0.01, 1.0), (-0.09, 0.03, 0.5), (-0.14, 0.03, 0.0)]
        {
            let mut posture = Posture::default();
            posture.root_position += Vec3::new(0.0, y, z);
            motion.postures.push(posture);
            motion.contacts.push([contact, 0.0]);
        }
        let figures = foot_figures(&motion, 0.01);
        close(figures.skate_cm, 2.0);
        close(figures.worst_skate_cm, 3.0);
        close(figures.low_skate_cm, 2.0);
        close(figures.sink_cm, 0.0);
        // Under a floor that is 4 cm higher than they are, they sink, and none is near it.
        let deep = foot_figures(&motion, 0.05);
        close(deep.sink_cm, 4.0);
        assert_eq!(deep.low_skate_cm, 0.0);
        // A planted frame after one that is not is no slide yet.
        motion.contacts[0][0] = 0.5;
        close(foot_figures(&motion, 0.01).skate_cm, 3.0);
        motion.postures.truncate(1);
        assert_eq!(foot_figures(&motion, 0.01), FootFigures::default());
    }

    #[test]
    fn contact_ends_where_the_faster_foot_leaves() {
        let mut error = ContactError::default();
        let at = |left: f32, right: f32| [Vec2::new(left, 0.0), Vec2::new(right, 0.0)];
        // Both faster than 2 cm a frame: the slower touches. Its distances are 0 and 4 cm when it ends.
        error.add(at(0.0, 0.0), at(0.03, 0.10));
        error.add(at(0.03, 0.10), at(0.07, 0.20));
        assert_eq!(error.mean(), 0.0);
        error.add(at(0.07, 0.20), at(0.27, 0.21));
        close(error.mean(), 0.02);
        // The right foot's window, of one frame, adds a distance of nothing.
        error.add(at(0.27, 0.21), at(0.28, 0.51));
        close(error.mean(), 0.04 / 3.0);
    }

    #[test]
    fn a_librarys_feet_are_those_of_its_walks_by_their_length() {
        use crate::library::{Segment, Source};
        let clip = |motion: Motion, label: ActionLabel, until: usize| {
            let end = motion.len();
            let segment = |label, first, end| Segment { label, first, end, complete: end - 1 };
            let segments = vec![segment(label, 0, until), segment(ActionLabel::Other, until, end)];
            Clip { name: "clip".into(), source: Source::Mocap, mirrored: false, motion, segments }
        };
        let walks = |frames: usize, step: f32| clip(sliding(step, frames), ActionLabel::Walk, frames - 1);
        let library = MotionLibrary {
            clips: vec![
                walks(10, 0.01),
                walks(30, 0.005),
                // Half of it walks, or another action: neither counts.
                clip(sliding(0.019, 10), ActionLabel::Walk, 5),
                clip(sliding(0.019, 10), ActionLabel::Sit, 9),
            ],
        };
        let figures = library.foot_figures();
        close(figures.skate_cm, (10.0 * 1.0 + 30.0 * 0.5) / 40.0);
        close(figures.low_skate_cm, figures.skate_cm);
        close(figures.worst_skate_cm, 1.0);
        close(figures.contact_cm, 0.0);
        assert!(figures.sink_cm.abs() < 1e-3);
        assert_eq!(MotionLibrary::default().foot_figures(), FootFigures::default());
    }

    #[test]
    fn a_contact_error_of_walks_is_weighted_too() {
        use crate::library::{Segment, Source};
        let clips = [(6, 0.01), (12, 0.02)].map(|(frames, far)| {
            let mut motion = sliding(0.0, frames);
            // Both feet creep in the last frame but one and leap in the last.
            motion.postures[frames - 2].root_position.y -= far * 0.9;
            motion.postures[frames - 1].root_position.y -= 1.0;
            let segments = vec![Segment { label: ActionLabel::Walk, first: 0, end: frames, complete: 0 }];
            Clip { name: "clip".into(), source: Source::Mocap, mirrored: false, motion, segments }
        });
        let each = clips.each_ref().map(|c| foot_figures(&c.motion, 0.0).contact_cm);
        close(each[0], 0.9 / 4.0);
        close(each[1], 1.8 / 10.0);
        let library = MotionLibrary { clips: clips.to_vec() };
        close(library.foot_figures().contact_cm, (6.0 * each[0] + 12.0 * each[1]) / 18.0);
    }
    #[test]
    fn only_what_is_faster_than_a_stroll_is_walking() {
        let mut motion = Motion::default();
        // 0.15, 0.6 and 1.2 m/s.
        for y in [0.0, 0.005, 0.025, 0.065] {
            let mut posture = Posture::default();
            posture.root_position.y = -y;
            motion.postures.push(posture);
            motion.contacts.push([0.0; 2]);
        }
        let figures = speed_figures(&motion, &[1.0; JOINT_COUNT], &[100.0; JOINT_COUNT]);
        close(figures.walking, 0.9);
        close(figures.fastest, 1.2);
        assert_eq!((figures.joint_ratio, figures.faster_percent, figures.harder_percent), (0.0, 0.0, 0.0));
        // 0.015 and 0.02 m over a step: 13.5 and 18 m/s².
        close(figures.acceleration_ratio, 0.18);
        assert!((figures.hardest_acceleration - 18.0).abs() < 0.01);
        let harder = speed_figures(&motion, &[1.0; JOINT_COUNT], &[15.0; JOINT_COUNT]).harder_percent;
        close(harder, 50.0);
    }

    #[test]
    fn a_cue_that_is_missed_is_not_met() {
        let cue = |x: f32, z: f32, yaw: f32, action_type: ActionType| ActionCue {
            name: "Cue".into(),
            action_type,
            position: Vec3::new(x, 0.0, crate::motion::skeleton::REST_HIPS_HEIGHT + z),
            yaw,
            feet: [None, Some(Vec3::new(-0.095, 0.3, 0.7))],
        };
        let motion = sliding(0.0, 3);
        let of = |cue: &ActionCue| residual(cue, &motion, 2).expect("three frames");
        assert!(of(&cue(0.099, 0.0, 0.34, ActionType::Sit)).met);
        assert!(!of(&cue(0.101, 0.0, 0.0, ActionType::Sit)).met);
        assert!(!of(&cue(0.0, 0.11, 0.0, ActionType::Sit)).met);
        assert!(!of(&cue(0.0, 0.0, -0.36, ActionType::Sit)).met);
        // The height of a stop says nothing.
        let stop = of(&cue(0.06, 0.4, -0.3, ActionType::Stop));
        assert!(stop.met && stop.frame == 2);
        close(stop.pelvis_cm, 6.0);
        close(stop.facing_degrees, 0.3f32.to_degrees());
        close(stop.feet_cm[1].expect("given"), 30.0);
        assert!(residual(&cue(0.0, 0.0, 0.0, ActionType::Sit), &motion, 3).is_none());
    }

    #[test]
    fn a_limit_is_beyond() {
        assert!(is_met(0.0999, 0.0) && !is_met(MET_DISTANCE, 0.0) && !is_met(0.0, MET_FACING));
    }
}

//! The degrees of freedom in which the finishing pass corrects a posture, and what each of them moves.
//!
//! A correction d turns a joint in its own frame, R = R₀·exp(d), and shifts the root. Knees and elbows are hinges: a
//! knee turns about the thigh's X axis, an elbow about the normal of the plane in which the arm is bent already.

use glam::{Mat3, Quat, Vec3};

use crate::anatomy::{elbow_beyond, wrist_beyond};
use crate::library::foot::LEGS;
use crate::math::rotation::wrap_angle;
use crate::motion::skeleton::{JOINT_COUNT, JOINT_OFFSET, PARENT};
use crate::motion::{Joint, Pose, Posture};

/// One joint's share of a correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Part {
    /// The root's place: x, y, z.
    Shift,
    /// A ball joint: an angle-axis vector.
    Ball(Joint),
    /// A joint that bends one way: an angle.
    Hinge(Joint),
}

impl Part {
    fn size(self) -> usize {
        if matches!(self, Part::Hinge(_)) { 1 } else { 3 }
    }

    /// How far a correction of this part goes as easily as any other's, radians or metres: what is near the hand or
    /// the foot gives way before the trunk does, and the trunk before the root.
    fn ease(self) -> [f64; 3] {
        use Joint::*;
        match self {
            // The root's place is kept by terms of its own.
            Part::Shift => [0.15, 0.15, 0.15],
            Part::Ball(Hips) => [0.35, 0.12, 0.12],
            Part::Ball(Spine | Spine1 | Spine2) => [0.20, 0.10, 0.10],
            Part::Ball(Neck | Head) => [0.25; 3],
            Part::Ball(LeftShoulder | RightShoulder) => [0.12; 3],
            Part::Ball(LeftHand | RightHand) => [0.6; 3],
            // Out of its plane a thigh turns less readily, or knees would swing about.
            Part::Ball(LeftUpLeg | RightUpLeg) => [0.8, 0.5, 0.5],
            Part::Ball(LeftFoot | RightFoot) => [0.5, 0.3, 0.3],
            Part::Hinge(LeftToe | RightToe) => [0.5; 3],
            _ => [0.9; 3],
        }
    }
}

/// What one number of a correction moves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    /// The turned joint; the root for a shift.
    pub joint: usize,
    /// World: the axis turned about, or the direction shifted in.
    pub axis: Vec3,
    pub shifts: bool,
}

/// A posture to be corrected, with what does not change while it is.
#[derive(Debug, Clone)]
pub(crate) struct BasePosture {
    pub posture: Posture,
    /// For each hinge, in the order of the parts: its axis in the joint's own frame, its angle, and how far that may go.
    hinges: Vec<Hinge>,
}

#[derive(Debug, Clone, Copy)]
struct Hinge {
    axis: Vec3,
    angle: f32,
    least: f32,
    most: f32,
}

/// Least and largest angle of a knee and of an elbow, radians: never quite straight, never through itself.
const KNEE_RANGE: (f32, f32) = (0.07, 2.6);
const ELBOW_RANGE: (f32, f32) = (0.10, 2.6);
const TOE_RANGE: (f32, f32) = (-1.0, 0.3);
/// An elbow bent less than this shows no plane of its own, radians.
const PLANE_SHOWN_FROM: f32 = 0.35;

/// All degrees of freedom of a correction.
#[derive(Debug, Clone)]
pub(crate) struct DegreesOfFreedom {
    parts: Vec<Part>,
    count: usize,
    /// Joints go no further than a person's.
    limited: bool,
    /// Wrists go as far as shoulders and elbows do.
    loose_wrists: bool,
}

/// How far a loose wrist goes as easily as any other joint: a hand is so much nearer to its wrist than to the shoulder that, with this,
/// each of the arm's three joints turns about as far to lift it. Radians.
const LOOSE_WRIST: f64 = 2.0;

impl DegreesOfFreedom {
    fn of(parts: Vec<Part>, limited: bool) -> Self {
        let count = parts.iter().map(|p| p.size()).sum();
        Self { parts, count, limited, loose_wrists: false }
    }

    /// The whole body, but for shoulders and wrists that `joints` do not ask for; `turned` joints are no hinges.
    pub(crate) fn for_joints(joints: &[Joint], turned: &[Joint]) -> Self {
        use Joint::*;
        let within = |chain: &[Joint]| joints.iter().any(|j| chain.contains(j));
        let mut parts = vec![Part::Shift];
        parts.extend([Hips, Spine, Spine1, Spine2, Neck, Head].map(Part::Ball));
        let hinge =
            |joint: Joint| if turned.contains(&joint) { Part::Ball(joint) } else { Part::Hinge(joint) };
        for arm in [
            [LeftShoulder, LeftArm, LeftForeArm, LeftHand],
            [RightShoulder, RightArm, RightForeArm, RightHand],
        ] {
            if within(&arm) {
                parts.push(Part::Ball(arm[0]));
            }
            parts.extend([Part::Ball(arm[1]), hinge(arm[2])]);
            if turned.contains(&arm[3]) {
                parts.push(Part::Ball(arm[3]));
            }
        }
        for [thigh, shin, foot, toe] in LEGS {
            parts.extend([Part::Ball(thigh), hinge(shin), Part::Ball(foot), hinge(toe)]);
        }
        Self::of(parts, true)
    }

    /// Shoulders, elbows and wrists alone: who passes a table's edge lifts the hand before the arm.
    pub(crate) fn arms() -> Self {
        use Joint::*;
        let parts: Vec<Part> = vec![
            Part::Ball(LeftArm),
            Part::Hinge(LeftForeArm),
            Part::Ball(LeftHand),
            Part::Ball(RightArm),
            Part::Hinge(RightForeArm),
            Part::Ball(RightHand),
        ];
        Self { loose_wrists: true, ..Self::of(parts, true) }
    }

    /// The arms of these sides, left and right, that hold something: shoulders and elbows, and wrists no more readily than they.
    pub(crate) fn holding(sides: [bool; 2], wrists: bool) -> Self {
        use Joint::*;
        let arms = [[LeftArm, LeftForeArm, LeftHand], [RightArm, RightForeArm, RightHand]];
        let of = |[upper, fore, hand]: [Joint; 3]| {
            [Some(Part::Ball(upper)), Some(Part::Hinge(fore)), wrists.then_some(Part::Ball(hand))]
        };
        let held = arms.into_iter().zip(sides).filter_map(|(arm, held)| held.then_some(arm));
        Self::of(held.flat_map(of).flatten().collect(), true)
    }

    /// Legs, spine and the place of a pelvis that keeps its turn.
    pub(crate) fn body_on_its_feet() -> Self {
        use Joint::*;
        let mut parts = vec![Part::Shift];
        parts.extend([Spine, Spine1, Spine2].map(Part::Ball));
        for [thigh, shin, foot, toe] in LEGS {
            parts.extend([Part::Ball(thigh), Part::Hinge(shin), Part::Ball(foot), Part::Hinge(toe)]);
        }
        Self::of(parts, true)
    }

    /// The plain solver of the ablation: one arm (or both) and the spine above a pelvis that stays, without limits.
    pub(crate) fn arm_and_spine(joints: &[Joint]) -> Self {
        use Joint::*;
        let mut parts: Vec<Part> = [Spine, Spine1, Spine2].map(Part::Ball).to_vec();
        for arm in [[LeftArm, LeftForeArm, LeftHand], [RightArm, RightForeArm, RightHand]] {
            if joints.iter().any(|j| arm.contains(j)) {
                parts.extend(arm[..2].iter().map(|&j| Part::Ball(j)));
            }
        }
        Self::of(parts, false)
    }

    /// Numbers of one frame's correction.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// 1/σ² of each number.
    pub(crate) fn stiffness(&self) -> Vec<f64> {
        let is_wrist = |part: &Part| matches!(part, Part::Ball(Joint::LeftHand | Joint::RightHand));
        let ease = |part: &Part| match self.loose_wrists && is_wrist(part) {
            true => [LOOSE_WRIST; 3],
            false => part.ease(),
        };
        self.parts.iter().flat_map(|p| ease(p)[..p.size()].to_vec()).map(|ease| 1.0 / (ease * ease)).collect()
    }

    /// Where the numbers of `joint` begin, and how many they are.
    #[cfg(test)]
    pub(crate) fn first_of(&self, joint: Joint) -> Option<(usize, usize)> {
        self.indexed()
            .find(|(p, _)| matches!(p, Part::Ball(j) | Part::Hinge(j) if *j == joint))
            .map(|(p, i)| (i, p.size()))
    }

    fn indexed(&self) -> impl Iterator<Item = (Part, usize)> + '_ {
        self.parts.iter().scan(0, |index, &part| {
            let here = *index;
            *index += part.size();
            Some((part, here))
        })
    }

    /// Makes a posture ready to be corrected.
    pub(crate) fn frame(&self, posture: &Posture) -> BasePosture {
        let pose = posture.pose();
        let hinges = self
            .parts
            .iter()
            .filter_map(|part| match part {
                Part::Hinge(joint) => Some(hinge(posture, &pose, *joint)),
                _ => None,
            })
            .collect();
        BasePosture { posture: *posture, hinges }
    }

    /// The posture after a correction.
    pub(crate) fn corrected(&self, frame: &BasePosture, correction: &[f64]) -> Posture {
        let mut posture = frame.posture;
        let mut hinges = frame.hinges.iter();
        for (part, i) in self.indexed() {
            match part {
                Part::Shift => posture.root_position += vector(&correction[i..]),
                Part::Ball(joint) => {
                    let rotation = &mut posture.rotations[joint.index()];
                    *rotation = (*rotation * Quat::from_scaled_axis(vector(&correction[i..]))).normalize();
                }
                Part::Hinge(joint) => {
                    let Some(hinge) = hinges.next() else { continue };
                    let rotation = &mut posture.rotations[joint.index()];
                    *rotation =
                        (*rotation * Quat::from_axis_angle(hinge.axis, correction[i] as f32)).normalize();
                }
            }
        }
        posture
    }

    /// What each number of the correction moves, at the corrected `pose`.
    pub(crate) fn columns(
        &self,
        frame: &BasePosture,
        correction: &[f64],
        pose: &Pose,
        out: &mut Vec<Column>,
    ) {
        out.clear();
        let mut hinges = frame.hinges.iter();
        for (part, i) in self.indexed() {
            match part {
                Part::Shift => {
                    out.extend(Vec3::AXES.map(|axis| Column { joint: 0, axis, shifts: true }));
                }
                Part::Ball(joint) => {
                    let turned =
                        Mat3::from_quat(pose.rotation(joint)) * right_jacobian(vector(&correction[i..]));
                    let column = |axis| Column { joint: joint.index(), axis, shifts: false };
                    out.extend([turned.x_axis, turned.y_axis, turned.z_axis].map(column));
                }
                Part::Hinge(joint) => {
                    let axis = hinges.next().map_or(Vec3::X, |h| h.axis);
                    out.push(Column {
                        joint: joint.index(),
                        axis: pose.rotation(joint) * axis,
                        shifts: false,
                    });
                }
            }
        }
    }

    /// What is over its limit: where its numbers begin, the direction in which it is (one number for a hinge, three for a
    /// ball joint), and how far, radians.
    pub(crate) fn beyond_limits<'a>(
        &'a self,
        frame: &'a BasePosture,
        correction: &'a [f64],
    ) -> impl Iterator<Item = Beyond> + 'a {
        let mut hinges = frame.hinges.iter();
        self.indexed()
            .filter(|_| self.limited)
            .flat_map(move |(part, first)| match part {
                Part::Shift => [None; 2],
                Part::Hinge(joint) => {
                    let Some(hinge) = hinges.next() else { return [None; 2] };
                    let turn = correction[first] as f32;
                    let angle = hinge.angle + turn;
                    let over = f64::from((angle - hinge.most).max(0.0) + (angle - hinge.least).min(0.0));
                    let beyond = Beyond { first, size: 1, direction: [1.0, 0.0, 0.0], over };
                    let aside =
                        beyond_plane(joint, frame.posture.rotations[joint.index()], hinge.axis, turn, first);
                    [(over != 0.0).then_some(beyond), aside]
                }
                Part::Ball(joint) => {
                    let turn = &correction[first..first + 3];
                    let angle = turn.iter().map(|t| t * t).sum::<f64>().sqrt();
                    let over = angle - most_turn(joint);
                    let direction = [0, 1, 2].map(|i| turn[i] / angle.max(1e-9));
                    let too_far = (over > 0.0).then_some(Beyond { first, size: 3, direction, over });
                    [too_far, beyond_cone(joint, frame.posture.rotations[joint.index()], turn, first)]
                }
            })
            .flatten()
    }
}

/// A part that is turned further than it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Beyond {
    pub first: usize,
    pub size: usize,
    /// How much farther it gets with each of them.
    pub direction: [f64; 3],
    pub over: f64,
}

/// Wrists are turned no further than people's go, or than they are already.
fn beyond_cone(joint: Joint, rotation: Quat, turn: &[f64], first: usize) -> Option<Beyond> {
    let side = Joint::HANDS.iter().position(|&hand| hand == joint)?;
    let turn = vector(turn);
    let over = |turn: Vec3| wrist_beyond(side, rotation * Quat::from_scaled_axis(turn)).to_radians();
    let allowed = over(Vec3::ZERO).max(0.0);
    let now = over(turn) - allowed;
    if now <= 0.0 {
        return None;
    }
    let slope =
        |axis: Vec3| (over(turn + axis * CONE_STEP) - over(turn - axis * CONE_STEP)) / (2.0 * CONE_STEP);
    let direction = Vec3::AXES.map(|axis| f64::from(slope(axis)));
    Some(Beyond { first, size: 3, direction, over: f64::from(now) })
}

/// Elbows bend out of their plane no further than people's, or than they do already: a little bend shows a plane that a larger one must
/// not be in.
fn beyond_plane(joint: Joint, rotation: Quat, axis: Vec3, turn: f32, first: usize) -> Option<Beyond> {
    if !matches!(joint, Joint::LeftForeArm | Joint::RightForeArm) {
        return None;
    }
    let over = |turn: f32| elbow_beyond(rotation * Quat::from_axis_angle(axis, turn)).to_radians();
    let now = over(turn) - over(0.0).max(0.0);
    if now <= 0.0 {
        return None;
    }
    let slope = (over(turn + CONE_STEP) - over(turn - CONE_STEP)) / (2.0 * CONE_STEP);
    Some(Beyond { first, size: 1, direction: [f64::from(slope), 0.0, 0.0], over: f64::from(now) })
}

/// Steps in which the slope of a cone's edge is taken, radians.
const CONE_STEP: f32 = 2e-3;

/// How far a correction may turn a ball joint, radians: what a person has left from most postures.
fn most_turn(joint: Joint) -> f64 {
    use Joint::*;
    match joint {
        Hips => 1.3,
        Spine | Spine1 | Spine2 => 0.5,
        Neck | Head => 0.6,
        LeftShoulder | RightShoulder => 0.35,
        LeftFoot | RightFoot => 0.7,
        LeftHand | RightHand => 1.3,
        // From hanging to overhead, and turned about itself on the way.
        LeftArm | RightArm => 3.05,
        _ => 2.8,
    }
}

fn hinge(posture: &Posture, pose: &Pose, joint: Joint) -> Hinge {
    use Joint::*;
    let local = posture.rotations[joint.index()];
    let about_x = wrap_angle(2.0 * local.x.atan2(local.w));
    let (axis, angle, (least, most)) = match joint {
        LeftForeArm | RightForeArm => {
            let parent = pose.rotations[PARENT[joint.index()]];
            let bone = parent * JOINT_OFFSET[joint.index()].normalize();
            let hand = if joint == LeftForeArm { LeftHand } else { RightHand };
            let rotation = pose.rotation(joint);
            let lower = rotation * JOINT_OFFSET[hand.index()].normalize();
            let normal = bone.cross(lower);
            let angle = normal.length().atan2(bone.dot(lower));
            // Forwards, palms down: about -Z on the left and +Z on the right.
            let usual = parent * if joint == LeftForeArm { Vec3::NEG_Z } else { Vec3::Z };
            let shown = (angle / PLANE_SHOWN_FROM).min(1.0);
            let axis = normal.normalize_or_zero().lerp(usual, (1.0 - shown) * (1.0 - shown));
            let axis = (axis - lower * axis.dot(lower)).normalize_or(usual);
            (rotation.inverse() * axis, angle, ELBOW_RANGE)
        }
        LeftToe | RightToe => (Vec3::X, about_x, TOE_RANGE),
        _ => (Vec3::X, about_x, KNEE_RANGE),
    };
    // A joint that is past its limit already may stay there.
    Hinge { axis, angle, least: least.min(angle), most: most.max(angle) }
}

/// Whether turning joint `above` moves joint `below` (or is it).
pub(super) fn carries(above: usize, below: usize) -> bool {
    CARRIES[below] >> above & 1 == 1
}

/// Bit a of entry j: a is j or one of its ancestors.
const CARRIES: [u32; JOINT_COUNT] = {
    let mut out = [0; JOINT_COUNT];
    let mut joint = 0;
    while joint < JOINT_COUNT {
        out[joint] = 1 << joint | if joint == 0 { 0 } else { out[PARENT[joint]] };
        joint += 1;
    }
    out
};

fn vector(numbers: &[f64]) -> Vec3 {
    Vec3::new(numbers[0] as f32, numbers[1] as f32, numbers[2] as f32)
}

/// J_r with exp(v + dv) ≈ exp(v)·exp(J_r·dv).
fn right_jacobian(v: Vec3) -> Mat3 {
    let angle = v.length();
    let cross =
        Mat3::from_cols(Vec3::new(0.0, v.z, -v.y), Vec3::new(-v.z, 0.0, v.x), Vec3::new(v.y, -v.x, 0.0));
    if angle < 1e-2 {
        return Mat3::IDENTITY - cross * 0.5 + cross * cross * (1.0 / 6.0);
    }
    let square = angle * angle;
    Mat3::IDENTITY - cross * ((1.0 - angle.cos()) / square)
        + cross * cross * ((angle - angle.sin()) / (square * angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{LimitedTurn, beyond_limits};
    use crate::math::rotation::to_angle_axis;
    use proptest::prelude::*;

    #[test]
    fn an_elbow_that_shows_a_tilted_plane_is_not_bent_on_in_it() {
        // Bent by 25° in a plane that is tilted by 35°: 14° aside, which elbows are.
        let (forearm, degrees) = (Joint::LeftForeArm, DegreesOfFreedom::arms());
        let mut posture = Posture::default();
        let tilt = Quat::from_rotation_x(35f32.to_radians());
        posture.rotations[forearm.index()] =
            tilt * Quat::from_rotation_z(-25f32.to_radians()) * tilt.inverse();
        let frame = degrees.frame(&posture);
        let (at, _) = degrees.first_of(forearm).expect("it is one of them");
        let over = |turn: f64| {
            let mut correction = vec![0.0; degrees.count()];
            correction[at] = turn;
            let beyond: Vec<Beyond> = degrees.beyond_limits(&frame, &correction).collect();
            let bent = degrees.corrected(&frame, &correction);
            let aside =
                beyond_limits(&bent).into_iter().find(|b| b.0 == forearm && b.1 == LimitedTurn::Sideways);
            (beyond, aside.map_or(0.0, |b| f64::from(b.2)))
        };
        assert!(over(0.0).0.is_empty() && over(0.0).1 < 0.0);
        let (beyond, aside) = over(0.6);
        assert_eq!((beyond.len(), beyond[0].first, beyond[0].size), (1, at, 1));
        assert!(aside > 5.0 && (beyond[0].over.to_degrees() - aside).abs() < 0.01, "{beyond:?} {aside}");
        let (further, _) = over(0.61);
        let slope = (further[0].over - beyond[0].over) / 0.01;
        assert!((slope - beyond[0].direction[0]).abs() < 0.02, "{slope} {beyond:?}");
    }

    proptest! {
        #[test]
        fn columns_are_the_derivatives(seed in prop::collection::vec(-0.6f32..0.6, 66), step in prop::collection::vec(-0.5f64..0.5, 80)) {
            let mut posture = Posture::default();
            for (rotation, v) in posture.rotations.iter_mut().zip(seed.chunks_exact(3)) {
                *rotation = Quat::from_scaled_axis(Vec3::new(v[0], v[1], v[2]));
            }
            let degrees = DegreesOfFreedom::for_joints(&[Joint::LeftHand, Joint::Head], &[Joint::LeftHand]);
            let frame = degrees.frame(&posture);
            let correction: Vec<f64> = step[..degrees.count()].to_vec();
            let pose = degrees.corrected(&frame, &correction).pose();
            let mut columns = Vec::new();
            degrees.columns(&frame, &correction, &pose, &mut columns);
            prop_assert_eq!(columns.len(), degrees.count());
            for joint in [Joint::LeftHand, Joint::Head, Joint::LeftToe, Joint::RightFoot] {
                for (i, column) in columns.iter().enumerate() {
                    let h = 2e-3;
                    let moved = |h: f64| {
                        let mut c = correction.clone();
                        c[i] += h;
                        degrees.corrected(&frame, &c).pose()
                    };
                    let (up, down) = (moved(h), moved(-h));
                    let numeric = (up.position(joint) - down.position(joint)) / (2.0 * h as f32);
                    let turned = to_angle_axis(up.rotation(joint) * down.rotation(joint).inverse()) / (2.0 * h as f32);
                    let (mut shift, mut turn) = (Vec3::ZERO, Vec3::ZERO);
                    if column.shifts {
                        shift = column.axis;
                    } else if carries(column.joint, joint.index()) {
                        shift = column.axis.cross(pose.position(joint) - pose.positions[column.joint]);
                        turn = column.axis;
                    }
                    prop_assert!(numeric.distance(shift) < 5e-3, "{joint:?} {i}: {numeric} {shift}");
                    prop_assert!(turned.distance(turn) < 5e-3, "{joint:?} {i}: {turned} {turn}");
                }
            }
        }
    }

    #[test]
    fn an_elbow_bends_in_the_plane_it_is_bent_in() {
        let mut posture = Posture::default();
        posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_y(-1.0);
        let degrees = DegreesOfFreedom::for_joints(&[Joint::LeftHand], &[]);
        let frame = degrees.frame(&posture);
        let (i, size) = degrees.first_of(Joint::LeftForeArm).expect("an elbow");
        assert_eq!(size, 1);
        let mut correction = vec![0.0; degrees.count()];
        correction[i] = 0.3;
        let bent = degrees.corrected(&frame, &correction).rotations[Joint::LeftForeArm.index()];
        assert!(bent.dot(Quat::from_rotation_y(-1.3)).abs() > 1.0 - 1e-5, "{bent}");
        correction[i] = -1.0;
        let beyond: Vec<_> = degrees.beyond_limits(&frame, &correction).filter(|b| b.first == i).collect();
        assert!(beyond.len() == 1 && (beyond[0].over + 0.10).abs() < 1e-3, "{beyond:?}");
        let (i, _) = degrees.first_of(Joint::Spine1).expect("a spine");
        correction[i + 1] = -0.7;
        let beyond: Vec<_> = degrees.beyond_limits(&frame, &correction).filter(|b| b.first == i).collect();
        assert!((beyond[0].over - 0.2).abs() < 1e-6 && beyond[0].direction == [0.0, -1.0, 0.0], "{beyond:?}");
    }
}

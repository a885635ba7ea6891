//! What the finishing pass pulls at: the terms of one frame, and the rows of its least-squares problem.

use glam::{Quat, Vec2, Vec3};

use super::degrees::{Column, carries};
use crate::math::rotation::{to_angle_axis, wrap_angle, yaw};
use crate::motion::{Joint, Pose, Posture};

/// σ of a body beyond its balance, metres.
const BALANCE_SIGMA: f32 = 2e-4;

/// Something that one frame's posture should meet. σ is the miss that weighs as much as a joint turned by its ease.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Term {
    /// A point in a joint's frame is at a place; σ for each world axis, metres.
    Point { joint: Joint, offset: Vec3, target: Vec3, sigma: Vec3 },
    /// A joint is turned as given in the world; σ radians.
    Turn { joint: Joint, target: Quat, sigma: f32 },
    /// The root faces so; radians.
    Facing { yaw: f32, sigma: f32 },
    /// A point of a joint lies on the far side of a plane: normal·p ≥ least.
    Plane { joint: Joint, offset: Vec3, normal: Vec3, least: f32, sigma: f32 },
    /// The body's weight stays over a place on the floor, and no farther from it than `most`, metres.
    Balance { target: Vec2, sigma: f32, most: f32 },
    /// A joint's own rotation (relative to its parent) is as given; σ radians.
    Local { joint: Joint, target: Quat, sigma: f32 },
}

/// Terms that follow from where the body is.
pub(crate) trait FoundTerms {
    /// Adds those of a frame of the span, in whose frames the body is at `poses`.
    fn terms(&self, frame: usize, poses: &[Pose], out: &mut Vec<Term>);
}

/// Share of the body's weight that hangs on each joint (after Winter, Biomechanics and Motor Control of Human Movement,
/// table 4.1; a segment's share is given to the joint nearest its middle).
const WEIGHT_SHARES: [(Joint, f32); 11] = [
    (Joint::Hips, 0.19),
    (Joint::Spine1, 0.17),
    (Joint::Spine2, 0.18),
    (Joint::Head, 0.08),
    (Joint::LeftForeArm, 0.05),
    (Joint::RightForeArm, 0.05),
    (Joint::LeftLeg, 0.125),
    (Joint::RightLeg, 0.125),
    (Joint::LeftFoot, 0.015),
    (Joint::RightFoot, 0.015),
    (Joint::Neck, 0.0),
];

/// Where the body's weight is, on the floor.
pub(crate) fn centre_of_mass(pose: &Pose) -> Vec2 {
    WEIGHT_SHARES.iter().map(|&(joint, share)| pose.position(joint).truncate() * share).sum()
}

/// One number that should be zero.
pub(super) struct Row {
    pub miss: f64,
    /// 1/σ.
    pub weight: f64,
    moved: Moved,
}

/// How a row changes with the columns.
enum Moved {
    /// `direction`·(a point of `joint` at `point`).
    Point { joint: usize, point: Vec3, direction: Vec3 },
    /// `direction`·(the world rotation vector of `joint`).
    Turn { joint: usize, direction: Vec3 },
    /// `direction`·(the rotation of `joint` over its parent's, in the world).
    Own { joint: usize, direction: Vec3 },
    /// `direction`·(the centre of mass).
    Mass { direction: Vec3 },
}

impl Row {
    /// How the miss changes with each column, into `out`.
    pub(super) fn derivative(&self, columns: &[Column], pose: &Pose, out: &mut [f64]) {
        let lever = |column: &Column, joint: usize, point: Vec3, direction: Vec3| {
            if column.shifts {
                direction.dot(column.axis)
            } else if carries(column.joint, joint) {
                direction.dot(column.axis.cross(point - pose.positions[column.joint]))
            } else {
                0.0
            }
        };
        for (out, column) in out.iter_mut().zip(columns) {
            *out = f64::from(match self.moved {
                Moved::Point { joint, point, direction } => lever(column, joint, point, direction),
                Moved::Turn { joint, direction } => {
                    let turns = !column.shifts && carries(column.joint, joint);
                    if turns { direction.dot(column.axis) } else { 0.0 }
                }
                Moved::Own { joint, direction } => {
                    let turns = !column.shifts && column.joint == joint;
                    if turns { direction.dot(column.axis) } else { 0.0 }
                }
                Moved::Mass { direction } => WEIGHT_SHARES
                    .iter()
                    .map(|&(j, share)| share * lever(column, j.index(), pose.position(j), direction))
                    .sum(),
            });
        }
    }
}

/// Gives every row of a term to `give`.
pub(super) fn rows(term: &Term, posture: &Posture, pose: &Pose, mut give: impl FnMut(Row)) {
    let row = |miss: f32, sigma: f32, moved: Moved| Row {
        miss: f64::from(miss),
        weight: 1.0 / f64::from(sigma.max(1e-5)),
        moved,
    };
    match *term {
        Term::Point { joint, offset, target, sigma } => {
            let point = pose.position(joint) + pose.rotation(joint) * offset;
            for (axis, direction) in Vec3::AXES.into_iter().enumerate() {
                let moved = Moved::Point { joint: joint.index(), point, direction };
                give(row((point - target)[axis], sigma[axis], moved));
            }
        }
        Term::Turn { joint, target, sigma } => {
            let miss = to_angle_axis(pose.rotation(joint) * target.inverse());
            for (axis, direction) in Vec3::AXES.into_iter().enumerate() {
                give(row(miss[axis], sigma, Moved::Turn { joint: joint.index(), direction }));
            }
        }
        Term::Local { joint, target, sigma } => {
            // In the world, seen over the parent: W_p·r·r*⁻¹·W_p⁻¹.
            let own = posture.rotations[joint.index()];
            let parent = pose.rotation(joint) * own.inverse();
            let miss = parent * to_angle_axis(own * target.inverse());
            for (axis, direction) in Vec3::AXES.into_iter().enumerate() {
                give(row(miss[axis], sigma, Moved::Own { joint: joint.index(), direction }));
            }
        }
        Term::Facing { yaw: target, sigma } => {
            let q = pose.rotation(Joint::Hips);
            // d yaw for a rotation vector ω of the world: yaw = 2·atan2(z, w), dq = ½ (0, ω)·q.
            let across = (q.w * q.w + q.z * q.z).max(1e-6);
            let dz = Vec3::new(q.y, -q.x, q.w) * 0.5;
            let dw = -Vec3::new(q.x, q.y, q.z) * 0.5;
            let direction = (dz * q.w - dw * q.z) * (2.0 / across);
            give(row(wrap_angle(yaw(q) - target), sigma, Moved::Turn { joint: 0, direction }));
        }
        Term::Plane { joint, offset, normal, least, sigma } => {
            let point = pose.position(joint) + pose.rotation(joint) * offset;
            let miss = normal.dot(point) - least;
            if miss < 0.0 {
                give(row(miss, sigma, Moved::Point { joint: joint.index(), point, direction: normal }));
            }
        }
        Term::Balance { target, sigma, most } => {
            let miss = centre_of_mass(pose) - target;
            let over = miss.length() - most;
            if over > 0.0 {
                let direction = (miss / miss.length()).extend(0.0);
                give(row(over, BALANCE_SIGMA, Moved::Mass { direction }));
            }
            give(row(miss.x, sigma, Moved::Mass { direction: Vec3::X }));
            give(row(miss.y, sigma, Moved::Mass { direction: Vec3::Y }));
        }
    }
}

//! Feet: a planted toe stays where it is, and the legs reach for the feet.
//!
//! The clip's toes and foot rotations are followed directly, not through the inertialised chain
//! above them: a planted foot of the clip is then planted in the result whatever the pelvis does.
//! What remains of the difference (transitions, alignment, the root's glide) is absorbed by holding
//! the toe in place while it is in contact and letting go of it in the swing.

use glam::{Quat, Vec2, Vec3};

use super::inertia::Inertia;
use crate::library::database::DatabaseFrame;
use crate::math::Planar;
use crate::math::rotation::{from_angle_axis, to_angle_axis};
use crate::motion::skeleton::{JOINT_OFFSET, LEG_LENGTH, TOE_HEIGHT};
use crate::motion::{FRAME_RATE, Joint, Pose, Posture};

/// A held toe is let go when the clip's toe is this far from it, metres.
const LET_GO: f32 = 0.16;
const HALF_LIFE: f32 = 0.075;
/// Longest reach of a leg as a share of its full length: the knee keeps some 8° of flexion.
const REACH: f32 = 0.9975;
/// The heel may rise this far to bring the leg within reach, radians.
const HEEL_RISE: f32 = 0.9;

/// UpLeg, Leg, Foot, Toe of each side.
const CHAIN: [[Joint; 4]; 2] = [
    [Joint::LeftUpLeg, Joint::LeftLeg, Joint::LeftFoot, Joint::LeftToe],
    [Joint::RightUpLeg, Joint::RightLeg, Joint::RightFoot, Joint::RightToe],
];

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Foot {
    /// Shown toe minus the clip's toe, world.
    toe: Inertia,
    /// Shown foot rotation over the clip's.
    turn: Inertia,
    /// Where the toe is held, world.
    held: Option<Vec2>,
    /// Where the toe came to stand because the leg could not reach the held place, in the last frame.
    dragged: Option<Vec2>,
    last_toe: Vec3,
}

impl Foot {
    /// Where the clip's toe would be.
    fn clip_toe(planar: &Planar, frame: &DatabaseFrame, side: usize) -> Vec3 {
        let toe = frame.toe[side];
        planar.point_to_world(toe.truncate()).extend(toe.z)
    }

    pub(super) fn transition(
        &mut self,
        planar: &Planar,
        old: &DatabaseFrame,
        old_next: &DatabaseFrame,
        new: &DatabaseFrame,
        new_next: &DatabaseFrame,
        side: usize,
    ) {
        let velocity = |a: &DatabaseFrame, b: &DatabaseFrame| {
            let next = planar.compose(a.step);
            (Self::clip_toe(&next, b, side) - Self::clip_toe(planar, a, side)) * FRAME_RATE
        };
        self.toe.offset += Self::clip_toe(planar, old, side) - Self::clip_toe(planar, new, side);
        self.toe.velocity += velocity(old, old_next) - velocity(new, new_next);
        self.toe.limit_velocity();
        let shown = from_angle_axis(self.turn.offset) * planar.rotation() * old.foot_rotation[side];
        self.turn.offset = to_angle_axis(shown * (planar.rotation() * new.foot_rotation[side]).inverse());
        self.turn.velocity = Vec3::ZERO;
        self.last_toe = Self::clip_toe(planar, new, side);
    }

    /// One frame on; `frame` is the frame now shown.
    pub(super) fn step(&mut self, planar: &Planar, frame: &DatabaseFrame, side: usize) {
        let clip = Self::clip_toe(planar, frame, side);
        let planted = frame.contact[side] >= 1.0;
        if let (Some(held), Some(dragged)) = (&mut self.held, self.dragged.take()) {
            *held = dragged;
        }
        if let Some(held) = self.held {
            let offset = held - clip.truncate();
            let far = offset.length() > LET_GO;
            if planted && !far {
                self.toe.offset = offset.extend(self.toe.offset.z);
                self.toe.velocity = Vec3::new(0.0, 0.0, self.toe.velocity.z);
            } else {
                // The shown toe stood still: its offset begins by undoing the clip's own velocity.
                let velocity = -((clip - self.last_toe) * FRAME_RATE).truncate();
                self.toe.offset = offset.extend(self.toe.offset.z);
                self.toe.velocity = velocity.extend(self.toe.velocity.z);
                self.toe.limit_velocity();
                self.held = None;
            }
        }
        if self.held.is_none() {
            self.toe.step(HALF_LIFE);
            if planted {
                self.held = Some(clip.truncate() + self.toe.offset.truncate());
            }
        } else {
            let mut vertical =
                Inertia { offset: Vec3::Z * self.toe.offset.z, velocity: Vec3::Z * self.toe.velocity.z };
            vertical.step(HALF_LIFE);
            self.toe.offset.z = vertical.offset.z;
            self.toe.velocity.z = vertical.velocity.z;
        }
        self.turn.step(HALF_LIFE);
        self.last_toe = clip;
    }

    /// The contact that is shown: a foot that is dragged or was let go is not planted.
    pub(super) fn contact(&self, clip: f32) -> f32 {
        if clip >= 1.0 && (self.held.is_none() || self.dragged.is_some()) { 0.5 } else { clip }
    }

    /// Bends the leg so that the toe stands where it should.
    pub(super) fn reach(
        &mut self,
        planar: &Planar,
        frame: &DatabaseFrame,
        floor: f32,
        side: usize,
        posture: &mut Posture,
        pose: &mut Pose,
    ) {
        let [thigh, shin, foot, toe] = CHAIN[side].map(Joint::index);
        let mut target = Self::clip_toe(planar, frame, side) + self.toe.offset;
        // Never under the floor: a toe's joint may sink no lower than when it stands flat.
        target.z = target.z.max(TOE_HEIGHT.min(frame.toe[side].z)) + floor;
        let mut rotation = from_angle_axis(self.turn.offset) * planar.rotation() * frame.foot_rotation[side];
        let hip = pose.positions[thigh];
        let longest = 2.0 * LEG_LENGTH * REACH;
        let ankle_of = |rotation: Quat| target - rotation * JOINT_OFFSET[toe];
        let mut ankle = ankle_of(rotation);
        let mut heel = 0.0;
        if ankle.distance(hip) > longest {
            // Raise the heel about the toe just far enough, as a trailing leg does.
            let raised = |angle: f32| rotation * Quat::from_rotation_x(angle);
            let (mut low, mut high) = (0.0, HEEL_RISE);
            for _ in 0..10 {
                let middle = 0.5 * (low + high);
                if ankle_of(raised(middle)).distance(hip) > longest { low = middle } else { high = middle }
            }
            heel = high;
            rotation = raised(heel);
            ankle = ankle_of(rotation);
            if ankle.distance(hip) > longest + 1e-3 {
                ankle = hip + (ankle - hip).clamp_length_max(longest);
                self.dragged = Some((ankle + rotation * JOINT_OFFSET[toe]).truncate());
            }
        }
        let down = (ankle - hip).normalize_or(Vec3::NEG_Z);
        let distance = ankle.distance(hip).clamp(0.15, longest);
        // The knee bends in the plane it bent in.
        let straight = pose.positions[foot] - hip;
        let knee_before = pose.positions[shin] - hip;
        let bent = knee_before - straight * (knee_before.dot(straight) / straight.length_squared().max(1e-9));
        let front = rotation * Vec3::NEG_Y;
        let pole = bent + 0.02 * front;
        let pole = (pole - down * pole.dot(down)).normalize_or(planar.forward().extend(0.0));
        let along = distance / 2.0;
        let knee = hip + down * along + pole * (LEG_LENGTH * LEG_LENGTH - along * along).max(0.0).sqrt();
        let side_axis = pole.cross(down).normalize_or(Vec3::X);
        let bone = |from: Vec3, to: Vec3| {
            let z = (from - to).normalize_or(Vec3::Z);
            let x = (side_axis - z * side_axis.dot(z)).normalize_or(Vec3::X);
            Quat::from_mat3(&glam::Mat3::from_cols(x, z.cross(x), z))
        };
        let (thigh_rotation, shin_rotation) = (bone(hip, knee), bone(knee, ankle));
        posture.rotations[thigh] = pose.rotations[0].inverse() * thigh_rotation;
        posture.rotations[shin] = thigh_rotation.inverse() * shin_rotation;
        posture.rotations[foot] = shin_rotation.inverse() * rotation;
        if heel > 0.0 {
            posture.rotations[toe] = Quat::from_rotation_x(-heel) * posture.rotations[toe];
        }
        for joint in [thigh, shin, foot, toe] {
            pose.place(posture, joint);
        }
    }
}

//! The posture m_t = (p_root, r_root, r_1 … r_J) and forward kinematics.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::skeleton::{JOINT_COUNT, JOINT_OFFSET, Joint, MIRROR, PARENT, REST_HIPS_HEIGHT};
use crate::math::Planar;

/// m_t: one posture of the unified skeleton (LAMA, section 3.1).
///
/// The paper keeps angle-axis vectors; quaternions here, converted where a formula asks for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Posture {
    /// p_root: world, metres.
    pub root_position: Vec3,
    /// `[0]` is r_root in the world; the others are relative to their parent.
    pub rotations: [Quat; JOINT_COUNT],
}

/// A posture after forward kinematics: each joint's place and rotation in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// World, metres.
    pub positions: [Vec3; JOINT_COUNT],
    /// World; a joint at rest has none.
    pub rotations: [Quat; JOINT_COUNT],
}

impl Default for Posture {
    /// The rest pose at the origin.
    fn default() -> Self {
        Self {
            root_position: Vec3::new(0.0, 0.0, REST_HIPS_HEIGHT),
            rotations: [Quat::IDENTITY; JOINT_COUNT],
        }
    }
}

impl Posture {
    /// Where the root stands on the floor and faces.
    pub fn planar(&self) -> Planar {
        Planar::of_root(self.root_position, self.rotations[0])
    }

    /// The posture carried rigidly over the floor: `from` is taken to `to`.
    pub fn moved(&self, from: Planar, to: Planar) -> Posture {
        let mut out = *self;
        let planar = from.point_to_local(self.root_position.truncate());
        out.root_position = to.point_to_world(planar).extend(self.root_position.z);
        out.rotations[0] = Quat::from_rotation_z(to.yaw - from.yaw) * self.rotations[0];
        out
    }

    /// Left and right exchanged about the plane x = 0.
    pub fn mirrored(&self) -> Posture {
        let flip = |q: Quat| Quat::from_xyzw(q.x, -q.y, -q.z, q.w);
        let mut out = *self;
        out.root_position.x = -self.root_position.x;
        for (joint, rotation) in out.rotations.iter_mut().enumerate() {
            *rotation = flip(self.rotations[MIRROR[joint]]);
        }
        out
    }

    /// Forward kinematics.
    pub fn pose(&self) -> Pose {
        let mut pose = Pose { positions: [self.root_position; JOINT_COUNT], rotations: self.rotations };
        for joint in 1..JOINT_COUNT {
            pose.place(self, joint);
        }
        pose
    }
}

impl Pose {
    /// Where a joint is, world, metres.
    pub fn position(&self, joint: Joint) -> Vec3 {
        self.positions[joint.index()]
    }

    /// How a joint is turned, world.
    pub fn rotation(&self, joint: Joint) -> Quat {
        self.rotations[joint.index()]
    }

    /// A point that moves with a joint, given in the joint's frame; world, metres.
    pub fn point(&self, joint: Joint, offset: Vec3) -> Vec3 {
        self.position(joint) + self.rotation(joint) * offset
    }

    /// Recomputes one joint from its parent, which must be up to date.
    pub(crate) fn place(&mut self, posture: &Posture, joint: usize) {
        let parent = PARENT[joint];
        self.rotations[joint] = self.rotations[parent] * posture.rotations[joint];
        self.positions[joint] = self.positions[parent] + self.rotations[parent] * JOINT_OFFSET[joint];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn raised_thigh_lifts_the_knee_to_the_hip() {
        // A thigh raised forward (towards -Y) by a quarter turn about +X's negative... worked by hand:
        // the thigh points along -Z at rest; turned by -90° about X it points along -Y.
        let mut posture = Posture::default();
        posture.rotations[Joint::LeftUpLeg.index()] = Quat::from_rotation_x(-FRAC_PI_2);
        let pose = posture.pose();
        let hip = pose.position(Joint::LeftUpLeg);
        assert!(pose.position(Joint::LeftLeg).distance(hip + Vec3::new(0.0, -0.444, 0.0)) < 1e-5);
    }

    #[test]
    fn mirror_swaps_the_sides() {
        let mut posture = Posture::default();
        posture.root_position.x = 0.3;
        posture.rotations[0] = Quat::from_rotation_z(0.5);
        posture.rotations[Joint::LeftArm.index()] = Quat::from_rotation_y(0.4) * Quat::from_rotation_z(0.2);
        let (a, b) = (posture.pose(), posture.mirrored().pose());
        for joint in Joint::ALL {
            let flipped = a.position(joint) * Vec3::new(-1.0, 1.0, 1.0);
            assert!(flipped.distance(b.position(joint.mirrored())) < 1e-5, "{joint:?}");
        }
    }

    #[test]
    fn moved_carries_every_joint_rigidly() {
        let posture = Posture::default();
        let to = Planar::new(Vec2::new(2.0, 1.0), 0.8);
        let moved = posture.moved(Planar::default(), to);
        let (a, b) = (posture.pose(), moved.pose());
        for joint in Joint::ALL {
            let expected = to.point_to_world(a.position(joint).truncate()).extend(a.position(joint).z);
            assert!(expected.distance(b.position(joint)) < 1e-5);
        }
        assert!((moved.planar().yaw - 0.8).abs() < 1e-6);
    }
}

//! The floor plane and the person-centric space on it.
//!
//! Blender's axes: Z up; a character at rest faces **-Y**, its left is **+X** (Blender's front view).
//! `yaw` turns the rest pose about +Z. The *heading* is the angle of the forward direction from +X
//! towards +Y, so `heading = yaw - 90°`. The paper's XZ plane is this XY plane.

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::rotation::{wrap_angle, yaw};

/// A place and a facing on the floor: the origin of a person-centric space.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Planar {
    /// Metres, world.
    pub position: Vec2,
    /// Radians about +Z from the rest pose (which faces -Y).
    pub yaw: f32,
}

impl Planar {
    /// A place (metres) and a facing (radians).
    pub fn new(position: Vec2, yaw: f32) -> Self {
        Self { position, yaw }
    }

    /// The projection of a root (position, global rotation) on the floor.
    pub fn of_root(position: Vec3, rotation: Quat) -> Self {
        Self::new(position.truncate(), yaw(rotation))
    }

    /// Unit forward direction in the world.
    pub fn forward(&self) -> Vec2 {
        rotate(self.yaw, Vec2::NEG_Y)
    }

    /// Angle of the forward direction from +X, radians.
    pub fn heading(&self) -> f32 {
        wrap_angle(self.yaw - FRAC_PI_2)
    }

    /// A place (metres) and where the facing points, an angle from +X (radians).
    pub fn from_heading(position: Vec2, heading: f32) -> Self {
        Self::new(position, wrap_angle(heading + FRAC_PI_2))
    }

    /// World point → person-centric point.
    pub fn point_to_local(&self, world: Vec2) -> Vec2 {
        rotate(-self.yaw, world - self.position)
    }

    /// Person-centric point → world point.
    pub fn point_to_world(&self, local: Vec2) -> Vec2 {
        self.position + rotate(self.yaw, local)
    }

    /// A direction of the world as seen from here.
    pub fn direction_to_local(&self, world: Vec2) -> Vec2 {
        rotate(-self.yaw, world)
    }

    /// A direction as seen from here, in the world.
    pub fn direction_to_world(&self, local: Vec2) -> Vec2 {
        rotate(self.yaw, local)
    }

    /// `self ∘ local`: where a placement given in this person-centric space stands in the world.
    pub fn compose(&self, local: Planar) -> Planar {
        Planar::new(self.point_to_world(local.position), wrap_angle(self.yaw + local.yaw))
    }

    /// The placement `other` as seen from here: `self.compose(self.relative(other)) == other`.
    pub fn relative(&self, other: Planar) -> Planar {
        Planar::new(self.point_to_local(other.position), wrap_angle(other.yaw - self.yaw))
    }

    /// The rotation about +Z.
    pub fn rotation(&self) -> Quat {
        Quat::from_rotation_z(self.yaw)
    }
}

/// Turns a planar vector by `angle` radians counter-clockwise.
pub(crate) fn rotate(angle: f32, v: Vec2) -> Vec2 {
    Vec2::from_angle(angle).rotate(v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rest_faces_minus_y_and_left_is_plus_x() {
        let here = Planar::default();
        assert!(here.forward().distance(Vec2::NEG_Y) < 1e-6);
        assert!((here.heading() + FRAC_PI_2).abs() < 1e-6);
        // Facing +X (heading 0), the left hand side is +Y.
        let facing_x = Planar::from_heading(Vec2::ZERO, 0.0);
        assert!(facing_x.forward().distance(Vec2::X) < 1e-6);
        assert!(facing_x.direction_to_world(Vec2::X).distance(Vec2::Y) < 1e-6);
    }

    proptest! {
        #[test]
        fn relative_undoes_compose(ax in -5f32..5., ay in -5f32..5., aw in -3f32..3., bx in -5f32..5., by in -5f32..5., bw in -3f32..3.) {
            let a = Planar::new(Vec2::new(ax, ay), aw);
            let b = Planar::new(Vec2::new(bx, by), bw);
            let c = a.compose(a.relative(b));
            prop_assert!(c.position.distance(b.position) < 1e-4);
            prop_assert!(wrap_angle(c.yaw - b.yaw).abs() < 1e-4);
        }
    }
}

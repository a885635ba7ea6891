//! How deep a limb is in the scene's surfaces.

use glam::Vec3;

use super::SceneIndex;
use super::polygon::Polygon;
use crate::math::capsule::{Capsule, nearest_to_triangle};

impl SceneIndex {
    /// How deep a capsule is in the surface that it is deepest in, metres, and where that surface is nearest to its axis
    /// (world). What is lower than `above` (world z) is not counted; `None` where nothing touches.
    ///
    /// Beside a surface it is as deep as its own surface is behind it; where its axis passes through, by the shorter end of the
    /// axis more: so far it would have to be moved to be free.
    pub fn depth_of(&self, capsule: &Capsule, above: f32) -> Option<(f32, Vec3)> {
        let [a, b] = capsule.ends;
        let radius = capsule.radii[0].max(capsule.radii[1]);
        let (low, high) = (a.min(b) - radius, a.max(b) + radius);
        if high.z < above || self.is_free(capsule, radius, low.z, above) {
            return None;
        }
        let low = low.with_z(low.z.max(above));
        let mut deepest: Option<(f32, Vec3)> = None;
        self.tree.visit_near(low, high, |triangle| {
            let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize_or_zero();
            let sides = capsule.ends.map(|end| (end - triangle[0]).dot(normal));
            if sides[0].abs().min(sides[1].abs()) > radius && sides[0] * sides[1] > 0.0 {
                return;
            }
            let shown = Polygon::new(triangle).clip(2, above, f32::INFINITY);
            for pair in shown.corners().get(1..).unwrap_or_default().windows(2) {
                let (part, place, through) =
                    nearest_to_triangle(capsule.ends, [shown.corners()[0], pair[0], pair[1]]);
                let axis = a + (b - a) * part;
                let depth = capsule.radius(part)
                    + if through { sides[0].abs().min(sides[1].abs()) } else { -axis.distance(place) };
                if depth > deepest.map_or(0.0, |d| d.0) {
                    deepest = Some((depth, place));
                }
            }
        });
        deepest
    }

    /// Whether the distance field rules out that anything touches a capsule no thicker than `radius`.
    fn is_free(&self, capsule: &Capsule, radius: f32, lowest: f32, above: f32) -> bool {
        // The field knows nothing of what lies under its bottom.
        if above < self.field.bottom && lowest <= self.field.bottom {
            return false;
        }
        let [a, b] = capsule.ends;
        let balls = (a.distance(b) / radius).ceil().clamp(1.0, 16.0);
        let reach = radius + 0.5 * a.distance(b) / balls;
        (0..balls as usize).all(|i| self.field.lower_bound(a + (b - a) * ((i as f32 + 0.5) / balls)) > reach)
    }
}

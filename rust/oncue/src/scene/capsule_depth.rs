//! How deep a limb is in the scene's surfaces.

use glam::Vec3;

use super::SceneIndex;
use super::polygon::Polygon;
use super::triangle_tree::TriangleTree;
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
        self.tree.depth_of(capsule, above)
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

impl TriangleTree {
    /// [`SceneIndex::depth_of`] by the triangles alone.
    pub(super) fn depth_of(&self, capsule: &Capsule, above: f32) -> Option<(f32, Vec3)> {
        let [a, b] = capsule.ends;
        let radius = capsule.radii[0].max(capsule.radii[1]);
        let (low, high) = (a.min(b) - radius, a.max(b) + radius);
        let low = low.with_z(low.z.max(above));
        let mut deepest: Option<(f32, Vec3)> = None;
        self.visit_near(low, high, |triangle| {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Progress;
    use crate::scene::SceneSettings;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        [-1f32..1.0, -1f32..1.0, 0f32..2.0].prop_map(Vec3::from)
    }

    proptest! {
        /// Tree, distance field and planes leave out nothing that touches.
        #[test]
        fn as_deep_as_brute_force_says(
            corners in prop::collection::vec((point(), point(), point()), 1..30),
            limbs in prop::collection::vec((point(), point(), 0.02f32..0.15, 0.02f32..0.15), 10),
        ) {
            let positions: Vec<Vec3> = corners.iter().flat_map(|&(a, b, c)| [a, a.lerp(b, 0.4), a.lerp(c, 0.4)]).collect();
            let triangles: Vec<[u32; 3]> = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let scene = SceneIndex::build(&positions, &triangles, &SceneSettings::default(), &Progress::new());
            let scene = scene.expect("a scene");
            for (a, b, first, last) in limbs {
                let capsule = Capsule { ends: [a, a.lerp(b, 0.3)], radii: [first, last] };
                let mut expected = 0f32;
                for corners in positions.chunks_exact(3) {
                    let triangle = [corners[0], corners[1], corners[2]];
                    let (part, place, through) = nearest_to_triangle(capsule.ends, triangle);
                    let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize_or_zero();
                    let behind = capsule.ends.map(|end| (end - triangle[0]).dot(normal).abs());
                    let on_axis = a + (capsule.ends[1] - a) * part;
                    let more = if through { behind[0].min(behind[1]) } else { -on_axis.distance(place) };
                    expected = expected.max(capsule.radius(part) + more);
                }
                let found = scene.depth_of(&capsule, -1.0).map_or(0.0, |d| d.0);
                prop_assert!((found - expected).abs() < 1e-5, "{} {}", found, expected);
            }
        }
    }
}

//! How deep a limb is in the scene's surfaces.

use glam::Vec3;

use super::SceneIndex;
use super::polygon::Polygon;
use super::triangle_tree::TriangleTree;
use crate::math::capsule::{Capsule, nearest_to_triangle};

/// A capsule in a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneContact {
    /// How deep, metres.
    pub depth: f32,
    /// Where the surface is nearest to the capsule's axis, or where the axis passes through it; world, metres.
    pub place: Vec3,
    /// The part (0..=1) of the axis that would have to be moved, …
    pub part: f32,
    /// … in this direction; world, of length 1.
    pub direction: Vec3,
    /// Whether the axis passes through the surface; `part` is then its shorter end.
    pub through: bool,
}

/// Two directions are not the same that differ by more than 45 degrees: the cosine.
const ANOTHER_WAY: f32 = 0.707;

impl SceneIndex {
    /// The surface that a capsule is deepest in. What is lower than `above` (world z) is not counted; `None` where nothing touches.
    ///
    /// Beside a surface it is as deep as its own surface is behind it; where its axis passes through, by the shorter end of the
    /// axis more: so far it would have to be moved to be free.
    pub fn depth_of(&self, capsule: &Capsule, above: f32) -> Option<SceneContact> {
        if self.touches_nothing(capsule, above) { None } else { self.tree.depth_of(capsule, above) }
    }

    /// The surfaces that a capsule is in, the deepest of those that would move it the same way; the deepest of all first.
    pub(crate) fn contacts_of(&self, capsule: &Capsule, above: f32) -> Vec<SceneContact> {
        if self.touches_nothing(capsule, above) { Vec::new() } else { self.tree.contacts_of(capsule, above) }
    }

    fn touches_nothing(&self, capsule: &Capsule, above: f32) -> bool {
        let [a, b] = capsule.ends;
        let radius = capsule.radii[0].max(capsule.radii[1]);
        let (lowest, highest) = (a.z.min(b.z) - radius, a.z.max(b.z) + radius);
        highest < above || self.is_free(capsule, radius, lowest, above)
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
    pub(super) fn depth_of(&self, capsule: &Capsule, above: f32) -> Option<SceneContact> {
        let mut deepest: Option<SceneContact> = None;
        self.visit_contacts(capsule, above, |contact| {
            if contact.depth > deepest.map_or(0.0, |d| d.depth) {
                deepest = Some(contact);
            }
        });
        deepest
    }

    /// [`SceneIndex::contacts_of`] by the triangles alone.
    pub(super) fn contacts_of(&self, capsule: &Capsule, above: f32) -> Vec<SceneContact> {
        let mut contacts: Vec<SceneContact> = Vec::new();
        self.visit_contacts(capsule, above, |contact| contacts.push(contact));
        contacts.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        let mut kept: Vec<SceneContact> = Vec::new();
        for contact in contacts {
            if kept.iter().all(|deeper| deeper.direction.dot(contact.direction) < ANOTHER_WAY) {
                kept.push(contact);
            }
        }
        kept
    }

    /// Each triangle that a capsule is in.
    fn visit_contacts(&self, capsule: &Capsule, above: f32, mut visit: impl FnMut(SceneContact)) {
        let [a, b] = capsule.ends;
        let radius = capsule.radii[0].max(capsule.radii[1]);
        let (low, high) = (a.min(b) - radius, a.max(b) + radius);
        let low = low.with_z(low.z.max(above));
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
                let away = a + (b - a) * part - place;
                let shorter = usize::from(sides[1].abs() < sides[0].abs());
                let depth =
                    capsule.radius(part) + if through { sides[shorter].abs() } else { -away.length() };
                if depth > 0.0 {
                    let back = normal * sides[1 - shorter].signum();
                    visit(if through {
                        SceneContact { depth, place, part: shorter as f32, direction: back, through }
                    } else {
                        SceneContact { depth, place, part, direction: away.normalize_or(back), through }
                    });
                }
            }
        });
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

    #[test]
    fn a_contact_says_which_way_is_out() {
        // A wall at y = 0, seen from +y; a limb of 10 cm along y through it and one beside it.
        let corners = [
            [-1.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 0.0, 2.0],
            [-1.0, 0.0, 2.0],
            [-3.0, -3.0, 0.0],
            [3.0, -3.0, 0.0],
            [0.0, 3.0, 0.0],
        ];
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6]];
        let scene = SceneIndex::build(
            &corners.map(Vec3::from),
            &triangles,
            &SceneSettings::default(),
            &Progress::new(),
        );
        let scene = scene.expect("a wall");
        let found = |from: f32, to: f32, x: f32| {
            let ends = [Vec3::new(0.0, from, 1.0), Vec3::new(x, to, 1.0)];
            scene.depth_of(&Capsule { ends, radii: [0.02, 0.02] }, 0.1).expect("a contact")
        };
        let near = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-5, "{a} {b}");
        // 3 cm of it are behind the wall: that end has to come back, by those and its radius.
        let through = found(0.07, -0.03, 0.0);
        assert!((through.depth - 0.05).abs() < 1e-5 && through.part == 1.0, "{through:?}");
        near(through.direction, Vec3::Y);
        near(through.place, Vec3::new(0.0, 0.0, 1.0));
        assert_eq!(found(-0.03, 0.07, 0.0).part, 0.0);
        near(found(0.03, -0.07, 0.0).direction, Vec3::NEG_Y);
        let beside = found(0.05, 0.01, 0.3);
        assert!((beside.depth - 0.01).abs() < 1e-5 && beside.part == 1.0, "{beside:?}");
        near(beside.direction, Vec3::Y);
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
                let found = scene.depth_of(&capsule, -1.0).map_or(0.0, |d| d.depth);
                prop_assert!((found - expected).abs() < 1e-5, "{} {}", found, expected);
            }
        }
    }
}

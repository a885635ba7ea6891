//! Capsules that taper, and how near straight pieces are to one another and to triangles.

use glam::Vec3;

/// A limb as a ball that runs along a straight piece and grows or shrinks on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// Where its axis begins and ends, metres.
    pub ends: [Vec3; 2],
    /// Its radius there, metres.
    pub radii: [f32; 2],
}

impl Capsule {
    /// Its radius at `part` (0..=1) of its axis, metres.
    pub fn radius(&self, part: f32) -> f32 {
        self.radii[0] + (self.radii[1] - self.radii[0]) * part
    }

    /// How deep two capsules are in one another where their axes are nearest, metres; negative is the gap between them.
    pub fn depth_in(&self, other: &Capsule) -> f32 {
        let (s, t) = nearest_parts(self.ends, other.ends);
        let apart = along(self.ends, s).distance(along(other.ends, t));
        self.radius(s) + other.radius(t) - apart
    }
}

/// The place at `part` of a straight piece.
fn along(ends: [Vec3; 2], part: f32) -> Vec3 {
    ends[0] + (ends[1] - ends[0]) * part
}

/// The parts (0..=1) of two straight pieces at which they are nearest (Ericson 2005, section 5.1.9).
pub fn nearest_parts(one: [Vec3; 2], other: [Vec3; 2]) -> (f32, f32) {
    let (d, e, r) = (one[1] - one[0], other[1] - other[0], one[0] - other[0]);
    let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
    let (dr, er) = (d.dot(r), e.dot(r));
    const POINT: f32 = 1e-12;
    if dd < POINT {
        let t = if ee < POINT { 0.0 } else { (er / ee).clamp(0.0, 1.0) };
        return (0.0, t);
    }
    if ee < POINT {
        return ((-dr / dd).clamp(0.0, 1.0), 0.0);
    }
    let across = dd * ee - de * de;
    // Parallel pieces are as near anywhere along where they overlap.
    let s = if across > POINT { ((de * er - dr * ee) / across).clamp(0.0, 1.0) } else { 0.0 };
    let t = (de * s + er) / ee;
    let held = t.clamp(0.0, 1.0);
    if held == t { (s, t) } else { (((held * de - dr) / dd).clamp(0.0, 1.0), held) }
}

/// A triangle lower than this is a line, metres: what is left of its normal is rounding.
const FLAT: f32 = 1e-5;

/// Where a straight piece is nearest to a triangle: the part (0..=1) of the piece, the place on the triangle, and whether the
/// piece passes through it.
pub fn nearest_to_triangle(ends: [Vec3; 2], triangle: [Vec3; 3]) -> (f32, Vec3, bool) {
    let [a, b, c] = triangle;
    let normal = (b - a).cross(c - a);
    let inside = |point: Vec3| {
        [(a, b), (b, c), (c, a)]
            .iter()
            .all(|(from, to)| (*to - *from).cross(point - *from).dot(normal) >= 0.0)
    };
    let square = normal.length_squared();
    // A triangle that is but a line has no face, and any point would be inside of it.
    let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    let has_face = square > FLAT * FLAT * longest;
    let sides = ends.map(|end| (end - a).dot(normal));
    if has_face && sides[0] * sides[1] < 0.0 {
        let part = sides[0] / (sides[0] - sides[1]);
        let place = along(ends, part);
        if inside(place) {
            return (part, place, true);
        }
    }
    let mut best = (0.0, a, f32::INFINITY);
    let mut offer = |part: f32, place: Vec3| {
        let apart = along(ends, part).distance_squared(place);
        if apart < best.2 {
            best = (part, place, apart);
        }
    };
    for (end, part) in [(0, 0.0), (1, 1.0)] {
        let foot = ends[end] - normal * (sides[end] / square.max(f32::MIN_POSITIVE));
        if has_face && inside(foot) {
            offer(part, foot);
        }
    }
    for edge in [[a, b], [b, c], [c, a]] {
        let (s, t) = nearest_parts(ends, edge);
        offer(s, along(edge, t));
    }
    (best.0, best.1, false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        [-1f32..1.0, -1f32..1.0, -1f32..1.0].prop_map(Vec3::from)
    }

    #[test]
    fn crossed_sticks_by_hand() {
        // Along X at the height 0 and along Y at the height 0.3, 5 cm and 10 cm thick: 15 cm of gap.
        let one = Capsule { ends: [Vec3::NEG_X, Vec3::X], radii: [0.05; 2] };
        let other =
            Capsule { ends: [Vec3::new(0.5, -1.0, 0.3), Vec3::new(0.5, 1.0, 0.3)], radii: [0.0, 0.2] };
        assert_eq!(nearest_parts(one.ends, other.ends), (0.75, 0.5));
        assert!((one.depth_in(&other) + 0.15).abs() < 1e-6);
        // The same stick beside itself.
        assert!((one.depth_in(&one) - 0.1).abs() < 1e-6);
    }

    #[test]
    fn a_triangle_that_is_a_line_has_no_face() {
        // A roof's corner as a room of the examples has it: three points on one line, 1.5 m from a limb.
        let line = [Vec3::new(1.0, -2.0, 1.5), Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, -1.0, 1.25)];
        let limb = [Vec3::new(2.5, -1.0, 1.25), Vec3::new(2.5, -1.0, 2.0)];
        let (part, place, through) = nearest_to_triangle(limb, line);
        assert!((along(limb, part).distance(place) - 1.5).abs() < 1e-5 && !through, "{part} {place}");
    }

    proptest! {
        #[test]
        fn a_thin_triangle_is_no_nearer_than_its_longest_edge(
            a in point(), b in point(), c in point(), d in point(), u in 0f32..1.0, off in point(), thin in -9f32..-3.0,
        ) {
            let triangle = [c, d, c.lerp(d, u) + off * 10f32.powf(thin)];
            let (part, place, _) = nearest_to_triangle([a, b], triangle);
            let (s, t) = nearest_parts([a, b], [c, d]);
            let (is, line) = (along([a, b], part).distance(place), along([a, b], s).distance(along([c, d], t)));
            prop_assert!((is - line).abs() < 4e-3, "{} {}", is, line);
        }

        #[test]
        fn nothing_is_nearer(a in point(), b in point(), c in point(), d in point(), e in point()) {
            let (one, other) = ([a, b], [c, d]);
            let (s, t) = nearest_parts(one, other);
            let found = along(one, s).distance(along(other, t));
            let (part, place, through) = nearest_to_triangle(one, [c, d, e]);
            let to_triangle = along(one, part).distance(place);
            prop_assert!(!through || to_triangle < 1e-4);
            let mut off_it = f32::INFINITY;
            for i in 0..=20 {
                let at = along(one, i as f32 / 20.0);
                for j in 0..=20 {
                    let v = j as f32 / 20.0;
                    prop_assert!(at.distance(along(other, v)) > found - 1e-4);
                    for k in 0..=20 - j {
                        let on = c + (d - c) * v + (e - c) * (k as f32 / 20.0);
                        prop_assert!(at.distance(on) > to_triangle - 1e-4);
                        off_it = off_it.min(place.distance(on));
                    }
                }
            }
            // The place is on the triangle: no farther from its nearest grid point than these are apart.
            prop_assert!(off_it < c.distance(d).max(c.distance(e)).max(d.distance(e)) / 20.0);
        }
    }
}

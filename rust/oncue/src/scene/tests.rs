//! The scene index against brute force and by hand, on geometry made here.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Quat, Vec2, Vec3};
use proptest::prelude::*;

use super::box_edges::{ALL_EDGES, OrientedBox, crossings};
use super::triangle_tree::{Scratch, TriangleTree};
use super::*;
use crate::action::ActionType;
use crate::cue::{ActionCue, InitialState, Task};
use crate::error::Error;
use crate::math::rotation::wrap_angle;
use crate::motion::skeleton::{Limb, SEATED_HIPS_HEIGHT};
use crate::motion::{Joint, Posture};
use crate::simd::Level;

/// A mesh made of boxes and sheets.
#[derive(Default, Clone)]
struct Mesh {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn quad(mut self, a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Self {
        let n = self.positions.len() as u32;
        self.positions.extend([a, b, c, d]);
        self.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        self
    }

    fn floor(self, lo: Vec2, hi: Vec2, z: f32) -> Self {
        self.quad(lo.extend(z), Vec3::new(hi.x, lo.y, z), hi.extend(z), Vec3::new(lo.x, hi.y, z))
    }

    fn solid(self, lo: [f32; 3], hi: [f32; 3]) -> Self {
        let p =
            |x: usize, y: usize, z: usize| Vec3::new([lo[0], hi[0]][x], [lo[1], hi[1]][y], [lo[2], hi[2]][z]);
        self.quad(p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0))
            .quad(p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1))
            .quad(p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1))
            .quad(p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0))
            .quad(p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0))
            .quad(p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1))
    }

    fn build(&self) -> Result<SceneIndex> {
        SceneIndex::build(&self.positions, &self.triangles, &SceneSettings::default(), &Progress::new())
    }

    fn build_for(&self, task: &Task) -> SceneIndex {
        let (settings, progress) = (SceneSettings::default(), Progress::new());
        SceneIndex::build_for(&self.positions, &self.triangles, &settings, &task.places(), &progress).unwrap()
    }

    /// What is said of a task in this scene, indexed for it; nothing where it can be done.
    fn said(&self, task: &Task) -> String {
        check_task(&self.build_for(task), task).map_or_else(|error| error.to_string(), |()| String::new())
    }

    fn corners(&self) -> Vec<[Vec3; 3]> {
        self.triangles.iter().map(|t| t.map(|i| self.positions[i as usize])).collect()
    }
}

/// A 6 × 4 m room with walls, a bench along the far wall and a partition with a door 0.8 m wide.
fn room() -> Mesh {
    Mesh::default()
        .floor(Vec2::ZERO, Vec2::new(6.0, 4.0), 0.0)
        .solid([-0.1, -0.1, 0.0], [0.0, 4.1, 2.5])
        .solid([6.0, -0.1, 0.0], [6.1, 4.1, 2.5])
        .solid([0.0, -0.1, 0.0], [6.0, 0.0, 2.5])
        .solid([0.0, 4.0, 0.0], [6.0, 4.1, 2.5])
        .solid([2.9, 0.0, 0.0], [3.0, 1.6, 2.5])
        .solid([2.9, 2.4, 0.0], [3.0, 4.0, 2.5])
        .solid([5.55, 1.0, 0.0], [6.0, 3.0, 0.45])
}

fn sit(x: f32, y: f32, z: f32, heading_degrees: f32) -> ActionCue {
    ActionCue {
        name: "Bench".into(),
        action_type: ActionType::Sit,
        position: Vec3::new(x, y, z),
        yaw: (heading_degrees + 90.0).to_radians(),
        feet: [None; 2],
    }
}

fn stop(x: f32, y: f32) -> ActionCue {
    ActionCue { action_type: ActionType::Stop, name: "There".into(), ..sit(x, y, 0.0, 0.0) }
}

fn task(start: Vec3, cue: ActionCue) -> Task {
    Task {
        start: InitialState::standing("Here", start, 0.0),
        cue,
        passes: Vec::new(),
        manipulations: Vec::new(),
    }
}

/// Crossings of a box's edges with a triangle in double precision, from the edges' end points; `None` where one is
/// too close to call.
fn reference_crossings(placed: &OrientedBox, t: &[Vec3; 3]) -> Option<u32> {
    let corner = |i: usize| -> DVec3 {
        let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let h = placed.half_extents.as_dvec3();
        let a = placed.axes.as_dmat3();
        placed.center.as_dvec3() + a * DVec3::new(sign(0) * h.x, sign(1) * h.y, sign(2) * h.z)
    };
    let [a, b, c] = t.map(|v| v.as_dvec3());
    let mut count = 0;
    for i in 0..8usize {
        for bit in 0..3 {
            if i >> bit & 1 == 1 {
                continue;
            }
            let (p, q) = (corner(i), corner(i | 1 << bit));
            // Signed volumes, as lengths over the edge's: the plane is crossed, and the line passes inside.
            let n = (b - a).cross(c - a).normalize();
            let (dp, dq) = ((p - a).dot(n), (q - a).dot(n));
            let d = (q - p).normalize();
            let side = |u: DVec3, v: DVec3| d.dot((u - p).cross(v - p)) / (v - u).length();
            let sides = [side(a, b), side(b, c), side(c, a)];
            let least = sides.iter().chain([&dp, &dq]).map(|s| s.abs()).fold(f64::INFINITY, f64::min);
            if least < 2e-6 {
                return None;
            }
            let inside = sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0);
            count += u32::from(inside && (dp > 0.0) != (dq > 0.0));
        }
    }
    Some(count)
}

fn vector(range: std::ops::Range<f32>) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(range).prop_map(Vec3::from)
}

fn placed_box() -> impl Strategy<Value = OrientedBox> {
    (vector(-1.0..1.0), vector(-3.0..3.0), vector(0.02..0.3))
        .prop_map(|(center, turn, half)| OrientedBox::new(center, Quat::from_scaled_axis(turn), half))
}

/// Small, large and thin triangles, and some flat on a plane across an axis, as walls and floors are.
fn soup() -> impl Strategy<Value = Vec<[Vec3; 3]>> {
    let triangle = (vector(-1.2..1.2), prop::array::uniform2(vector(-1.0..1.0)), 0.02f32..4.0, 0u8..6)
        .prop_map(|(at, [u, v], size, kind)| {
            let mut t = [at, at + u * size, at + v * size];
            if kind < 3 {
                t.iter_mut().for_each(|c| c[usize::from(kind)] = at[usize::from(kind)]);
            }
            t
        });
    prop::collection::vec(triangle, 1..200)
        .prop_map(|t| t.into_iter().filter(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() > 1e-6).collect())
}

proptest! {
    #[test]
    fn crossings_agree_with_double_precision(placed in placed_box(), soup in soup()) {
        for t in &soup {
            if let Some(expected) = reference_crossings(&placed, t) {
                prop_assert_eq!(crossings(&placed, t, ALL_EDGES, f32::NEG_INFINITY).count_ones(), expected, "{:?}", t);
            }
        }
    }

    #[test]
    fn the_tree_counts_what_brute_force_counts(soup in soup(), boxes in prop::collection::vec(placed_box(), 1..20), above in -1f32..1.0) {
        prop_assume!(!soup.is_empty());
        let tree = TriangleTree::build(&soup, &Progress::new()).unwrap();
        let mut scratch = Scratch::default();
        for placed in &boxes {
            for above in [f32::NEG_INFINITY, above] {
                let expected: u32 = soup.iter().map(|t| crossings(placed, t, ALL_EDGES, above).count_ones()).sum();
                prop_assert_eq!(tree.count(placed, above, &mut scratch), expected);
                prop_assert_eq!(tree.count_at(Level::Portable, placed, above, &mut scratch), expected);
            }
        }
    }

    #[test]
    fn a_ray_finds_the_nearest_triangle(soup in soup(), origin in vector(-1.5..1.5), direction in vector(-1.0..1.0)) {
        prop_assume!(!soup.is_empty() && direction.length() > 0.1);
        let direction = direction.normalize();
        let tree = TriangleTree::build(&soup, &Progress::new()).unwrap();
        let mut expected: Vec<f64> = soup.iter().filter_map(|t| {
            let [a, b, c] = t.map(|v| v.as_dvec3());
            let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
            let n = (b - a).cross(c - a);
            let t = (a - o).dot(n) / d.dot(n);
            let p = o + d * t;
            let inside = [(a, b), (b, c), (c, a)].iter().all(|&(u, v)| (v - u).cross(p - u).dot(n) > -1e-7 * n.length());
            ((0.0..=3.0).contains(&t) && inside).then_some(t)
        }).collect();
        expected.sort_by(f64::total_cmp);
        match (tree.ray(origin, direction, 3.0), expected.first()) {
            (Some(t), Some(e)) => prop_assert!((f64::from(t) - e).abs() < 1e-4, "{t} {e}"),
            (None, None) => {}
            // On a triangle's border, or at the very end of the ray, either answer is right.
            (Some(t), None) => prop_assert!(t > 2.999, "{t}"),
            (None, Some(e)) => prop_assert!(*e > 2.999, "{e}"),
        }
    }

    #[test]
    fn the_field_never_promises_too_much(soup in soup(), points in prop::collection::vec(vector(-2.0..2.0), 30)) {
        prop_assume!(!soup.is_empty());
        let first = soup[0][0];
        let bounds = soup.iter().flatten().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        let bottom = -0.3;
        let field = DistanceField::build(&soup, bounds, bottom, 0.05, 4_000_000, &Progress::new()).unwrap();
        for p in points {
            let bound = field.lower_bound(p);
            // Points spread over the triangles are at least as far as the nearest of their parts over the bottom.
            for t in &soup {
                for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.3), (0.5, 0.5), (0.1, 0.8), (0.05, 0.05)] {
                    let q = t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
                    prop_assert!(q.z < bottom || q.distance(p) >= bound - 1e-5, "{q} {p} {bound}");
                }
            }
        }
    }
}

#[test]
fn a_scene_with_more_in_it_is_that_scene_with_its_floor() {
    let room = Mesh::default()
        .floor(Vec2::splat(-2.0), Vec2::splat(2.0), 0.0)
        .solid([-1.5, 1.0, 0.0], [1.5, 1.5, 0.45])
        .solid([1.9, -2.0, 0.0], [2.0, 2.0, 2.0]);
    let more = Mesh::default().solid([-0.3, -0.3, 0.0], [0.3, 0.3, 1.7]);
    let solids: Vec<[Vec3; 3]> =
        more.triangles.iter().map(|triangle| triangle.map(|i| more.positions[i as usize])).collect();
    let (alone, both) =
        (room.build().expect("a room"), room.clone().solid([-0.3, -0.3, 0.0], [0.3, 0.3, 1.7]));
    let (with, both) =
        (alone.with(&solids, &Progress::new()).expect("not cancelled"), both.build().expect("a room"));
    assert_eq!((with.triangle_count(), with.floor_height()), (both.triangle_count(), both.floor_height()));
    assert_eq!(with.bounds(), both.bounds());
    assert!(with.fingerprint() != alone.fingerprint());
    let (grid, other) = (with.occupancy(), both.occupancy());
    assert_eq!((grid.raster, grid.walkable_cells()), (other.raster, other.walkable_cells()));
    assert_eq!(grid.raster, alone.occupancy().raster);
    assert!(alone.occupancy().is_walkable(Vec2::ZERO) && !grid.is_walkable(Vec2::new(0.3, 0.0)));
    let ray = |scene: &SceneIndex| scene.ray(Vec3::new(-1.0, 0.0, 1.0), Vec3::X, 3.0);
    assert_eq!(ray(&with), ray(&both));
    assert!(ray(&with) < ray(&alone));
}

#[test]
fn a_surface_is_crossed_once_wherever_it_is_cut() {
    // A box whose upright edges pass exactly through the diagonal, a corner and the inner edges of a cut-up square.
    let mut mesh = Mesh::default();
    for x in 0..4 {
        for y in 0..4 {
            let (x, y) = (x as f32 - 2.0, y as f32 - 2.0);
            mesh = mesh.floor(Vec2::new(x, y), Vec2::new(x + 1.0, y + 1.0), 0.5);
        }
    }
    let node = BoxNode {
        limb: Limb::Leg,
        joint: Joint::Hips,
        center: Vec3::ZERO,
        half_extents: Vec3::new(0.5, 0.5, 1.0),
    };
    let scene = mesh.build().unwrap();
    for (x, y) in [(0.0, 0.0), (0.5, 0.5), (0.5, 0.0), (0.0, 0.25), (-0.5, 0.3)] {
        let count = scene.intersection_count(&node, Vec3::new(x, y, 0.0), Quat::IDENTITY);
        assert_eq!(count, 4, "at {x}, {y}");
    }
    // By hand: wholly over it nothing; tilted by 45 degrees about x the eight edges across y and z cross.
    assert_eq!(scene.intersection_count(&node, Vec3::new(0.1, 0.1, 2.0), Quat::IDENTITY), 0);
    let tilted = Quat::from_rotation_x(std::f32::consts::FRAC_PI_4);
    let thin = BoxNode { half_extents: Vec3::new(0.1, 0.05, 0.4), ..node };
    assert_eq!(scene.intersection_count(&thin, Vec3::new(0.13, 0.17, 0.5), tilted), 4);
}

#[test]
fn a_closed_box_is_crossed_twice_by_an_edge_through_it() {
    let scene = room().build().unwrap();
    // An arm through the partition (both of its faces), four long edges: 8.
    let node = BoxNode {
        limb: Limb::Arm,
        joint: Joint::LeftArm,
        center: Vec3::ZERO,
        half_extents: Vec3::new(0.15, 0.035, 0.035),
    };
    assert_eq!(scene.intersection_count(&node, Vec3::new(2.95, 1.0, 1.2), Quat::IDENTITY), 8);
    assert_eq!(scene.intersection_count(&node, Vec3::new(2.5, 1.0, 1.2), Quat::IDENTITY), 0);
}

#[test]
fn the_body_sums_its_nodes_and_leaves_out_the_floor() {
    let scene = room().build().unwrap();
    let mut posture = Posture::default();
    for (x, y, z) in
        [(1.0, 2.0, 0.993), (2.6, 1.0, 0.993), (1.0, 2.0, 0.95), (5.4, 2.0, 0.993), (3.0, 2.0, 0.993)]
    {
        posture.root_position = Vec3::new(x, y, z);
        let pose = posture.pose();
        let all = scene.body_intersections(&pose, f32::NEG_INFINITY);
        let high = scene.body_intersections(&pose, 0.05);
        for (i, node) in BODY_BOXES.iter().enumerate() {
            let joint = node.joint.index();
            let (p, r) = (pose.positions[joint], pose.rotations[joint]);
            assert_eq!(all[i], scene.intersection_count(node, p, r));
            let placed = OrientedBox::of_node(node, p, r);
            let count: u32 =
                room().corners().iter().map(|t| crossings(&placed, t, ALL_EDGES, 0.05).count_ones()).sum();
            assert_eq!(high[i], count);
        }
        assert_eq!(scene.limb_intersections(&pose, 0.05)[..], high[..8]);
        if x == 1.0 && z > 0.95 {
            assert_eq!(high.iter().sum::<u32>(), 0);
        }
        // Sunk by 4 cm, the feet's upright edges pass through the floor.
        if z == 0.95 {
            assert!(all[8] >= 4 && all[9] >= 4, "{all:?}");
        }
    }
}

#[test]
fn a_large_triangle_without_a_vertex_in_the_layer_occupies_its_cells() {
    // One triangle, corners at -1 and 5 m height, passes through the layer along x = 2.
    let mut mesh = Mesh::default().floor(Vec2::ZERO, Vec2::splat(4.0), 0.0);
    mesh.positions.extend([
        Vec3::new(2.02, 1.0, -1.0),
        Vec3::new(2.02, 3.0, -1.0),
        Vec3::new(2.02, 2.0, 5.0),
    ]);
    mesh.triangles.push([4, 5, 6]);
    let grid = mesh.build().unwrap().occupancy().clone();
    // At 0.15 m the triangle is 2 · (1 − 1.15 / 6) = 1.617 m wide: y from 1.192 to 2.808.
    let occupied = |y: f32| grid.is_occupied(Vec2::new(2.02, y));
    assert!(occupied(2.0) && occupied(1.22) && occupied(2.78) && !occupied(1.12) && !occupied(2.9));
    assert!(!grid.is_occupied(Vec2::new(1.9, 2.0)) && !grid.is_occupied(Vec2::new(2.1, 2.0)));
    // Clearance, by hand: from (1.0, 2.0) to the cell's border at x = 2.0; from outside, none.
    assert!((grid.clearance(Vec2::new(1.525, 2.0)) - 0.475).abs() < 0.03);
    assert_eq!(grid.clearance(Vec2::new(-0.5, 2.0)), 0.0);
    assert!(grid.is_occupied(Vec2::new(5.0, 2.0)));
    assert_eq!(
        grid.occupied_cells().iter().filter(|o| **o).count(),
        grid.walkable_cells().iter().filter(|w| !**w).count()
    );
}

#[test]
fn the_floor_is_found_under_rugs_tables_and_ceilings() {
    let base = |z: f32| room().positions.iter().map(|p| *p + Vec3::Z * z).collect::<Vec<_>>();
    for z in [0.0, 0.037, -3.2] {
        let mut mesh = Mesh { positions: base(z), triangles: room().triangles };
        mesh = mesh
            .floor(Vec2::new(3.2, 0.5), Vec2::new(5.0, 3.5), z + 0.015)
            .solid([0.5, 0.5, z + 0.70], [2.0, 2.0, z + 0.74])
            .floor(Vec2::ZERO, Vec2::new(6.0, 4.0), z + 2.5)
            .floor(Vec2::ZERO, Vec2::new(6.0, 4.0), z - 0.02);
        let scene = mesh.build().unwrap();
        assert!((scene.floor_height() - z).abs() < 0.016, "{} for {z}", scene.floor_height());
        let under = scene.floor_height_at(Vec2::new(5.7, 2.1), z + 0.6).unwrap();
        assert!((under - z - 0.45).abs() < 1e-5);
        assert!((scene.floor_height_at(Vec2::new(1.1, 1.3), z + 0.5).unwrap() - z).abs() < 1e-5);
    }
}

#[test]
fn bad_meshes_get_a_sentence() {
    let build = |positions: &[Vec3], triangles: &[[u32; 3]]| {
        SceneIndex::build(positions, triangles, &SceneSettings::default(), &Progress::new())
            .unwrap_err()
            .to_string()
    };
    let good = [Vec3::ZERO, Vec3::X, Vec3::Y];
    assert!(build(&[], &[]).contains("no mesh faces"));
    assert!(build(&good, &[[0, 1, 2], [0, 1, 7]]).starts_with("Triangle 1 of the scene names vertex 7"));
    assert!(build(&[Vec3::ZERO, Vec3::X, Vec3::splat(f32::NAN)], &[[0, 1, 2]]).starts_with("Triangle 0"));
    assert!(build(&[Vec3::ZERO, Vec3::X, Vec3::X * f32::INFINITY], &[[0, 1, 2]]).contains("not a number"));
    assert!(build(&[Vec3::ZERO, Vec3::X, Vec3::X * 3.0], &[[0, 1, 2], [1, 1, 1]]).contains("zero area"));
    assert!(build(&[Vec3::ZERO, Vec3::X, Vec3::Y * 1e6], &[[0, 1, 2]]).contains("from the origin"));
    // Of several bad triangles the first is told, on any number of threads.
    let mut many = vec![[0u32, 1, 2]; 200_000];
    (many[70_000][1], many[150_000][2]) = (9, 8);
    assert!(build(&good, &many).starts_with("Triangle 70000 of the scene names vertex 9"));
    let cancelled = Progress::new();
    cancelled.cancel();
    let mesh = room();
    let result = SceneIndex::build(&mesh.positions, &mesh.triangles, &SceneSettings::default(), &cancelled);
    assert!(matches!(result, Err(Error::Cancelled)));
    let settings = SceneSettings { cell_size: 0.0, ..SceneSettings::default() };
    let result = SceneIndex::build(&mesh.positions, &mesh.triangles, &settings, &Progress::new());
    assert!(matches!(result, Err(Error::Input(_))));
}

#[test]
fn odd_but_usable_meshes_are_indexed() {
    // One triangle; a zero-area one beside it is dropped; an unused vertex may be anything.
    let scene = SceneIndex::build(
        &[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(f32::NAN)],
        &[[0, 1, 2], [0, 0, 1]],
        &SceneSettings::default(),
        &Progress::new(),
    )
    .unwrap();
    assert_eq!(scene.triangle_count(), 1);
    // A single upright sheet: no area on the floor at all.
    let sheet = Mesh::default().quad(Vec3::ZERO, Vec3::Y, Vec3::new(0.0, 1.0, 1.0), Vec3::Z).build().unwrap();
    assert!(!sheet.occupancy().is_walkable(Vec2::new(0.0, 0.5)));
    // A ground of 2 km with a tiny box on it: the grids grow coarser, the counts stay exact.
    let ground = Mesh::default()
        .floor(Vec2::splat(-1000.0), Vec2::splat(1000.0), 0.0)
        .solid([0.0, 0.0, 0.3], [0.01, 0.01, 0.31])
        .build()
        .unwrap();
    assert!(ground.memory() < 100_000_000);
    let node = BoxNode {
        limb: Limb::Leg,
        joint: Joint::Hips,
        center: Vec3::ZERO,
        half_extents: Vec3::new(0.05, 0.005, 0.005),
    };
    // One of the long edges passes through the tiny box, at y = 0.005 and z = 0.305.
    assert_eq!(ground.intersection_count(&node, Vec3::new(0.0, 0.0, 0.3), Quat::IDENTITY), 2);
    let upright = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    assert_eq!(ground.intersection_count(&node, Vec3::new(100.3, 50.2, 0.0), upright), 4);
}

#[test]
fn one_thread_and_two_give_the_same_index() {
    let mesh = room();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mesh.build().unwrap())
    };
    let (a, b) = (on(1), on(2));
    assert_eq!(a.floor_height().to_bits(), b.floor_height().to_bits());
    assert_eq!(a.occupancy().clearance_cells(), b.occupancy().clearance_cells());
    let cue = sit(5.75, 2.0, 0.55, 180.0);
    let from = Vec2::new(1.0, 1.0);
    assert_eq!(ClearPath::to_cue(&a, &cue).path(from), ClearPath::to_cue(&b, &cue).path(from));
    for i in 0..50 {
        let p = Vec3::new(0.1 * i as f32, 0.07 * i as f32, 0.02 * i as f32);
        assert_eq!(a.clearance_lower_bound(p).to_bits(), b.clearance_lower_bound(p).to_bits());
    }
}

#[test]
fn the_way_leads_through_the_middle_of_the_door_to_the_front_of_the_seat() {
    let scene = room().build().unwrap();
    let ways = ClearPath::to_cue(&scene, &sit(5.75, 2.0, 0.55, 180.0));
    for start in [Vec2::new(1.0, 0.6), Vec2::new(0.5, 3.5), Vec2::new(1.5, 2.0)] {
        let path = ways.path(start);
        let length: f32 = path.windows(2).map(|w| w[0].distance(w[1])).sum();
        // Straight to the door's middle and straight on, at most a tenth longer.
        let door = Vec2::new(2.95, 2.0);
        let end = *path.last().unwrap();
        let straight = start.distance(door) + door.distance(end);
        assert!(length > 0.97 * straight - 0.05 && length < 1.1 * straight, "{length} {straight}");
        assert!((ways.distance(start) - length - end.distance(ways.goal())).abs() < 0.05 * length + 0.05);
        let across =
            path.iter().filter(|p| (p.x - 2.95).abs() < 0.05).map(|p| (p.y - 2.0).abs()).fold(0.0, f32::max);
        assert!(across < 0.15, "{across} m off the middle of the door");
        let approach = ways.approach_from(start).unwrap();
        assert!(approach.position.distance(end) < 1e-6 && (0.44..0.76).contains(&end.distance(ways.goal())));
        assert!(approach.angle.abs() < 60f32.to_radians());
        // The effort falls along the path, and a point ahead lies on it.
        let efforts: Vec<f32> = path.iter().map(|&p| ways.effort(p)).collect();
        assert!(efforts.windows(2).all(|w| w[1] <= w[0] + 1e-3));
        let ahead = ways.point_ahead(start, 1.0);
        assert!(path.iter().any(|p| p.distance(ahead) < 0.06) && ahead.distance(start) <= 1.0 + 1e-4);
        assert!((ways.distance(start) - ways.distance(ahead) - 1.0).abs() < 0.1);
        let several = ways.points_ahead(start, [1.0, 0.5, 0.0, 100.0]);
        assert_eq!(several[0], ahead);
        assert!(several[2] == start && several[3] == end && (several[1].distance(start) - 0.5).abs() < 0.05);
        assert!(ways.point_ahead(start, 100.0).distance(end) < 1e-5);
    }
    // On the seat the rest is straight, and outside the scene there is no way.
    assert!((ways.distance(Vec2::new(5.6, 2.0)) - 0.15).abs() < 0.05);
    assert!(ways.distance(Vec2::new(-2.0, 0.0)).is_infinite() && ways.path(Vec2::new(-2.0, 0.0)).is_empty());
    // A start close to a wall gets out.
    assert!(ways.distance(Vec2::new(0.03, 2.0)).is_finite() && ways.path(Vec2::new(0.03, 2.0)).len() > 50);
}

#[test]
fn a_seat_close_to_a_table_is_entered_from_its_side_with_the_back_to_it() {
    // A chair without a back, its front edge so far from a table that stands on two legs.
    let at = |gap: f32| {
        Mesh::default()
            .floor(Vec2::ZERO, Vec2::new(6.0, 6.0), 0.0)
            .solid([2.8, 2.8, 0.42], [3.2, 3.2, 0.46])
            .solid([3.2 + gap, 2.4, 0.68], [3.9 + gap, 3.6, 0.74])
            .build()
            .unwrap()
    };
    let cue = sit(3.0, 3.0, 0.56, 0.0);
    let free = at(1.2);
    let ways = ClearPath::to_cue(&free, &cue);
    assert!(!ways.from_the_side());
    let front = ways.arrival_at(ways.point_ahead(Vec2::new(3.5, 4.5), 100.0)).unwrap();
    assert!(wrap_angle(front.yaw - cue.yaw).abs() < 1e-6);

    let tight = at(0.15);
    let ways = ClearPath::to_cue(&tight, &cue);
    assert!(ways.from_the_side());
    for start in [Vec2::new(2.5, 5.5), Vec2::new(2.5, 0.5)] {
        let arrival = ways.arrival_at(ways.point_ahead(start, 100.0)).unwrap();
        let out = arrival.position - ways.goal();
        assert!((out.y > 0.0) == (start.y > 3.0), "{out}");
        // The seat is behind: one faces away from it, by 50 to 100 degrees from where the cue faces.
        let facing = Vec2::from_angle(arrival.heading());
        assert!(facing.dot(out.normalize()) > 0.999, "{facing} {out}");
        assert!((45f32..101.0).contains(&wrap_angle(arrival.yaw - cue.yaw).abs().to_degrees()));
    }
}

/// The same chair and table; on one side a leg of the table stands where a person's legs come round.
#[test]
fn a_tight_seat_is_entered_from_the_side_where_the_legs_come_round() {
    let beside = |side: f32| {
        let leg = 3.0 + side * 0.30;
        Mesh::default()
            .floor(Vec2::ZERO, Vec2::new(6.0, 6.0), 0.0)
            .solid([2.8, 2.8, 0.42], [3.2, 3.2, 0.46])
            .solid([3.35, 2.4, 0.68], [4.05, 3.6, 0.74])
            .solid([3.37, leg - 0.02, 0.0], [3.41, leg + 0.02, 0.68])
            .build()
            .unwrap()
    };
    let cue = sit(3.0, 3.0, 0.56, 0.0);
    for side in [-1.0, 1.0] {
        let scene = beside(side);
        let ways = ClearPath::to_cue(&scene, &cue);
        assert!(ways.from_the_side());
        // Even who stands on that side goes round to the other.
        for start in [Vec2::new(2.5, 4.6), Vec2::new(2.5, 1.4)] {
            let arrival = ways.arrival_at(ways.point_ahead(start, 100.0)).unwrap();
            assert!((arrival.position.y - 3.0) * side < 0.0, "{} {start}", arrival.position);
        }
    }
}

/// A backrest that comes forward on one side of the seat is not sat down over from there.
#[test]
fn a_person_has_a_width() {
    let scene = Mesh::default()
        .floor(Vec2::ZERO, Vec2::new(6.0, 6.0), 0.0)
        .solid([2.8, 2.8, 0.42], [3.2, 3.2, 0.46])
        .solid([2.8, 3.2, 0.46], [2.95, 3.25, 0.80])
        .build()
        .unwrap();
    let ways = ClearPath::to_cue(&scene, &sit(3.0, 3.0, 0.56, 0.0));
    let cost = |degrees: f32| {
        let at = |a: &&ApproachPoint| (a.angle.to_degrees() - degrees).abs() < 1.0;
        ways.approach_points().iter().find(at).expect("an approach").cost
    };
    // The line through the middle is free on both sides; a person's right shoulder is not on the left one.
    assert!(cost(90.0) > cost(-90.0) + 0.3, "{} {}", cost(90.0), cost(-90.0));
    assert!((cost(40.0) - cost(-40.0)).abs() < 0.1);
}

#[test]
fn knees_that_do_not_fit_are_measured() {
    let bar = |gap: f32| {
        Mesh::default()
            .floor(Vec2::ZERO, Vec2::new(6.0, 6.0), 0.0)
            .solid([2.8, 2.8, 0.62], [3.2, 3.2, 0.66])
            .solid([3.0 + gap, 2.0, 0.1], [3.5 + gap, 4.0, 1.0])
            .build()
            .unwrap()
    };
    for (seat, gap, needed) in [(0.66, 0.36, 0.40), (0.45, 0.43, 0.48)] {
        let cue = sit(3.0, 3.0, seat + SEATED_HIPS_HEIGHT, 0.0);
        let (near, needs) = short_of_knee_room(&bar(gap), &cue).unwrap();
        assert!((near - gap).abs() < 1e-4 && needs == needed, "{near} {needs}");
        assert_eq!(short_of_knee_room(&bar(needed + 0.02), &cue), None);
    }
    assert_eq!(short_of_knee_room(&bar(0.36), &stop(3.0, 3.0)), None);
}

#[test]
fn a_gap_of_55_cm_is_passable_and_one_of_15_cm_is_not() {
    let with_gap = |gap: f32| {
        Mesh::default()
            .floor(Vec2::ZERO, Vec2::new(6.0, 4.0), 0.0)
            .solid([2.9, -0.1, 0.0], [3.0, 2.0 - 0.5 * gap, 2.5])
            .solid([2.9, 2.0 + 0.5 * gap, 0.0], [3.0, 4.1, 2.5])
            .build()
            .unwrap()
    };
    let (wide, tight) = (with_gap(0.55), with_gap(0.15));
    let task = task(Vec3::new(1.0, 2.0, 0.0), stop(5.0, 2.0));
    assert!(check_task(&wide, &task).is_ok());
    let distance = ClearPath::to_cue(&wide, &task.cue).distance(Vec2::new(1.0, 2.0));
    assert!((distance - 4.0).abs() < 0.2, "{distance}");
    let error = check_task(&tight, &task).unwrap_err();
    assert!(matches!(error, Error::Unreachable(_)));
    // The free floor ends 12 cm before the wall at x = 2.9, and a little later before the gap: 2.1 to 2.3 m from the cue.
    assert!(error.to_string().contains("ends 2.1") || error.to_string().contains("ends 2.2"), "{error}");
}

#[test]
fn tasks_that_cannot_be_done_are_named() {
    let scene = room().build().unwrap();
    let here = Vec3::new(1.0, 1.0, 0.0);
    let bench = || sit(5.75, 2.0, 0.55, 180.0);
    check_task(&scene, &task(here, bench())).unwrap();
    check_task(&scene, &task(here, stop(4.0, 1.0))).unwrap();
    let says = |task: Task| check_task(&scene, &task).unwrap_err().to_string();
    let cases = [
        (says(task(Vec3::new(9.0, 1.0, 0.0), bench())), "Start ‘Here’ lies outside the scene, 2.90 m"),
        (says(task(Vec3::new(5.7, 2.0, 0.0), bench())), "Start ‘Here’ stands inside furniture"),
        (says(task(Vec3::new(1.0, 1.0, 1.2), bench())), "Start ‘Here’ stands 1.20 m over"),
        (says(task(Vec3::new(1.0, 1.0, -1.0), bench())), "Start ‘Here’ has no floor under it"),
        (
            says(task(here, sit(5.75, 2.0, 1.07, 180.0))),
            "floats: the nearest surface is 0.62 m below the pelvis",
        ),
        (says(task(here, sit(4.0, 2.0, 0.1, 180.0))), "too low: its seat is 0.00 m"),
        (says(task(here, sit(5.75, 2.0, -0.5, 180.0))), "0.50 m below the floor"),
        (says(task(here, sit(2.95, 1.0, 0.55, 180.0))), "inside a wall"),
        (says(task(here, sit(5.75, 2.0, 0.20, 180.0))), "inside furniture, 0.25 m under its surface"),
        (says(task(here, sit(5.75, 2.0, 0.55, 0.0))), "no room for the legs: something is 0.25 m"),
        (says(task(here, sit(9.0, 2.0, 0.55, 0.0))), "Sit cue ‘Bench’ lies outside the scene"),
        (says(task(here, stop(5.8, 2.0))), "Stop cue ‘There’ stands inside furniture"),
        (says(task(here, stop(0.08, 2.0))), "Stop cue ‘There’ has only"),
        (says(task(Vec3::new(f32::NAN, 0.0, 0.0), bench())), "not a number"),
    ];
    for (sentence, part) in cases {
        assert!(sentence.contains(part), "“{sentence}” does not say “{part}”");
    }
    let under_table = room()
        .solid([3.5, 1.5, 0.70], [4.5, 2.5, 0.74])
        .solid([3.9, 1.9, 0.0], [4.1, 2.1, 0.3])
        .build()
        .unwrap();
    let low = check_task(&under_table, &task(here, sit(4.0, 2.0, 0.33, 180.0))).unwrap_err().to_string();
    assert!(low.contains("no room above it: something is 0.37 m"), "{low}");
    let mut far = bench();
    far.feet[1] = Some(Vec3::new(2.0, 2.0, 0.0));
    assert!(says(task(here, far)).contains("right foot of cue ‘Bench’ is 3.79 m"));
    // The door shut: both rooms are whole, and no way leads between them.
    let shut = room().solid([2.9, 1.6, 0.0], [3.0, 2.4, 2.0]).build().unwrap();
    let error = check_task(&shut, &task(here, bench())).unwrap_err();
    assert!(
        matches!(error, Error::Unreachable(_)) && error.to_string().contains("from start ‘Here’"),
        "{error}"
    );
}

/// Whatever else is level in a scene, and larger: each with the room of [`room`] on its floor.
fn larger_surfaces() -> Vec<(&'static str, Mesh)> {
    let wide = |z: f32, half: f32| room().floor(Vec2::splat(-half), Vec2::splat(half), z);
    let mut sky = room();
    for i in 0..64 {
        // A ball of 25 m, in strips from pole to pole.
        let at = |i: i32, j: i32| {
            let (turn, rise) = (i as f32 * TAU / 64.0, j as f32 * PI / 32.0);
            Vec3::new(3.0, 2.0, 0.0)
                + 25.0 * Vec3::new(rise.sin() * turn.cos(), rise.sin() * turn.sin(), rise.cos())
        };
        for j in 0..32 {
            sky = sky.quad(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
        }
    }
    vec![
        ("garden", wide(-0.3, 12.0)),
        ("low garden", wide(-0.15, 12.0)),
        ("ground", wide(-0.1, 50.0)),
        ("land", wide(-0.1, 400.0)),
        ("storey below", wide(-3.0, 10.0)),
        ("roof", wide(3.0, 12.0)),
        ("sky", sky),
        ("ground box", room().solid([-9.0, -9.0, -2.0], [9.0, 9.0, -0.07])),
    ]
}

#[test]
fn the_floor_is_under_the_start_whatever_else_is_level() {
    let task = task(Vec3::new(1.0, 1.0, 0.0), sit(5.75, 2.0, 0.55, 180.0));
    let alone = room().build_for(&task);
    assert_eq!(alone.floor_height(), room().build().unwrap().floor_height());
    assert_eq!(alone.fingerprint(), room().build().unwrap().fingerprint());
    let way = ClearPath::to_cue(&alone, &task.cue).distance(task.start.planar().position);
    for (name, mesh) in larger_surfaces() {
        let scene = mesh.build_for(&task);
        assert_eq!(scene.floor_height(), 0.0, "{name}");
        assert_eq!(mesh.said(&task), "", "{name}");
        // Cells lie elsewhere, yet they are as fine: through the same door, by the same way.
        assert_eq!(scene.occupancy().raster.cell, 0.05, "{name}");
        let there = ClearPath::to_cue(&scene, &task.cue).distance(task.start.planar().position);
        assert!((there - way).abs() < 0.15, "{name}: {there} m, not {way} m");
        // What was learnt on another level is not taken for this one's.
        let other = mesh.build().unwrap();
        assert_eq!(other.floor_height() == 0.0, other.fingerprint() == scene.fingerprint(), "{name}");
        assert!(!scene.occupancy().is_walkable(Vec2::new(5.75, 2.0)), "{name}");
    }
}

#[test]
fn a_rug_is_floor_and_a_podium_a_level_of_its_own() {
    let rug = room().solid([0.5, 0.5, 0.0], [1.5, 1.5, 0.03]);
    let bench = || sit(5.75, 2.0, 0.55, 180.0);
    let on_rug = task(Vec3::new(1.0, 1.0, 0.03), bench());
    assert_eq!((rug.build_for(&on_rug).floor_height(), rug.said(&on_rug).as_str()), (0.0, ""));
    let podium = room().solid([0.0, 0.0, 0.0], [2.0, 4.0, 0.18]);
    let high = Vec3::new(1.0, 2.0, 0.18);
    // From the podium to the bench below; from the floor onto the podium; and all on the podium.
    let down = podium.said(&task(high, bench()));
    assert!(down.contains("Sit cue ‘Bench’ stands on another level than start ‘Here’"), "{down}");
    assert!(down.contains("at z = 0.00 m, that of the start at z = 0.18 m"), "{down}");
    let mut top = stop(1.0, 1.0);
    top.position.z = 0.18;
    let up = podium.said(&task(Vec3::new(2.5, 1.0, 0.0), top.clone()));
    assert!(up.contains("Stop cue ‘There’ stands on another level"), "{up}");
    assert_eq!(podium.said(&task(high, top)), "");
    assert!((podium.build_for(&task(high, bench())).floor_height() - 0.18).abs() < 1e-5);
}

#[test]
fn a_start_on_furniture_is_told_to_come_down() {
    let table = room().solid([0.85, 0.85, 0.0], [1.15, 1.15, 0.7]);
    let said = table.said(&task(Vec3::new(1.0, 1.0, 0.7), sit(5.75, 2.0, 0.55, 180.0)));
    assert!(said.contains("stands on something 0.70 m over the floor (z = 0.00 m)"), "{said}");
    // Where there is room to walk on it, the cue is on another level.
    let stage = room().solid([0.2, 0.2, 0.0], [2.2, 2.2, 0.7]);
    let said = stage.said(&task(Vec3::new(1.0, 1.0, 0.7), sit(5.75, 2.0, 0.55, 180.0)));
    assert!(said.contains("on another level than start ‘Here’"), "{said}");
}

#[test]
fn storeys_are_floors_of_their_own() {
    // Two rooms over each other, the lower one larger.
    let below =
        room().floor(Vec2::splat(-3.0), Vec2::splat(9.0), -3.0).solid([5.55, 1.0, -3.0], [6.0, 3.0, -2.55]);
    let place = |z: f32| Vec3::new(1.0, 1.0, z);
    let bench = |z: f32| sit(5.75, 2.0, z + 0.55, 180.0);
    for z in [0.0, -3.0] {
        assert_eq!(below.said(&task(place(z), bench(z))), "", "{z}");
        let elsewhere = below.said(&task(place(z), bench(-3.0 - z)));
        assert!(elsewhere.contains("stands on another level than start ‘Here’"), "{elsewhere}");
        let mut far = stop(1.0, 2.0);
        far.position.z = -3.0 - z;
        let elsewhere = below.said(&task(place(z), far));
        assert!(elsewhere.contains("Stop cue ‘There’ stands on another level"), "{elsewhere}");
    }
    // A start that floats is lowered onto what is under it, not sent to another storey.
    let floats = below.said(&task(place(0.6), bench(0.0)));
    assert!(floats.contains("stands 0.60 m over the nearest surface"), "{floats}");
    // And a cue that is a little too deep is raised, not sent to the floor below.
    let deep = below.said(&task(place(0.0), sit(4.0, 2.0, -0.2, 180.0)));
    assert!(deep.contains("0.20 m below the floor"), "{deep}");
}

#[test]
fn a_step_that_feet_would_stand_in_is_another_level() {
    let here = task(Vec3::new(1.0, 1.0, 0.0), stop(2.0, 3.0));
    for (step, taken) in [(0.015, true), (0.04, true), (0.07, false), (0.10, false), (0.18, false)] {
        let mut up = here.clone();
        up.cue.position.z += step;
        let said = room().solid([1.2, 2.2, 0.0], [2.8, 3.8, step]).said(&up);
        let refused = format!("the floor there is at z = {step:.2} m, that of the start at z = 0.00 m");
        assert_eq!(said.contains(&refused), !taken, "{step}: {said}");
        assert_eq!(said.is_empty(), taken, "{step}: {said}");
    }
}

#[test]
fn a_cue_in_the_middle_of_a_mattress_is_told_where_its_edge_is() {
    let here = Vec3::new(1.0, 1.0, 0.0);
    // 2 m deep and as wide as the bench's wall is long.
    let bed = room().solid([3.8, 0.0, 0.0], [6.0, 4.0, 0.45]);
    let said = bed.said(&task(here, sit(5.0, 2.0, 0.55, 180.0)));
    assert!(said.contains("no free floor to stand on within 0.75 m"), "{said}");
    assert!(said.contains("1.01 m away: move it to x = 3.99 m, y = 2.00 m."), "{said}");
    // It can be sat on there.
    assert_eq!(bed.said(&task(here, sit(3.99, 2.0, 0.55, 180.0))), "");
    // Facing the wall it is turned as well.
    let turned = bed.said(&task(here, sit(5.0, 2.0, 0.55, 90.0)));
    assert!(turned.contains("x = 4.01 m") && turned.contains("turned 80° to the left."), "{turned}");
    // Where no edge has floor before it, none is named.
    let full = room().solid([0.0, 0.0, 0.0], [6.0, 4.0, 0.45]);
    let said = check_task(&full.build().unwrap(), &task(here, sit(3.5, 2.0, 0.55, 180.0)));
    assert!(!said.unwrap_err().to_string().contains("edge"));
}

/// Bumpy ground of 2 × 90,000 small triangles, and four giant ones through it: several chunks, and cut triangles.
fn large_mesh() -> Mesh {
    let mut mesh = Mesh::default();
    let n = 300;
    for y in 0..=n {
        for x in 0..=n {
            let (x, y) = (x as f32 * 0.02, y as f32 * 0.02);
            mesh.positions.push(Vec3::new(
                x,
                y,
                0.3 * (3.1 * x).sin() * (2.3 * y).cos() + 0.02 * (40.0 * x * y).sin(),
            ));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            mesh.triangles.extend([[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]);
        }
    }
    mesh.floor(Vec2::splat(-20.0), Vec2::splat(30.0), 0.01).quad(
        Vec3::new(2.9, -9.0, -5.0),
        Vec3::new(3.2, 9.0, -5.0),
        Vec3::new(3.2, 9.0, 5.0),
        Vec3::new(2.9, -9.0, 5.0),
    )
}

#[test]
fn chunks_and_cut_triangles_lose_and_double_nothing() {
    let mesh = large_mesh();
    let corners = mesh.corners();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mesh.build().unwrap())
    };
    let (one, two) = (on(1), on(2));
    let mut scratch = Scratch::default();
    let (mut total, mut ruled_out) = (0, 0);
    for i in 0..60 {
        let k = i as f32;
        let node = BODY_BOXES[i % BODY_BOXES.len()];
        let place =
            Vec3::new(3.0 + 2.9 * (0.7 * k).sin(), 3.0 + 2.9 * (1.3 * k).cos(), 0.6 * (0.9 * k).sin());
        let turn = Quat::from_scaled_axis(Vec3::new(k.sin(), (2.0 * k).cos(), (3.0 * k).sin()) * 2.0);
        let placed = OrientedBox::of_node(&node, place, turn);
        let expected: u32 =
            corners.iter().map(|t| crossings(&placed, t, ALL_EDGES, f32::NEG_INFINITY).count_ones()).sum();
        assert_eq!(one.intersection_count(&node, place, turn), expected);
        assert_eq!(two.intersection_count(&node, place, turn), expected);
        assert_eq!(two.tree.count_at(Level::Portable, &placed, f32::NEG_INFINITY, &mut scratch), expected);
        ruled_out += u32::from(one.is_clear(&placed, one.field.steps_at(placed.center), f32::NEG_INFINITY));
        total += expected;
    }
    // The comparison is worth something: many crossings, and some boxes that the field alone decides.
    assert!(total > 100 && ruled_out > 3, "{total} crossings, {ruled_out} boxes ruled out");
}

//! Scene index: seconds to build, µs a frame of collisions (8 limbs, 12 edges each), beside the plain reference in
//! the same run: every edge as a ray through obvhs's own tree.
//!
//! `cargo bench -p oncue --bench scene`. On the quest_living_room scan where the reference data is present (cut
//! finer until it has the asked number of triangles), and on a room made here.
//!
//! With `ONCUE_PEERS` naming a Python that has it, the same edges go through Embree (`tools/peers/embree_crossings.py`);
//! `nox -s bench` sets the variable.

#[path = "../tests/common/mod.rs"]
mod common;
mod mesh;
#[allow(dead_code)] // each bench uses what it needs of it
mod peer;

use std::hint::black_box;
use std::time::{Duration, Instant};

use glam::{Mat3, Quat, Vec2, Vec3, Vec3A};
use mesh::{Mesh, finer, made_room, peak_memory};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use oncue::internals::LIMB_BOX_COUNT;
use oncue::motion::{BODY_BOXES, Joint, Pose, Posture};
use oncue::scene::{ClearPath, SceneIndex, SceneSettings};
use oncue::{ActionCue, ActionType, Progress};
use peer::Work;
use serde_json::json;

/// Embree is asked again so far behind a hit, metres: nearer, rounding has it hit the same wall again and again. It sees
/// one of two surfaces that coincide.
const BEHIND: f32 = 1e-4;

fn main() {
    println!("{} threads", rayon::current_num_threads());
    let mut rooms = vec![("made room", made_room())];
    if let Some(folder) = common::shared("data/rooms") {
        let scan = common::glb::read(&folder.join("quest_living_room.glb"));
        rooms.push(("living room scan", Mesh { positions: scan.positions, triangles: scan.triangles }));
    }
    let large = std::env::args().any(|a| a == "--large");
    for (name, mesh) in rooms {
        let sizes: &[usize] = if large { &[5_000_000] } else { &[100_000, 1_000_000] };
        for &size in sizes {
            measure(name, finer(&mesh, size));
        }
    }
}

fn measure(name: &str, mesh: Mesh) {
    println!("\n{name}, {} triangles", mesh.triangles.len());
    let settings = SceneSettings::default();
    let mut scene = None;
    let cpu = cpu_seconds();
    let build = best(3, || {
        let progress = Progress::new();
        scene = SceneIndex::build(&mesh.positions, &mesh.triangles, &settings, &progress).ok();
    });
    let cpu = (cpu_seconds() - cpu) / 3.0;
    let Some(scene) = scene else { return println!("  could not be indexed") };
    println!(
        "  build {:.3} s ({cpu:.2} s of processor time over all threads), {:.0} MB kept, {}",
        build.as_secs_f64(),
        scene.memory() as f64 / 1e6,
        peak_memory()
    );

    let triangles: Vec<Triangle> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|i| Vec3A::from(mesh.positions[i as usize])))
        .map(|[v0, v1, v2]| Triangle { v0, v1, v2 })
        .collect();
    let mut tree = Bvh2::default();
    let reference_build = best(1, || {
        tree = build_bvh2_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
    });
    println!("  obvhs alone, medium preset: build {:.3} s", reference_build.as_secs_f64());

    let above = scene.floor_height() + settings.carpet_height;
    let title = format!("{name}, {} triangles", mesh.triangles.len());
    let work = Work::new(&format!("scene-{name}-{}", mesh.triangles.len()).replace(' ', "-"));
    let mut kinds = serde_json::Map::new();
    for (kind, frames) in frames(&scene) {
        let mut count = 0;
        let ours = best(7, || {
            count = frames.iter().map(|f| scene.limb_intersections(f, above).iter().sum::<u32>()).sum();
        });
        let whole = best(7, || {
            for frame in &frames {
                black_box(scene.body_intersections(frame, above));
            }
        });
        let mut reference_count = 0;
        let reference = best(2, || {
            reference_count = frames.iter().map(|f| edge_by_edge(&tree, &triangles, f, above)).sum();
        });
        let per_frame = |d: Duration| d.as_secs_f64() * 1e6 / frames.len() as f64;
        println!(
            "  {kind:8} {:6} frames: {:7.2} µs (whole body {:7.2}), obvhs edge by edge {:7.2}; {:.2} crossings a frame, reference {:.2}",
            frames.len(),
            per_frame(ours),
            per_frame(whole),
            per_frame(reference),
            f64::from(count) / frames.len() as f64,
            f64::from(reference_count) / frames.len() as f64,
        );
        if let Some(work) = &work {
            let edges = frames.iter().flat_map(limb_edges).filter_map(|edge| edge.over(above));
            let numbers = edges.flat_map(|e| {
                [e.origin.to_array(), e.direction.to_array()].concat().into_iter().chain([e.length])
            });
            work.floats(&format!("{kind}-edges"), &numbers.collect::<Vec<_>>());
            let apart: u32 = frames.iter().map(|f| apart(&tree, &triangles, f, above)).sum();
            let ours = json!({ "frames": frames.len(), "microseconds": per_frame(ours), "crossings": count, "apart": apart });
            kinds.insert(kind.to_owned(), ours);
        }
        if kind == "walking" {
            paths(&scene, &frames);
        }
    }
    if let Some(work) = work {
        work.floats("positions", &mesh.positions.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>());
        work.counts("triangles", mesh.triangles.iter().flatten().copied());
        let facts =
            json!({ "title": title, "behind": BEHIND, "build_seconds": build.as_secs_f64(), "kinds": kinds });
        work.run("embree_crossings.py", &facts);
    }
}

/// Clear paths: building one, and asking it.
fn paths(scene: &SceneIndex, frames: &[Pose]) {
    let grid = scene.occupancy();
    let clearance = grid.clearance_cells();
    let goal = (0..clearance.len()).max_by(|&a, &b| clearance[a].total_cmp(&clearance[b])).unwrap_or(0);
    let mut ways = None;
    let build = best(5, || {
        ways = Some(ClearPath::to_cue(scene, &stop_at(grid.raster.center(goal), scene.floor_height())))
    });
    let Some(ways) = ways else { return };
    let places: Vec<Vec2> = frames.iter().map(|f| f.position(Joint::Hips).truncate()).collect();
    let distance = best(5, || places.iter().for_each(|&p| _ = black_box(ways.distance(p))));
    let ahead = best(3, || places.iter().for_each(|&p| _ = black_box(ways.point_ahead(p, 1.5))));
    let each = |d: Duration| d.as_secs_f64() * 1e6 / places.len() as f64;
    println!(
        "  clear paths over {} cells: {:.1} ms to build, distance {:.3} µs, point 1.5 m ahead {:.1} µs",
        grid.raster.len(),
        build.as_secs_f64() * 1e3,
        each(distance),
        each(ahead),
    );
}

fn stop_at(place: Vec2, floor: f32) -> ActionCue {
    ActionCue {
        name: String::new(),
        action_type: ActionType::Stop,
        position: place.extend(floor),
        yaw: 0.0,
        feet: [None; 2],
    }
}

fn best(times: usize, mut work: impl FnMut()) -> Duration {
    (0..times)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed()
        })
        .min()
        .unwrap_or_default()
}

/// Processor seconds of this process so far, from Linux: what a busy machine does not change. 0 elsewhere.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    // utime and stime, the 14th and 15th fields, in hundredths of a second.
    after_name.split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// A posture in mid-stride, arms hanging and swinging.
fn stride(place: Vec2, floor: f32, yaw: f32, phase: f32) -> Pose {
    let mut posture = Posture { root_position: place.extend(floor + 0.97), ..Posture::default() };
    posture.rotations[0] = Quat::from_rotation_z(yaw);
    let swing = 0.45 * phase.sin();
    let mut turn = |joint: Joint, q: Quat| posture.rotations[joint.index()] = q;
    turn(Joint::LeftUpLeg, Quat::from_rotation_x(swing));
    turn(Joint::RightUpLeg, Quat::from_rotation_x(-swing));
    turn(Joint::LeftLeg, Quat::from_rotation_x(0.3 + 0.3 * phase.cos()));
    turn(Joint::RightLeg, Quat::from_rotation_x(0.3 - 0.3 * phase.cos()));
    turn(Joint::LeftArm, Quat::from_rotation_x(-swing) * Quat::from_rotation_y(1.4));
    turn(Joint::RightArm, Quat::from_rotation_x(swing) * Quat::from_rotation_y(-1.4));
    posture.pose()
}

/// Frames with every limb at furniture (near), in the freest places (far), and along a walk between far places.
fn frames(scene: &SceneIndex) -> Vec<(&'static str, Vec<Pose>)> {
    let grid = scene.occupancy();
    let floor = scene.floor_height();
    let clearance = grid.clearance_cells();
    let cells =
        |wanted: &dyn Fn(usize) -> bool| (0..clearance.len()).filter(|&i| wanted(i)).collect::<Vec<_>>();
    let pick = |from: &[usize]| -> Vec<Pose> {
        (0..2000)
            .filter_map(|k| from.get((k * 7919) % from.len().max(1)).map(|&i| (k, grid.raster.center(i))))
            .map(|(k, place)| stride(place, floor, k as f32, 0.7 * k as f32))
            .collect()
    };
    let near = pick(&cells(&|i| grid.walkable_cells()[i] && clearance[i] < 0.12));
    let most = clearance.iter().fold(0.0f32, |a, &b| a.max(b));
    let far = pick(&cells(&|i| clearance[i] > 0.75 * most));
    // From every hundredth walkable cell to the freest place.
    let goal = (0..clearance.len()).max_by(|&a, &b| clearance[a].total_cmp(&clearance[b])).unwrap_or(0);
    let cue = stop_at(grid.raster.center(goal), floor);
    let ways = ClearPath::to_cue(scene, &cue);
    let mut walking = Vec::new();
    for start in cells(&|i| clearance[i] > 0.25).into_iter().step_by(100) {
        let path = ways.path(grid.raster.center(start));
        for (k, pair) in path.windows(2).enumerate() {
            let yaw = (pair[1] - pair[0]).to_angle() + std::f32::consts::FRAC_PI_2;
            walking.push(stride(pair[0], floor, yaw, 0.2 * k as f32));
        }
    }
    vec![("near", near), ("far", far), ("walking", walking)]
}

/// An edge of a placed box: `direction` is a unit vector, metres.
struct Edge {
    origin: Vec3,
    direction: Vec3,
    length: f32,
}

impl Edge {
    /// The part that lies over the height `above`, from which crossings count.
    fn over(self, above: f32) -> Option<Self> {
        let (low, high) = (self.origin.z, self.origin.z + self.length * self.direction.z);
        if low >= above && high >= above {
            return Some(self);
        }
        let cut = (above - low) / self.direction.z;
        match (low < above, high < above) {
            (true, true) => None,
            (true, false) => {
                Some(Self { origin: self.origin + cut * self.direction, length: self.length - cut, ..self })
            }
            _ => Some(Self { length: cut, ..self }),
        }
    }
}

/// The 12 edges of each limb.
fn limb_edges(pose: &Pose) -> Vec<Edge> {
    let mut edges = Vec::with_capacity(12 * LIMB_BOX_COUNT);
    for node in &BODY_BOXES[..LIMB_BOX_COUNT] {
        let joint = node.joint.index();
        let (rotation, axes) = (pose.rotations[joint], Mat3::from_quat(pose.rotations[joint]));
        let center = pose.positions[joint] + rotation * node.center;
        let h = node.half_extents;
        for axis in 0..3 {
            for corner in 0..4 {
                let sign = |bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
                let mut local = Vec3::ZERO;
                local[axis] = -h[axis];
                local[(axis + 1) % 3] = sign(0) * h[(axis + 1) % 3];
                local[(axis + 2) % 3] = sign(1) * h[(axis + 2) % 3];
                edges.push(Edge {
                    origin: center + axes * local,
                    direction: axes.col(axis),
                    length: 2.0 * h[axis],
                });
            }
        }
    }
    edges
}

/// The reference: each of the 12 edges of each limb as a segment through obvhs's tree, all hits counted.
fn edge_by_edge(tree: &Bvh2, triangles: &[Triangle], pose: &Pose, above: f32) -> u32 {
    limb_edges(pose)
        .iter()
        .map(|edge| {
            let mut count = 0;
            hits(tree, triangles, edge, above, |_| count += 1);
            count
        })
        .sum()
}

/// The same without hits that lie less than [`BEHIND`] behind the one before: what is left where two surfaces coincide.
fn apart(tree: &Bvh2, triangles: &[Triangle], pose: &Pose, above: f32) -> u32 {
    let mut all = Vec::new();
    let mut count = 0;
    for edge in limb_edges(pose) {
        all.clear();
        hits(tree, triangles, &edge, above, |t| all.push(t));
        all.sort_by(f32::total_cmp);
        let mut last = f32::NEG_INFINITY;
        for &t in &all {
            if t > last + BEHIND {
                (last, count) = (t, count + 1);
            }
        }
    }
    count
}

/// Distances along an edge at which it crosses a triangle, in no order.
fn hits(tree: &Bvh2, triangles: &[Triangle], edge: &Edge, above: f32, mut visit: impl FnMut(f32)) {
    let ray = Ray::new(edge.origin.into(), edge.direction.into(), 0.0, edge.length);
    tree.ray_traverse_anyhit(ray, |ray, id| {
        let t = triangles[tree.primitive_indices[id] as usize].intersect(ray);
        if t <= ray.tmax && edge.origin.z + t * edge.direction.z >= above {
            visit(t);
        }
    });
}

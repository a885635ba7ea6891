//! The scene W: where its triangles are, what a body touches, and where one can walk.
//!
//! [`SceneIndex`] answers from three structures: the `triangle_tree` (ρ(b, W), rays), the `distance_field`
//! that rules most of the tree out, and the `occupancy` grid g_occ with the `clear_path`s over it.
//!
//! ```
//! use oncue::glam::{Vec2, Vec3};
//! use oncue::scene::{SceneIndex, SceneSettings};
//! use oncue::{Posture, Progress};
//!
//! # fn main() -> oncue::Result<()> {
//! // A floor, and a wall across it at y = 1.
//! let corners = [
//!     [-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0],
//!     [-2.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 2.0], [-2.0, 1.0, 2.0],
//! ];
//! let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
//! let scene = SceneIndex::build(&corners.map(Vec3::from), &triangles, &SceneSettings::default(), &Progress::new())?;
//! assert_eq!(scene.floor_height(), 0.0);
//! assert!(!scene.occupancy().is_walkable(Vec2::new(0.0, 1.0)) && scene.occupancy().is_walkable(Vec2::ZERO));
//! // ρ(b, W) of every box of a body that stands in the open, and of one that stands in the wall.
//! let mut posture = Posture::default();
//! assert_eq!(scene.body_intersections(&posture.pose(), 0.1).iter().sum::<u32>(), 0);
//! posture.root_position.y = 1.0;
//! assert!(scene.body_intersections(&posture.pose(), 0.1).iter().sum::<u32>() > 10);
//! # Ok(())
//! # }
//! ```

mod box_edges;
mod capsule_depth;
mod check;
mod clear_path;
mod distance_field;
mod eikonal;
mod floor;
mod levels;
mod mesh;
mod moving;
mod occupancy;
mod polygon;
mod raster;
mod settings;
#[cfg(test)]
mod tests;
mod tree_nodes;
mod tree_references;
mod triangle_tree;
mod way;

pub use capsule_depth::SceneContact;
pub(crate) use check::{Misfit, way_of};
pub use check::{check_task, short_of_knee_room};
pub use clear_path::{ApproachPoint, ClearPath};
pub use moving::{BODY_REACH, MovingObject};
pub use occupancy::OccupancyGrid;
pub use raster::Raster;
pub use settings::SceneSettings;
pub use way::Way;

use std::cell::RefCell;

use glam::{Quat, UVec3, Vec2, Vec3};

use crate::error::Result;
use crate::motion::skeleton::LIMB_BOX_COUNT;
use crate::motion::{BODY_BOXES, BoxNode, Pose};
use crate::progress::Progress;
use box_edges::OrientedBox;
use distance_field::DistanceField;
use triangle_tree::{Scratch, TriangleTree};

/// Legs and arms: the first of [`BODY_BOXES`].
const LIMB_BOXES: [BoxNode; LIMB_BOX_COUNT] = {
    let mut limbs = [BODY_BOXES[0]; LIMB_BOX_COUNT];
    let mut i = 0;
    while i < LIMB_BOX_COUNT {
        limbs[i] = BODY_BOXES[i];
        i += 1;
    }
    limbs
};

/// Cushions give way and bulge round a person, and scans of them are uneven: what lies no higher over the seat than this
/// is the seat, metres. The pelvis joint is at 0.10; armrests, backrests and tables reach higher.
pub(crate) const SEAT_GIVE: f32 = 0.08;

/// A scene so wide that its grid would be coarser is looked at so far about the start and the cues, metres.
const SURROUNDINGS: f32 = 20.0;

/// The part of the floor plane in which the ways from place to place are found.
fn surroundings(bounds: (Vec3, Vec3), places: &[Vec3], settings: &SceneSettings) -> (Vec3, Vec3) {
    let (lo, hi) = bounds;
    let cells = (((hi - lo).truncate() / settings.cell_size).as_dvec2() + 1.0).element_product();
    if cells <= settings.max_cells as f64 / 4.0 || places.iter().any(|place| !place.is_finite()) {
        return bounds;
    }
    let within = |place: &Vec3| place.clamp(lo, hi);
    let least = places.iter().map(within).reduce(Vec3::min).unwrap_or(lo);
    let most = places.iter().map(within).reduce(Vec3::max).unwrap_or(hi);
    let (from, to) = ((least - SURROUNDINGS).max(lo), (most + SURROUNDINGS).min(hi));
    (from.with_z(lo.z), to.with_z(hi.z))
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// The scene W, indexed. Immutable, and shared between threads as it is.
#[derive(Debug)]
pub struct SceneIndex {
    settings: SceneSettings,
    fingerprint: String,
    triangle_count: usize,
    bounds: (Vec3, Vec3),
    floor_height: f32,
    tree: TriangleTree,
    field: DistanceField,
    occupancy: OccupancyGrid,
}

impl SceneIndex {
    /// Indexes triangles (world, metres, Z up) on their dominant walkable level. The result does not depend on the number of
    /// threads.
    ///
    /// Errors: `Input` for an empty or unreadable mesh, naming the triangle; `Cancelled`.
    pub fn build(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        settings: &SceneSettings,
        progress: &Progress,
    ) -> Result<SceneIndex> {
        Self::build_for(positions, triangles, settings, &[], progress)
    }

    /// The same for places that a person is to be at: its floor is the level that carries the first of them, the start, whatever
    /// else in the scene is level, and in a scene too wide for its grid the ways are found about them.
    pub fn build_for(
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        settings: &SceneSettings,
        places: &[Vec3],
        progress: &Progress,
    ) -> Result<SceneIndex> {
        settings.validate()?;
        progress.stage("Indexing the scene");
        let corners = mesh::corners(positions, triangles, progress)?;
        let first = corners[0][0];
        let bounds = corners.iter().flatten().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        progress.fraction(0.1);
        let tree = TriangleTree::build(&corners, progress)?;
        progress.fraction(0.7);
        let dominant = floor::dominant_level(&tree, bounds, settings.headroom, progress)?;
        let floor_height = match (settings.floor_height, places.first()) {
            (Some(height), _) => height,
            (None, Some(&start)) => floor::level_under(&tree, bounds, dominant, start, settings, progress)?,
            (None, None) => dominant,
        };
        // What was learnt on one level says nothing of another.
        let level = (settings.floor_height.is_none() && floor_height != dominant).then_some(floor_height);
        let fingerprint = mesh::fingerprint(&corners, settings, level);
        let bottom = floor_height + settings.carpet_height;
        let field =
            DistanceField::build(&corners, bounds, bottom, settings.cell_size, settings.max_cells, progress)?;
        progress.fraction(0.9);
        let region = if places.is_empty() { bounds } else { surroundings(bounds, places, settings) };
        let occupancy = OccupancyGrid::build(&corners, region, floor_height, settings, progress)?;
        progress.fraction(1.0);
        Ok(SceneIndex {
            settings: settings.clone(),
            fingerprint,
            triangle_count: corners.len(),
            bounds,
            floor_height,
            tree,
            field,
            occupancy,
        })
    }

    /// The same scene with more in it, on the same floor: people who are in the way, doors as they stand by then.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn with(&self, solids: &[[Vec3; 3]], progress: &Progress) -> Result<SceneIndex> {
        let mut corners = self.tree.triangles();
        corners.extend(solids);
        let bounds = solids.iter().flatten().fold(self.bounds, |(lo, hi), &v| (lo.min(v), hi.max(v)));
        let settings = &self.settings;
        let bottom = self.floor_height + settings.carpet_height;
        let field =
            DistanceField::build(&corners, bounds, bottom, settings.cell_size, settings.max_cells, progress)?;
        // The ways are found in the same cells as before.
        let raster = &self.occupancy.raster;
        let last = Vec2::new(raster.width as f32 - 0.5, raster.height as f32 - 0.5) * raster.cell;
        let region = (raster.origin.extend(bounds.0.z), (raster.origin + last).extend(bounds.1.z));
        let occupancy = OccupancyGrid::build(&corners, region, self.floor_height, settings, progress)?;
        let level = Some(self.floor_height);
        Ok(SceneIndex {
            settings: settings.clone(),
            fingerprint: mesh::fingerprint(&corners, settings, level),
            triangle_count: corners.len(),
            bounds,
            floor_height: self.floor_height,
            tree: TriangleTree::build(&corners, progress)?,
            field,
            occupancy,
        })
    }

    /// The constants that it was indexed with.
    pub fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    /// BLAKE3 of the triangles and the settings, hexadecimal: changes when anything in the scene moves.
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    /// Triangles that have an area.
    pub fn triangle_count(&self) -> usize {
        self.triangle_count
    }

    /// Smallest and largest corner of the scene, metres.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// World z of the level that is walked on: the dominant one, or that of the task's start.
    pub fn floor_height(&self) -> f32 {
        self.floor_height
    }

    /// World z of the surface that carries a point: the highest one under `near_z`, or up to 2 cm over it.
    pub fn floor_height_at(&self, xy: Vec2, near_z: f32) -> Option<f32> {
        let from = near_z + 0.02;
        let depth = from - self.bounds.0.z + 0.1;
        (depth > 0.0).then(|| self.tree.ray(xy.extend(from), Vec3::NEG_Z, depth).map(|t| from - t))?
    }

    /// ρ(b, W) of LAMA, eq. 4: how often the 12 edges of a box node cross a triangle, for its joint at `position`
    /// (world, metres) with global `rotation`.
    pub fn intersection_count(&self, node: &BoxNode, position: Vec3, rotation: Quat) -> u32 {
        let placed = OrientedBox::of_node(node, position, rotation);
        let room = self.field.steps_at(placed.center);
        SCRATCH.with_borrow_mut(|scratch| self.count(&placed, room, f32::NEG_INFINITY, scratch))
    }

    /// ρ(b, W) for every node of [`BODY_BOXES`], in its order. Crossings lower than `above` (world z) are not
    /// counted: the floor and what lies on it.
    pub fn body_intersections(&self, pose: &Pose, above: f32) -> [u32; BODY_BOXES.len()] {
        self.intersections(&BODY_BOXES, pose, |_| above)
    }

    /// As [`SceneIndex::body_intersections`] for someone who sits down or sits on a seat `seat` metres high (world z):
    /// what carries pelvis and thighs, that is whatever lies no higher than the seat, is not counted for them.
    pub fn seated_intersections(&self, pose: &Pose, above: f32, seat: f32) -> [u32; BODY_BOXES.len()] {
        let over = seat + SEAT_GIVE;
        self.intersections(&BODY_BOXES, pose, |node| if node.is_carried() { over.max(above) } else { above })
    }

    /// The one or the other: `seat` is the height of what carries the person, if anything does.
    pub fn intersections_on(&self, pose: &Pose, above: f32, seat: Option<f32>) -> [u32; BODY_BOXES.len()] {
        match seat {
            Some(seat) => self.seated_intersections(pose, above, seat),
            None => self.body_intersections(pose, above),
        }
    }

    /// As [`SceneIndex::body_intersections`] for legs and arms alone: the B of the paper's r_coli (LAMA, eq. 4). Ours counts the
    /// whole body; this is what the collision benches compare.
    pub fn limb_intersections(&self, pose: &Pose, above: f32) -> [u32; LIMB_BOX_COUNT] {
        self.intersections(&LIMB_BOXES, pose, |_| above)
    }

    fn intersections<const N: usize>(
        &self,
        nodes: &[BoxNode; N],
        pose: &Pose,
        above: impl Fn(&BoxNode) -> f32,
    ) -> [u32; N] {
        let placed = nodes.each_ref().map(|node| {
            let joint = node.joint.index();
            OrientedBox::of_node(node, pose.positions[joint], pose.rotations[joint])
        });
        // All of these loads at once: one after the other each would wait for memory.
        let room = placed.each_ref().map(|placed| self.field.steps_at(placed.center));
        SCRATCH.with_borrow_mut(|scratch| {
            std::array::from_fn(|i| self.count(&placed[i], room[i], above(&nodes[i]), scratch))
        })
    }

    /// No triangle is nearer to `point` than this, metres: a lower bound up to about 0.5 m, 0 where one may be close.
    pub fn clearance_lower_bound(&self, point: Vec3) -> f32 {
        self.field.lower_bound(point).min((point.z - self.field.bottom).max(0.0))
    }

    /// Distance along `direction` (unit) to the nearest triangle within `max`, metres.
    pub fn ray(&self, origin: Vec3, direction: Vec3, max: f32) -> Option<f32> {
        self.tree.ray(origin, direction, max)
    }

    /// g_occ and the clearance.
    pub fn occupancy(&self) -> &OccupancyGrid {
        &self.occupancy
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        self.tree.memory() + self.field.memory() + self.occupancy.memory()
    }

    fn count(&self, placed: &OrientedBox, room: u8, above: f32, scratch: &mut Scratch) -> u32 {
        if self.is_clear(placed, room, above) { 0 } else { self.tree.count(placed, above, scratch) }
    }

    /// Whether the distance field rules out every crossing that counts. `room`: the field at the box's middle.
    #[inline]
    fn is_clear(&self, placed: &OrientedBox, room: u8, above: f32) -> bool {
        // The field knows nothing of what lies under its bottom: nothing there may count, or the box must not reach it.
        let lowest = placed.center.z - placed.world_half_extents.z;
        if above < self.field.bottom && lowest <= self.field.bottom {
            return false;
        }
        let (field, half) = (&self.field, placed.half_extents);
        if room >= field.steps_of(half.length() + 1e-4) {
            return true;
        }
        // Smaller balls that hold the box together: nearly cubes of its thinnest side, at most four a side.
        let count = (half * half.min_element().recip() + 0.5).as_uvec3().clamp(UVec3::ONE, UVec3::splat(4));
        let part = half / count.as_vec3();
        let steps = field.steps_of(part.length() + 1e-4);
        let axes = placed.axes;
        let (dx, dy, dz) =
            (axes.x_axis * (2.0 * part.x), axes.y_axis * (2.0 * part.y), axes.z_axis * (2.0 * part.z));
        let middle = 0.5 * (count - 1).as_vec3();
        let corner = placed.center - dx * middle.x - dy * middle.y - dz * middle.z;
        for z in 0..count.z {
            for y in 0..count.y {
                let row = corner + dy * y as f32 + dz * z as f32;
                for x in 0..count.x {
                    if field.steps_at(row + dx * x as f32) < steps {
                        return false;
                    }
                }
            }
        }
        true
    }
}

//! The way along the clear floor to a cue: what r_pos measures, and where its path leads next.
//!
//! Travel times from the cue are marched over the occupancy grid, where a metre costs more the less room there
//! is, so that the quickest way leads through the middle of doors. A seat is occupied itself: its way ends at
//! approach points in front of it, and the rest is the straight line to the seat.

use glam::Vec2;

use super::SceneIndex;
use super::eikonal::TravelTimes;
use super::raster::{Raster, Stencil};
use super::settings::SceneSettings;
use crate::action::Approach;
use crate::cue::{ActionCue, InitialState, PassCue};
use crate::math::Planar;
use crate::math::rotation::wrap_angle;

/// Approach points lie so far from the pelvis target, metres: from where a person begins to sit down, to a step before.
const APPROACH: (f32, f32) = (0.45, 0.75);
/// And within this angle of the facing, degrees.
const APPROACH_ANGLE: f32 = 100.0;
/// Angle between neighbouring approach points, degrees.
const APPROACH_STEP: f32 = 10.0;
/// What an approach from `APPROACH_ANGLE` costs over one from the front, metres; it grows with the square of the angle,
/// as one more step of turning round.
const SIDE_COST: f32 = 0.8;
/// What a metre farther from the seat than the nearest approach costs: the last step onto the seat is no walk.
const DISTANCE_COST: f32 = 0.5;
/// What an approach over an armrest, or past the edge of a backrest, costs, metres.
const ARMREST_COST: f32 = 0.4;
/// Half the width of who sits down, metres.
const HALF_WIDTH: f32 = 0.15;
/// What an approach costs from where the legs, turning with the person on the seat, run into something, metres: rather
/// walk round to the other side.
const SWEEP_COST: f32 = 2.5;
/// Where the legs are when one sits, on the front half of the seat too: from its edge to the knees, metres from the cue.
const LEG_SPACE: (f32, f32) = (0.30, 0.58);
/// Heights of the thighs and of the shins over the pelvis, metres.
const LEG_HEIGHTS: [f32; 2] = [-0.03, -0.25];
/// A seat without an approach within this angle of its front is sat down on from the side, degrees.
const FRONT: f32 = 45.0;
/// Room that an approach point should have; less is taken where there is no such point.
const APPROACH_CLEARANCE: f32 = 0.17;
/// Cost of a metre at `narrow_clearance` and at `blocked_clearance`; 1 in free space.
const NARROW_COST: f32 = 3.0;
const BLOCKED_COST: f32 = 15.0;
/// How far into the blocked band and into furniture times are known, metres: a start close to a wall gets out.
const BAND: f32 = 0.4;

/// A place to stand before sitting down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachPoint {
    /// World, metres.
    pub position: Vec2,
    /// Angle from the facing direction, radians, left positive.
    pub angle: f32,
    /// What it costs beyond its distance to the seat, metres.
    pub cost: f32,
}

/// Travel times and lengths of the clear ways from everywhere to one cue.
#[derive(Debug, Clone)]
pub struct ClearPath {
    raster: Raster,
    goal: Vec2,
    /// The cue's facing, radians.
    yaw: f32,
    approach: Vec<ApproachPoint>,
    times: TravelTimes,
    /// Unit vectors down the travel time, at the cells' centres.
    descent: Vec<Vec2>,
}

impl ClearPath {
    /// The ways to `cue`. Nothing is reached (all infinite) when the cue has no free place before it.
    pub fn to_cue(scene: &SceneIndex, cue: &ActionCue) -> ClearPath {
        let grid = scene.occupancy();
        let raster = grid.raster;
        let settings = scene.settings();
        let goal = cue.position.truncate();
        let ends = cue.action_type.spec().approach;
        let approach = match ends {
            Approach::Seat => approach_points(scene, cue),
            Approach::Place => vec![ApproachPoint { position: goal, angle: 0.0, cost: 0.0 }],
        };
        let mut times = TravelTimes::unreached(&raster);
        let clearance = grid.clearance_cells();
        let free = |i: usize| clearance[i] >= settings.blocked_clearance;
        for point in &approach {
            let rest = point.position.distance(goal);
            for i in near(&raster, point.position, 1.6 * raster.cell) {
                let extra = raster.center(i).distance(point.position);
                if grid.walkable_cells()[i] {
                    times.offer(i, rest + point.cost + extra, rest + extra);
                }
            }
        }
        times.march(
            &raster,
            |i| if free(i) { cost(clearance[i], settings) } else { f32::INFINITY },
            false,
            f32::INFINITY,
        );
        if ends == Approach::Seat {
            let facing = cue.planar().heading();
            for i in near(&raster, goal, APPROACH.1) {
                let away = raster.center(i) - goal;
                let angle = angle_from(facing, away);
                // On the seat, and between the seat and an approach point, the straight line counts.
                let by = approach
                    .iter()
                    .filter(|a| {
                        (a.angle - angle).abs() <= 0.6 * APPROACH_STEP.to_radians() || away.length() < 0.3
                    })
                    .map(|a| a.cost)
                    .min_by(f32::total_cmp);
                if let Some(cost) = by {
                    times.offer(i, away.length() + cost, away.length());
                }
            }
        }
        // Out of the band where there is too little room, and out of what is occupied, but never through it
        // into other free space.
        let walkable = grid.walkable_cells();
        times.march(
            &raster,
            |i| if walkable[i] && !free(i) { BLOCKED_COST } else { f32::INFINITY },
            true,
            BAND,
        );
        times.march(&raster, |i| if walkable[i] { f32::INFINITY } else { 2.0 * BLOCKED_COST }, true, BAND);
        let descent = (0..raster.len()).map(|i| steepest(&raster, &times.time, i)).collect();
        Self { raster, goal, yaw: cue.yaw, approach, times, descent }
    }

    /// The ways to a place to stand.
    pub(crate) fn to_place(scene: &SceneIndex, place: Vec2) -> ClearPath {
        let position = place.extend(scene.floor_height());
        Self::to_cue(scene, &PassCue { name: String::new(), position }.as_stop())
    }

    /// Metres along the clear floor from `xy` to the cue (for a seat, the straight rest from the approach point
    /// included); infinite where no way leads. Bilinear between the cells.
    pub fn distance(&self, xy: Vec2) -> f32 {
        self.value(&self.times.length, xy)
    }

    /// As [`ClearPath::distance`], with every metre weighted by how little room it has: continuous everywhere, and
    /// falling along [`ClearPath::path`].
    pub fn effort(&self, xy: Vec2) -> f32 {
        self.value(&self.times.time, xy)
    }

    /// Where the way from `start` begins: there, or, of who sits, on the free floor before the seat from where it is easiest.
    pub fn departure(&self, scene: &SceneIndex, start: &InitialState) -> Vec2 {
        let here = start.position.truncate();
        let Some(seat) = start.seat() else { return here };
        let effort = |point: &ApproachPoint| self.effort(point.position) + point.cost;
        let points = approach_points(scene, seat);
        let easiest = points.iter().min_by(|a, b| effort(a).total_cmp(&effort(b)));
        easiest.map_or(here, |point| point.position)
    }

    /// The cue's place on the floor plane.
    pub fn goal(&self) -> Vec2 {
        self.goal
    }

    /// Where one can stand before sitting down, from right to left; for a stop the place itself.
    pub fn approach_points(&self) -> &[ApproachPoint] {
        &self.approach
    }

    /// The approach point that the way from `from` ends at; `None` where no way leads.
    pub fn approach_from(&self, from: Vec2) -> Option<ApproachPoint> {
        self.approach_at(*self.path(from).last()?)
    }

    /// The approach point at the end of a way.
    fn approach_at(&self, end: Vec2) -> Option<ApproachPoint> {
        let away = |a: &ApproachPoint| a.position.distance_squared(end);
        self.approach.iter().copied().min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    /// Whether there is room beside the seat only: one sits down on its side and turns on it, as at a table.
    pub fn from_the_side(&self) -> bool {
        !self.approach.is_empty() && self.approach.iter().all(|a| a.angle.abs() > FRONT.to_radians())
    }

    /// Where to stand at the `end` of a way, and which way to face: as the cue does, or with the back to the seat where it
    /// is entered [from the side](Self::from_the_side). `None` where no way leads to the cue.
    pub fn arrival_at(&self, end: Vec2) -> Option<Planar> {
        let approach = self.approach_at(end)?;
        let turned = if self.from_the_side() { approach.angle } else { 0.0 };
        Some(Planar::new(approach.position, wrap_angle(self.yaw + turned)))
    }

    /// The point `distance` metres further along the clear path; the path's end where it is shorter, and `xy`
    /// itself where no way leads.
    pub fn point_ahead(&self, xy: Vec2, distance: f32) -> Vec2 {
        self.points_ahead(xy, [distance])[0]
    }

    /// [`ClearPath::point_ahead`] for several distances in one walk along the path.
    pub fn points_ahead<const N: usize>(&self, xy: Vec2, distances: [f32; N]) -> [Vec2; N] {
        points_along(xy, distances, |visit| self.follow(xy, visit))
    }

    /// The clear path from `from` to the cue's approach point (a stop's place): points about half a cell apart,
    /// `from` first. Empty where no way leads.
    pub fn path(&self, from: Vec2) -> Vec<Vec2> {
        if !self.effort(from).is_finite() {
            return Vec::new();
        }
        let mut points = vec![from];
        self.follow(from, |point| {
            points.push(point);
            true
        });
        points
    }

    fn value(&self, values: &[f32], xy: Vec2) -> f32 {
        self.raster.stencil(xy).map_or(f32::INFINITY, |s| Self::value_at(values, &s))
    }

    fn value_at(values: &[f32], stencil: &Stencil) -> f32 {
        if values[stencil.cell].is_finite() { stencil.blend(values) } else { f32::INFINITY }
    }

    /// Steepest descent of the travel time, to the approach point; `visit` returns false to stop.
    pub(super) fn follow(&self, from: Vec2, mut visit: impl FnMut(Vec2) -> bool) {
        let step = 0.5 * self.raster.cell;
        let look = |at: Vec2| {
            let stencil = self.raster.stencil(at)?;
            Some((stencil, Self::value_at(&self.times.time, &stencil))).filter(|(_, time)| time.is_finite())
        };
        let mut here = from;
        let Some((mut stencil, mut time)) = look(here) else { return };
        // Every step lowers the time, so this ends; the bound is for rounding.
        for _ in 0..8 * self.raster.len() {
            if let Some(end) = self.arrived(here, time) {
                visit(end);
                return;
            }
            let mut next = here + step * self.descent(&stencil);
            let mut found = look(next);
            if found.is_none_or(|(_, next_time)| next_time >= time) {
                // In a fold of the surface: over to the best cell around.
                let Some(i) = self.lowest_around(here).filter(|i| self.times.time[*i] < time) else { return };
                next = self.raster.center(i);
                found = look(next);
            }
            let Some((next_stencil, next_time)) = found else { return };
            if !visit(next) {
                return;
            }
            (here, stencil, time) = (next, next_stencil, next_time);
        }
    }

    /// The approach point that a way ends at here; points that it only passes, on to a better one, do not count.
    fn arrived(&self, here: Vec2, time: f32) -> Option<Vec2> {
        let cell = self.raster.cell;
        let away = here.distance(self.goal);
        if away > APPROACH.1 + 2.0 * cell {
            return None;
        }
        let on_seat = away < APPROACH.0 - cell;
        self.approach
            .iter()
            .filter(|a| on_seat || a.position.distance(here) <= cell)
            .filter(|a| on_seat || a.position.distance(self.goal) + a.cost <= time + 0.5 * cell)
            .map(|a| a.position)
            .min_by(|a, b| a.distance_squared(here).total_cmp(&b.distance_squared(here)))
    }

    /// Unit vector down the travel time, between the four nearest cells; zero where they disagree or it is flat.
    fn descent(&self, at: &Stencil) -> Vec2 {
        let way = at.blend_vectors(&self.descent);
        if way.length_squared() > 0.1 { way.normalize() } else { Vec2::ZERO }
    }

    fn lowest_around(&self, at: Vec2) -> Option<usize> {
        near(&self.raster, at, 1.6 * self.raster.cell)
            .filter(|&i| self.times.time[i].is_finite())
            .min_by(|&a, &b| self.times.time[a].total_cmp(&self.times.time[b]))
    }
}

/// The points so far from `xy` along a way; its end where it is shorter. `follow` walks along it, point by point, for as long as what
/// it is given returns true.
pub(super) fn points_along<const N: usize>(
    xy: Vec2,
    distances: [f32; N],
    follow: impl FnOnce(&mut dyn FnMut(Vec2) -> bool),
) -> [Vec2; N] {
    let mut order: [usize; N] = std::array::from_fn(|i| i);
    order.sort_unstable_by(|a, b| distances[*a].total_cmp(&distances[*b]));
    let mut points = [xy; N];
    let (mut next, mut gone, mut last) = (0, 0.0, xy);
    follow(&mut |point| {
        let step = point.distance(last);
        while next < N && gone + step >= distances[order[next]] {
            let part = if step > 0.0 { (distances[order[next]] - gone) / step } else { 0.0 };
            points[order[next]] = last.lerp(point, part.clamp(0.0, 1.0));
            next += 1;
        }
        gone += step;
        last = point;
        next < N
    });
    order[next..].iter().for_each(|i| points[*i] = last);
    points
}

/// Cost of a metre with so much room: 1 in free space, rising smoothly to `NARROW_COST`, then steeply.
fn cost(clearance: f32, settings: &SceneSettings) -> f32 {
    let part = |from: f32, to: f32| ((to - clearance) / (to - from)).clamp(0.0, 1.0);
    let tight = part(settings.narrow_clearance, settings.free_clearance);
    let blocked = part(settings.blocked_clearance, settings.narrow_clearance);
    1.0 + (NARROW_COST - 1.0) * tight * tight + (BLOCKED_COST - NARROW_COST) * blocked
}

/// Unit vector down `time` at a cell: by the lower neighbour of each axis, as the times were found; zero at a source.
fn steepest(raster: &Raster, time: &[f32], cell: usize) -> Vec2 {
    if !time[cell].is_finite() {
        return Vec2::ZERO;
    }
    let [left, right, below, above] =
        raster.neighbours(cell).map(|n| n.map_or(0.0, |n| (time[cell] - time[n]).max(0.0)));
    let along = |less: f32, more: f32| if less > more { -less } else { more };
    Vec2::new(along(left, right), along(below, above)).normalize_or_zero()
}

/// Signed angle from the heading to a direction, radians in (-π, π], left positive.
fn angle_from(heading: f32, direction: Vec2) -> f32 {
    Vec2::from_angle(heading).angle_to(direction)
}

/// Cells whose centre lies within `radius` of a place, ascending.
fn near(raster: &Raster, place: Vec2, radius: f32) -> impl Iterator<Item = usize> {
    let raster = *raster;
    let cells = (radius / raster.cell).ceil() as i64;
    let middle = ((place - raster.origin) / raster.cell).floor();
    let (mx, my) = (middle.x as i64, middle.y as i64);
    (my - cells..=my + cells)
        .flat_map(move |y| (mx - cells..=mx + cells).map(move |x| (x, y)))
        .filter(move |&(x, y)| x >= 0 && y >= 0 && x < raster.width as i64 && y < raster.height as i64)
        .map(move |(x, y)| x as usize + raster.width * y as usize)
        .filter(move |&i| raster.center(i).distance(place) <= radius)
}

/// In each direction before the seat the nearest place to stand with nothing tall between it and the seat.
pub(super) fn approach_points(scene: &SceneIndex, cue: &ActionCue) -> Vec<ApproachPoint> {
    let settings = scene.settings();
    let with_room = |room: f32| -> Vec<ApproachPoint> {
        let steps = (APPROACH_ANGLE / APPROACH_STEP) as i32;
        (-steps..=steps)
            .filter_map(|i| approach_at(scene, cue, (i as f32 * APPROACH_STEP).to_radians(), room))
            .collect()
    };
    let points = with_room(APPROACH_CLEARANCE.max(settings.blocked_clearance));
    if points.is_empty() { with_room(settings.blocked_clearance) } else { points }
}

fn approach_at(scene: &SceneIndex, cue: &ActionCue, angle: f32, room: f32) -> Option<ApproachPoint> {
    let goal = cue.position.truncate();
    let direction = Vec2::from_angle(cue.planar().heading() + angle);
    let grid = scene.occupancy();
    let steps = ((APPROACH.1 - APPROACH.0) / 0.025).round() as i32;
    let position = (0..=steps)
        .map(|i| goal + direction * (APPROACH.0 + 0.025 * i as f32))
        .find(|&p| grid.is_walkable(p) && grid.clearance(p) >= room)?;
    // What stands between the person and the seat at a height, up to the person's back on the seat.
    let between = |z: f32, aside: f32| {
        let way = position.distance(goal) - 0.15;
        let from = position + aside * direction.perp();
        scene.ray(from.extend(z), -direction.extend(0.0), way).is_some()
    };
    let chest = (cue.position.z + 0.45).max(scene.floor_height() + 1.0);
    if between(chest, 0.0) {
        return None;
    }
    let side = SIDE_COST * (angle / APPROACH_ANGLE.to_radians()).powi(2);
    let far = DISTANCE_COST * (position.distance(goal) - APPROACH.0);
    let over_something =
        [-HALF_WIDTH, 0.0, HALF_WIDTH].into_iter().any(|a| between(cue.position.z + 0.12, a));
    let armrest = if over_something { ARMREST_COST } else { 0.0 };
    let sweep = if legs_are_barred(scene, cue, angle) { SWEEP_COST } else { 0.0 };
    Some(ApproachPoint { position, angle, cost: side + far + armrest + sweep })
}

/// Whether something stands in the way of the legs, at the height of the thighs or of the shins, as they turn from `angle`
/// to the seat's front; never for an approach from the front.
fn legs_are_barred(scene: &SceneIndex, cue: &ActionCue, angle: f32) -> bool {
    let count = (angle.abs() / APPROACH_STEP.to_radians()).round() as i32;
    angle.abs() > FRONT.to_radians()
        && (0..=count).any(|i| {
            let direction = Vec2::from_angle(cue.planar().heading() + angle * i as f32 / count as f32);
            let from = cue.position.truncate() + LEG_SPACE.0 * direction;
            LEG_HEIGHTS.into_iter().any(|dz| {
                let from = from.extend(cue.position.z + dz);
                scene.ray(from, direction.extend(0.0), LEG_SPACE.1 - LEG_SPACE.0).is_some()
            })
        })
}

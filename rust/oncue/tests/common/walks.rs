//! Walks through waypoints in the real rooms, laid out by rule from the clear floor.

use glam::Vec2;
use oncue::scene::{ClearPath, SceneIndex};
use oncue::{ActionCue, ActionType, PassCue, Task};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::rooms::Row;

/// A waypoint is so far from the way that would be gone without it, metres.
const ASIDE: (f32, f32) = (0.5, 2.0);
/// So far from start, cue and other waypoints, metres.
const APART: f32 = 0.7;
/// It makes the way no longer than by so much, metres.
const LONGER: f32 = 5.0;
/// Between the places that are thought of, metres.
const SPACING: f32 = 0.15;

/// Some walks in a room, from the starts of its rows: with one waypoint and with two by turns, two to the row's own seat, then two to
/// where the next row starts. Where a room has no place for a waypoint there are fewer.
pub fn walks(rows: &[Row], scene: &SceneIndex, count: usize) -> Vec<Task> {
    (0..count).filter_map(|at| walk(rows, scene, at)).collect()
}

fn walk(rows: &[Row], scene: &SceneIndex, at: usize) -> Option<Task> {
    let (own, next) = (&rows[at % rows.len()].task, &rows[(at + 1) % rows.len()].task);
    let mut task = own.clone();
    let far = own.start.position.distance(next.start.position) > 2.0;
    if at % 4 >= 2 && far {
        let (position, yaw) = (next.start.position, next.start.yaw);
        task.cue =
            ActionCue { name: "Stop".into(), action_type: ActionType::Stop, position, yaw, feet: [None; 2] };
    }
    let ways = ClearPath::to_cue(scene, &task.cue);
    let start = task.start.position.truncate();
    let (path, shortest) = (ways.path(start), ways.distance(start));
    let from_start = ClearPath::to_cue(
        scene,
        &ActionCue { action_type: ActionType::Stop, position: task.start.position, ..task.cue.clone() },
    );
    let ends = [start, task.cue.position.truncate()];
    // How far along the way it lies, of each place that may be a waypoint.
    let mut places: Vec<(usize, Vec2)> = grid(scene)
        .filter_map(|place| {
            let apart = |i: &usize| path[*i].distance(place);
            let nearest = (0..path.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            let aside = (ASIDE.0..=ASIDE.1).contains(&apart(&nearest));
            let longer = from_start.distance(place) + ways.distance(place) - shortest;
            let apart = ends.iter().all(|end| end.distance(place) >= APART);
            (aside && apart && longer <= LONGER).then_some((nearest, place))
        })
        .collect();
    let mut rng = Pcg64::seed_from_u64(at as u64);
    let mut chosen: Vec<(usize, Vec2)> = Vec::new();
    while chosen.len() < 1 + at % 2 && !places.is_empty() {
        let one = places[rng.random_range(0..places.len())];
        chosen.push(one);
        places.retain(|(_, place)| place.distance(one.1) >= APART);
    }
    chosen.sort_by_key(|(along, _)| *along);
    let name = |i: usize| format!("By {}", i + 1);
    let pass = |(i, (_, place)): (usize, &(usize, Vec2))| PassCue {
        name: name(i),
        position: place.extend(scene.floor_height()),
    };
    task.passes = chosen.iter().enumerate().map(pass).collect();
    (!task.passes.is_empty()).then_some(task)
}

/// Places on the floor where nothing is in a person's way.
fn grid(scene: &SceneIndex) -> impl Iterator<Item = Vec2> {
    let (low, high) = scene.bounds();
    let room = scene.settings().free_clearance;
    let (columns, rows) = (((high.x - low.x) / SPACING) as usize, ((high.y - low.y) / SPACING) as usize);
    (0..rows)
        .flat_map(move |row| (0..columns).map(move |column| Vec2::new(column as f32 + 0.5, row as f32 + 0.5)))
        .map(move |cell| low.truncate() + SPACING * cell)
        .filter(move |place| {
            scene.occupancy().is_walkable(*place) && scene.occupancy().clearance(*place) >= room
        })
}

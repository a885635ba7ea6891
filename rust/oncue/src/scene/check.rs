//! What can be known before optimizing: whether a task can be done at all, and if not, why, in words.

use glam::{Vec2, Vec3};

use super::SceneIndex;
use super::clear_path::ClearPath;
use crate::action::{ActionType, Approach};
use crate::cue::{ActionCue, Task};
use crate::error::{Error, Result};
use crate::math::planar::rotate;

/// The pelvis joint of a seated person is about 0.10 m over the seat; a cue farther than this over it floats, metres.
const FLOATING: f32 = 0.35;
/// A cue this deep under a surface is in the cushion, not on it, metres.
const SUNK: f32 = 0.12;
/// Seats that a person sits down on, metres over the floor: from a low step to a bar stool.
const SEAT: (f32, f32) = (0.20, 0.85);
/// Thighs need so much room before the pelvis, metres: half of a thigh and the shin before it.
const LEG_ROOM: f32 = 0.28;
/// Knees reach so far before the pelvis, metres; on a high seat, where they are spread at need, less far.
const KNEE_ROOM: f32 = 0.48;
const SPREAD_KNEE_ROOM: f32 = 0.40;
/// A seat from so high on is a high one, metres over the floor.
const HIGH_SEAT: f32 = 0.60;
/// A start may stand so far over or under its floor, metres.
const START_TOLERANCE: f32 = 0.25;
/// Something on both sides so near, metres, means inside of it.
const INSIDE: f32 = 0.12;

/// Whether the person can get from the start to the cue and do there what it asks.
///
/// Errors: `Input` for a start or cue that is misplaced in itself, `Unreachable` where no clear way leads; the
/// sentence names it, the value, and what to do.
pub fn check_task(scene: &SceneIndex, task: &Task) -> Result<()> {
    check_start(scene, task)?;
    check_feet(&task.cue)?;
    let spec = task.cue.action_type.spec();
    if !spec.has_cue {
        return Err(Error::input(format!(
            "Cue ‘{}’ asks for no action that a motion can end with: {} is not one.",
            task.cue.name, spec.name
        )));
    }
    match spec.approach {
        Approach::Seat => check_seat(scene, &task.cue)?,
        Approach::Place => check_place(scene, &task.cue)?,
    }
    check_way(scene, task)
}

fn check_start(scene: &SceneIndex, task: &Task) -> Result<()> {
    let (start, place) = (&task.start, task.start.position);
    let name = &start.name;
    if !(place.is_finite() && start.yaw.is_finite()) {
        return Err(Error::input(format!("Start ‘{name}’ has a place or a facing that is not a number.")));
    }
    let (lo, hi) = scene.bounds();
    let xy = place.truncate();
    if xy.cmplt(lo.truncate()).any() || xy.cmpgt(hi.truncate()).any() {
        return Err(Error::input(format!(
            "Start ‘{name}’ lies outside the scene, {:.2} m from its nearest mesh; move it onto the floor.",
            xy.distance(xy.clamp(lo.truncate(), hi.truncate()))
        )));
    }
    let support = support(scene, xy, place.z + START_TOLERANCE, 0.05);
    match support {
        Some(z) if (place.z - z).abs() <= START_TOLERANCE => {}
        Some(z) if z > scene.floor_height() - START_TOLERANCE => {
            return Err(Error::input(format!(
                "Start ‘{name}’ stands {:.2} m over the nearest surface; lower it onto the floor.",
                place.z - z
            )));
        }
        _ => {
            return Err(Error::input(format!(
                "Start ‘{name}’ has no floor under it; move it onto the floor, which is at z = {:.2} m.",
                scene.floor_height()
            )));
        }
    }
    let up = place.z - scene.floor_height();
    if up.abs() > START_TOLERANCE {
        return Err(Error::input(format!(
            "Start ‘{name}’ stands {:.2} m {} the scene's walkable floor (z = {:.2} m); move it there.",
            up.abs(),
            if up > 0.0 { "over" } else { "under" },
            scene.floor_height()
        )));
    }
    if scene.occupancy().is_occupied(xy) {
        return Err(Error::input(format!(
            "Start ‘{name}’ stands inside furniture or a wall; move it to a free place on the floor."
        )));
    }
    let room = scene.occupancy().clearance(xy);
    if room < START_ROOM {
        return Err(Error::input(format!(
            "Start ‘{name}’ stands {:.0} cm from furniture or a wall, where a body does not fit; move it {:.0} cm away from it.",
            100.0 * room,
            100.0 * (START_ROOM - room) + 5.0
        )));
    }
    Ok(())
}

/// A person who stands nearer to something than this is in it, metres.
const START_ROOM: f32 = 0.18;

fn check_feet(cue: &ActionCue) -> Result<()> {
    for (foot, side) in cue.feet.iter().zip(["left", "right"]) {
        let Some(foot) = foot else { continue };
        let away = foot.distance(cue.position);
        if !foot.is_finite() || away > 1.2 {
            return Err(Error::input(format!(
                "The {side} foot of cue ‘{}’ is {away:.2} m from it; a leg reaches about 0.9 m.",
                cue.name
            )));
        }
    }
    Ok(())
}

/// What a cue of either kind must meet.
fn check_cue_place(scene: &SceneIndex, cue: &ActionCue, kind: &str) -> Result<()> {
    let name = &cue.name;
    let place = cue.position;
    if !(place.is_finite() && cue.yaw.is_finite()) {
        return Err(Error::input(format!(
            "{kind} cue ‘{name}’ has a place or a facing that is not a number."
        )));
    }
    let (lo, hi) = scene.bounds();
    let xy = place.truncate();
    if xy.cmplt(lo.truncate()).any() || xy.cmpgt(hi.truncate()).any() {
        return Err(Error::input(format!(
            "{kind} cue ‘{name}’ lies outside the scene, {:.2} m from its nearest mesh.",
            xy.distance(xy.clamp(lo.truncate(), hi.truncate()))
        )));
    }
    let under = scene.floor_height() - place.z;
    if under > START_TOLERANCE || (cue.pelvis_height().is_some() && under > 0.0) {
        return Err(Error::input(format!(
            "{kind} cue ‘{name}’ lies {under:.2} m below the floor; raise it."
        )));
    }
    Ok(())
}

fn check_place(scene: &SceneIndex, cue: &ActionCue) -> Result<()> {
    check_cue_place(scene, cue, "Stop")?;
    let xy = cue.position.truncate();
    if scene.occupancy().is_occupied(xy) {
        return Err(Error::input(format!(
            "Stop cue ‘{}’ stands inside furniture or a wall; move it to a free place on the floor.",
            cue.name
        )));
    }
    if !scene.occupancy().is_walkable(xy) {
        return Err(Error::input(format!(
            "Stop cue ‘{}’ has no floor under it; move it onto the floor.",
            cue.name
        )));
    }
    let room = scene.occupancy().clearance(xy);
    if room < scene.settings().blocked_clearance {
        return Err(Error::input(format!(
            "Stop cue ‘{}’ has only {:.0} cm of room around it; a person needs {:.0} cm.",
            cue.name,
            100.0 * room,
            100.0 * scene.settings().blocked_clearance
        )));
    }
    Ok(())
}

fn check_seat(scene: &SceneIndex, cue: &ActionCue) -> Result<()> {
    check_cue_place(scene, cue, "Sit")?;
    let (name, place) = (&cue.name, cue.position);
    let xy = place.truncate();
    if let Some(sentence) = inside(scene, cue) {
        return Err(Error::input(sentence));
    }
    // The seat under the buttocks: the highest of a few places, as seats have slats, gaps and rims.
    let rings = [0.10, 0.18].map(|radius| support(scene, xy, place.z + SUNK, radius));
    let Some(seat) = rings.into_iter().flatten().reduce(f32::max) else {
        return Err(Error::input(format!(
            "Sit cue ‘{name}’ floats: there is no surface below it; move it onto a seat."
        )));
    };
    let over = place.z - seat;
    if over > FLOATING {
        return Err(Error::input(format!(
            "Sit cue ‘{name}’ floats: the nearest surface is {over:.2} m below the pelvis; lower it onto the seat."
        )));
    }
    let height = seat - scene.floor_height();
    if height > SEAT.1 {
        return Err(Error::input(format!(
            "Sit cue ‘{name}’ is too high: its seat is {height:.2} m over the floor, and a person gets onto {:.2} m.",
            SEAT.1
        )));
    }
    if height < SEAT.0 {
        return Err(Error::input(format!(
            "Sit cue ‘{name}’ is too low: its seat is {height:.2} m over the floor; at least {:.2} m are needed.",
            SEAT.0
        )));
    }
    if let Some(ahead) = before_the_pelvis(scene, cue, LEG_ROOM) {
        return Err(Error::input(format!(
            "Sit cue ‘{name}’ has no room for the legs: something is {ahead:.2} m in front of the pelvis, where {LEG_ROOM:.2} m are \
             needed; turn the cue, move it back, or move what is there."
        )));
    }
    Ok(())
}

/// How near before the pelvis of a person on the cue something stands, metres; `None` where nothing does `within`.
fn before_the_pelvis(scene: &SceneIndex, cue: &ActionCue, within: f32) -> Option<f32> {
    let facing = cue.planar().forward();
    let left = rotate(std::f32::consts::FRAC_PI_2, facing);
    [-0.1, 0.1]
        .iter()
        .filter_map(|&side| scene.ray(cue.position + (left * side).extend(0.0), facing.extend(0.0), within))
        .reduce(f32::min)
}

/// How near something stands before a seated person whose knees do not fit there, and how much room they need, metres.
/// Nobody is refused for it: a motion library may have a way.
pub fn short_of_knee_room(scene: &SceneIndex, cue: &ActionCue) -> Option<(f32, f32)> {
    let height = cue.seat_height()? - scene.floor_height();
    let needed = if height < HIGH_SEAT { KNEE_ROOM } else { SPREAD_KNEE_ROOM };
    before_the_pelvis(scene, cue, needed).map(|ahead| (ahead, needed))
}

/// A sentence when the sit cue is inside a wall or under something.
fn inside(scene: &SceneIndex, cue: &ActionCue) -> Option<String> {
    let chest = cue.position + Vec3::Z * 0.35;
    let facing = cue.planar().forward();
    let hit = |direction: Vec2| scene.ray(chest, direction.extend(0.0), INSIDE).is_some();
    let left = rotate(std::f32::consts::FRAC_PI_2, facing);
    if (hit(facing) && hit(-facing)) || (hit(left) && hit(-left)) {
        return Some(format!("Sit cue ‘{}’ is inside a wall or furniture; move it onto the seat.", cue.name));
    }
    let over = scene.ray(cue.position + Vec3::Z * SUNK, Vec3::Z, 0.70 - SUNK)? + SUNK;
    // Half a torso up it is a cushion or a box around the cue; higher, a table or a shelf over it.
    Some(if over < 0.35 {
        format!(
            "Sit cue ‘{}’ is inside furniture, {over:.2} m under its surface; raise it onto the seat.",
            cue.name
        )
    } else {
        format!(
            "Sit cue ‘{}’ has no room above it: something is {over:.2} m over the pelvis, and a seated person needs 0.80 m.",
            cue.name
        )
    })
}

fn check_way(scene: &SceneIndex, task: &Task) -> Result<()> {
    let cue = &task.cue;
    let ways = ClearPath::to_cue(scene, cue);
    if ways.approach_points().is_empty() {
        return Err(Error::Unreachable(format!(
            "Sit cue ‘{}’ cannot be reached: there is no free floor to stand on within 0.75 m in front of it.",
            cue.name
        )));
    }
    if ways.distance(task.start.position.truncate()).is_finite() {
        return Ok(());
    }
    // Which of the two is shut in: look from the start at how near a clear way comes.
    let start = ActionCue {
        name: task.start.name.clone(),
        action_type: ActionType::Stop,
        position: task.start.position,
        yaw: task.start.yaw,
        feet: [None; 2],
    };
    let from_start = ClearPath::to_cue(scene, &start);
    let goal = cue.position.truncate();
    let grid = scene.occupancy();
    let nearest = (0..grid.raster.len())
        .filter(|&i| grid.clearance_cells()[i] >= scene.settings().blocked_clearance)
        .map(|i| grid.raster.center(i))
        .filter(|&p| from_start.distance(p).is_finite())
        .map(|p| p.distance(goal))
        .fold(f32::INFINITY, f32::min);
    let kind = cue.action_type.spec().name;
    let ends = if nearest.is_finite() {
        format!("the floor that is free for a person ends {nearest:.2} m from the cue")
    } else {
        "the start has no room around it".to_owned()
    };
    Err(Error::Unreachable(format!(
        "{kind} cue ‘{}’ cannot be reached from start ‘{}’: {ends}; open a door or clear a way at least 30 cm wide.",
        cue.name, task.start.name
    )))
}

/// The highest surface at or under `from` within `radius` of a place, of nine points.
fn support(scene: &SceneIndex, xy: Vec2, from: f32, radius: f32) -> Option<f32> {
    let around = (0..8).map(|i| Vec2::from_angle(i as f32 * std::f32::consts::FRAC_PI_4) * radius);
    std::iter::once(Vec2::ZERO)
        .chain(around)
        .filter_map(|d| scene.floor_height_at(xy + d, from))
        .reduce(f32::max)
}

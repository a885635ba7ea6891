//! What can be known before optimizing: whether a task can be done at all, and if not, why, in words.

use glam::{Vec2, Vec3};

use super::SceneIndex;
use super::clear_path::ClearPath;
use super::levels::{floor_around, nowhere_to_stand, on_another_level};
use super::way::Way;
use crate::action::Approach;
use crate::cue::{ActionCue, BodyState, PassCue, Task};
use crate::error::{Error, Result};
use crate::math::planar::rotate;
use crate::motion::Posture;

/// The pelvis joint of a seated person is about 0.10 m over the seat; a cue farther than this over it floats, metres.
pub(super) const FLOATING: f32 = 0.35;
/// A cue this deep under a surface is in the cushion, not on it, metres.
const SUNK: f32 = 0.12;
/// Seats that a person sits down on, metres over the floor: from a low step to a bar stool.
pub(super) const SEAT: (f32, f32) = (0.20, 0.85);
/// Thighs need so much room before the pelvis, metres: half of a thigh and the shin before it.
const LEG_ROOM: f32 = 0.28;
/// Knees reach so far before the pelvis, metres; on a high seat, where they are spread at need, less far.
const KNEE_ROOM: f32 = 0.48;
const SPREAD_KNEE_ROOM: f32 = 0.40;
/// A seat from so high on is a high one, metres over the floor.
const HIGH_SEAT: f32 = 0.60;
/// A start may stand so far over or under its floor, metres.
pub(super) const START_TOLERANCE: f32 = 0.25;
/// Something on both sides so near, metres, means inside of it.
const INSIDE: f32 = 0.12;

/// Whether the person can get from the start to the cue and do there what it asks.
///
/// Errors: `Input` for a start or cue that is misplaced in itself, `Unreachable` where no clear way leads; the
/// sentence names it, the value, and what to do.
pub fn check_task(scene: &SceneIndex, task: &Task) -> Result<()> {
    way_of(scene, task).map(|_| ()).map_err(|misfit| misfit.error)
}

/// Why a task cannot be done, and where that shows, world, metres.
#[derive(Debug)]
pub(crate) struct Misfit {
    pub error: Error,
    /// The start, waypoint or cue that is misplaced; where no way leads, where the free floor ends.
    pub at: Vec3,
}

impl Misfit {
    fn at(at: Vec3) -> impl Fn(Error) -> Misfit {
        move |error| Misfit { error, at }
    }
}

/// The way from the start to the cue, where the task can be done.
pub(crate) fn way_of(scene: &SceneIndex, task: &Task) -> std::result::Result<Way, Misfit> {
    let cue = &task.cue;
    let of_cue = Misfit::at(cue.position);
    check_start(scene, task).map_err(Misfit::at(task.start.position))?;
    check_feet(cue).map_err(&of_cue)?;
    for pass in &task.passes {
        check_pass(scene, &task.start.name, pass).map_err(Misfit::at(pass.position))?;
    }
    let spec = cue.action_type.spec();
    if !spec.has_cue {
        return Err(of_cue(Error::input(format!(
            "Cue ‘{}’ asks for no action that a motion can end with: {} is not one.",
            cue.name, spec.name
        ))));
    }
    let checked = match spec.approach {
        Approach::Seat => check_seat(scene, cue),
        Approach::Place => check_place(scene, cue, spec.name),
    };
    let checked = checked.map_err(&of_cue).and_then(|()| check_ways(scene, task));
    // The height of a place to stand says nothing, so that a way may lead under it or over it.
    let may_be_elsewhere = checked.is_err() || spec.approach == Approach::Place;
    match on_another_level(scene, cue, spec.name, &task.start.name).filter(|_| may_be_elsewhere) {
        Some(error) => Err(of_cue(error)),
        None => checked,
    }
}

/// Whether a person can walk over a waypoint.
fn check_pass(scene: &SceneIndex, start: &str, pass: &PassCue) -> Result<()> {
    let place = pass.as_stop();
    let checked = check_place(scene, &place, PASS);
    on_another_level(scene, &place, PASS, start).map_or(checked, Err)
}

/// A waypoint's kind in sentences.
const PASS: &str = "Pass";

fn check_start(scene: &SceneIndex, task: &Task) -> Result<()> {
    let (start, place) = (&task.start, task.start.position);
    let name = &start.name;
    if !(place.is_finite() && start.yaw.is_finite()) {
        return Err(Error::input(format!("Start ‘{name}’ has a place or a facing that is not a number.")));
    }
    if let Some(body) = &start.body {
        return check_body(name, body);
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
    if let Some(floor) = floor_under_a_perch(scene, xy) {
        return Err(Error::input(format!(
            "Start ‘{name}’ stands on something {:.2} m over the floor (z = {floor:.2} m), with no room to walk; move it down.",
            scene.floor_height() - floor
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

/// Who is in the middle of a motion is wherever that led.
fn check_body(name: &str, body: &BodyState) -> Result<()> {
    let is_posture = |p: &Posture| {
        p.root_position.is_finite() && p.rotations.iter().all(|q| (q.length_squared() - 1.0).abs() < 1e-2)
    };
    if body.postures.iter().all(is_posture) && body.contact.iter().all(|c| (0.0..=1.0).contains(c)) {
        return Ok(());
    }
    Err(Error::input(format!("Start ‘{name}’ goes on from a posture whose places or rotations are none.")))
}

/// World z of the floor about a start that stands on something too small to walk on, no higher than a person.
fn floor_under_a_perch(scene: &SceneIndex, xy: Vec2) -> Option<f32> {
    let here = scene.floor_height();
    let step = scene.settings().floor_tolerance;
    if scene.occupancy().clearance(xy) >= START_ROOM {
        return None;
    }
    floor_around(scene, xy, here + 0.05).filter(|floor| (step..START_PERCH).contains(&(here - floor)))
}

/// What a start may have been put on by mistake is no higher, metres.
const START_PERCH: f32 = 1.7;
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

fn check_place(scene: &SceneIndex, cue: &ActionCue, kind: &str) -> Result<()> {
    check_cue_place(scene, cue, kind)?;
    let xy = cue.position.truncate();
    if scene.occupancy().is_occupied(xy) {
        return Err(Error::input(format!(
            "{kind} cue ‘{}’ stands inside furniture or a wall; move it to a free place on the floor.",
            cue.name
        )));
    }
    if !scene.occupancy().is_walkable(xy) {
        return Err(Error::input(format!(
            "{kind} cue ‘{}’ has no floor under it; move it onto the floor.",
            cue.name
        )));
    }
    let room = scene.occupancy().clearance(xy);
    if room < scene.settings().blocked_clearance {
        return Err(Error::input(format!(
            "{kind} cue ‘{}’ has only {:.0} cm of room around it; a person needs {:.0} cm.",
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
    if let Some(sentence) = inside(scene, cue) {
        return Err(Error::input(sentence));
    }
    let Some(seat) = seat_under(scene, cue) else {
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

/// World z of the seat under the buttocks: the highest of a few places, as seats have slats, gaps and rims.
pub(super) fn seat_under(scene: &SceneIndex, cue: &ActionCue) -> Option<f32> {
    let (xy, from) = (cue.position.truncate(), cue.position.z + SUNK);
    [0.10, 0.18].into_iter().filter_map(|radius| support(scene, xy, from, radius)).reduce(f32::max)
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
pub(super) fn inside(scene: &SceneIndex, cue: &ActionCue) -> Option<String> {
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

/// Whether a way leads to the cue, by its waypoints in their order.
fn check_ways(scene: &SceneIndex, task: &Task) -> std::result::Result<Way, Misfit> {
    let way = Way::to_cue(scene, &task.passes, &task.cue);
    if way.last().approach_points().is_empty() {
        return Err(Misfit::at(task.cue.position)(nowhere_to_stand(scene, &task.cue)));
    }
    let mut from = (way.departure(scene, &task.start), format!("start ‘{}’", task.start.name));
    for (leg, pass) in task.passes.iter().enumerate() {
        check_way(scene, way.leg(leg), from, PASS, &pass.name)?;
        from = (pass.place(), format!("pass cue ‘{}’", pass.name));
    }
    check_way(scene, way.last(), from, task.cue.action_type.spec().name, &task.cue.name)?;
    Ok(way)
}

/// `from`: a place, and whose it is; `ways` lead to a cue of that kind and name.
fn check_way(
    scene: &SceneIndex,
    ways: &ClearPath,
    (from, whose): (Vec2, String),
    kind: &str,
    name: &str,
) -> std::result::Result<(), Misfit> {
    if ways.distance(from).is_finite() {
        return Ok(());
    }
    // Which of the two is shut in: look from the start at how near a clear way comes.
    let from_start = ClearPath::to_place(scene, from);
    let goal = ways.goal();
    let grid = scene.occupancy();
    let nearest = (0..grid.raster.len())
        .filter(|&i| grid.clearance_cells()[i] >= scene.settings().blocked_clearance)
        .map(|i| grid.raster.center(i))
        .filter(|&p| from_start.distance(p).is_finite())
        .min_by(|a, b| a.distance(goal).total_cmp(&b.distance(goal)));
    let ends = match nearest {
        Some(place) => {
            let away = place.distance(goal);
            format!("the floor that is free for a person ends {away:.2} m from the cue")
        }
        None => format!("{whose} has no room around it"),
    };
    let at = nearest.unwrap_or(from).extend(scene.floor_height());
    Err(Misfit::at(at)(Error::Unreachable(format!(
        "{kind} cue ‘{name}’ cannot be reached from {whose}: {ends}; open a door or clear a way at least 30 cm wide."
    ))))
}

/// The highest surface at or under `from` within `radius` of a place, of nine points.
pub(super) fn support(scene: &SceneIndex, xy: Vec2, from: f32, radius: f32) -> Option<f32> {
    let around = (0..8).map(|i| Vec2::from_angle(i as f32 * std::f32::consts::FRAC_PI_4) * radius);
    std::iter::once(Vec2::ZERO)
        .chain(around)
        .filter_map(|d| scene.floor_height_at(xy + d, from))
        .reduce(f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::ActionType;
    use crate::test_world::{Boxes, World, room, sit_cue, stop_cue};
    use std::f32::consts::FRAC_PI_2;

    /// What is said of a task in a room; nothing where it can be done.
    fn said(scene: &SceneIndex, task: &Task) -> String {
        check_task(scene, task).map_or_else(|error| error.to_string(), |()| String::new())
    }

    /// To sit on a box of that height, from the origin, facing -Y; and to stop there.
    fn to_sit(height: f32) -> (SceneIndex, Task) {
        let mut world = World::stool();
        world.task.cue.position = Vec3::new(0.0, 0.32, height + 0.1);
        world.task.start.position = Vec3::new(0.0, -1.0, 0.0);
        (seat(height, &[]), world.task)
    }

    fn seat(height: f32, more: &Boxes) -> SceneIndex {
        let mut boxes = vec![([-0.3, 0.1, 0.0], [0.3, 0.6, height])];
        boxes.extend_from_slice(more);
        room(&boxes)
    }

    fn to_stop(place: Vec2) -> Task {
        Task { cue: stop_cue(place, 0.0), ..World::stop_ahead(1.0).task }
    }

    #[track_caller]
    fn says(scene: &SceneIndex, task: &Task, part: &str) {
        let said = said(scene, task);
        assert!(
            if part.is_empty() { said.is_empty() } else { said.contains(part) },
            "“{said}”, not “{part}”"
        );
    }

    #[test]
    fn a_waypoint_is_a_place_that_one_can_walk_over() {
        // A box, a platform, and a wall that shuts off a corner.
        let scene = room(&[
            ([0.5, -1.5, 0.0], [1.1, -0.9, 0.5]),
            ([1.0, 1.0, 0.0], [2.5, 2.5, 0.40]),
            ([-3.0, 1.0, 0.0], [-1.0, 1.1, 2.0]),
            ([-1.1, 1.0, 0.0], [-1.0, 3.0, 2.0]),
        ]);
        let by =
            |name: &str, x: f32, y: f32, z: f32| PassCue { name: name.into(), position: Vec3::new(x, y, z) };
        let with = |passes: &[PassCue]| Task { passes: passes.to_vec(), ..to_stop(Vec2::new(0.0, -2.0)) };
        let fine = by("Fine", -1.0, -1.0, 0.0);
        says(&scene, &with(std::slice::from_ref(&fine)), "");
        says(
            &scene,
            &with(&[fine.clone(), by("In", 0.8, -1.2, 0.0)]),
            "Pass cue ‘In’ stands inside furniture",
        );
        says(&scene, &with(&[by("Out", 9.0, 0.0, 0.0)]), "Pass cue ‘Out’ lies outside the scene");
        says(&scene, &with(&[by("Under", 0.0, 0.5, -1.0)]), "Pass cue ‘Under’ lies 1.00 m below the floor");
        says(&scene, &with(&[by("Up", 1.8, 1.8, 0.4)]), "Pass cue ‘Up’ stands on another level than start");
        says(&scene, &with(&[by("None", f32::NAN, 0.0, 0.0)]), "Pass cue ‘None’ has a place");
        says(&scene, &with(&[by("By", 0.5 - 0.05, -1.2, 0.0)]), "Pass cue ‘By’ has only");
        let shut = by("Shut", -2.0, 2.0, 0.0);
        let said = said(&scene, &with(&[fine, shut]));
        assert!(said.contains("Pass cue ‘Shut’ cannot be reached from pass cue ‘Fine’"), "{said}");
    }

    #[test]
    fn a_start_stands_on_its_floor() {
        let scene = room(&[]);
        let at = |position: Vec3| {
            let mut task = to_stop(Vec2::new(1.0, 1.0));
            task.start.position = position;
            said(&scene, &task)
        };
        for (z, part) in [(0.24, ""), (0.26, "0.26 m over"), (-0.24, "no floor"), (0.0, "")] {
            let said = at(Vec3::Z * z);
            // Under its floor there is none under it, but for what a foot's tolerance sees.
            assert!(
                if part.is_empty() { said.is_empty() } else { said.contains(part) || z < 0.0 },
                "{z}: {said}"
            );
        }
        assert!(at(Vec3::Z * -0.4).contains("no floor under it"), "{}", at(Vec3::Z * -0.4));
        let nearly = [Vec3::new(2.79, 0.0, 0.0), Vec3::new(-2.79, 0.0, 0.0), Vec3::new(0.0, 2.79, 0.0)];
        assert!(nearly.iter().all(|p| at(*p).is_empty()));
        for place in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y] {
            assert!(at(place * 3.5).contains("outside the scene, 0.50 m"), "{}", at(place * 3.5));
        }
        assert!(at(Vec3::NAN).contains("not a number"));
        let mut task = to_stop(Vec2::ONE);
        task.start.yaw = f32::NAN;
        says(&scene, &task, "not a number");
    }

    #[test]
    fn a_start_on_another_level_is_sent_to_the_floor() {
        // A platform that one can stand on.
        let scene = room(&[([1.0, 1.0, 0.0], [2.5, 2.5, 0.40])]);
        let mut task = to_stop(Vec2::new(-1.0, -1.0));
        task.start.position = Vec3::new(1.7, 1.7, 0.40);
        says(&scene, &task, "0.40 m over the scene's walkable floor");
    }

    #[test]
    fn a_start_has_room_for_a_body() {
        // A wall at x = 1, which the grid has to 5 cm.
        let scene = room(&[([1.02, -3.0, 0.0], [1.08, 3.0, 2.0])]);
        let at = |x: f32| {
            let mut task = to_stop(Vec2::new(-1.0, 1.0));
            task.start.position.x = x;
            said(&scene, &task)
        };
        assert!(at(0.78).is_empty(), "{}", at(0.78));
        let near = at(0.85);
        assert!(near.contains("cm from furniture or a wall") && near.contains("‘Here’"), "{near}");
        let words: Vec<f32> = near.split([' ', ';']).filter_map(|w| w.parse().ok()).collect();
        // So far from it now, and so far away to be: 18 cm and 5 more.
        assert!((words[0] - 13.0).abs() < 5.0 && (words[0] + words[1] - 23.0).abs() < 1.1, "{near}");
        assert!(at(1.05).contains("inside furniture"));
    }

    #[test]
    fn a_seat_has_a_height_that_a_person_sits_on() {
        for (height, part) in [
            (0.22, ""),
            (0.45, ""),
            (0.83, ""),
            (0.18, "too low: its seat is 0.18 m"),
            (0.87, "too high: its seat is 0.87 m"),
        ] {
            let (scene, task) = to_sit(height);
            says(&scene, &task, part);
        }
    }

    #[test]
    fn a_pelvis_rests_on_its_seat() {
        let (scene, task) = to_sit(0.45);
        let over = |z: f32| {
            let mut task = task.clone();
            task.cue.position.z = 0.45 + z;
            said(&scene, &task)
        };
        assert!(over(0.34).is_empty() && !over(-0.11).contains("inside"), "{} {}", over(0.34), over(-0.11));
        assert!(over(0.37).contains("floats: the nearest surface is 0.37 m"), "{}", over(0.37));
        assert!(over(-0.14).contains("inside furniture, 0.14 m under"), "{}", over(-0.14));
        assert!(over(-0.5).contains("0.05 m below the floor"), "{}", over(-0.5));
        // The highest of a few places counts: a rim 15 cm from the middle.
        let rim = room(&[([-0.3, 0.12, 0.0], [0.3, 0.17, 0.45])]);
        let mut task = task;
        task.cue.position = Vec3::new(0.0, 0.32, 0.55);
        says(&rim, &task, "");
        task.cue.position.y = 0.42;
        says(&rim, &task, "floats");
        // Over nothing at all.
        let hole = crate::test_world::scene(&[
            ([-3.0, -3.0, -0.1], [3.0, 0.0, 0.0]),
            ([-3.0, 2.0, -0.1], [3.0, 3.0, 0.0]),
        ]);
        task.cue.position = Vec3::new(0.0, 1.0, 0.55);
        says(&hole, &task, "there is no surface below it");
    }

    #[test]
    fn a_seat_has_room_for_legs_and_head() {
        let (_, task) = to_sit(0.45);
        // Something before the pelvis at its height: 0.32 m - y.
        let bar = |y: f32| seat(0.45, &[([-0.5, y - 0.05, 0.5], [0.5, y, 0.6])]);
        says(&bar(0.02), &task, "");
        says(&bar(0.06), &task, "no room for the legs: something is 0.26 m");
        // On one side alone is enough, and a hand's width beside is not.
        let beside = |x: f32| seat(0.45, &[([x - 0.01, 0.1, 0.5], [x + 0.01, 0.15, 0.6])]);
        says(&beside(0.1), &task, "no room for the legs: something is 0.17 m");
        says(&beside(-0.1), &task, "no room for the legs");
        says(&beside(0.2), &task, "");
        // Over it: a table, or a box around.
        let over = |z: f32| seat(0.45, &[([-0.5, 0.2, 0.55 + z], [0.5, 0.6, 0.6 + z])]);
        says(&over(0.73), &task, "");
        says(&over(0.66), &task, "no room above it: something is 0.66 m");
        says(&over(0.38), &task, "no room above it: something is 0.38 m");
        says(&over(0.30), &task, "inside furniture, 0.30 m under");
    }

    #[test]
    fn a_seat_is_not_inside_a_wall() {
        let (_, task) = to_sit(0.45);
        // Walls on both sides of the chest, at its height, so near.
        let across = |d: f32| {
            seat(0.45, &[([-d - 0.02, 0.2, 0.8], [-d, 0.5, 1.0]), ([d, 0.2, 0.8], [d + 0.02, 0.5, 1.0])])
        };
        says(&across(0.11), &task, "inside a wall");
        says(&across(0.13), &task, "");
        // On one side alone, whichever, it is none.
        for (from, to) in [(-0.13, -0.11), (0.11, 0.13)] {
            says(&seat(0.45, &[([from, 0.2, 0.8], [to, 0.5, 1.0])]), &task, "");
        }
        let along = |d: f32, behind: f32| {
            seat(
                0.45,
                &[
                    ([-0.2, 0.32 - d - 0.02, 0.8], [0.2, 0.32 - d, 1.0]),
                    ([-0.2, 0.32 + behind, 0.8], [0.2, 0.34 + behind, 1.0]),
                ],
            )
        };
        says(&along(0.11, 0.11), &task, "inside a wall");
        // A backrest close behind is none, nor is what is close before alone.
        says(&along(0.4, 0.11), &task, "");
        says(&along(0.11, 0.4), &task, "");
    }

    #[test]
    fn a_place_to_stop_is_free_floor_with_room() {
        let scene = room(&[([1.02, -3.0, 0.0], [1.08, 3.0, 2.0])]);
        says(&scene, &to_stop(Vec2::new(0.80, 1.0)), "");
        let near = said(&scene, &to_stop(Vec2::new(0.92, 1.0)));
        assert!(near.contains("cm of room around it; a person needs 12 cm"), "{near}");
        says(&scene, &to_stop(Vec2::new(1.05, 1.0)), "inside furniture or a wall");
        let mut low = to_stop(Vec2::new(-1.0, 1.0));
        low.cue.position.z = -0.24;
        says(&scene, &low, "");
        low.cue.position.z = -0.26;
        says(&scene, &low, "0.26 m below the floor");
        low.cue.position = Vec3::new(-1.0, 3.4, 0.0);
        says(&scene, &low, "Stop cue ‘There’ lies outside the scene, 0.40 m");
        low.cue.position = Vec3::new(f32::INFINITY, 0.0, 0.0);
        says(&scene, &low, "Stop cue ‘There’ has a place or a facing that is not a number");
        low.cue.position = Vec3::ZERO;
        low.cue.yaw = f32::NAN;
        says(&scene, &low, "not a number");
        let hole = crate::test_world::scene(&[
            ([-3.0, -3.0, -0.1], [3.0, 0.5, 0.0]),
            ([-3.0, 1.6, -0.1], [3.0, 3.0, 0.0]),
        ]);
        says(&hole, &to_stop(Vec2::new(0.0, 1.05)), "no floor under it");
    }

    #[test]
    fn a_cue_is_a_cue() {
        let mut task = to_stop(Vec2::ONE);
        task.cue.action_type = ActionType::Walk;
        says(&room(&[]), &task, "asks for no action that a motion can end with: Walk");
        let mut task = to_stop(Vec2::ONE);
        task.cue.feet[0] = Some(Vec3::new(1.0 - 1.19, 1.0, 0.0));
        says(&room(&[]), &task, "");
        task.cue.feet[0] = Some(Vec3::new(1.0 - 1.21, 1.0, 0.0));
        says(&room(&[]), &task, "left foot of cue ‘There’ is 1.21 m");
        task.cue.feet = [None, Some(Vec3::NAN)];
        says(&room(&[]), &task, "right foot");
    }

    #[test]
    fn a_way_that_is_shut_is_said_with_where_it_ends() {
        // A wall between the two, from side to side.
        let scene = room(&[([-3.0, 0.9, 0.0], [3.0, 1.0, 2.0])]);
        let error = check_task(&scene, &to_stop(Vec2::new(0.0, 2.0))).unwrap_err();
        let sentence = error.to_string();
        assert!(matches!(error, Error::Unreachable(_)));
        assert!(sentence.contains("Stop cue ‘There’ cannot be reached from start ‘Here’"), "{sentence}");
        // The free floor ends 12 cm before the wall.
        let ends = ["ends 1.20 m", "ends 1.2", "ends 1.25 m"];
        assert!(ends.iter().any(|e| sentence.contains(e)), "{sentence}");
        says(&scene, &to_stop(Vec2::new(0.0, -2.0)), "");
        // A seat with no free floor before it.
        let (_, task) = to_sit(0.45);
        let shut = seat(
            0.45,
            &[
                ([-1.0, -0.75, 0.0], [1.0, -0.02, 0.4]),
                ([-1.0, -0.75, 0.0], [-0.31, 1.2, 0.4]),
                ([0.31, -0.75, 0.0], [1.0, 1.2, 0.4]),
            ],
        );
        says(&shut, &task, "no free floor to stand on within 0.75 m");
    }

    #[test]
    fn knees_have_less_room_on_a_high_seat() {
        let mut cue = sit_cue();
        cue.position = Vec3::new(0.0, 0.32, 0.0);
        let near = |height: f32, ahead: f32| {
            let mut cue = cue.clone();
            cue.position.z = height + 0.1;
            let y = 0.32 - ahead;
            short_of_knee_room(&seat(height, &[([-0.5, y - 0.1, 0.3], [0.5, y, 1.1])]), &cue)
        };
        for (height, needed) in [(0.45, 0.48), (0.59, 0.48), (0.61, 0.40), (0.75, 0.40)] {
            assert_eq!(near(height, needed + 0.01), None);
            let (ahead, needs) = near(height, needed - 0.01).expect("too near");
            assert!((ahead - needed + 0.01).abs() < 1e-3 && needs == needed, "{ahead} {needs}");
        }
        assert_eq!(short_of_knee_room(&room(&[]), &stop_cue(Vec2::ZERO, 0.0)), None);
        // As the cue faces.
        let mut turned = cue;
        turned.position.z = 0.55;
        turned.yaw = FRAC_PI_2;
        let side = seat(0.45, &[([0.35, 0.0, 0.3], [0.5, 0.6, 1.1])]);
        assert!((short_of_knee_room(&side, &turned).expect("too near").0 - 0.35).abs() < 1e-3);
    }
}

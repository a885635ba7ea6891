//! Where start and cue stand on floors of their own, and where the edge of a wide seat is.

use std::f32::consts::{PI, TAU};

use glam::Vec2;

use super::SceneIndex;
use super::check::{FLOATING, SEAT, START_TOLERANCE, inside, seat_under, support};
use super::clear_path::approach_points;
use crate::action::Approach;
use crate::cue::ActionCue;
use crate::error::Error;
use crate::math::rotation::wrap_angle;

/// The floor about a seat is looked for so far from the pelvis, metres, in `AROUND` directions.
const RINGS: [f32; 3] = [0.5, 0.65, 0.8];
const AROUND: usize = 16;
/// Surfaces that differ by no more are one floor, metres.
const ONE_FLOOR: f32 = 0.03;
/// What lies so much lower than a seat's surface is no part of it, metres.
const UNDER_SEAT: f32 = 0.15;
/// How far over a wide seat its edge is looked for, metres, and in which steps.
const WIDEST_SEAT: f32 = 3.0;
const EDGE_STEP: f32 = 0.025;
/// The pelvis of who sits on an edge is so far behind it, metres.
const BEHIND_EDGE: f32 = 0.22;

/// What to say of a cue of that kind that stands on another floor than the start does; `None` where it does not, or where it stands on
/// nothing that could be told.
pub(super) fn on_another_level(
    scene: &SceneIndex,
    cue: &ActionCue,
    kind: &str,
    start: &str,
) -> Option<Error> {
    let there = match cue.action_type.spec().approach {
        Approach::Seat => {
            let seat = seat_under(scene, cue).filter(|seat| cue.position.z - seat <= FLOATING)?;
            let floor = floor_around(scene, cue.position.truncate(), seat - UNDER_SEAT)?;
            (SEAT.0..=SEAT.1).contains(&(seat - floor)).then_some(floor)?
        }
        Approach::Place => {
            let place = cue.position;
            support(scene, place.truncate(), place.z + START_TOLERANCE, 0.05)
                .filter(|z| (place.z - z).abs() <= START_TOLERANCE)?
        }
    };
    // A motion has one floor: feet would stand in a step, or over it, by all of its height.
    let (here, step) = (scene.floor_height(), scene.settings().carpet_height);
    ((there - here).abs() > step).then(|| {
        let (there, here) = (hundredths(there), hundredths(here));
        Error::Unreachable(format!(
            "{kind} cue ‘{}’ stands on another level than start ‘{start}’: the floor there is at z = {there:.2} m, that of the start at \
             z = {here:.2} m, and the person takes no stairs and no step higher than {:.0} cm; move one of the two to the other's \
             level.",
            cue.name,
            100.0 * step
        ))
    })
}

/// As a sentence tells a height: nothing is "-0.00".
fn hundredths(metres: f32) -> f32 {
    (100.0 * metres).round() / 100.0 + 0.0
}

/// World z of the surface that most of the places about `xy` have under `from`.
pub(super) fn floor_around(scene: &SceneIndex, xy: Vec2, from: f32) -> Option<f32> {
    let directions = (0..AROUND).map(|i| Vec2::from_angle(i as f32 * TAU / AROUND as f32));
    let mut heights: Vec<f32> = directions
        .flat_map(|d| RINGS.map(|ring| xy + ring * d))
        .filter_map(|place| scene.floor_height_at(place, from))
        .collect();
    heights.sort_by(f32::total_cmp);
    // The highest of equals: what lies under a floor is no floor here.
    let share = |z: f32| heights.iter().filter(|&&other| (other - z).abs() <= ONE_FLOOR).count();
    heights.iter().copied().max_by_key(|&z| share(z))
}

/// The nearest place on the same seat from which one can sit down, and the facing there, radians: for a cue in the middle of
/// a mattress or a wide sill. `None` where there is none.
fn near_edge(scene: &SceneIndex, cue: &ActionCue) -> Option<ActionCue> {
    let seat = seat_under(scene, cue)?;
    let goal = cue.position.truncate();
    let on_seat =
        |xy: Vec2| scene.floor_height_at(xy, cue.position.z).is_some_and(|z| (z - seat).abs() <= UNDER_SEAT);
    let steps = (WIDEST_SEAT / EDGE_STEP) as usize;
    (0..36)
        .filter_map(|i| {
            let angle = wrap_angle(i as f32 * TAU / 36.0);
            let direction = Vec2::from_angle(cue.planar().heading() + angle);
            let edge = (1..=steps).map(|i| i as f32 * EDGE_STEP).find(|&r| !on_seat(goal + r * direction))?;
            let moved = edge - BEHIND_EDGE;
            let place = goal + moved * direction;
            let there = ActionCue {
                position: place.extend(cue.position.z),
                yaw: wrap_angle(cue.yaw + angle),
                ..cue.clone()
            };
            let serves =
                moved > 0.0 && inside(scene, &there).is_none() && !approach_points(scene, &there).is_empty();
            // Rather a little farther than with the back to where the cue faces.
            serves.then_some((moved * (1.0 + angle.abs() / PI), there))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, there)| there)
}

/// What is said of a seat before which there is nowhere to stand, and of its nearest edge where there is one.
pub(super) fn nowhere_to_stand(scene: &SceneIndex, cue: &ActionCue) -> Error {
    let said = format!(
        "Sit cue ‘{}’ cannot be reached: there is no free floor to stand on within 0.75 m in front of it.",
        cue.name
    );
    let Some(edge) = near_edge(scene, cue) else { return Error::Unreachable(said) };
    let turn = wrap_angle(edge.yaw - cue.yaw).to_degrees();
    let turned = if turn.abs() < 1.0 {
        String::new()
    } else {
        format!(", turned {:.0}° to the {}", turn.abs(), if turn > 0.0 { "left" } else { "right" })
    };
    let sentence = format!(
        "{said} The nearest edge to sit on is {:.2} m away: move it to x = {:.2} m, y = {:.2} m{turned}.",
        edge.position.distance(cue.position),
        edge.position.x,
        edge.position.y
    );
    Error::FarFromEdge { sentence, place: edge.position, yaw: edge.yaw }
}

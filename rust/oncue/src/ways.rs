//! The ways that people would walk, before anything is played: what the view draws while cues are placed.
//!
//! They are the clear paths that the controller follows and that [`crate::scene::check_task`] looks for, so that what is drawn is what is
//! tried: a motion leaves them only as far as steps and turns do.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::action::Approach;
use crate::cue::{Performance, Task};
use crate::error::Error;
use crate::hands::leaf::Phases;
use crate::perform::{check_steps, tasks_of};
use crate::progress::Progress;
use crate::scene::{ClearPath, Misfit, SceneIndex, Way, way_of};
use crate::timing::check_times;
use crate::together::check_people;

/// The ways of a shot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ways {
    /// One person's each, in the order of the performances.
    pub people: Vec<PersonWays>,
    /// What cannot be of the shot as a whole, though every way is clear: times that run backwards, two people in one place.
    pub problems: Vec<String>,
}

/// The ways of one person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PersonWays {
    /// The name of the person's start.
    pub start: String,
    /// From the start to the first cue, and from each cue to the next.
    pub steps: Vec<StepWay>,
}

/// The way to one cue, by its waypoints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepWay {
    /// The cue's name.
    pub cue: String,
    /// The way along the floor, world, metres, some centimetres from point to point: to the cue, or as far as it is free. Empty where
    /// none begins.
    pub path: Vec<Vec3>,
    /// How long that is, metres.
    pub length_m: f32,
    /// Where the way would fail: where the free floor ends, or the start, waypoint or cue that cannot be; none where all is well.
    pub fails_at: Option<Vec3>,
    /// In words why it would fail; none where all is well.
    pub problem: Option<String>,
}

/// The ways of people among whose cues no two need to be met yet: each way is looked for as if the cue before were met, so that one
/// that fails says nothing of those after it. Nothing is played; the scene is not changed.
pub fn ways(scene: &SceneIndex, performances: &[Performance]) -> Ways {
    let people: Vec<PersonWays> = performances
        .par_iter()
        .map(|performance| {
            // What cannot be opened is said where the whole is checked.
            let phases = Phases::of(scene, performance, &Progress::new()).ok();
            let stands = |step: usize| phases.as_ref().map_or(scene, |phases| phases.before(step));
            let tasks = tasks_of(performance);
            let ways = tasks.par_iter().enumerate().map(|(at, task)| step_way(stands(at), task));
            PersonWays { start: performance.start.name.clone(), steps: ways.collect() }
        })
        .collect();
    let is_clear = people.iter().flat_map(|person| &person.steps).all(|step| step.problem.is_none());
    let whole = || -> Result<(), Error> {
        performances.iter().try_for_each(check_steps)?;
        performances.iter().try_for_each(check_times)?;
        check_people(performances)
    };
    // Until then there is something else to do.
    let problems = if is_clear { whole().err().map(|error| error.to_string()) } else { None };
    Ways { people, problems: problems.into_iter().collect() }
}

fn step_way(scene: &SceneIndex, task: &Task) -> StepWay {
    let floor = task.start.position.z;
    let (points, misfit) = match way_of(scene, task) {
        Ok(way) => (to_the_cue(scene, task, &way), None),
        Err(misfit) => (as_far_as_it_is_free(scene, task, &misfit), Some(misfit)),
    };
    let path: Vec<Vec3> = points.into_iter().map(|point| point.extend(floor)).collect();
    StepWay {
        cue: task.cue.name.clone(),
        length_m: path.windows(2).map(|pair| pair[0].distance(pair[1])).sum(),
        path,
        fails_at: misfit.as_ref().map(|misfit| misfit.at),
        problem: misfit.map(|misfit| misfit.error.to_string()),
    }
}

/// From where the person is, off the seat if there, to the cue, onto the seat if it is one.
fn to_the_cue(scene: &SceneIndex, task: &Task, way: &Way) -> Vec<Vec2> {
    let mut points = begun(task, way.departure(scene, &task.start));
    points.extend(way.path(way.departure(scene, &task.start)).into_iter().skip(1));
    if task.cue.action_type.spec().approach == Approach::Seat {
        points.push(task.cue.position.truncate());
    }
    points
}

/// The same by the waypoints that can be reached, and from there to where the free floor ends.
fn as_far_as_it_is_free(scene: &SceneIndex, task: &Task, misfit: &Misfit) -> Vec<Vec2> {
    if !matches!(misfit.error, Error::Unreachable(_)) {
        return Vec::new();
    }
    let end = misfit.at.truncate();
    let way = Way::to_cue(scene, &task.passes, &task.cue);
    let from = way.departure(scene, &task.start);
    let mut points = begun(task, from);
    let (mut here, mut leg) = (from, 0);
    while let Some(waypoint) = way.waypoint(leg).filter(|_| way.leg(leg).distance(here).is_finite()) {
        points.extend(way.leg(leg).path(here).into_iter().skip(1));
        (here, leg) = (waypoint, leg + 1);
    }
    points.extend(ClearPath::to_place(scene, end).path(here).into_iter().skip(1));
    if points.len() > 1 { points } else { Vec::new() }
}

/// Where the person is, and where the way begins.
fn begun(task: &Task, from: Vec2) -> Vec<Vec2> {
    let here = task.start.position.truncate();
    if here == from { vec![here] } else { vec![here, from] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::{ActionCue, InitialState, PassCue, Step};
    use crate::test_world::{Boxes, room, sit_cue, stop_cue};

    fn step(cue: ActionCue, passes: &[[f32; 2]]) -> Step {
        let pass = |&[x, y]: &[f32; 2]| PassCue { name: "By".into(), position: Vec3::new(x, y, 0.0) };
        Step {
            passes: passes.iter().map(pass).collect(),
            cue,
            hold_seconds: None,
            at_seconds: None,
            manipulations: Vec::new(),
            things: Vec::new(),
        }
    }

    fn named(name: &str, cue: ActionCue) -> ActionCue {
        ActionCue { name: name.into(), ..cue }
    }

    fn from(x: f32, y: f32, steps: Vec<Step>) -> Performance {
        Performance {
            start: InitialState::standing("Start", Vec3::new(x, y, 0.0), 0.0),
            steps,
            things: Vec::new(),
            leaves: Vec::new(),
            looks: Vec::new(),
        }
    }

    /// A stool 45 cm high, and what else stands there.
    fn with_stool(more: &Boxes) -> SceneIndex {
        let mut boxes = vec![([-0.2, 0.1, 0.0], [0.2, 0.5, 0.45])];
        boxes.extend_from_slice(more);
        room(&boxes)
    }

    #[test]
    fn ways_lead_from_cue_to_cue() {
        let scene = with_stool(&[]);
        let seat = ActionCue { position: Vec3::new(0.0, 0.3, 0.55), ..sit_cue() };
        let stop = named("There", stop_cue(Vec2::new(2.0, -2.0), 0.0));
        let person = from(-1.0, -2.0, vec![step(seat, &[]), step(stop, &[[2.0, 0.0]])]);
        let found = ways(&scene, std::slice::from_ref(&person));
        assert_eq!(found.problems, Vec::<String>::new());
        let [sit, go] = &found.people[0].steps[..] else { panic!("two steps: {found:?}") };
        assert_eq!((sit.cue.as_str(), go.cue.as_str()), ("Stool", "There"));
        for (way, ends) in [(sit, [[-1.0, -2.0], [0.0, 0.3]]), (go, [[0.0, 0.3], [2.0, -2.0]])] {
            assert_eq!((&way.problem, way.fails_at), (&None, None));
            let [first, last] = ends.map(Vec2::from);
            assert!(way.path[0].truncate().distance(first) < 0.01, "{way:?}");
            assert!(way.path[way.path.len() - 1].truncate().distance(last) < 0.05, "{way:?}");
            assert!(way.path.iter().all(|point| point.z == 0.0));
        }
        // By the waypoint, and off the seat at its front, not over its back.
        assert!(go.path.iter().any(|point| point.truncate().distance(Vec2::new(2.0, 0.0)) < 0.06));
        assert!(go.path.iter().all(|point| point.y < 0.31));
        assert!((2.4..3.6).contains(&sit.length_m) && go.length_m > 3.9, "{} {}", sit.length_m, go.length_m);
    }

    #[test]
    fn a_way_that_fails_is_drawn_as_far_as_it_goes_and_those_after_it_too() {
        // A wall across the room, 20 cm thick, and a stool before it.
        let scene = with_stool(&[([-3.0, 1.4, 0.0], [3.0, 1.6, 2.0])]);
        let beyond = named("Beyond", stop_cue(Vec2::new(1.0, 2.3), 0.0));
        let inside = named("Inside", stop_cue(Vec2::new(0.0, 0.3), 0.0));
        let back = named("Back", stop_cue(Vec2::new(-2.0, 2.3), 0.0));
        let steps = vec![step(beyond, &[[2.0, -1.0]]), step(back, &[]), step(inside, &[])];
        let found = ways(&scene, &[from(-1.0, -2.0, steps)]);
        let [to_beyond, to_back, to_inside] = &found.people[0].steps[..] else { panic!("{found:?}") };
        let said = to_beyond.problem.as_ref().expect("a wall stands there");
        assert!(said.contains("‘Beyond’ cannot be reached from pass cue ‘By’"), "{said}");
        let at = to_beyond.fails_at.expect("where");
        // The free floor ends before the wall, beside the cue.
        assert!((0.9..1.4).contains(&at.y) && (at.x - 1.0).abs() < 0.2, "{at}");
        assert!(to_beyond.path.iter().any(|point| point.truncate().distance(Vec2::new(2.0, -1.0)) < 0.06));
        assert!(to_beyond.path[to_beyond.path.len() - 1].distance(at) < 0.06);
        // As if that cue had been met.
        assert_eq!(to_back.problem, None);
        assert!(to_back.length_m > 2.9);
        let said = to_inside.problem.as_ref().expect("it stands in the stool");
        assert!(said.contains("‘Inside’ stands inside furniture"), "{said}");
        assert_eq!((to_inside.fails_at, to_inside.path.len()), (Some(Vec3::new(0.0, 0.3, 0.0)), 0));
    }

    #[test]
    fn what_no_way_says_is_said_of_the_whole() {
        let scene = room(&[]);
        let timed = |seconds: f32, y: f32| Step {
            at_seconds: Some(seconds),
            ..step(named("There", stop_cue(Vec2::new(0.0, y), 0.0)), &[])
        };
        let late = from(0.0, 2.0, vec![timed(9.0, 1.0), timed(8.0, 0.0)]);
        assert!(ways(&scene, &[late]).problems[0].contains("no later than"));
        let one = |x: f32| from(x, 2.0, vec![step(stop_cue(Vec2::new(0.1 * x, 0.0), 0.0), &[])]);
        let found = ways(&scene, &[one(1.0), one(-1.0)]);
        assert!(found.problems[0].contains("two people need 45 cm"), "{found:?}");
        assert_eq!(found.people.len(), 2);
        // Nobody is told of the second thing first.
        let shut = from(1.0, 2.0, vec![step(stop_cue(Vec2::new(40.0, 0.0), 0.0), &[])]);
        let found = ways(&scene, &[shut, one(-1.0)]);
        assert_eq!(found.problems, Vec::<String>::new());
        assert!(found.people[0].steps[0].problem.is_some());
    }
}

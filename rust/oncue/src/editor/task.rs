//! The editor's part of the main job: the seat, what legs and trunk still run into, then the hands, and then arms.

use std::ops::Range;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::edit::ConstraintFigures;
use super::free_limbs::{Room, free_arms, free_body};
use super::manipulation::{Manipulated, ManipulationFigures, manipulate};
use super::seat::{Seat, SeatFigures, SeatFit, rests_from};
use crate::action::Fit;
use crate::cue::{Hand, Task};
use crate::error::{Error, Result};
use crate::figures::Surroundings;
use crate::manifold::Manifold;
use crate::motion::Motion;
use crate::progress::Progress;
use crate::settings::EditorSettings;

/// What E did to the controller's motion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TaskEditFigures {
    /// How the person sits after the seat fit; `None` for a stop, and where the fit was impossible.
    pub seat: Option<SeatFigures>,
    /// Where the manipulation cues came to lie in the motion.
    pub manipulations: Vec<ManipulationFigures>,
    /// What is left of every constraint.
    pub constraints: Vec<ConstraintFigures>,
    /// Frame on which the action is complete and everything stands where it should.
    pub complete_frame: usize,
    /// Seconds that the editor took.
    pub seconds: f32,
    /// In words what could not be done; the motion is then as it was.
    pub problems: Vec<String>,
}

impl TaskEditFigures {
    /// The frames in which hands follow the cues of `task`.
    pub(crate) fn carried(&self, task: &Task) -> Vec<(Hand, Range<usize>)> {
        let hand_of = |name: &str| task.manipulations.iter().find(|cue| cue.name == name).map(|cue| cue.hand);
        let frames = |m: &ManipulationFigures| m.first_frame..m.first_frame + m.frames;
        self.manipulations.iter().filter_map(|m| Some((hand_of(&m.name)?, frames(m)))).collect()
    }
}

/// E(M): fits `motion`, which is complete at frame `complete`, to its seat, carries the hands along their cues, and takes limbs
/// and trunk out of the body and out of what is `around`. What cannot be done leaves the motion as it was and is said in
/// `problems`. `manifold`: as in [`super::edit_motion`].
///
/// # Errors
/// `Cancelled`.
pub fn edit_for_task(
    motion: &mut Motion,
    task: &Task,
    complete: usize,
    around: &Surroundings,
    manifold: Option<&Manifold>,
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<TaskEditFigures> {
    let began = Instant::now();
    settings.validate()?;
    let floor = task.start.position.z;
    let mut out = TaskEditFigures { complete_frame: complete, ..Default::default() };
    if task.cue.action_type.spec().fit == Fit::Seat {
        let seat = Seat { motion, cue: &task.cue, complete, scene: Some(around.scene), floor, settings };
        match seat.fit(manifold, progress) {
            Ok(SeatFit { motion: fitted, figures, seat }) => {
                *motion = fitted;
                out.complete_frame = motion.len() - 1;
                out.constraints.extend(figures.constraints);
                out.seat = Some(seat);
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => out.problems.push(error.to_string()),
        }
    }
    let room = Room { around: Some(around), floor, continues: task.start.body.is_some() };
    let rests = rests_from(motion, out.complete_frame, around.seats.at_end().is_some());
    free_body(motion, room, rests, progress)?;
    if !task.manipulations.is_empty() {
        progress.stage("Carrying the hands");
        match manipulate(manifold, motion, &task.manipulations, Some(around.scene), floor, settings, progress)
        {
            Ok(Manipulated { motion: carried, cues, holds, figures }) => {
                *motion = carried;
                // What was held before the action is complete puts that off.
                for (frame, count) in holds {
                    out.complete_frame += if frame < out.complete_frame { count } else { 0 };
                }
                out.manipulations = cues;
                out.constraints.extend(figures.constraints);
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => out.problems.push(error.to_string()),
        }
    }
    let carried = out.carried(task);
    free_arms(motion, room, &carried, progress)?;
    out.seconds = began.elapsed().as_secs_f32();
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::ManipulationCue;
    use crate::test_world::{World, library, still};
    use glam::Vec3;

    fn edited(motion: &Motion, task: &Task, complete: usize, world: &World) -> (Motion, TaskEditFigures) {
        let mut out = motion.clone();
        let settings =
            EditorSettings { reach_seconds: 0.2, reach_seconds_per_metre: 0.0, ..Default::default() };
        let around = Surroundings::at_end(&world.scene, &task.cue);
        let figures = edit_for_task(&mut out, task, complete, &around, None, &settings, &Progress::new());
        (out, figures.expect("not cancelled"))
    }

    fn rail(first_frame: Option<usize>, place: Vec3) -> ManipulationCue {
        ManipulationCue { name: "Rail".into(), hand: Hand::Left, path: vec![place; 5], first_frame }
    }

    #[test]
    fn a_sit_is_fitted_and_then_its_hands_are_carried() {
        let mut world = World::stool();
        let mut motion = library().clips.remove(5).motion;
        motion.postures.truncate(60);
        motion.contacts.truncate(60);
        let (out, figures) = edited(&motion, &world.task, 50, &world);
        assert!(figures.problems.is_empty(), "{:?}", figures.problems);
        assert_eq!((figures.complete_frame, figures.constraints.len()), (out.len() - 1, 1));
        assert!(figures.seat.as_ref().is_some_and(|s| s.pelvis_cm < 0.5) && figures.manipulations.is_empty());
        // A hand's cue after the end lengthens the motion; the action is complete as early as before.
        let hand = out.postures[out.len() - 1].pose().position(crate::motion::Joint::LeftHand);
        world.task.manipulations = vec![rail(None, hand + Vec3::new(0.0, -0.1, 0.15))];
        let (longer, with_hand) = edited(&motion, &world.task, 50, &world);
        assert_eq!(with_hand.complete_frame, figures.complete_frame);
        assert!(longer.len() > out.len() + 5 && with_hand.problems.is_empty(), "{:?}", with_hand.problems);
        assert_eq!((with_hand.manipulations.len(), with_hand.constraints.len()), (1, 2));
        // What cannot be done is said, and leaves the motion as it was.
        world.task.manipulations = vec![rail(None, hand + Vec3::Z * 5.0)];
        let (same, refused) = edited(&motion, &world.task, 50, &world);
        assert!(same == out && refused.problems.len() == 1 && refused.problems[0].contains("‘Rail’"));
        world.task.manipulations.clear();
        world.task.cue.position.y += 3.0;
        let (same, refused) = edited(&motion, &world.task, 50, &world);
        assert!(same == motion && refused.seat.is_none() && refused.problems[0].contains("‘Stool’"));
        assert_eq!(refused.complete_frame, 50);
    }

    #[test]
    fn a_hold_before_the_action_is_complete_puts_that_off() {
        let mut world = World::stop_ahead(1.0);
        let motion = still(60);
        let hand = motion.postures[0].pose().position(crate::motion::Joint::LeftHand);
        for (first, complete) in [(39, 45), (40, 40)] {
            world.task.manipulations = vec![rail(Some(first), hand + Vec3::new(0.0, -0.1, 0.15))];
            let (out, figures) = edited(&motion, &world.task, 40, &world);
            assert_eq!(
                (figures.complete_frame, figures.problems.len()),
                (complete, 0),
                "{:?}",
                figures.problems
            );
            assert!(figures.seat.is_none() && out.len() >= 65);
        }
    }
}

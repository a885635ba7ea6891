//! The editor's part of the main job: the seat, then the hands.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::edit::ConstraintFigures;
use super::manipulation::{Manipulated, ManipulationFigures, manipulate};
use super::seat::{Seat, SeatFigures, SeatFit};
use crate::action::Fit;
use crate::cue::Task;
use crate::error::{Error, Result};
use crate::manifold::Manifold;
use crate::motion::Motion;
use crate::progress::Progress;
use crate::scene::SceneIndex;
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

/// E(M): fits `motion`, which is complete at frame `complete`, to its seat and carries the hands along their cues. What
/// cannot be done leaves the motion as it was and is said in `problems`. `manifold`: as in [`super::edit_motion`].
///
/// # Errors
/// `Cancelled`.
pub fn edit_for_task(
    motion: &mut Motion,
    task: &Task,
    complete: usize,
    scene: &SceneIndex,
    manifold: Option<&Manifold>,
    settings: &EditorSettings,
    progress: &Progress,
) -> Result<TaskEditFigures> {
    let began = Instant::now();
    settings.validate()?;
    let floor = task.start.position.z;
    let mut out = TaskEditFigures { complete_frame: complete, ..Default::default() };
    if task.cue.action_type.spec().fit == Fit::Seat {
        let seat = Seat { motion, cue: &task.cue, complete, scene: Some(scene), floor, settings };
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
    if !task.manipulations.is_empty() {
        progress.stage("Carrying the hands");
        match manipulate(manifold, motion, &task.manipulations, Some(scene), floor, settings, progress) {
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
    out.seconds = began.elapsed().as_secs_f32();
    Ok(out)
}

//! Cues that are to be met at a time: who would be there a little too soon walks slower, who would be much too soon stays longer where
//! the way begins, and who would be too late hurries, as far as people do.
//!
//! A step is played as it comes, and timed afterwards. So its time changes nothing of how it is played, nor of what follows: what was
//! made before serves for every time.

use crate::controller::EpisodeEnd;
use crate::cue::{InitialState, Moments, Performance, Step};
use crate::error::{Error, Result};
use crate::figures::Surroundings;
use crate::library::database::MotionDatabase;
use crate::life::{Pause, pause};
use crate::motion::{FRAME_RATE, Motion, Posture};
use crate::progress::Progress;
use crate::scene::SceneIndex;
use crate::settings::Settings;
use crate::synthesize::{Synthesis, liveliness};
use crate::synthesizer::{FASTEST_WALK, Leeway};

/// No cue is asked for later than this, seconds.
const LATEST: f32 = 3600.0;
/// Who is there within so many frames of the one that was asked for is there on time.
const PUNCTUAL: f32 = 1.0;
/// Between the seeds of a rest and of the wait after it.
const WAIT_SEED: u64 = 1 << 36;

/// A step as it is shown.
#[derive(Debug, Clone)]
pub(crate) struct Timed {
    pub motion: Motion,
    /// In its frames.
    pub moments: Moments,
    /// Frames that the person waits before setting off.
    pub waits: usize,
    /// Frames that the way takes more than by itself, or fewer.
    pub dawdles: isize,
}

/// All that a step is timed with.
pub(crate) struct Timing<'a> {
    pub scene: &'a SceneIndex,
    pub database: &'a MotionDatabase,
    pub settings: &'a Settings,
    pub floor: f32,
    pub progress: &'a Progress,
}

impl Timing<'_> {
    /// A step that begins on frame `first` of the performance, by `start`, so that its cue is met at its time as nearly as people
    /// manage.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(crate) fn timed(
        &self,
        made: &Synthesis,
        step: &Step,
        start: &InitialState,
        first: usize,
        seed: u64,
    ) -> Result<Timed> {
        let as_it_comes = Timed { motion: made.motion.clone(), moments: made.moments, waits: 0, dawdles: 0 };
        let Some(asked) = asked_frame(step).filter(|_| made.end == EpisodeEnd::Complete) else {
            return Ok(as_it_comes);
        };
        let by = asked as isize - (first + made.moments.complete) as isize;
        if by == 0 {
            return Ok(as_it_comes);
        }
        let complete = made.moments.complete;
        let leeway = if by > 0 {
            Leeway::leisurely(&made.motion, complete)
        } else {
            Leeway::hurried(&made.motion, complete, &self.database.turns)
        };
        let most = leeway.most();
        if by > most.max(0) {
            return self.waiting(as_it_comes, start, by as usize, seed);
        }
        let dawdles = if by > 0 { by } else { by.max(most) };
        if dawdles == 0 {
            return Ok(as_it_comes);
        }
        let paced = leeway.taken(&made.motion, dawdles);
        let moments = made.moments.each(|frame| paced.frame_of(frame));
        Ok(Timed { motion: paced.motion, moments, waits: 0, dawdles })
    }

    /// The same after so many frames of rest where it begins.
    fn waiting(&self, step: Timed, start: &InitialState, waits: usize, seed: u64) -> Result<Timed> {
        let before = start.body.as_ref().map(|body| body.postures[0]);
        let around = Surroundings::at_start(self.scene, start);
        let mut motion = self.rest(&step.motion, before, around, waits, seed ^ WAIT_SEED)?;
        motion.postures.extend(step.motion.postures);
        motion.contacts.extend(step.motion.contacts);
        Ok(Timed { motion, moments: step.moments.each(|frame| frame + waits), waits, dawdles: 0 })
    }

    /// So many frames of rest for the front of a motion, see [`pause`]; `before`: the posture one frame earlier.
    pub(crate) fn rest(
        &self,
        motion: &Motion,
        before: Option<Posture>,
        around: Surroundings,
        frames: usize,
        seed: u64,
    ) -> Result<Motion> {
        let (size, floor) = (liveliness(self.settings), self.floor);
        self.progress.stage("Bringing to life");
        pause(motion, &Pause { frames, before, size, seed, floor, around }, self.progress)
    }
}

/// The frame on which the cue of a step is to be met.
pub(crate) fn asked_frame(step: &Step) -> Option<usize> {
    step.at_seconds.map(|seconds| (seconds * FRAME_RATE).round() as usize)
}

/// How much later than asked for a step's cue is met, seconds; `moments` in frames of the performance.
pub(crate) fn late_seconds(step: &Step, moments: &Moments) -> Option<f32> {
    step.at_seconds.map(|asked| moments.complete as f32 / FRAME_RATE - asked)
}

/// What is said of each cue that is not met when it was to be; `moments`: of each step that was played, in frames of the performance.
pub(crate) fn unpunctual(performance: &Performance, moments: &[Moments]) -> Vec<String> {
    let said = |(step, moments): (&Step, &Moments)| {
        let late = late_seconds(step, moments).filter(|late| late.abs() * FRAME_RATE > PUNCTUAL + 0.01)?;
        let (name, asked, met) = (&step.cue.name, asked_frame(step)?, moments.complete);
        Some(if late > 0.0 {
            format!(
                "‘{name}’ is reached on frame {met}, {late:.1} s after frame {asked}, which was asked for: nobody hurries more than \
                 that; ask for it later, or have the person stay shorter before."
            )
        } else {
            format!(
                "‘{name}’ is reached on frame {met}, {:.1} s before frame {asked}, which was asked for.",
                -late
            )
        })
    };
    performance.steps.iter().zip(moments).filter_map(said).collect()
}

/// Whether the times of a performance can be kept at all: each after the one before, the stay there and the shortest way from there.
///
/// # Errors
/// `Input`, naming the cue.
pub(crate) fn check_times(performance: &Performance) -> Result<()> {
    // The last cue that has a time, when, and how far it is from there by way of what has none.
    let mut before: (&str, f32) = (&performance.start.name, 0.0);
    let (mut stays, mut way, mut here) = (0.0, 0.0, performance.start.position);
    for step in &performance.steps {
        let name = &step.cue.name;
        for place in step.passes.iter().map(|pass| pass.position).chain([step.cue.position]) {
            way += place.truncate().distance(here.truncate());
            here = place;
        }
        if let Some(at) = step.at_seconds {
            if !(0.0..=LATEST).contains(&at) {
                return Err(Error::input(format!(
                    "‘{name}’ is asked for after {at} seconds; give 0 to {LATEST:.0}."
                )));
            }
            let frame = |seconds: f32| (seconds * FRAME_RATE).round() as usize;
            let (other, then) = before;
            let (asked, last) = (frame(at), frame(then));
            if at <= then {
                return Err(Error::input(format!(
                    "‘{name}’ is asked for on frame {asked}, no later than ‘{other}’ before it on frame {last}; give it a later frame, or \
                     change their order."
                )));
            }
            let soonest = then + stays + way / FASTEST_WALK;
            if at < soonest {
                return Err(Error::input(format!(
                    "‘{name}’ cannot be reached by frame {asked}: with the way from ‘{other}’ ({way:.1} m) and the stays on it nobody is \
                     there before frame {}; ask for it later.",
                    (soonest * FRAME_RATE).ceil()
                )));
            }
            (before, stays, way) = ((name.as_str(), at), 0.0, 0.0);
        }
        stays += step.hold_seconds.unwrap_or(0.0);
    }
    Ok(())
}

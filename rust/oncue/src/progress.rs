//! Progress is pulled: the core writes atomics, whoever watches reads them ten times a second.
//! Cancel is a flag that the core looks at, and it comes back as [`Error::Cancelled`]. Each stage leaves a line in the log.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::error::{Error, Result};

/// Shared between the thread that works and the thread that watches.
#[derive(Debug, Default)]
pub struct Progress {
    cancelled: AtomicBool,
    /// Bits of an `f32` in 0..=1: how far the current stage is.
    fraction: AtomicU32,
    update: AtomicU32,
    /// Bits of an `f32`: mean reward per decision of the last update.
    reward: AtomicU32,
    /// Bits of an `f32` in 0..=1: share of the last update's episodes that met the cue.
    success_rate: AtomicU32,
    stage: Mutex<Stage>,
    /// Whose work it is, where it is several people's.
    person: Mutex<Option<String>>,
}

#[derive(Debug, Default)]
struct Stage {
    name: String,
    /// `None` once it has ended.
    begun: Option<Instant>,
}

/// What a watcher sees at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgressSnapshot {
    /// The stage, as the artist will read it.
    pub stage: String,
    /// How far the stage is, 0 to 1.
    pub fraction: f32,
    /// The last update.
    pub update: u32,
    /// Its mean reward of a decision.
    pub reward: f32,
    /// Share of its episodes that met the cue.
    pub success_rate: f32,
}

impl Progress {
    /// Nothing done yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Ask the work to stop; it returns [`Error::Cancelled`] within a tenth of a second.
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }

    /// Whether [`Progress::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Relaxed)
    }

    /// `Err(Cancelled)` once [`Progress::cancel`] was called. Call it at least every few milliseconds.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Whose stages those are that begin from now on; `None` where nobody's in particular.
    pub fn person(&self, name: Option<&str>) {
        *self.person.lock().unwrap_or_else(PoisonError::into_inner) = name.map(str::to_owned);
    }

    /// Begin a stage, named as the artist will read it ("Reading motion capture").
    pub fn stage(&self, name: &str) {
        self.end_stage();
        let person = self.person.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let name = person.map_or_else(|| name.to_owned(), |person| format!("{person}: {name}"));
        *self.lock_stage() = Stage { name: name.clone(), begun: Some(Instant::now()) };
        self.fraction(0.0);
        log::debug!(target: "oncue", "{name} …");
    }

    /// The stage has ended, and none follows it: logs what it took. Nothing where that was said before.
    pub fn end_stage(&self) {
        // The lock is given back before anything is logged: a watcher must not wait for a logger.
        let ended = {
            let mut stage = self.lock_stage();
            stage.begun.take().map(|begun| (stage.name.clone(), begun.elapsed()))
        };
        if let Some((name, took)) = ended {
            log::info!(target: "oncue", "{name}: {:.2} s", took.as_secs_f32());
        }
    }

    /// A stage is replaced whole, so one left by a panicking thread is still good.
    fn lock_stage(&self) -> MutexGuard<'_, Stage> {
        self.stage.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says how far the stage is, 0 to 1.
    pub fn fraction(&self, fraction: f32) {
        self.fraction.store(fraction.to_bits(), Relaxed);
    }

    /// Says what an update came to; see [`ProgressSnapshot`].
    pub fn update(&self, update: u32, reward: f32, success_rate: f32) {
        self.update.store(update, Relaxed);
        self.reward.store(reward.to_bits(), Relaxed);
        self.success_rate.store(success_rate.to_bits(), Relaxed);
    }

    /// What there is to see now.
    pub fn snapshot(&self) -> ProgressSnapshot {
        ProgressSnapshot {
            stage: self.lock_stage().name.clone(),
            fraction: f32::from_bits(self.fraction.load(Relaxed)),
            update: self.update.load(Relaxed),
            reward: f32::from_bits(self.reward.load(Relaxed)),
            success_rate: f32::from_bits(self.success_rate.load(Relaxed)),
        }
    }
}

/// Work that is no [`crate::Job`] ends with its progress.
impl Drop for Progress {
    fn drop(&mut self) {
        self.end_stage();
    }
}

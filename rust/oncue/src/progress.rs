//! Progress is pulled: the core writes atomics, whoever watches reads them ten times a second.
//! Cancel is a flag that the core looks at, and it comes back as [`Error::Cancelled`].

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

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
    stage: Mutex<String>,
}

/// What a watcher sees at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgressSnapshot {
    pub stage: String,
    pub fraction: f32,
    pub update: u32,
    pub reward: f32,
    pub success_rate: f32,
}

impl Progress {
    pub fn new() -> Self {
        Self::default()
    }

    /// Ask the work to stop; it returns [`Error::Cancelled`] within a tenth of a second.
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }

    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Relaxed)
    }

    /// `Err(Cancelled)` once [`Progress::cancel`] was called. Call it at least every few milliseconds.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Begin a stage, named as the artist will read it ("Reading motion capture").
    pub fn stage(&self, name: &str) {
        if let Ok(mut stage) = self.stage.lock() {
            name.clone_into(&mut stage);
        }
        self.fraction(0.0);
    }

    pub fn fraction(&self, fraction: f32) {
        self.fraction.store(fraction.to_bits(), Relaxed);
    }

    pub fn update(&self, update: u32, reward: f32, success_rate: f32) {
        self.update.store(update, Relaxed);
        self.reward.store(reward.to_bits(), Relaxed);
        self.success_rate.store(success_rate.to_bits(), Relaxed);
    }

    pub fn snapshot(&self) -> ProgressSnapshot {
        ProgressSnapshot {
            stage: self.stage.lock().map(|s| s.clone()).unwrap_or_default(),
            fraction: f32::from_bits(self.fraction.load(Relaxed)),
            update: self.update.load(Relaxed),
            reward: f32::from_bits(self.reward.load(Relaxed)),
            success_rate: f32::from_bits(self.success_rate.load(Relaxed)),
        }
    }
}

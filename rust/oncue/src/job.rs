//! A running computation as a handle: watch it, cancel it, wait for it, take what it gave.
//!
//! The work runs on a thread of its own. A panic in it ends in [`Failure::Panic`] and never leaves the thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::progress::{Progress, ProgressSnapshot};

/// Deep recursion over a scene's tree needs more than the 2 MiB of a default thread.
const STACK_BYTES: usize = 16 << 20;

/// Why a job gave no value.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// What a user can act on.
    #[error(transparent)]
    Error(#[from] Error),
    /// A bug in the work; the panic's own message.
    #[error("Oncue ran into a bug of its own: {0}")]
    Panic(String),
}

/// Runs `work`, and turns a panic into [`Failure::Panic`].
pub fn catch<T>(work: impl FnOnce() -> Result<T>) -> std::result::Result<T, Failure> {
    // Unwind safety: after a panic nothing of the work is looked at again but the atomics of `Progress`.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(outcome) => outcome.map_err(Failure::Error),
        Err(payload) => Err(Failure::Panic(
            payload
                .downcast_ref::<&str>()
                .map(|message| (*message).to_owned())
                .or_else(|| payload.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "a panic without a message".to_owned()),
        )),
    }
}

fn log_failure<T>(result: &std::result::Result<T, Failure>) {
    match result {
        Ok(_) => {}
        Err(Failure::Error(Error::Cancelled)) => log::info!(target: "oncue", "{}", Error::Cancelled),
        Err(Failure::Error(error)) => log::warn!(target: "oncue", "{error}"),
        Err(failure @ Failure::Panic(_)) => log::error!(target: "oncue", "{failure}"),
    }
}

/// Work on a thread of its own. Dropping the handle cancels the work and does not wait for it.
#[derive(Debug)]
pub struct Job<T> {
    progress: Arc<Progress>,
    outcome: Arc<Outcome<T>>,
}

#[derive(Debug)]
struct Outcome<T> {
    state: Mutex<State<T>>,
    finished: Condvar,
}

#[derive(Debug)]
enum State<T> {
    Running,
    Done(std::result::Result<T, Failure>),
    Taken,
}

impl<T: Send + 'static> Job<T> {
    /// Starts `work`. [`Error::Io`] where the system gives no thread.
    pub fn start(work: impl FnOnce(&Progress) -> Result<T> + Send + 'static) -> Result<Self> {
        let progress = Arc::new(Progress::new());
        let outcome = Arc::new(Outcome { state: Mutex::new(State::Running), finished: Condvar::new() });
        let job = Self { progress: progress.clone(), outcome: outcome.clone() };
        std::thread::Builder::new()
            .name("oncue job".to_owned())
            .stack_size(STACK_BYTES)
            .spawn(move || {
                let result = catch(|| work(&progress));
                // Before the work counts as done: who then looks into the log finds all of it.
                progress.end_stage();
                log_failure(&result);
                *outcome.lock() = State::Done(result);
                outcome.finished.notify_all();
            })
            .map_err(|source| Error::io("a new thread", source))?;
        Ok(job)
    }
}

impl<T> Job<T> {
    /// How far the work is.
    pub fn progress(&self) -> ProgressSnapshot {
        self.progress.snapshot()
    }

    /// Asks the work to stop; it ends with [`Error::Cancelled`] unless it was done before.
    pub fn cancel(&self) {
        self.progress.cancel();
    }

    /// Whether the work has ended, one way or another.
    pub fn is_done(&self) -> bool {
        !matches!(*self.outcome.lock(), State::Running)
    }

    /// Waits at most `timeout`; whether the work is done.
    pub fn wait(&self, timeout: Duration) -> bool {
        let started = Instant::now();
        let mut state = self.outcome.lock();
        while matches!(*state, State::Running) {
            let Some(left) = timeout.checked_sub(started.elapsed()).filter(|left| !left.is_zero()) else {
                return false;
            };
            state = self.outcome.finished.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    /// What the work gave: `None` while it runs, and once it was taken.
    pub fn take(&self) -> Option<std::result::Result<T, Failure>> {
        let mut state = self.outcome.lock();
        if matches!(*state, State::Running) {
            return None;
        }
        match std::mem::replace(&mut *state, State::Taken) {
            State::Done(result) => Some(result),
            State::Running | State::Taken => None,
        }
    }
}

impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.progress.cancel();
    }
}

impl<T> Outcome<T> {
    /// A state is replaced whole, so one left by a panicking thread is still good.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    const LONG: Duration = Duration::from_secs(20);

    fn until_cancelled(progress: &Progress) -> Result<()> {
        loop {
            progress.check()?;
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn gives_its_value_once() {
        let job = Job::start(|progress| {
            progress.stage("Counting");
            progress.update(3, 0.5, 0.25);
            Ok(7)
        })
        .unwrap();
        assert!(job.wait(LONG));
        let seen = job.progress();
        assert_eq!((seen.stage.as_str(), seen.update, seen.reward), ("Counting", 3, 0.5));
        assert!(matches!(job.take(), Some(Ok(7))));
        assert!(job.take().is_none());
        assert!(job.is_done());
    }

    #[test]
    fn a_cancelled_job_ends_with_cancelled() {
        let job = Job::start(until_cancelled).unwrap();
        assert!(!job.wait(Duration::from_millis(20)));
        assert!(job.take().is_none());
        job.cancel();
        assert!(job.wait(LONG));
        assert!(matches!(job.take(), Some(Err(Failure::Error(Error::Cancelled)))));
    }

    #[test]
    fn a_panic_becomes_a_failure_with_its_message() {
        for (work, message) in [
            ((|_: &Progress| panic!("a plain message")) as fn(&Progress) -> Result<()>, "a plain message"),
            (|_| panic!("frame {} of {}", 3, 2), "frame 3 of 2"),
            (|_| std::panic::panic_any(5_u8), "without a message"),
        ] {
            let job = Job::start(work).unwrap();
            assert!(job.wait(LONG));
            let Some(Err(Failure::Panic(said))) = job.take() else { panic!("no failure") };
            assert!(said.contains(message), "{said}");
        }
    }

    #[test]
    fn a_panic_in_a_parallel_loop_is_caught_too() {
        use rayon::prelude::*;
        let outcome = catch(|| {
            (0..100).into_par_iter().for_each(|i| assert!(i != 50, "item {i}"));
            Ok(())
        });
        assert!(matches!(outcome, Err(Failure::Panic(said)) if said.contains("item 50")));
    }

    #[test]
    fn dropping_the_handle_cancels_without_waiting() {
        let (release, gate) = mpsc::channel::<()>();
        let (report, ended) = mpsc::channel();
        let job = Job::start(move |progress| {
            // Would dead-lock here if the drop below waited for this thread.
            gate.recv_timeout(LONG).ok();
            report.send(progress.is_cancelled()).ok();
            Ok(())
        })
        .unwrap();
        drop(job);
        release.send(()).unwrap();
        assert_eq!(ended.recv_timeout(LONG), Ok(true));
    }
}

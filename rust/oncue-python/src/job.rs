//! The one door between Python and the core: it lets go of the interpreter, catches panics, maps errors and hands the
//! log over.
//! [`run`] is for calls that return at once, [`Job`] for those that take a while.

use std::time::Duration;

use oncue::{Error, Progress, Result};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::error::to_python;
use crate::logging::hand_over;

/// How long `result()` waits before it looks for Ctrl-C.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Makes the Python object of a job's value; runs on the thread that asks for it.
type Convert = Box<dyn FnOnce(Python<'_>) -> PyResult<Py<PyAny>> + Send>;

/// Runs `work` to its end without holding the interpreter.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let outcome = py.detach(|| oncue::job::catch(work));
    hand_over(py)?;
    outcome.map_err(to_python)
}

/// Work that runs on a thread of its own. Dropping the handle cancels it.
#[pyclass(frozen, generic, module = "oncue_core")]
pub struct Job {
    inner: oncue::Job<Convert>,
    outcome: PyOnceLock<PyResult<Py<PyAny>>>,
}

impl Job {
    /// Starts `work`; `convert` makes the Python object of what it gives.
    pub fn start<T: Send + 'static>(
        work: impl FnOnce(&Progress) -> Result<T> + Send + 'static,
        convert: impl FnOnce(Python<'_>, T) -> PyResult<Py<PyAny>> + Send + 'static,
    ) -> PyResult<Self> {
        let inner = oncue::Job::start(move |progress| {
            let value = work(progress)?;
            let convert: Convert = Box::new(move |py| convert(py, value));
            Ok(convert)
        })
        .map_err(|error| to_python(error.into()))?;
        Ok(Self { inner, outcome: PyOnceLock::new() })
    }

    fn finish(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        match self.inner.take() {
            Some(Ok(convert)) => convert(py),
            Some(Err(failure)) => Err(to_python(failure)),
            None => Err(to_python(Error::input("The job has no result.").into())),
        }
    }
}

#[pymethods]
impl Job {
    /// What the work has got to: stage, fraction, update, reward, success_rate.
    fn progress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        hand_over(py)?;
        let seen = self.inner.progress();
        let out = PyDict::new(py);
        out.set_item("stage", seen.stage)?;
        out.set_item("fraction", seen.fraction)?;
        out.set_item("update", seen.update)?;
        out.set_item("reward", seen.reward)?;
        out.set_item("success_rate", seen.success_rate)?;
        Ok(out)
    }

    /// Asks the work to stop; `result` then raises Cancelled unless the work was done before.
    fn cancel(&self) {
        self.inner.cancel();
    }

    /// Whether the work has ended, in whichever way.
    fn done(&self, py: Python<'_>) -> PyResult<bool> {
        let done = self.inner.is_done();
        hand_over(py)?;
        Ok(done)
    }

    /// Waits at most `timeout_s` seconds; whether the work is done. Other Python threads run meanwhile.
    fn wait(&self, py: Python<'_>, timeout_s: f64) -> PyResult<bool> {
        // Not finite or too long for a clock means: for as long as it takes.
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        let done = py.detach(|| self.inner.wait(timeout));
        hand_over(py)?;
        Ok(done)
    }

    /// Waits for the work, and gives its result or raises what it raised; the same each time.
    fn result(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        while !py.detach(|| self.inner.wait(SIGNAL_INTERVAL)) {
            py.check_signals()?;
            hand_over(py)?;
        }
        hand_over(py)?;
        match self.outcome.get_or_init(py, || self.finish(py)) {
            Ok(value) => Ok(value.clone_ref(py)),
            Err(error) => Err(error.clone_ref(py)),
        }
    }
}

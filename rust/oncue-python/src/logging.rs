//! The core's log, as records of Python's `logging` under the logger `oncue`.
//!
//! The log is pulled, as progress is: who works puts a line into a queue, and a Python thread that asks a job anything
//! takes the lines along. No thread of the core ever waits for the interpreter, which may be held by somebody who waits
//! for that very thread, or be gone.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use log::{Level, LevelFilter, Log, Metadata, Record};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Lines that are kept while nobody asks; of more the oldest go.
const MOST_LINES: usize = 1000;

/// A line that Python has not seen yet.
struct Line {
    logger: String,
    level: Level,
    text: String,
    source_file: String,
    source_line: u32,
    /// Seconds since 1970 when it was written, which is before Python sees it.
    created: f64,
}

struct Queue(Mutex<VecDeque<Line>>);

static QUEUE: Queue = Queue(Mutex::new(VecDeque::new()));

impl Queue {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Line>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn pop(&self) -> Option<Line> {
        self.lock().pop_front()
    }
}

impl Log for Queue {
    /// What libraries below the core say is nothing that an artist could use.
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().split("::").next() == Some("oncue")
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let line = Line {
            logger: record.target().replace("::", "."),
            level: record.level(),
            text: record.args().to_string(),
            source_file: record.file().unwrap_or_default().to_owned(),
            source_line: record.line().unwrap_or_default(),
            created: SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64(),
        };
        let mut lines = self.lock();
        if lines.len() >= MOST_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    fn flush(&self) {}
}

/// From now on what the core logs is kept for [`hand_over`].
pub fn install() {
    // Refused only where a logger is there already, which then gets the lines.
    if log::set_logger(&QUEUE).is_ok() {
        log::set_max_level(LevelFilter::Debug);
    }
}

/// Gives Python's `logging` what the core has logged meanwhile. Raises what a filter of the caller's raises.
pub fn hand_over(py: Python<'_>) -> PyResult<()> {
    while let Some(line) = QUEUE.pop() {
        hand_over_line(py, &line)?;
    }
    Ok(())
}

fn hand_over_line(py: Python<'_>, line: &Line) -> PyResult<()> {
    let logger = py.import("logging")?.call_method1("getLogger", (&line.logger,))?;
    let level = match line.level {
        Level::Error => 40,
        Level::Warn => 30,
        Level::Info => 20,
        Level::Debug | Level::Trace => 10,
    };
    if !logger.call_method1("isEnabledFor", (level,))?.is_truthy()? {
        return Ok(());
    }
    let (file, number, text) = (&line.source_file, line.source_line, &line.text);
    let arguments = (&line.logger, level, file, number, text, PyTuple::empty(py), py.None());
    let record = logger.call_method1("makeRecord", arguments)?;
    record.setattr("created", line.created)?;
    record.setattr("msecs", (line.created.fract() * 1000.0).floor())?;
    logger.call_method1("handle", (record,))?;
    Ok(())
}

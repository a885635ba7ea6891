//! The core's errors as Python's: the short tree of `oncue_core/errors.py`, and `OSError` for files.

use std::path::Path;

use oncue::Error;
use oncue::error::FileFault;
use oncue::job::Failure;
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;

pyo3::import_exception!(oncue_core.errors, OncueError);
pyo3::import_exception!(oncue_core.errors, InputError);
pyo3::import_exception!(oncue_core.errors, EdgeError);
pyo3::import_exception!(oncue_core.errors, DataFileError);
pyo3::import_exception!(oncue_core.errors, DamagedFileError);
pyo3::import_exception!(oncue_core.errors, NewerFileError);
pyo3::import_exception!(oncue_core.errors, Cancelled);

/// The Python exception of a failed job.
pub fn to_python(failure: Failure) -> PyErr {
    match failure {
        Failure::Panic(_) => PyRuntimeError::new_err(failure.to_string()),
        Failure::Error(error) => match &error {
            Error::Input(_) | Error::Unreachable(_) => InputError::new_err(error.to_string()),
            Error::FarFromEdge { sentence, place, yaw } => {
                EdgeError::new_err((sentence.clone(), (place.x, place.y, place.z), *yaw))
            }
            Error::DataFile { fault: FileFault::Damaged | FileFault::Foreign, .. } => {
                DamagedFileError::new_err(error.to_string())
            }
            Error::DataFile { fault: FileFault::Newer, .. } => NewerFileError::new_err(error.to_string()),
            Error::MocapFile { .. } | Error::DataFile { .. } => DataFileError::new_err(error.to_string()),
            Error::Io { file, source } => os_error(file, source),
            Error::Cancelled => Cancelled::new_err(error.to_string()),
            // `Error` may grow; whatever it grows is still something to act on.
            _ => OncueError::new_err(error.to_string()),
        },
    }
}

/// `OSError(errno, text, file, winerror)`, which Python turns into `FileNotFoundError`, `PermissionError` and so on.
fn os_error(file: &Path, source: &std::io::Error) -> PyErr {
    match source.raw_os_error() {
        Some(code) => {
            // Rust's text ends in " (os error 2)", Python's begins with "[Errno 2]": once is enough. That of Windows is a
            // sentence with its full stop, which Python takes off its own, too.
            let text = source.to_string();
            let text = text.split(" (os error").next().unwrap_or_default().trim_end_matches('.').to_owned();
            // Windows counts its errors otherwise than `errno` does; Python knows which are which.
            let (errno, winerror) = if cfg!(windows) { (0, Some(code)) } else { (code, None) };
            PyOSError::new_err((errno, text, file.display().to_string(), winerror))
        }
        None => PyOSError::new_err(format!("{}: {source}", file.display())),
    }
}

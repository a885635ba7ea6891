//! The Python face of `oncue`: all of pyo3 and numpy, and nothing else.

use pyo3::prelude::*;

#[pymodule]
fn oncue_core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}

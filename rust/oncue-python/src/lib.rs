//! The Python face of `oncue`: all of pyo3 and numpy, and nothing else.
//!
//! One file per noun, each a thin wrapper; [`job`] is the door they all go through, [`error`] the
//! exceptions they raise, [`logging`] what becomes of the core's log. The package around this module is `oncue_core/`, its types `_native.pyi`.

mod arrays;
mod editor;
mod error;
mod job;
mod json;
mod keys;
mod library;
mod logging;
mod manifold;
mod motion;
mod perform;
mod policy;
mod scene;
mod skeleton;
mod synthesis;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    logging::install();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<editor::EditedMotion>()?;
    module.add_class::<job::Job>()?;
    module.add_class::<library::Library>()?;
    module.add_class::<manifold::Manifold>()?;
    module.add_class::<perform::Performed>()?;
    module.add_class::<policy::Policy>()?;
    module.add_class::<scene::MovingObject>()?;
    module.add_class::<scene::SceneIndex>()?;
    module.add_class::<synthesis::Synthesis>()?;
    module.add_function(wrap_pyfunction!(skeleton::skeleton, module)?)?;
    module.add_function(wrap_pyfunction!(skeleton::map_rig, module)?)?;
    module.add_function(wrap_pyfunction!(editor::edit_motion, module)?)?;
    module.add_function(wrap_pyfunction!(editor::fit_seat, module)?)?;
    module.add_function(wrap_pyfunction!(editor::motion_figures, module)?)?;
    module.add_function(wrap_pyfunction!(editor::plain_ik, module)?)?;
    module.add_function(wrap_pyfunction!(keys::fit_keys, module)?)?;
    module.add_function(wrap_pyfunction!(library::build_library, module)?)?;
    module.add_function(wrap_pyfunction!(library::practice_room, module)?)?;
    module.add_function(wrap_pyfunction!(manifold::train_manifold, module)?)?;
    module.add_function(wrap_pyfunction!(scene::index_scene, module)?)?;
    module.add_function(wrap_pyfunction!(scene::check_task, module)?)?;
    module.add_function(wrap_pyfunction!(scene::find_ways, module)?)?;
    module.add_function(wrap_pyfunction!(scene::pass_moving, module)?)?;
    module.add_function(wrap_pyfunction!(perform::perform, module)?)?;
    module.add_function(wrap_pyfunction!(perform::perform_together, module)?)?;
    module.add_function(wrap_pyfunction!(policy::optimize_policy, module)?)?;
    module.add_function(wrap_pyfunction!(policy::robustness, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::synthesize, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::measure_motion, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::measure_performance, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::default_settings, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::presets, module)?)?;
    module.add_function(wrap_pyfunction!(synthesis::cue_types, module)?)?;
    Ok(())
}

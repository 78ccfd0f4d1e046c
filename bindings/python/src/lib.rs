//! The native part of the Python package `dtof`.
//!
//! Options come as key and text, arrays as bytes; results are bytes and JSON. `python/dtof` wraps them in
//! keyword arguments and numpy arrays.

mod aer;
mod error;
mod events;
mod find;
mod input;
mod load;
mod maps;
mod options;
mod pixel;
mod pixels;
mod run;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("Error", module.py().get_type::<error::Error>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<pixel::Pixel>()?;
    module.add_class::<pixels::Pixels>()?;
    module.add_function(wrap_pyfunction!(run::replay, module)?)?;
    module.add_function(wrap_pyfunction!(run::check_options, module)?)?;
    module.add_function(wrap_pyfunction!(options::keywords, module)?)?;
    module.add_function(wrap_pyfunction!(run::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(load::load, module)?)?;
    module.add_function(wrap_pyfunction!(find::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(find::compare, module)?)?;
    module.add_function(wrap_pyfunction!(find::tune, module)?)?;
    module.add_function(wrap_pyfunction!(aer::read_events, module)?)?;
    module.add_function(wrap_pyfunction!(aer::write_events, module)?)?;
    module.add_function(wrap_pyfunction!(aer::export, module)?)?;
    module.add_function(wrap_pyfunction!(maps::maps, module)?)?;
    module.add_function(wrap_pyfunction!(maps::points, module)?)?;
    Ok(())
}

//! Where photons come from: the name of a file, or an array.

use std::path::PathBuf;
use std::sync::Arc;

use dtof_data::photons::input::{Input, NpyArray};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

/// A recording as Python gives it.
#[derive(FromPyObject)]
pub enum PyInput {
    /// The name of a file.
    File(PathBuf),
    /// The name of an array, the header of its `.npy` file, and its elements.
    Array(String, Vec<u8>, PyBackedBytes),
}

impl From<PyInput> for Input {
    fn from(given: PyInput) -> Self {
        match given {
            PyInput::File(path) => Self::File(path),
            PyInput::Array(name, header, data) => Self::Array(Arc::new(NpyArray {
                name,
                header,
                data: Box::new(data),
            })),
        }
    }
}

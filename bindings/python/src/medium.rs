//! Where photons come from: the name of a file, or an array.

use std::path::PathBuf;
use std::sync::Arc;

use dtof_photons::medium::{Medium, NpyArray};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

/// A recording as Python gives it.
#[derive(FromPyObject)]
pub enum Given {
    /// The name of a file.
    File(PathBuf),
    /// What an array is called, the header of its `.npy` file, and its elements.
    Array(String, Vec<u8>, PyBackedBytes),
}

impl From<Given> for Medium {
    fn from(given: Given) -> Self {
        match given {
            Given::File(path) => Self::File(path),
            Given::Array(name, header, data) => Self::Array(Arc::new(NpyArray {
                name,
                header,
                data: Box::new(data),
            })),
        }
    }
}

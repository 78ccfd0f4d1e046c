//! NumPy arrays: recorded histograms and photon lists from `.npy` and `.npz` files, and pictures,
//! also of floats.

pub(crate) mod archive;
mod header;
pub(crate) mod histograms;
pub mod numbers;
pub(crate) mod records;

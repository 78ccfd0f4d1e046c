//! NumPy arrays: recorded histograms and photon lists, from `.npy` and `.npz` files; and
//! pictures, also of floats.

pub mod archive;
mod header;
pub mod histograms;
pub mod numbers;
pub mod records;

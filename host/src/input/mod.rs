//! Where photons come from.

pub mod masked;
pub mod npy;
pub mod open;
pub mod photon_csv;
pub mod range;
pub mod recorded;
pub mod source;
pub mod tmf8820;

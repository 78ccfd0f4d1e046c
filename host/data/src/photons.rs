//! Recordings of single-photon (SPAD) LiDARs as a stream of photons. It reads NumPy arrays of histograms (`.npy`, `.npz`),
//! lists of photons (`.npy`, `.csv`) and logs of the sensors TMF8820, TMF8828 and TMF8829 (`.json`, `.json.gz`).
//!
//! `open::open` takes a file, or an array in memory, and gives a `PhotonSource`. Its photons come in slices of a few laser
//! cycles, so memory does not grow with their number. `open::counts` gives histograms instead. The module also has the
//! rays of the pixels, from a field of view or a calibration file. The README of the package has an example.
//!
//! ## What it does not know
//!
//! - It knows no engine and no events: `dtof-engine` decides on the photons.
//! - It simulates no scene. `dtof-light` has another `PhotonSource`.
//! - It writes no files.
//! - A histogram has no laser cycles. Each photon gets a random one, and a seed makes it repeatable.
//! - A histogram of unknown length is assumed to have one photon a laser cycle in its brightest pixel.
//! - Recordings have 8 to 4096 bins, which become 8 to 1024. An array has at most 65,536 pixels.

pub mod axes;
mod bins;
mod capture_log;
pub mod geometry;
pub mod histograms;
pub mod input;
pub mod list_checks;
pub mod masked;
pub mod npy;
pub mod open;
mod photon_csv;
mod photon_list;
pub mod pixel_counts;
pub mod range;
pub mod ranges;
pub mod recorded;
pub mod source;
pub mod tmf8820;
pub mod tmf8829;
pub mod warnings;

/// Millimetres of range a picosecond, half the speed of light.
pub const MM_PER_PS: f64 = 0.149_896_229;

//! The rules that are newer than the paper: whole spaces of small histograms against models written from the formulas.
//!
//! ```sh
//! cargo test -p dtof-core proofs:: -- --nocapture             # a share of the cases
//! cargo test -p dtof-core proofs:: -- --nocapture --ignored   # all of them, in minutes
//! ```

mod count8;
mod live;
mod once_per_bin;

//! The rules that are newer than the paper: whole spaces of small histograms against models written from the formulas.
//!
//! ```sh
//! cargo test -p dtof-core --test proofs -- --nocapture             # a share of the cases
//! cargo test -p dtof-core --test proofs -- --nocapture --ignored   # all of them, in minutes
//! ```

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod count8;
mod live;
#[path = "../common/live.rs"]
mod live_formula;
mod neighbours;
#[path = "../common/neighbours.rs"]
mod neighbours_formula;
mod once_per_bin;
#[path = "../common/parallel.rs"]
mod parallel;
#[path = "../common/window.rs"]
mod window_formula;

/// All histograms of eight bins with 0 to 3 photons each.
const HISTOGRAMS: u64 = 1 << 16;

/// The histogram of a number below [`HISTOGRAMS`].
fn histogram(number: u64) -> [u32; 8] {
    std::array::from_fn(|bin| (number >> (2 * bin) & 3) as u32)
}

//! The rules that are newer than the paper: whole spaces of small histograms against models written from the formulas.
//!
//! ```sh
//! cargo test -p dtof-core --test all proofs:: -- --nocapture             # a share of the cases
//! cargo test -p dtof-core --test all proofs:: -- --nocapture --ignored   # all of them, in minutes
//! ```

mod count8;
mod live;
mod neighbours;
mod once_per_bin;

/// All histograms of eight bins with 0 to 3 photons each.
const HISTOGRAMS: u64 = 1 << 16;

/// The histogram of a number below [`HISTOGRAMS`].
fn histogram(number: u64) -> [u32; 8] {
    std::array::from_fn(|bin| (number >> (2 * bin) & 3) as u32)
}

//! All histograms of eight bins with 0 to 3 photons each.

pub const HISTOGRAMS: u64 = 1 << 16;

/// The histogram of a number below [`HISTOGRAMS`].
pub fn histogram(number: u64) -> [u32; 8] {
    std::array::from_fn(|bin| (number >> (2 * bin) & 3) as u32)
}

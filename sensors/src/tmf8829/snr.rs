//! The signal-to-noise ratio of a target.

/// 40, and each next one is × 1.053676, computed with 64 fractional bits.
const RATIOS: [u32; 216] = {
    let mut ratios = [0; 216];
    let mut ratio: u128 = 40 << 64;
    let mut code = 0;
    while code < ratios.len() {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::indexing_slicing,
            reason = "the last is 3.05 million; computed when compiled"
        )]
        {
            ratios[code] = (ratio >> 64) as u32;
        }
        // The remainder of the division is less than 2⁻⁴⁴.
        ratio = ratio / 1_000_000 * 1_053_676;
        code += 1;
    }
    ratios
};

/// The signal-to-noise ratio of a target's `confidence`, rounded down: up to 40 they are equal, then
/// 40 × 1.053676^(confidence − 40), at most 3.05 million.
#[must_use]
pub fn snr(confidence: u8) -> u32 {
    let above = usize::from(confidence).checked_sub(40);
    let ratio = above.and_then(|above| RATIOS.get(above));
    ratio.copied().unwrap_or(confidence.into())
}

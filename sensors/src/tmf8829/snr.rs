//! The signal-to-noise ratio of a target.

/// 40, and from there on each the one before × 1.053676, with 64 binary places behind the point.
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
        // What the division leaves is less than 2⁻⁴⁴.
        ratio = ratio / 1_000_000 * 1_053_676;
        code += 1;
    }
    ratios
};

/// The ratio that a target's `confidence` stands for, rounded down: itself up to 40, then
/// 40 × 1.053676^(confidence − 40), at most 3.05 million.
#[must_use]
pub fn snr(confidence: u8) -> u32 {
    let above = usize::from(confidence).checked_sub(40);
    let ratio = above.and_then(|above| RATIOS.get(above));
    ratio.copied().unwrap_or(confidence.into())
}

//! The threshold of the window rule, in floating point.

/// Whether `inside` photons of a window exceed the threshold of the window rule at `z`. The window has `width` of `bins`
/// bins, which have `total` photons. `None` if rounding decides: between the threshold with all that lowers it,
/// and with all that raises it.
///
/// `z²/6`, `z²/36` and `z²` are rounded down, to 1/16, 1/16 and 1/256. So is `N/(N + c)`, of whose terms 16 bits are
/// divided: by variance/2¹⁵ and, in `B²`, by 1/16.
pub fn exceeds(inside: u64, total: u64, width: u64, bins: u64, z: f64) -> Option<bool> {
    let (inside, total) = (inside as f64, total as f64);
    let share = width as f64 / bins as f64;
    let variance = total * share * (1.0 - share);
    let skew = (1.0 - 2.0 * share).max(0.0) * z * z / 6.0;
    let level = |z: f64, spread: f64| total * share + skew + z * spread.max(0.0).sqrt();
    let spread = |c: f64| {
        let sum = variance + c;
        if sum > 0.0 {
            variance * variance / sum
        } else {
            0.0
        }
    };
    let c = z * z / 36.0;
    let z_low = (z * z - 1.0 / 256.0).max(0.0).sqrt();
    let unit = 1.0 / (bins as f64).powi(2);
    let low = level(z_low, spread(c) - variance / 32_768.0 - unit / 16.0) - 0.0626;
    let c_low = (c - 1.0 / (36.0 * 16.0) - unit).max(0.0);
    let high = level(z, spread(c_low) + variance / 32_768.0);
    if inside > high + 1e-6 * high {
        Some(true)
    } else if inside < low - 1e-6 * low {
        Some(false)
    } else {
        None
    }
}

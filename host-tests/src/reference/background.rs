//! Background estimation (sec. II-A and sec. IV-B).

/// The background level `λ_b` as the mean of all bins of the gate: what sec. IV-B calls
/// "the average of all 128 bins". The bins of the pulse are among them.
///
/// # Panics
///
/// Panics if `first..=last` is empty or reaches beyond the histogram.
#[must_use]
pub fn average_background(counts: &[f64], first: usize, last: usize) -> f64 {
    let window = &counts[first..=last];
    window.iter().sum::<f64>() / window.len() as f64
}

/// The background level `λ_b` by the rule of the FPGA prototype (sec. IV-B).
///
/// The half of the histogram without the peak consists of two
/// quadrants. The smaller of the maxima of these two is the background.
///
/// Under a range gate the window `first..=last` replaces the
/// histogram: with `n` bins in it, quadrant `k` runs from bin
/// `first + floor(k n / 4)` up to, not including, bin
/// `first + floor((k + 1) n / 4)`. In the paper, `n` is 128 and each quadrant
/// has 32 bins.
///
/// A window of fewer than four bins has quadrants without a bin; the maximum
/// of such a quadrant is zero.
///
/// # Panics
///
/// Panics if `first..=last` does not contain the peak or reaches beyond the histogram.
#[must_use]
pub fn quadrant_background(counts: &[f64], first: usize, last: usize, peak: usize) -> f64 {
    assert!(
        first <= peak && peak <= last && last < counts.len(),
        "the peak lies in the window, the window in the histogram"
    );
    let bins = last + 1 - first;
    let boundary = |k: usize| first + k * bins / 4;
    // The two quadrants of the other half are start..middle and middle..end.
    let (start, middle, end) = if peak < boundary(2) {
        (boundary(2), boundary(3), boundary(4))
    } else {
        (boundary(0), boundary(1), boundary(2))
    };
    maximum(&counts[start..middle]).min(maximum(&counts[middle..end]))
}

/// The largest of some counts, zero if there are none.
fn maximum(counts: &[f64]) -> f64 {
    counts.iter().copied().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_paper() {
        // The peak lies in bins 64 to 127, so that bins 0 to 31 (maximum 7)
        // are compared with bins 32 to 63 (maximum 5).
        let mut counts = [1.0; 128];
        counts[31] = 7.0;
        counts[32] = 5.0;
        counts[64] = 90.0;
        assert_eq!(quadrant_background(&counts, 0, 127, 64), 5.0);
        assert_eq!(quadrant_background(&counts, 0, 127, 127), 5.0);
        // With the peak in bin 63: bins 64 to 95 (maximum 90) against bins 96 to 127
        // (maximum 1).
        assert_eq!(quadrant_background(&counts, 0, 127, 63), 1.0);
    }

    #[test]
    fn the_average_is_that_of_the_gated_bins() {
        let counts = [100.0, 1.0, 2.0, 9.0, 100.0];
        assert_eq!(average_background(&counts, 1, 3), 4.0);
        assert_eq!(average_background(&counts, 4, 4), 100.0);
    }

    #[test]
    fn the_gate_plays_the_part_of_the_histogram() {
        // Bins 3 to 12, n = 10: boundaries 3 + 0, 3 + 2, 3 + 5, 3 + 7 and
        // 3 + 10, which makes the quadrants 3-4, 5-7, 8-9 and 10-12.
        let mut counts = [99.0; 16];
        for (bin, count) in counts.iter_mut().enumerate().take(13).skip(3) {
            *count = bin as f64;
        }
        // Peak in bin 12: quadrants 3-4 and 5-7, maxima 4 and 7.
        assert_eq!(quadrant_background(&counts, 3, 12, 12), 4.0);
        // Bin 8 is the first of the upper half.
        assert_eq!(quadrant_background(&counts, 3, 12, 8), 4.0);
        // Bin 7 is the last of the lower half; quadrants 8-9 and 10-12, maxima
        // 9 and 12.
        assert_eq!(quadrant_background(&counts, 3, 12, 7), 9.0);
    }

    #[test]
    fn a_quadrant_without_a_bin_has_maximum_zero() {
        // n = 3: boundaries 0, 0, 1, 2, 3, which makes the quadrants none, 0,
        // 1 and 2.
        let counts = [4.0, 6.0, 8.0];
        assert_eq!(quadrant_background(&counts, 0, 2, 2), 0.0);
        assert_eq!(quadrant_background(&counts, 0, 2, 0), 6.0);
        // n = 1: the only bin is in the upper half, the lower has none.
        assert_eq!(quadrant_background(&counts, 1, 1, 1), 0.0);
    }
}

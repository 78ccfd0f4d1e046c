//! Peak finding (sec. II-A).

/// The peak bin `i_max` and its count: "the bin with the largest photon count
/// in the histogram" (sec. II-A), searched in `first..=last`.
///
/// Among bins with the same largest count, the one with the lowest index is the peak; the paper
/// leaves this open.
///
/// # Panics
///
/// Panics if `first..=last` is empty or reaches beyond the histogram.
#[must_use]
pub fn peak(counts: &[f64], first: usize, last: usize) -> (usize, f64) {
    assert!(
        first <= last && last < counts.len(),
        "the window lies in the histogram"
    );
    let mut peak_bin = first;
    for bin in first..=last {
        if counts[bin] > counts[peak_bin] {
            peak_bin = bin;
        }
    }
    (peak_bin, counts[peak_bin])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_count_is_the_peak() {
        // 9 is the largest, in bin 2.
        assert_eq!(peak(&[3.0, 1.0, 9.0, 4.0], 0, 3), (2, 9.0));
    }

    #[test]
    fn the_lowest_index_wins_a_tie() {
        // Bins 1 and 3 have 7.
        assert_eq!(peak(&[2.0, 7.0, 0.0, 7.0], 0, 3), (1, 7.0));
        // An empty histogram is a tie of all bins.
        assert_eq!(peak(&[0.0; 8], 2, 5), (2, 0.0));
    }

    #[test]
    fn both_ends_of_the_window_count_and_nothing_beyond() {
        let counts = [9.0, 5.0, 1.0, 6.0, 8.0];
        // Bins 1 to 3 hold 5, 1 and 6.
        assert_eq!(peak(&counts, 1, 3), (3, 6.0));
        // Bins 1 and 2 hold 5 and 1.
        assert_eq!(peak(&counts, 1, 2), (1, 5.0));
        assert_eq!(peak(&counts, 4, 4), (4, 8.0));
    }
}

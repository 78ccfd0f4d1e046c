//! From a peak bin to a range (sec. III-A: Center of Mass Method, CMM).

/// Speed of light in vacuum, in metres per second.
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// The sub-bin position of a peak, by the centroid of the peak bin and
/// its two neighbours (the CMM of sec. III-A).
///
/// The background is subtracted from each of the three counts, and negative values become zero;
/// a neighbour outside `first..=last` counts as zero. The paper names the method without its
/// window or background correction, which were chosen here.
///
/// The position is in bins from the start of bin 0. Photons spread evenly over
/// bin `i` have their centre at `i + 0.5`, which is also the result if no count
/// exceeds the background.
///
/// # Panics
///
/// Panics if `first..=last` does not contain the peak or reaches beyond the histogram.
#[must_use]
pub fn centroid(counts: &[f64], first: usize, last: usize, peak: usize, background: f64) -> f64 {
    assert!(
        first <= peak && peak <= last && last < counts.len(),
        "the peak lies in the window, the window in the histogram"
    );
    let signal = |bin: usize| (counts[bin] - background).max(0.0);
    let left = if peak > first { signal(peak - 1) } else { 0.0 };
    let centre = signal(peak);
    let right = if peak < last { signal(peak + 1) } else { 0.0 };

    let total = left + centre + right;
    let offset = if total > 0.0 {
        (right - left) / total
    } else {
        0.0
    };
    peak as f64 + 0.5 + offset
}

/// The range in millimetres of a `position` in bins: the light travels the
/// distance twice (direct time of flight, sec. II-A), and `offset_mm` is added
/// for the delays of the system.
#[must_use]
pub fn range_mm(position: f64, bin_width_ps: f64, offset_mm: f64) -> f64 {
    let time_of_flight_s = position * bin_width_ps * 1e-12;
    let range_m = time_of_flight_s * SPEED_OF_LIGHT / 2.0;
    range_m * 1e3 + offset_mm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_symmetric_peak_lies_in_the_middle_of_its_bin() {
        // Signal 4, 8, 4 in bins 1, 2, 3 with centres 1.5, 2.5, 3.5:
        // (6 + 20 + 14) / 16 = 2.5
        let counts = [1.0, 5.0, 9.0, 5.0, 1.0];
        assert_eq!(centroid(&counts, 0, 4, 2, 1.0), 2.5);
    }

    #[test]
    fn the_heavier_neighbour_pulls() {
        // Signal 0, 6, 2 in bins 1, 2, 3: (15 + 7) / 8 = 2.75; the 9 in bin 4
        // is not among the three bins.
        let counts = [0.0, 2.0, 8.0, 4.0, 9.0];
        assert_eq!(centroid(&counts, 0, 4, 2, 2.0), 2.75);
    }

    #[test]
    fn a_count_below_the_background_is_clipped() {
        // Signal 0 (not -3), 6, 2: as above.
        let counts = [0.0, 2.0, 11.0, 7.0, 0.0];
        assert_eq!(centroid(&counts, 0, 4, 2, 5.0), 2.75);
    }

    #[test]
    fn bins_outside_the_window_are_zero() {
        let counts = [4.0, 8.0, 8.0, 4.0];
        // Window 1 to 3, peak 1: signal 0, 8, 8: (12 + 20) / 16 = 2
        assert_eq!(centroid(&counts, 1, 3, 1, 0.0), 2.0);
        // Window 0 to 1, peak 1: signal 4, 8, 0: (2 + 12) / 12 = 7 / 6
        assert!((centroid(&counts, 0, 1, 1, 0.0) - 7.0 / 6.0).abs() < 1e-15);
        // In the first bin of the histogram, signal 4, 8 in bins 0, 1:
        // (2 + 12) / 12; in the last, signal 8, 4 in bins 2, 3: (20 + 14) / 12
        assert!((centroid(&counts, 0, 3, 0, 0.0) - 14.0 / 12.0).abs() < 1e-15);
        assert!((centroid(&counts, 0, 3, 3, 0.0) - 34.0 / 12.0).abs() < 1e-15);
    }

    #[test]
    fn without_signal_the_peak_lies_in_the_middle_of_its_bin() {
        assert_eq!(centroid(&[3.0; 5], 0, 4, 1, 3.0), 1.5);
        assert_eq!(centroid(&[3.0; 5], 0, 4, 1, 7.0), 1.5);
    }

    #[test]
    fn range_of_a_position() {
        // One bin of 250 ps: 250e-12 s * 299792458 m/s / 2 = 37.47405725 mm
        assert!((range_mm(1.0, 250.0, 0.0) - 37.474_057_25).abs() < 1e-9);
        // 10.5 of them: 393.477601125 mm, less an offset of 93.477601125 mm
        assert!((range_mm(10.5, 250.0, -93.477_601_125) - 300.0).abs() < 1e-9);
        assert_eq!(range_mm(0.0, 250.0, 12.0), 12.0);
    }
}

//! The histogram of photon arrivals (sec. II-A).

/// Photon counts per time bin, summed over the laser cycles of an exposure
/// (sec. II-A).
///
/// A counter that has reached its limit stays there. The counters of the FPGA
/// prototype are 10 bits wide (sec. IV-B), which is a limit of 1023.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    counts: Vec<f64>,
    limit: f64,
}

impl Histogram {
    /// An empty histogram of `bins` bins, each counting up to `limit`
    /// (sec. IV-B: 128 bins of 10 bits).
    #[must_use]
    pub fn new(bins: usize, limit: f64) -> Self {
        Self {
            counts: vec![0.0; bins],
            limit,
        }
    }

    /// Counts one photon in `bin` (sec. II-A); a full counter keeps its value.
    ///
    /// Returns whether the histogram has such a bin.
    pub fn add(&mut self, bin: usize) -> bool {
        let Some(count) = self.counts.get_mut(bin) else {
            return false;
        };
        *count = (*count + 1.0).min(self.limit);
        true
    }

    /// The counts `h_i`, bin 0 first (sec. II-A).
    #[must_use]
    pub fn counts(&self) -> &[f64] {
        &self.counts
    }

    /// Resets every counter to zero, as after a peak event (sec. II-B).
    pub fn clear(&mut self) {
        self.counts.fill(0.0);
    }

    /// Resets the counter of one bin to zero.
    ///
    /// # Panics
    ///
    /// Panics if the histogram has no such bin.
    pub fn clear_bin(&mut self, bin: usize) {
        self.counts[bin] = 0.0;
    }

    /// The sum of all counts (sec. II-A).
    #[must_use]
    pub fn total(&self) -> f64 {
        self.counts.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_land_in_their_bins() {
        let mut histogram = Histogram::new(4, 1023.0);
        assert!(histogram.add(0));
        assert!(histogram.add(3));
        assert!(histogram.add(3));
        // One photon in bin 0, two in bin 3: three in all.
        assert_eq!(histogram.counts(), [1.0, 0.0, 0.0, 2.0]);
        assert_eq!(histogram.total(), 3.0);
    }

    #[test]
    fn a_bin_out_of_range_is_refused() {
        let mut histogram = Histogram::new(4, 1023.0);
        // The bins are 0, 1, 2 and 3.
        assert!(!histogram.add(4));
        assert_eq!(histogram.total(), 0.0);
    }

    #[test]
    fn a_counter_saturates() {
        let mut histogram = Histogram::new(2, 1023.0);
        for _ in 0..1023 {
            histogram.add(1);
        }
        assert_eq!(histogram.counts(), [0.0, 1023.0]);
        // The counter is full at photon 1024; the bin exists nevertheless.
        assert!(histogram.add(1));
        assert_eq!(histogram.counts(), [0.0, 1023.0]);
    }

    #[test]
    fn clear_leaves_an_empty_histogram() {
        let mut histogram = Histogram::new(3, 1023.0);
        histogram.add(2);
        histogram.clear();
        assert_eq!(histogram, Histogram::new(3, 1023.0));
    }
}

//! The window rule. Not in the paper: written from its formula in `docs/design.md` and the binomial
//! distribution.

/// The input of a decision of the window rule: `inside` photons in a window of `width` bins, and `total`
/// photons in all `bins` bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// The bin that is reported if the window exceeds the threshold.
    pub bin: usize,
    /// `S`: photons in the window.
    pub inside: f64,
    /// `T`: photons in all bins.
    pub total: f64,
    /// `w`: bins of the window.
    pub width: f64,
    /// `B`: bins that are not excluded.
    pub bins: f64,
    /// `z`: standard deviations above the mean.
    pub z: f64,
}

impl Window {
    /// The window with the most photons among all of `width` bins in `first..=last` that contain the bin
    /// `around`; it reports `bin`. `left_out` of the bins are excluded: empty and not counted.
    #[must_use]
    pub fn around(
        counts: &[f64],
        (first, last): (usize, usize),
        left_out: usize,
        (width, z): (usize, f64),
        (around, bin): (usize, usize),
    ) -> Self {
        let windows =
            (first..=last + 1 - width).filter(|start| (*start..start + width).contains(&around));
        let sums = windows.map(|start| counts[start..start + width].iter().sum());
        Self {
            bin,
            inside: sums.fold(0.0, f64::max),
            total: counts[first..=last].iter().sum(),
            width: width as f64,
            bins: (last + 1 - first - left_out) as f64,
            z,
        }
    }

    /// `p = w/B`: the probability that a photon of the background is in the window.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.width / self.bins
    }

    /// `V = T·p·(1 - p)`: the variance of the photons in the window.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.total * self.share() * (1.0 - self.share())
    }

    /// `z²/6·(1 - 2p)`, at least 0: the correction for the skewness of the distribution.
    #[must_use]
    pub fn skew(&self) -> f64 {
        self.z * self.z / 6.0 * (1.0 - 2.0 * self.share()).max(0.0)
    }

    /// `T·p + z·V/√(V + z²/36) + z²/6·(1 - 2p)`: the threshold of the window.
    #[must_use]
    pub fn level(&self) -> f64 {
        let variance = self.variance();
        let spread = if variance > 0.0 {
            variance / (variance + self.z * self.z / 36.0).sqrt()
        } else {
            0.0
        };
        self.total * self.share() + self.z * spread + self.skew()
    }

    /// Whether the window has more photons than the threshold.
    #[must_use]
    pub fn stands_clear(&self) -> bool {
        self.inside > self.level()
    }

    /// The mean of the bins outside the window.
    #[must_use]
    pub fn background(&self) -> f64 {
        (self.total - self.inside) / (self.bins - self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_by_hand() {
        // p = 1/4, V = 64 · 3/16 = 12: 16 + 6·12/√(12 + 1) + 6·1/2
        let window = Window {
            bin: 0,
            inside: 38.0,
            total: 64.0,
            width: 2.0,
            bins: 8.0,
            z: 6.0,
        };
        assert!((window.level() - (19.0 + 72.0 / 13f64.sqrt())).abs() < 1e-12);
        assert!(!window.stands_clear()); // 38.97
        assert!(
            Window {
                inside: 39.0,
                ..window
            }
            .stands_clear()
        );
        // Without photons only the skewness remains, which is 0 for a window of half of the bins.
        let empty = Window {
            inside: 0.0,
            total: 0.0,
            ..window
        };
        assert_eq!(empty.level(), 3.0);
        assert_eq!(
            Window {
                width: 4.0,
                ..empty
            }
            .level(),
            0.0
        );
        // 26 photons in 6 bins.
        assert!((window.background() - 26.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn the_best_window_around_a_bin() {
        let counts = [9.0, 1.0, 2.0, 3.0, 5.0, 0.0, 9.0];
        let around = |bin| Window::around(&counts, (1, 5), 2, (2, 4.0), (bin, 4));
        // Bins 1 and 2, 2 and 3: the latter. Bins 3 and 4. Bin 1 with bin 2 only.
        assert_eq!([2, 3, 1].map(|bin| around(bin).inside), [5.0, 8.0, 3.0]);
        assert_eq!(
            (around(2).total, around(2).bins, around(2).bin),
            (11.0, 3.0, 4)
        );
    }
}

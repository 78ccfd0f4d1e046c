//! The window rule for a TDC that is blind for some bins after each photon. Not in the paper: written
//! from its formula in `core/src/detect/live.rs` and the binomial distribution.

/// The photons of an exposure, with those before the gate.
#[derive(Debug, Clone, Copy)]
pub struct LiveHistogram<'a> {
    /// Photons a bin.
    pub counts: &'a [f64],
    /// `N`: laser cycles of the exposure.
    pub cycles: f64,
    /// `D`: bins for which the TDC is blind after a photon.
    pub dead_time: usize,
    /// The first bin inside the range gate.
    pub first: usize,
    /// The last bin inside the range gate.
    pub last: usize,
}

/// One window, and how far it is from the threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiveTest {
    /// Its first bin.
    pub start: usize,
    /// Live laser cycles of its bins, added up.
    pub live: f64,
    /// `S`: photons in the window.
    pub photons: f64,
    /// `E`: photons expected there.
    pub expected: f64,
    /// What must be exceeded by `S - E`.
    pub level: f64,
}

impl LiveHistogram<'_> {
    /// The laser cycles in which a bin was live; below 0 if the counts contradict the dead time.
    #[must_use]
    pub fn live(&self, bin: usize) -> f64 {
        let blind = &self.counts[bin.saturating_sub(self.dead_time)..bin];
        self.cycles - blind.iter().sum::<f64>()
    }

    /// Whether a gated bin was blind or had a photon in more laser cycles than there were, or all bins
    /// were always blind.
    #[must_use]
    pub fn contradicts(&self) -> bool {
        let mut bins = self.first..=self.last;
        self.fewest_empty() < 0.0 || bins.all(|bin| self.live(bin) == 0.0)
    }

    /// The fewest laser cycles in which a gated bin was live and had no photon.
    #[must_use]
    pub fn fewest_empty(&self) -> f64 {
        let empty = (self.first..=self.last).map(|bin| self.live(bin) - self.counts[bin]);
        empty.fold(f64::INFINITY, f64::min)
    }

    /// All gated windows of `width` bins, tested at `z` standard deviations.
    #[must_use]
    pub fn windows(&self, width: usize, z: f64) -> Vec<LiveTest> {
        let gated = self.first..=self.last;
        let total: f64 = self.counts[gated.clone()].iter().sum();
        let all: f64 = gated.map(|bin| self.live(bin)).sum();
        let window = |start: usize| {
            let live: f64 = (start..start + width).map(|bin| self.live(bin)).sum();
            let share = live / all;
            let expected = total * share;
            let variance = expected * (1.0 - share);
            let skew = z * z / 6.0 * (1.0 - 2.0 * share).max(0.0);
            let spread = (variance + z * z / 36.0).sqrt();
            LiveTest {
                start,
                live,
                photons: self.counts[start..start + width].iter().sum(),
                expected,
                level: skew + z * variance / spread,
            }
        };
        (self.first..=self.last + 1 - width).map(window).collect()
    }
}

impl LiveTest {
    /// `(S - E)²/E`, 0 of a window with fewer photons than expected. Of windows above the threshold that
    /// with the highest is reported.
    #[must_use]
    pub fn score(&self) -> f64 {
        let excess = (self.photons - self.expected).max(0.0);
        excess * excess / self.expected
    }

    /// Photons above the threshold.
    #[must_use]
    pub fn clearance(&self) -> f64 {
        self.photons - self.expected - self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 laser cycles, blind for two bins.
    const COUNTS: [f64; 8] = [10.0, 9.0, 8.0, 30.0, 6.0, 6.0, 8.0, 8.0];

    fn histogram(dead_time: usize) -> LiveHistogram<'static> {
        LiveHistogram {
            counts: &COUNTS,
            cycles: 100.0,
            dead_time,
            first: 2,
            last: 7,
        }
    }

    #[test]
    fn photons_before_the_gate_blind_its_first_bins() {
        let live: Vec<f64> = (0..8).map(|bin| histogram(2).live(bin)).collect();
        assert_eq!(live, [100.0, 90.0, 81.0, 83.0, 62.0, 64.0, 88.0, 86.0]);
        assert_eq!(histogram(8).live(7), 23.0);
    }

    #[test]
    fn a_window_is_expected_to_have_its_share_of_live_laser_cycles() {
        // 66 photons in 464 live laser cycles; bin 3 was live in 83 of them.
        let windows = histogram(2).windows(1, 3.0);
        let window = windows[1];
        assert_eq!((window.start, window.photons, windows.len()), (3, 30.0, 6));
        let share = 83.0 / 464.0;
        assert!((window.expected - 66.0 * share).abs() < 1e-12);
        // 11.8 photons, of a variance of 9.7: 0.96 for the skew and 3·9.7/√9.9.
        assert!((window.level - (1.5 * (1.0 - 2.0 * share) + 9.21)).abs() < 0.02);
        assert!(window.clearance() > 7.0 && windows[2].clearance() < 0.0);
    }

    #[test]
    fn counts_may_contradict_the_dead_time() {
        let with = |cycles| LiveHistogram {
            cycles,
            ..histogram(8)
        };
        // 77 photons come before bin 7, and 8 in it.
        assert!(with(84.0).contradicts() && !with(85.0).contradicts());
        // A photon in each laser cycle, and then one in a bin that is always blind.
        let counts = [0.0, 0.0, 100.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let with = |cycles| LiveHistogram {
            counts: &counts,
            cycles,
            ..histogram(1)
        };
        assert!(with(100.0).contradicts() && !with(101.0).contradicts());
    }
}

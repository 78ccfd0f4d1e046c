//! The asynchronous operation of a pixel (sec. II-B and its figure "Pixel
//! operation flow chart").

use super::{Histogram, average_background, centroid, peak, quadrant_background, stands_clear};

/// The estimator of the background `λ_b`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Background {
    /// Two quadrants (sec. IV-B).
    Quadrants,
    /// All bins (sec. II-A).
    Average,
}

/// The hyperparameters of a pixel (sec. II-B) and its range gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// `X`: the laser cycles between checks, at least one (sec. II-B).
    pub x: u32,
    /// `L_1`: a decision needs an exposure of more laser cycles than this (sec. II-B).
    pub l1: u32,
    /// `L_2`: the exposure ends when it has this many laser cycles (sec. II-B).
    pub l2: u32,
    /// The estimator of `λ_b`.
    pub background: Background,
    /// `α`: standard deviations of the threshold above the background (Eq. 5).
    pub alpha: f64,
    /// The smallest count of a peak with an event. Not in the paper; zero
    /// turns it off, see [`stands_clear`].
    pub minimum_count: f64,
    /// The first bin inside the range gate. The paper's full histogram
    /// (sec. IV-B) is a gate from bin 0 to the last bin.
    pub first: usize,
    /// The last bin inside the range gate; see [`first`](Self::first).
    pub last: usize,
}

/// A decision, with or without an event: the values at a check with `L_1 < N < L_2` (sec. II-B).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Index, from zero, of the laser cycle at whose end the decision was taken
    /// (sec. II-B).
    pub cycle: u64,
    /// `N`: the laser cycles since the histogram was last cleared (sec. II-A).
    pub exposure: u32,
    /// `i_max`: the bin of the peak (sec. II-A).
    pub peak_bin: usize,
    /// `h_{i_max}`: the count in the peak bin (sec. II-B).
    pub peak_count: f64,
    /// `λ_b`: the background the peak was compared with (Eq. 5, sec. IV-B).
    pub background: f64,
    /// Whether the peak was significant and caused an [`Event`] (Eq. 5).
    pub fired: bool,
}

/// A peak event: a significant peak, reported by the pixel (sec. II-B).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The decision that caused it.
    pub look: Look,
    /// The sub-bin position of the peak, in bins from the start of bin 0
    /// (sec. III-A); see [`centroid`].
    pub position: f64,
}

/// An asynchronous pixel (sec. II-B).
///
/// For every laser cycle, call [`photon`](Self::photon) any number of times, then
/// [`end_laser_cycle`](Self::end_laser_cycle) once.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixel {
    config: Config,
    histogram: Histogram,
    /// Laser cycles that have ended in all.
    cycles: u64,
    /// `N`
    exposure: u32,
    event: Option<Event>,
}

impl Pixel {
    /// A pixel at the start of its first exposure (sec. II-B), with a histogram
    /// of `bins` bins that count up to `limit`.
    ///
    /// # Panics
    ///
    /// Panics if `config.x` is zero, or the gate is empty or reaches beyond the
    /// histogram.
    #[must_use]
    pub fn new(bins: usize, limit: f64, config: Config) -> Self {
        assert!(config.x > 0, "X is at least one laser cycle");
        assert!(
            config.first <= config.last && config.last < bins,
            "the gate is a window of the histogram"
        );
        Self {
            config,
            histogram: Histogram::new(bins, limit),
            cycles: 0,
            exposure: 0,
            event: None,
        }
    }

    /// Counts a photon in `bin` (sec. II-A). Photons outside the range gate have no effect.
    pub fn photon(&mut self, bin: usize) {
        if (self.config.first..=self.config.last).contains(&bin) {
            self.histogram.add(bin);
        }
    }

    /// Ends a laser cycle and follows the flow chart of sec. II-B.
    ///
    /// After every `X` cycles `N` is checked. If `L_1 < N < L_2` the decision
    /// is taken, and returned. After an event, or once `N` has reached `L_2`,
    /// the histogram is cleared and `N` restarts from zero.
    pub fn end_laser_cycle(&mut self) -> Option<Look> {
        let cycle = self.cycles;
        self.cycles += 1;
        self.exposure += 1;
        self.event = None;

        if !self.exposure.is_multiple_of(self.config.x) {
            return None;
        }
        let look = (self.config.l1 < self.exposure && self.exposure < self.config.l2)
            .then(|| self.look(cycle));
        if let Some(look) = look
            && look.fired
        {
            self.event = Some(self.report(look));
        }
        if self.event.is_some() || self.exposure >= self.config.l2 {
            self.histogram.clear();
            self.exposure = 0;
        }
        look
    }

    /// The peak event of the last [`end_laser_cycle`](Self::end_laser_cycle), if there was one
    /// (sec. II-B).
    #[must_use]
    pub fn event(&self) -> Option<&Event> {
        self.event.as_ref()
    }

    /// The histogram of the exposure so far (sec. II-A).
    #[must_use]
    pub fn histogram(&self) -> &Histogram {
        &self.histogram
    }

    /// The decision: peak, background, threshold (sec. II-B, Eq. 5).
    fn look(&self, cycle: u64) -> Look {
        let Config {
            background,
            alpha,
            minimum_count,
            first,
            last,
            ..
        } = self.config;
        let counts = self.histogram.counts();
        let (peak_bin, peak_count) = peak(counts, first, last);
        let background = match background {
            Background::Quadrants => quadrant_background(counts, first, last, peak_bin),
            Background::Average => average_background(counts, first, last),
        };
        Look {
            cycle,
            exposure: self.exposure,
            peak_bin,
            peak_count,
            background,
            fired: stands_clear(peak_count, background, alpha, minimum_count),
        }
    }

    /// The event of a decision that fired (sec. II-B, sec. III-A).
    fn report(&self, look: Look) -> Event {
        let Config { first, last, .. } = self.config;
        let counts = self.histogram.counts();
        Event {
            look,
            position: centroid(counts, first, last, look.peak_bin, look.background),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: Config = Config {
        x: 4,
        l1: 8,
        l2: 20,
        background: Background::Quadrants,
        alpha: 2.0,
        minimum_count: 0.0,
        first: 0,
        last: 7,
    };

    /// Runs `cycles` laser cycles with the same photons in each. Returns their decisions and events.
    fn run(pixel: &mut Pixel, cycles: u32, photons: &[usize]) -> (Vec<Look>, Vec<Event>) {
        let mut looks = Vec::new();
        let mut events = Vec::new();
        for _ in 0..cycles {
            for &bin in photons {
                pixel.photon(bin);
            }
            looks.extend(pixel.end_laser_cycle());
            events.extend(pixel.event());
        }
        (looks, events)
    }

    /// Cycle and exposure of every decision in the dark.
    fn looks_in_the_dark(config: Config, cycles: u32) -> Vec<(u64, u32)> {
        let mut pixel = Pixel::new(8, 1023.0, config);
        let (looks, events) = run(&mut pixel, cycles, &[]);
        assert_eq!(events, []);
        looks.iter().map(|l| (l.cycle, l.exposure)).collect()
    }

    #[test]
    fn decisions_lie_strictly_between_the_limits() {
        // Checks at N = 4, 8, 12, 16 and 20, of which 12 and 16 are strictly
        // between 8 and 20. N = 20 is reached at the end of cycle 19, so that
        // the second exposure is the first, 20 cycles later.
        assert_eq!(
            looks_in_the_dark(CONFIG, 40),
            [(11, 12), (15, 16), (31, 12), (35, 16)]
        );
    }

    #[test]
    fn the_upper_limit_is_noticed_at_a_check() {
        // L2 = 18 lies between the checks at 16 and 20: N = 20 >= 18 ends the
        // exposure, and the second one starts with cycle 20.
        let config = Config { l2: 18, ..CONFIG };
        assert_eq!(
            looks_in_the_dark(config, 32),
            [(11, 12), (15, 16), (31, 12)]
        );
    }

    #[test]
    fn limits_without_a_check_between_them_never_decide() {
        // Checks at 4, 8 and 12: none is above 8 and below 12.
        let config = Config { l2: 12, ..CONFIG };
        assert_eq!(looks_in_the_dark(config, 100), []);
    }

    #[test]
    fn a_significant_peak_makes_an_event_and_restarts_the_exposure() {
        let mut pixel = Pixel::new(8, 1023.0, CONFIG);
        // After 12 cycles: 12, 12, 24, 12 counts in bins 0, 2, 5, 6. Peak in
        // bin 5, upper half; quadrants 0-1 and 2-3 have maxima 12 and 12.
        // Threshold 12 + 2 * 3.46 = 18.9 < 24. Above the background: 0, 12, 0
        // in bins 4, 5, 6.
        let (looks, events) = run(&mut pixel, 12, &[0, 2, 5, 5, 6]);
        let look = Look {
            cycle: 11,
            exposure: 12,
            peak_bin: 5,
            peak_count: 24.0,
            background: 12.0,
            fired: true,
        };
        let position = 5.5;
        assert_eq!(looks, [look]);
        assert_eq!(events, [Event { look, position }]);
        assert_eq!(pixel.histogram().total(), 0.0);

        // The next 12 cycles give the same, and clear the event before.
        let (looks, events) = run(&mut pixel, 12, &[0, 2, 5, 5, 6]);
        let look = Look { cycle: 23, ..look };
        assert_eq!(looks, [look]);
        assert_eq!(events, [Event { look, position }]);
    }

    #[test]
    fn a_weak_peak_needs_a_longer_exposure() {
        // alpha = 3.75. N = 12: peak 24, threshold 12 + 3.75 * 3.464 = 24.99.
        // N = 16: peak 32, threshold 16 + 3.75 * 4 = 31.
        let config = Config {
            alpha: 3.75,
            ..CONFIG
        };
        let mut pixel = Pixel::new(8, 1023.0, config);
        let (looks, events) = run(&mut pixel, 16, &[0, 2, 5, 5]);
        let fired: Vec<_> = looks.iter().map(|l| (l.exposure, l.fired)).collect();
        assert_eq!(fired, [(12, false), (16, true)]);
        assert_eq!(events.len(), 1);
        assert_eq!(events[0].look.peak_count, 32.0);
    }

    #[test]
    fn the_average_of_all_bins_as_background() {
        // After 12 cycles 12, 12, 24, 12 counts, 60 in all: the average is 7.5 and the
        // threshold with alpha = 6 is 7.5 + 6 * 2.74 = 23.9. Above the background: 0, 16.5
        // and 4.5 in bins 4, 5 and 6.
        let config = Config {
            background: Background::Average,
            alpha: 6.0,
            ..CONFIG
        };
        let (looks, events) = run(&mut Pixel::new(8, 1023.0, config), 12, &[0, 2, 5, 5, 6]);
        assert_eq!((looks[0].background, looks[0].fired), (7.5, true));
        assert!((events[0].position - (5.5 + 4.5 / 21.0)).abs() < 1e-12);
    }

    #[test]
    fn the_upper_limit_clears_the_histogram() {
        // No decision is taken at N = 20, however strong the peak.
        let config = Config { l1: 16, ..CONFIG };
        let mut pixel = Pixel::new(8, 1023.0, config);
        run(&mut pixel, 19, &[5]);
        assert_eq!(pixel.histogram().total(), 19.0);
        let (looks, events) = run(&mut pixel, 1, &[5]);
        assert_eq!((looks.len(), events.len()), (0, 0));
        assert_eq!(pixel.histogram().total(), 0.0);
    }

    #[test]
    fn the_minimum_count_holds_an_event_back() {
        // Peak 12 at N = 12 and 16 at N = 16, no background.
        let config = Config {
            minimum_count: 13.0,
            ..CONFIG
        };
        let (looks, _) = run(&mut Pixel::new(8, 1023.0, config), 16, &[5]);
        let fired: Vec<_> = looks.iter().map(|l| (l.peak_count, l.fired)).collect();
        assert_eq!(fired, [(12.0, false), (16.0, true)]);
    }

    #[test]
    fn photons_outside_the_gate_leave_no_trace() {
        let config = Config {
            first: 2,
            last: 6,
            ..CONFIG
        };
        let mut pixel = Pixel::new(8, 1023.0, config);
        for bin in 0..10 {
            pixel.photon(bin);
        }
        assert_eq!(
            pixel.histogram().counts(),
            [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]
        );
    }

    #[test]
    fn the_gate_holds_for_peak_background_and_position() {
        // Bins 2 to 6, n = 5: boundaries 2, 3, 4, 5, 7. After 12 cycles bin 6
        // has 36, bins 2 and 3 have 12 and 24; bin 7 is gated out. Background
        // min(12, 24) = 12; above it 0 in bin 5, 24 in bin 6, none in bin 7.
        let config = Config {
            first: 2,
            last: 6,
            ..CONFIG
        };
        let mut pixel = Pixel::new(8, 1023.0, config);
        let (_, events) = run(&mut pixel, 12, &[2, 3, 3, 6, 6, 6, 7, 7, 7, 7]);
        let look = Look {
            cycle: 11,
            exposure: 12,
            peak_bin: 6,
            peak_count: 36.0,
            background: 12.0,
            fired: true,
        };
        let position = 6.5;
        assert_eq!(events, [Event { look, position }]);
    }

    #[test]
    fn a_saturated_peak_is_reported_at_the_limit() {
        // 24 photons in bin 5 by N = 12, the counter stops at 15.
        let (_, events) = run(&mut Pixel::new(8, 15.0, CONFIG), 12, &[5, 5]);
        assert_eq!(events[0].look.peak_count, 15.0);
    }
}

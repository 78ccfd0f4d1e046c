//! A pixel with the window rule that reports several echoes and expects the next event at the bin of
//! the last. Not in the paper; otherwise it follows its flow chart (sec. II-B).

use std::collections::BTreeSet;

use super::{Histogram, Window, centroid, peak};

/// The settings of the pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoConfig {
    /// `X`, `L_1` and `L_2` of the flow chart.
    pub x: u32,
    /// See [`x`](Self::x).
    pub l1: u32,
    /// See [`x`](Self::x).
    pub l2: u32,
    /// Bins of the window.
    pub width: usize,
    /// Standard deviations above the mean.
    pub z: f64,
    /// With tracking: the standard deviations near the last event, and elsewhere.
    pub tracking: Option<(f64, f64)>,
    /// The fewest photons in the window of an event.
    pub minimum_count: f64,
    /// The first bin inside the range gate.
    pub first: usize,
    /// The last bin inside the range gate.
    pub last: usize,
    /// The most echoes of an exposure.
    pub echoes: usize,
    /// Bins to either side of an echo that are excluded after it.
    pub reach: usize,
    /// An exposure ends when it is this many times as long as at its last echo; `None`: at `L_2`.
    pub wait: Option<u32>,
}

/// An event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Echo {
    /// Number of the echo, from 1 in each exposure.
    pub number: usize,
    /// Laser cycles of the exposure so far.
    pub exposure: u32,
    /// The window of the peak.
    pub window: Window,
    /// Photons in the bin.
    pub count: f64,
    /// Position in bins from the start of bin 0.
    pub position: f64,
    /// Whether it follows directly on excluded bins.
    pub is_tail: bool,
    /// Whether the centroid reaches excluded bins, or past the gate.
    pub is_clipped: bool,
    /// Whether it was expected in its bin.
    pub is_expected: bool,
}

/// The pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoPixel {
    config: EchoConfig,
    histogram: Histogram,
    exposure: u32,
    /// The exposure at the last echo.
    echo_at: Option<u32>,
    peaks: Vec<usize>,
    left_out: BTreeSet<usize>,
    expected: Option<usize>,
}

impl EchoPixel {
    /// A pixel at the start of its first exposure, with `bins` bins that count up to `limit`.
    #[must_use]
    pub fn new(bins: usize, limit: f64, config: EchoConfig) -> Self {
        Self {
            config,
            histogram: Histogram::new(bins, limit),
            exposure: 0,
            echo_at: None,
            peaks: Vec::new(),
            left_out: BTreeSet::new(),
            expected: None,
        }
    }

    /// Whether the present exposure has had an echo.
    #[must_use]
    pub fn has_reported(&self) -> bool {
        !self.peaks.is_empty()
    }

    /// Counts a photon in `bin`. Photons outside the gate and in excluded bins have no effect.
    pub fn photon(&mut self, bin: usize) {
        let is_gated = (self.config.first..=self.config.last).contains(&bin);
        if is_gated && !self.left_out.contains(&bin) {
            self.histogram.add(bin);
        }
    }

    /// Ends a laser cycle. `stands_clear` decides about each window, as
    /// [`Window::stands_clear`] does.
    pub fn end_laser_cycle(
        &mut self,
        mut stands_clear: impl FnMut(&Window) -> bool,
    ) -> Option<Echo> {
        let EchoConfig { x, l1, l2, .. } = self.config;
        self.exposure += 1;
        if !self.exposure.is_multiple_of(x) || self.exposure <= l1 {
            return None;
        }
        let end = self.echo_at.zip(self.config.wait);
        let end = end.map_or(l2, |(at, times)| l2.min(at * times));
        if self.exposure >= end {
            self.start_over();
            return None;
        }
        let (window, is_expected) = self.look(&mut stands_clear)?;
        let echo = self.echo(window, is_expected);
        self.peaks.push(window.bin);
        self.echo_at = Some(self.exposure);
        let (first, last, reach) = (self.config.first, self.config.last, self.config.reach);
        for bin in first.max(window.bin.saturating_sub(reach))..=last.min(window.bin + reach) {
            self.left_out.insert(bin);
            self.histogram.clear_bin(bin);
        }
        // A decision needs at least eight bins.
        let left = last + 1 - first - self.left_out.len();
        if self.peaks.len() == self.config.echoes || left < 8 {
            self.start_over();
        }
        Some(echo)
    }

    /// The window above its threshold, and whether it is around the expected bin.
    fn look(&self, stands_clear: &mut impl FnMut(&Window) -> bool) -> Option<(Window, bool)> {
        let EchoConfig {
            width,
            z,
            minimum_count,
            first,
            last,
            ..
        } = self.config;
        let counts = self.histogram.counts();
        let window = |z, around, bin| {
            let left_out = self.left_out.len();
            Window::around(counts, (first, last), left_out, (width, z), (around, bin))
        };
        let mut clears = |window: &Window| window.inside >= minimum_count && stands_clear(window);
        let mut z_far = z;
        if let (Some(expected), Some((near, far))) = (self.expected, self.config.tracking) {
            z_far = far;
            // The bins of all windows that contain it.
            let lowest = first.max((expected + 1).saturating_sub(width));
            let (bin, _) = peak(counts, lowest, last.min(expected + width - 1));
            let window = window(near, expected, bin);
            if clears(&window) {
                return Some((window, true));
            }
        }
        let (bin, _) = peak(counts, first, last);
        Some((window(z_far, bin, bin), false)).filter(|(window, _)| clears(window))
    }

    fn echo(&self, window: Window, is_expected: bool) -> Echo {
        let EchoConfig {
            first, last, reach, ..
        } = self.config;
        let (counts, bin) = (self.histogram.counts(), window.bin);
        let is_behind = |&peak: &usize| bin > peak + reach && bin <= peak + 2 * reach;
        let is_out = |beside: usize| self.left_out.contains(&beside);
        Echo {
            number: self.peaks.len() + 1,
            exposure: self.exposure,
            window,
            count: counts[bin],
            position: centroid(counts, first, last, bin, window.background()),
            is_tail: self.peaks.iter().any(is_behind),
            is_clipped: bin == first || bin == last || is_out(bin - 1) || is_out(bin + 1),
            is_expected,
        }
    }

    /// Starts a new exposure, which expects its event at the bin of the last one.
    fn start_over(&mut self) {
        self.expected = self.peaks.last().copied();
        self.peaks.clear();
        self.left_out.clear();
        self.histogram.clear();
        self.exposure = 0;
        self.echo_at = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: EchoConfig = EchoConfig {
        x: 4,
        l1: 4,
        l2: 24,
        width: 1,
        z: 4.0,
        tracking: None,
        minimum_count: 5.0,
        first: 0,
        last: 31,
        echoes: 3,
        reach: 2,
        wait: None,
    };

    /// Laser cycle, number and bin of the events with the same photons in each laser cycle.
    fn run(config: EchoConfig, cycles: u32, photons: &[usize]) -> Vec<(u32, usize, usize, bool)> {
        let mut pixel = EchoPixel::new(32, 1023.0, config);
        let cycles = (0..cycles).filter_map(|cycle| {
            photons.iter().for_each(|&bin| pixel.photon(bin));
            let echo = pixel.end_laser_cycle(Window::stands_clear)?;
            Some((cycle, echo.number, echo.window.bin, echo.is_tail))
        });
        cycles.collect()
    }

    #[test]
    fn echoes_come_one_a_look_and_then_the_exposure_ends() {
        // Bins 10 to 14 are excluded, then bins 18 to 22; bin 16 is two after the former.
        let photons = [12, 12, 12, 12, 12, 12, 12, 12, 20, 20, 20, 20, 16, 16];
        let exposure = [(7, 1, 12, false), (11, 2, 20, false), (15, 3, 16, true)];
        assert_eq!(run(CONFIG, 16, &photons), exposure);
        // The fourth look is the second of the next exposure, above L1 of 4.
        assert_eq!(run(CONFIG, 24, &photons)[3], (23, 1, 12, false));
    }

    #[test]
    fn one_surface_waits_for_the_upper_limit() {
        assert_eq!(
            run(CONFIG, 48, &[12]),
            [(7, 1, 12, false), (31, 1, 12, false)]
        );
    }

    #[test]
    fn one_surface_waits_no_longer_than_it_took_several_times() {
        // The look at 8 laser cycles finds it, and that at 16 ends the exposure.
        let config = EchoConfig {
            wait: Some(2),
            ..CONFIG
        };
        assert_eq!(
            run(config, 40, &[12]),
            [(7, 1, 12, false), (23, 1, 12, false), (39, 1, 12, false)]
        );
    }

    #[test]
    fn the_last_event_is_expected_again() {
        // 8 photons in one of 32 bins, one in each other. The level is 7.4 at z = 4, 9.4 at
        // z = 5, higher at z = 6.
        let photons: Vec<usize> = (0..32).chain([12; 7]).collect();
        let tracking = Some((4.0, 6.0));
        let config = EchoConfig {
            z: 5.0,
            tracking,
            echoes: 1,
            ..CONFIG
        };
        let mut pixel = EchoPixel::new(32, 1023.0, config);
        let mut found = Vec::new();
        for cycle in 0..40 {
            if cycle % 8 == 0 {
                photons.iter().for_each(|&bin| pixel.photon(bin));
            }
            if cycle == 0 {
                (0..3).for_each(|_| pixel.photon(12)); // 11 photons for the first event
            }
            let echo = pixel.end_laser_cycle(Window::stands_clear);
            found.extend(echo.map(|echo| (cycle, echo.is_expected)));
        }
        assert_eq!(
            found,
            [(7, false), (15, true), (23, true), (31, true), (39, true)]
        );
    }
}

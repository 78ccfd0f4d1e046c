//! Peaks of a histogram: consecutive bins that hold significantly more than the background.
//!
//! Bins with two tops are two peaks if the counts between them are significantly lower, and less than
//! half of the lower top.

use super::significance::{are_surely_more, is_surely_less};

/// By chance one bin in so many belongs to a peak.
const ONE_IN: f64 = 1e7;

/// A peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its first bin.
    pub first: usize,
    /// Its highest bin.
    pub top: usize,
    /// Its last bin.
    pub last: usize,
    /// Photons above the background.
    pub photons: f64,
}

impl Peak {
    /// All peaks of `counts` above `background` photons a bin, from the nearest on. The TDC was `live` in so much of the
    /// laser cycles in each bin.
    #[must_use]
    pub fn all(counts: &[f64], live: &[f64], background: f64) -> Vec<Self> {
        let mut peaks = Vec::new();
        let stands = standing(counts, live, background);
        let mut bin = 0;
        while bin < counts.len() {
            if !stands[bin] {
                bin += 1;
                continue;
            }
            let length = stands[bin..].iter().take_while(|&&stands| stands).count();
            split(
                (counts, live),
                background,
                bin,
                bin + length - 1,
                &mut peaks,
            );
            bin += length;
        }
        peaks
    }

    /// Whether bin `top` lies in the peak or next to it.
    #[must_use]
    pub const fn is_near(&self, top: usize) -> bool {
        self.first <= top + 1 && self.last + 1 >= top
    }

    fn new(counts: &[f64], background: f64, first: usize, last: usize) -> Self {
        let top = highest(counts, first, last);
        let above = counts[first..=last].iter().map(|count| count - background);
        Self {
            first,
            top,
            last,
            photons: above.sum(),
        }
    }
}

/// For each bin whether it holds significantly more than the background, alone or with both neighbours.
/// In a group of three, only the bins above the background by a standard deviation count, and one between
/// them: a photon two bins beside a bright bin is no peak of its own.
fn standing(counts: &[f64], live: &[f64], background: f64) -> Vec<bool> {
    let surely = |(counts, live)| are_surely_more(counts, live, background, ONE_IN);
    let windows = |width| counts.windows(width).zip(live.windows(width));
    let mut stands: Vec<bool> = windows(1).map(surely).collect();
    for (first, (three, live)) in windows(3).enumerate() {
        if surely((three, live)) {
            let counts =
                |at: usize| (three[at] - background) * live[at] > (background * live[at]).sqrt();
            stands[first] |= counts(0);
            stands[first + 1] |= counts(1) || (counts(0) && counts(2));
            stands[first + 2] |= counts(2);
        }
    }
    stands
}

fn highest(counts: &[f64], first: usize, last: usize) -> usize {
    let mut top = first;
    for bin in first..=last {
        if counts[bin] > counts[top] {
            top = bin;
        }
    }
    top
}

/// Adds the peaks among the bins `first..=last`.
fn split(
    (counts, live): (&[f64], &[f64]),
    background: f64,
    first: usize,
    last: usize,
    peaks: &mut Vec<Peak>,
) {
    let (mut start, mut top, mut valley) = (first, first, first);
    for bin in first..=last {
        if counts[bin] > counts[top] && valley <= top {
            (top, valley) = (bin, bin);
            continue;
        }
        if counts[bin] < counts[valley] {
            valley = bin;
        }
        if valley <= top {
            continue;
        }
        let above = |bin: usize| counts[bin] - background;
        // The lower of the two tops, so far.
        let lower = above(top).min(above(bin));
        let [here, expected] =
            [counts[valley], lower + background].map(|count| count * live[valley]);
        if above(valley) < 0.5 * lower && is_surely_less(here, expected, ONE_IN) {
            peaks.push(Peak::new(counts, background, start, valley - 1));
            (start, top, valley) = (valley, bin, bin);
        } else if counts[bin] > counts[top] {
            (top, valley) = (bin, bin);
        }
    }
    peaks.push(Peak::new(counts, background, start, last));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::find::background::Level;
    use crate::find::observed::Trace;
    use rand_core::SeedableRng;
    use rand_distr::{Binomial, Distribution};
    use rand_pcg::Pcg64;

    fn pulse(counts: &mut [f64], photons: f64, position: f64, sigma: f64) {
        for (bin, count) in (0u32..).zip(counts) {
            *count += photons * dtof_light::rates::bin_share(bin, position, sigma);
        }
    }

    #[test]
    fn tops_with_a_valley_between_are_two_peaks() {
        let mut counts = vec![10.0; 128];
        pulse(&mut counts, 5000.0, 30.5, 1.0);
        pulse(&mut counts, 1000.0, 36.5, 1.0);
        pulse(&mut counts, 500.0, 100.2, 0.5);
        let peaks = Peak::all(&counts, &[1.0; 128], 10.0);
        let tops: Vec<usize> = peaks.iter().map(|peak| peak.top).collect();
        assert_eq!(tops, [30, 36, 100]);
        assert!((peaks[0].photons / 5000.0 - 1.0).abs() < 0.01);
        assert!(peaks[0].last < peaks[1].first);
    }

    #[test]
    fn a_photon_two_bins_beside_a_peak_belongs_to_it() {
        let mut counts = vec![0.0; 64];
        (counts[20], counts[22]) = (50.0, 1.0);
        let peaks = Peak::all(&counts, &[1.0; 64], 0.2);
        assert_eq!(peaks.len(), 1, "{peaks:?}");
        assert_eq!([peaks[0].first, peaks[0].top, peaks[0].last], [20, 20, 22]);
    }

    #[test]
    fn noise_on_a_slope_is_no_second_peak() {
        let mut counts = vec![0.0; 64];
        for (bin, count) in counts.iter_mut().enumerate().skip(20) {
            *count = 400.0 * (-(bin as f64 - 20.0) / 5.0).exp();
        }
        counts[27] += 25.0; // over two standard deviations
        let peaks = Peak::all(&counts, &[1.0; 64], 0.5);
        assert_eq!(peaks.len(), 1, "{peaks:?}");
        assert!(Peak::all(&[7.0; 64], &[1.0; 64], 7.0).is_empty());
        assert!(Peak::all(&[0.0; 64], &[1.0; 64], 0.0).is_empty());
    }

    /// Behind a bright surface a TDC of the first photon is live in few laser cycles, so that corrected counts scatter
    /// far more than counts.
    #[test]
    fn noise_after_pile_up_is_no_peak() {
        let mut rng = Pcg64::seed_from_u64(3);
        let (mut false_peaks, mut found) = (0, 0);
        for number in 0..2000_u32 {
            let cycles = 1000.0 * f64::from(1 + number % 20);
            let light = 0.002 * f64::from(1 + number % 15);
            let wall = f64::from(number % 7) * 0.5;
            let mut left = cycles;
            let mut counts = vec![0.0; 128];
            for (bin, count) in counts.iter_mut().enumerate() {
                let rate = light + if bin == 40 { wall } else { 0.0 };
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let first = Binomial::new(left as u64, -(-rate).exp_m1()).unwrap();
                *count = first.sample(&mut rng) as f64;
                left -= *count;
            }
            let mut trace = Trace {
                pixel: 0,
                cycles,
                counts,
                live: vec![1.0; 128],
                truth_mm: None,
            };
            trace.correct(cycles, 128);
            let peaks = Peak::all(&trace.counts, &trace.live, light * cycles);
            false_peaks += peaks.iter().filter(|peak| !peak.is_near(40)).count();
            found += peaks.iter().filter(|peak| peak.is_near(40)).count();
            let level = Level::of(&trace.counts, &trace.live);
            let error = (light * cycles / level.clear_bins).sqrt();
            assert!(
                (level.mean - light * cycles).abs() < 6.0 * error,
                "{number}"
            );
        }
        assert_eq!(false_peaks, 0);
        assert!(found >= 1714, "{found}"); // six of seven have a wall
    }
}

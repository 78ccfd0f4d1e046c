//! What the photons of a list tell, as they pass, that no histogram shows: photons that come together, as those of raindrops
//! do, and peaks that wander, as those of another LiDAR do.

use crate::options::rows::grouped;

/// So many bins are watched, or up to twice as many. Of larger arrays some of the pixels tell.
const MOST_BINS: usize = 1 << 17;
/// The mean number of photons is compared over so many laser cycles.
const LAGS: usize = 16;
/// The parts of a recording in which peaks are sought, and how many in a row have to show that one wanders.
const PARTS: u64 = 64;
const IN_A_ROW: usize = 8;
/// By so many bins at least meanwhile, within so many bins of a straight line.
const FARTHER: f64 = 4.0;
const WITHIN: f64 = 1.5;
/// Standard deviations that chance does not reach.
const SURE: f64 = 6.0;

/// What is wrong with the photons of a list.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ListChecks {
    /// Photons come so many times as often in one bin of a laser cycle as by chance, if that is surely too often.
    pub together: Option<f64>,
    /// Pixels in which a peak wanders, of those that were watched, and by how many bins in a laser cycle the median one
    /// does.
    pub wandering: Option<(usize, usize, f64)>,
}

impl ListChecks {
    /// That photons come together.
    #[must_use]
    pub fn together_warning(self) -> Option<String> {
        self.together.map(|times| {
            format!(
                "photons of one pixel and laser cycle are {times:.1} times as often in the same bin as chance would have it: \
                 rain or other flashes, crosstalk between pixels, or photons that are listed twice. --once-per-bin counts them once"
            )
        })
    }

    /// That a peak wanders.
    #[must_use]
    pub fn wandering_warning(self) -> Option<String> {
        self.wandering.map(|(some, all, bins)| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "laser cycles"
            )]
            let cycles = (1.0 / bins.abs()).round() as u64;
            format!(
                "in {some} of {all} pixels a peak wanders through the range, by a bin in about {} laser cycles. If it is another \
                 LiDAR, record with dither (docs/settings.md#dither); if it is a target that moves, take the events",
                grouped(cycles)
            )
        })
    }
}

/// The photons of one bin of a pixel.
#[derive(Clone, Copy, Default)]
struct Watched {
    /// The laser cycle of the last photon, and photons in it and those before it.
    cycle: u64,
    recent: [u8; LAGS + 1],
    /// Photons of this part of the recording, and of those before.
    now: u32,
    before: u32,
}

impl Watched {
    /// Another photon. Returns how many there are of each of the last laser cycles.
    fn photon(&mut self, cycle: u64) -> [u8; LAGS + 1] {
        let passed = usize::try_from(cycle - self.cycle).unwrap_or(usize::MAX);
        if passed > 0 {
            let kept = (LAGS + 1).saturating_sub(passed);
            self.recent.copy_within(..kept, passed.min(LAGS + 1));
            self.recent[..passed.min(LAGS + 1)].fill(0);
            self.cycle = cycle;
        }
        let recent = self.recent;
        self.recent[0] = self.recent[0].saturating_add(1);
        self.now = self.now.saturating_add(1);
        recent
    }
}

/// Watches the photons of a list.
pub(crate) struct ListWatch {
    bins: usize,
    /// One pixel in so many is watched.
    step: usize,
    watched: Vec<Watched>,
    /// Pairs of photons in one bin, of the same laser cycle and of some that follow each other.
    same: u64,
    others: [u64; LAGS],
    /// Laser cycles of a part, and the part of the last photon.
    length: u64,
    part: u64,
    /// For each pixel the parts with a peak that was not there before, and its bin.
    peaks: Vec<Vec<(u64, f64)>>,
}

impl ListWatch {
    /// Of so many pixels and bins, for so many laser cycles.
    pub(crate) fn new(pixels: usize, bins: usize, cycles: u64) -> Self {
        // Odd, so that it is not always the same column.
        let step = (pixels * bins / MOST_BINS) | 1;
        let watched = pixels.div_ceil(step);
        Self {
            bins,
            step,
            watched: vec![Watched::default(); watched * bins],
            same: 0,
            others: [0; LAGS],
            length: (cycles / PARTS).max(1),
            part: 0,
            peaks: vec![Vec::new(); watched],
        }
    }

    /// Another photon.
    pub(crate) fn photon(&mut self, pixel: usize, cycle: u64, bin: usize) {
        if !pixel.is_multiple_of(self.step) {
            return;
        }
        if cycle / self.length != self.part {
            self.end_part();
            self.part = cycle / self.length;
        }
        let recent = self.watched[pixel / self.step * self.bins + bin].photon(cycle);
        self.same += u64::from(recent[0]);
        for (pairs, recent) in self.others.iter_mut().zip(&recent[1..]) {
            *pairs += u64::from(*recent);
        }
    }

    /// Looks in each pixel for the bin that has most more than in the parts before.
    fn end_part(&mut self) {
        /// From so many parts on their mean is nearly right.
        const MANY: u64 = 8;
        for (pixel, bins) in self.watched.chunks_mut(self.bins).enumerate() {
            if self.part >= MANY {
                let more = |bins: &[Watched]| {
                    let (now, before) = bins.iter().fold((0.0, 0.0), |(now, before), bin| {
                        (now + f64::from(bin.now), before + f64::from(bin.before))
                    });
                    let expected = before / self.part as f64;
                    (now - expected) / (expected + 1.0).sqrt()
                };
                let all = bins.windows(3).map(more).enumerate();
                let most = all.max_by(|one, other| one.1.total_cmp(&other.1));
                if let Some((bin, _)) = most.filter(|(_, more)| *more > SURE) {
                    self.peaks[pixel].push((self.part, bin as f64));
                }
            }
            for bin in bins {
                bin.before = bin.before.saturating_add(bin.now);
                bin.now = 0;
            }
        }
    }

    /// What they tell.
    pub(crate) fn checks(self) -> ListChecks {
        /// By its fluctuations light comes together up to twice as often.
        const TIMES: f64 = 2.5;
        /// Fewer pairs may be so by chance.
        const FEWEST: f64 = 30.0;
        // Ordered pairs, as those of two laser cycles are.
        let same = 2.0 * self.same as f64;
        let others = self.others.iter().copied().max().unwrap_or(0) as f64;
        // Without pairs a laser was not on in those.
        let is_sure = (self.same as f64).min(others) >= FEWEST
            && same - others > SURE * (2.0 * same + others).sqrt()
            && same > TIMES * others;
        let mut speeds: Vec<f64> = self.peaks.iter().filter_map(|peaks| speed(peaks)).collect();
        speeds.sort_by(f64::total_cmp);
        let all = self.peaks.len();
        let is_several = speeds.len() > usize::from(all > 1);
        let speed = speeds.get(speeds.len() / 2).filter(|_| is_several);
        let speed = speed.map(|speed| (speeds.len(), all, speed / self.length as f64));
        ListChecks {
            together: is_sure.then(|| same / others),
            wandering: speed,
        }
    }
}

/// The bins a part by which a peak wanders, if it does.
fn speed(peaks: &[(u64, f64)]) -> Option<f64> {
    let of = |peaks: &[(u64, f64)]| {
        let [(first, _), .., (last, _)] = *peaks else {
            return None;
        };
        let is_in_a_row = last - first < PARTS.min(IN_A_ROW as u64 + 2);
        let number = peaks.len() as f64;
        let mean = |of: &dyn Fn(&(u64, f64)) -> f64| peaks.iter().map(of).sum::<f64>() / number;
        let (part, bin) = (mean(&|peak| peak.0 as f64), mean(&|peak| peak.1));
        // The bins less their mean add up to 0, so that the parts need not be less theirs.
        let covariance = mean(&|peak| peak.0 as f64 * (peak.1 - bin));
        let variance = mean(&|peak| (peak.0 as f64 - part).powi(2));
        let slope = covariance / variance;
        let is_line =
            |peak: &(u64, f64)| (peak.1 - bin - slope * (peak.0 as f64 - part)).abs() <= WITHIN;
        let is_far = slope.abs() * (last - first) as f64 >= FARTHER;
        (is_in_a_row && is_far && peaks.iter().all(is_line)).then_some(slope)
    };
    peaks.windows(IN_A_ROW).find_map(of)
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "photons, and bins of 0 to 63"
)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, Normal, Poisson, Uniform};
    use rand_pcg::Pcg64;

    const BINS: usize = 64;

    /// A part ends with the first photon of the next.
    #[test]
    fn a_photon_is_of_the_part_of_its_laser_cycle() {
        let mut watch = ListWatch::new(1, BINS, 100 * PARTS);
        for cycle in 0..=203 {
            watch.photon(0, cycle, 5);
            let part = cycle / 100;
            assert_eq!(watch.part, part);
            let watched = watch.watched[5];
            let of_part = cycle - 100 * part + 1;
            assert_eq!(u64::from(watched.before), 100 * part);
            assert_eq!(u64::from(watched.now), of_part);
        }
    }

    /// The photons of some pixels: pixel, laser cycle, bin.
    struct Photons {
        rng: Pcg64,
        cycles: u64,
        all: Vec<(u64, usize, usize)>,
    }

    impl Photons {
        fn new(cycles: u64, seed: u64) -> Self {
            Self {
                rng: Pcg64::seed_from_u64(seed),
                cycles,
                all: Vec::new(),
            }
        }

        /// So many photons in each laser cycle of a part of them, around a place that may move.
        fn add(
            &mut self,
            pixel: usize,
            cycles: std::ops::Range<u64>,
            rate: f64,
            place: impl Fn(u64) -> f64,
            sigma: f64,
        ) {
            for cycle in cycles {
                let number = Poisson::new(rate).unwrap().sample(&mut self.rng);
                for _ in 0..number as u32 {
                    let bin = Normal::new(place(cycle), sigma)
                        .unwrap()
                        .sample(&mut self.rng);
                    if (0.0..BINS as f64).contains(&bin) {
                        self.all.push((cycle, pixel, bin as usize));
                    }
                }
            }
        }

        fn background(&mut self, pixel: usize, rate: f64) {
            for cycle in 0..self.cycles {
                for _ in 0..Poisson::new(rate).unwrap().sample(&mut self.rng) as u32 {
                    let bin = Uniform::new(0, BINS).unwrap().sample(&mut self.rng);
                    self.all.push((cycle, pixel, bin));
                }
            }
        }

        fn checks(mut self, pixels: usize) -> ListChecks {
            self.all.sort_unstable();
            let mut watch = ListWatch::new(pixels, BINS, self.cycles);
            for (cycle, pixel, bin) in self.all {
                watch.photon(pixel, cycle, bin);
            }
            watch.checks()
        }
    }

    const PIXELS: usize = 4;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Targets of any light that stay, flicker slowly, go, come, or move from place to place.
        #[test]
        fn light_that_stays_is_right(
            background in 0.01..3.0_f64,
            signal in 0.05..5.0_f64,
            sigma in 0.2..1.5_f64,
            flickers: bool,
            goes: bool,
            seed: u64,
        ) {
            let mut photons = Photons::new(4000, seed);
            for pixel in 0..PIXELS {
                photons.background(pixel, background);
                let parts = if flickers { 0..10 } else { 0..1 };
                let length = 4000 / parts.end;
                for part in parts {
                    let rate = if part % 2 == 0 { signal } else { signal / 3.0 };
                    let place = if goes && part >= 5 { 50.0 } else { 20.0 + pixel as f64 };
                    photons.add(pixel, part * length..(part + 1) * length, rate, |_| place, sigma);
                }
            }
            prop_assert_eq!(photons.checks(PIXELS), ListChecks::default());
        }

        /// Drops of 20 to 60 photons in a laser cycle.
        #[test]
        fn photons_that_come_together_are_found(
            background in 0.01..3.0_f64,
            signal in 0.05..0.3_f64,
            drops in 20_usize..60,
            photons_each in 20.0..60.0_f64,
            seed: u64,
        ) {
            let mut photons = Photons::new(4000, seed);
            for pixel in 0..PIXELS {
                photons.background(pixel, background);
                photons.add(pixel, 0..4000, signal, |_| 40.0, 1.0);
                for _ in 0..drops {
                    let cycle = Uniform::new(0, 4000).unwrap().sample(&mut photons.rng);
                    let place = Uniform::new(2.0, 15.0).unwrap().sample(&mut photons.rng);
                    photons.add(pixel, cycle..cycle + 1, photons_each, |_| place, 1.0);
                }
            }
            let found = photons.checks(PIXELS);
            prop_assert!(found.together.is_some_and(|times| times > 2.5), "{:?}", found);
            prop_assert_eq!(found.wandering, None);
        }

        /// By 40 to 200 bins in the whole recording; by two bins it stays. By 30 some pixels do not show it.
        #[test]
        fn peaks_that_wander_are_found(
            background in 0.01..3.0_f64,
            bins in 40.0..200.0_f64,
            is_back: bool,
            seed: u64,
        ) {
            let with = |bins: f64| {
                let mut photons = Photons::new(4000, seed);
                let speed = if is_back { -bins } else { bins } / 4000.0;
                for pixel in 0..PIXELS {
                    photons.background(pixel, background);
                    photons.add(pixel, 0..4000, 0.5, |_| 40.0, 1.0);
                    let start = 10.0 * pixel as f64;
                    let place = |cycle| (start + speed * cycle as f64).rem_euclid(BINS as f64);
                    photons.add(pixel, 0..4000, 1.0, place, 1.0);
                }
                photons.checks(PIXELS).wandering
            };
            let (some, all, speed) = with(bins).unwrap();
            prop_assert!(some > 1 && all == PIXELS);
            let speed = speed * 4000.0;
            prop_assert!((0.65..1.5).contains(&(speed.abs() / bins)) && (speed < 0.0) == is_back, "{}", speed);
            prop_assert_eq!(with(2.0), None);
        }
    }

    /// Eight peaks in at most ten parts, along a line of at least four bins.
    #[test]
    fn a_speed_is_that_of_a_line_that_is_long_enough() {
        let at = |parts: [u64; 8], slope: f64, off: f64| {
            let peak = |(number, part): (usize, u64)| {
                let bin = 100.0 + slope * (part as f64 - 20.0);
                (part, if number == 3 { bin + off } else { bin })
            };
            let peaks: Vec<(u64, f64)> = parts.into_iter().enumerate().map(peak).collect();
            speed(&peaks)
        };
        let row = [10, 11, 12, 13, 14, 15, 16, 17];
        for slope in [-3.0, -0.58, 0.58, 7.0] {
            let found = at(row, slope, 0.0).unwrap();
            assert!((found - slope).abs() < 1e-9, "{found}");
        }
        for slope in [-0.56, 0.0, 0.56] {
            assert_eq!(at(row, slope, 0.0), None);
        }
        // Some parts have none.
        assert!(at([10, 11, 12, 13, 14, 15, 16, 19], 2.0, 0.0).is_some());
        assert_eq!(at([10, 11, 12, 13, 14, 15, 16, 20], 2.0, 0.0), None);
        assert_eq!(at([1, 2, 3, 4, 5, 6, 7, 40], 2.0, 0.0), None);
        // One lies beside the line.
        assert!(at(row, 2.0, 1.6).is_some());
        assert_eq!(at(row, 2.0, 2.0), None);
        assert_eq!(at(row, 2.0, -2.0), None);
        assert_eq!(speed(&[]), None);
    }

    proptest! {
        /// As counted one by one.
        #[test]
        fn the_last_laser_cycles_of_a_bin_are_remembered(steps in prop::collection::vec(prop_oneof![3 => 0_u64..3, 1 => 0_u64..40], 1..80)) {
            let (mut watched, mut cycle, mut cycles) = (Watched::default(), 0, Vec::new());
            for step in steps {
                cycle += step;
                let recent = watched.photon(cycle);
                for (lag, &photons) in recent.iter().enumerate() {
                    let expected = cycles.iter().filter(|&&other| other + lag as u64 == cycle).count();
                    prop_assert_eq!(usize::from(photons), expected, "{} of {:?}", lag, cycles);
                }
                cycles.push(cycle);
            }
        }
    }

    /// 180 ordered pairs of one laser cycle against 60 of two are within 6 standard deviations, 20.5 each; 200 are not.
    #[test]
    fn pairs_are_surely_too_many() {
        let together = |same: u64, others: u64| {
            let mut watch = ListWatch::new(1, 8, 1000);
            (watch.same, watch.others[3]) = (same, others);
            watch.checks().together
        };
        assert_eq!(together(90, 60), None);
        // 6 times 18.
        assert_eq!(together(72, 36), None);
        assert_eq!(together(73, 36), Some(146.0 / 36.0));
        assert_eq!(together(100, 60), Some(200.0 / 60.0));
        // Fewer than 30, or less than 2.5 times as many.
        assert_eq!(together(1000, 29), None);
        assert_eq!(together(1000, 30), Some(2000.0 / 30.0));
        assert_eq!(together(1250, 1000), None);
        assert_eq!(together(1251, 1000), Some(2.502));
    }

    /// Two are enough, or the only one.
    #[test]
    fn one_pixel_of_several_may_be_wrong() {
        let line: Vec<(u64, f64)> = (10..10 + IN_A_ROW as u64)
            .map(|part| (part, 2.0 * part as f64))
            .collect();
        let wandering = |wander: usize, stay: usize| {
            let mut watch = ListWatch::new(wander + stay, 64, 640);
            watch.peaks[..wander].fill(line.clone());
            watch.checks().wandering
        };
        assert_eq!(wandering(1, 1), None);
        assert_eq!(wandering(2, 1), Some((2, 3, 0.2)));
        assert_eq!(wandering(1, 0), Some((1, 1, 0.2)));
    }

    #[test]
    fn the_words_have_the_numbers() {
        let checks = ListChecks {
            together: Some(4.26),
            wandering: Some((16, 36, -0.008)),
        };
        let together = checks.together_warning().unwrap();
        assert!(
            together.contains(" are 4.3 times as often in the same bin"),
            "{together}"
        );
        let wanders = "in 16 of 36 pixels a peak wanders through the range, by a bin in about 125 laser cycles";
        assert!(checks.wandering_warning().unwrap().starts_with(wanders));
        let none = ListChecks::default();
        assert_eq!(
            (none.together_warning(), none.wandering_warning()),
            (None, None)
        );
    }

    /// Rows that are there twice.
    #[test]
    fn photons_that_are_listed_twice_are_found() {
        let mut photons = Photons::new(4000, 1);
        photons.background(0, 0.1);
        photons.add(0, 0..4000, 0.2, |_| 30.0, 1.0);
        photons.all = photons.all.repeat(2);
        assert!(photons.checks(1).together.is_some());
    }

    /// One pixel in nine; the same photons twice come together.
    #[test]
    fn of_a_large_array_some_pixels_tell() {
        for (pixel, is_watched) in [
            (0, true),
            (9, true),
            (1017, true),
            (1, false),
            (1016, false),
        ] {
            let mut watch = ListWatch::new(1024, 1024, 64_000);
            for cycle in 0..64_000 {
                watch.photon(pixel, cycle, (cycle * cycle % 61) as usize);
                watch.photon(pixel, cycle, (cycle * cycle % 61) as usize);
            }
            assert_eq!(watch.checks().together.is_some(), is_watched, "{pixel}");
        }
    }

    #[test]
    fn many_pixels_are_watched_in_part() {
        let watch = ListWatch::new(65_536, 1024, 1000);
        assert!(
            watch.watched.len() <= MOST_BINS + 1024,
            "{}",
            watch.watched.len()
        );
        assert!(!watch.step.is_multiple_of(2));
    }
}

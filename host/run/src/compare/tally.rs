//! The reports of one method: how often they come, and their errors.

use anyhow::{Result, ensure};
use dtof_core::{Array, BlockLevel, DepthEvent, PixelAddress};

use super::stress::Stress;
use super::truth::Truth;
use dtof_data::events::events_csv::range_mm;
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::ranges::Ranges;
use dtof_engine::settings::Settings;

/// A report with an error of more than so many bins is wrong.
pub const WRONG_BEYOND_BINS: f64 = 3.0;

/// The length of a bin in millimetres.
pub fn mm_per_bin(settings: &Settings) -> f64 {
    settings.configuration.bin_width_ps.to_num::<f64>() * MM_PER_PS
}

/// The first and the last bin of the gate, or of the histogram.
///
/// # Errors
/// Fails if the gate does not lie in the histogram.
pub fn first_and_last(settings: &Settings) -> Result<(usize, usize)> {
    let (first, last) = settings.configuration.gate;
    let (first, last) = (first.into(), last.into());
    ensure!(
        first <= last && last < settings.bins,
        "a gate from bin {first} to {last} of {} bins",
        settings.bins
    );
    Ok((first, last))
}

/// The most errors that are kept, of all pixels together.
const MAX_KEPT: usize = 400_000;

/// The reports of a method.
pub struct Tally<'a> {
    truth: &'a Truth,
    stress: &'a Stress,
    array: Array,
    ranges: Ranges,
    mm_per_bin: f64,
    cycles: u64,
    has_neighbours: bool,
    /// The most errors that are kept of a pixel.
    most: usize,
    pixels: Vec<Reports>,
    /// Reports of pixels without a target.
    stray: u64,
    /// Reports of pixels with a target that are of their blocks.
    of_blocks: u64,
}

/// The reports of a pixel.
#[derive(Clone, Default)]
struct Reports {
    right: u32,
    wrong: u32,
    /// Laser cycles until the first right report.
    first: Option<u64>,
    /// Errors in millimetres: every `2^stride`-th.
    kept: Vec<f32>,
    stride: u32,
}

impl Reports {
    fn keep(&mut self, value: f64, most: usize) {
        let number = self.right + self.wrong;
        if number.trailing_zeros() < self.stride {
            return;
        }
        if self.kept.len() == most {
            // Drop every other one.
            let mut odd = false;
            self.kept.retain(|_| {
                odd = !odd;
                !odd
            });
            self.stride += 1;
            if number.trailing_zeros() < self.stride {
                return;
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "millimetres")]
        self.kept.push(value as f32);
    }
}

/// The laser cycles in which a pixel has a target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watched {
    /// The first of them.
    pub from: u64,
    /// How many they are.
    pub cycles: u64,
}

/// Times and errors of a method.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Laser cycles of a pixel from one right report to the next: the mean of the middle half of the pixels
    /// with a target. Infinite if they have no right report. With neighbours that of a pixel is at least the time
    /// from its target to its first report: later ones may use photons that a neighbour has kept.
    pub cycles: f64,
    /// The same for the pixel at the 90th percentile.
    pub slow_cycles: f64,
    /// The 68th percentile of the absolute error in millimetres, of pixels with a target. Each pixel has
    /// the same weight.
    pub error_mm: f64,
    /// Reports of pixels with a target.
    pub reports: u64,
    /// The share of these with an error of more than three bins.
    pub wrong: f64,
    /// Reports of pixels without a target.
    pub stray: u64,
    /// The share of the reports of pixels with a target that are of their blocks.
    pub of_blocks: f64,
    /// The share of the pixels with a target that have no right report.
    pub silent: f64,
}

impl<'a> Tally<'a> {
    /// A tally of an array, for a run of `cycles` laser cycles.
    ///
    /// # Errors
    /// Fails if the range scale is invalid.
    pub fn new(
        truth: &'a Truth,
        stress: &'a Stress,
        array: Array,
        settings: &Settings,
        cycles: u64,
    ) -> Result<Self> {
        let pixels = array.pixels() as usize;
        Ok(Self {
            truth,
            stress,
            array,
            ranges: settings.ranges(array)?,
            mm_per_bin: mm_per_bin(settings),
            cycles,
            has_neighbours: settings.configuration.neighbours.is_some(),
            most: (MAX_KEPT / pixels.max(1)).clamp(8, 1024),
            pixels: vec![Reports::default(); pixels],
            stray: 0,
            of_blocks: 0,
        })
    }

    /// Adds events. An event of a block counts for each of its pixels.
    pub fn add(&mut self, events: &[DepthEvent]) {
        for event in events {
            for pixel in self.array.pixels_of(event.pixel, event.level) {
                self.report(event, pixel);
            }
        }
    }

    fn report(&mut self, event: &DepthEvent, pixel: PixelAddress) {
        let cycle = event.cycle.raw();
        if self.stress.is_hot(pixel, self.array.columns()) {
            return;
        }
        let ranges = self.truth.ranges(pixel, cycle);
        if ranges[0].is_none() {
            self.stray += 1;
            return;
        }
        // Without the drift, at the middle of the exposure.
        let middle = cycle.saturating_sub(u64::from(event.exposure) / 2);
        let moved = self.stress.moved(middle, self.cycles) * self.mm_per_bin;
        let range = range_mm(event, &self.ranges) - moved;
        let errors = ranges.into_iter().flatten().map(|truth| range - truth);
        let error = errors.min_by(|one, other| one.abs().total_cmp(&other.abs()));
        let limit = WRONG_BEYOND_BINS * self.mm_per_bin;
        let reports = &mut self.pixels[usize::from(pixel.raw())];
        let Some(error) = error else { return };
        if error.abs() > limit {
            reports.wrong += 1;
        } else {
            reports.right += 1;
            reports.first.get_or_insert(cycle + 1);
        }
        reports.keep(error, self.most);
        self.of_blocks += u64::from(event.level != BlockLevel::PIXEL);
    }

    /// The figures. Each pixel was `watched`.
    #[must_use]
    pub fn finish(mut self, watched: &[Watched]) -> Figures {
        if !matches!(self.truth, Truth::Scene(_)) {
            self.subtract_offset(watched);
        }
        let mut figures = Figures {
            stray: self.stray,
            ..Figures::default()
        };
        let mut times = Vec::new();
        let mut errors = Vec::new();
        let mut wrong = 0;
        for (pixel, (reports, &Watched { from, cycles })) in
            self.pixels.iter().zip(watched).enumerate()
        {
            #[allow(clippy::cast_possible_truncation, reason = "an address")]
            let is_hot = self
                .stress
                .is_hot(PixelAddress::new(pixel as u16), self.array.columns());
            if cycles == 0 || is_hot {
                continue;
            }
            let (cycles, mut right) = (cycles as f64, f64::from(reports.right));
            if let Some(first) = reports.first.filter(|_| self.has_neighbours) {
                right = right.min(cycles / first.saturating_sub(from).max(1) as f64);
            }
            times.push((cycles, right));
            figures.reports += u64::from(reports.right + reports.wrong);
            wrong += u64::from(reports.wrong);
            let weight = 1.0 / reports.kept.len().max(1) as f64;
            errors.extend(reports.kept.iter().map(|error| (error.abs(), weight)));
        }
        // Infinite without a right report.
        let time = |(cycles, right): &(f64, f64)| cycles / right;
        times.sort_unstable_by(|one, other| time(one).total_cmp(&time(other)));
        let silent = times.iter().filter(|pixel| pixel.1 == 0.0).count();
        figures.silent = silent as f64 / times.len().max(1) as f64;
        let quarter = times.len() / 4;
        let middle = &times[quarter..times.len() - quarter];
        let sum = |of: fn(&(f64, f64)) -> f64| middle.iter().map(of).sum::<f64>();
        figures.cycles = sum(|pixel| pixel.0) / sum(|pixel| pixel.1);
        if figures.cycles.is_nan() {
            figures.cycles = f64::INFINITY;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place"
        )]
        let slow = (0.9 * times.len() as f64) as usize;
        figures.slow_cycles = times.get(slow).map_or(f64::INFINITY, time);
        figures.wrong = wrong as f64 / figures.reports.max(1) as f64;
        figures.of_blocks = self.of_blocks as f64 / figures.reports.max(1) as f64;
        figures.error_mm = weighted_quantile(&mut errors, 0.68);
        figures
    }

    /// Subtracts the median error: the offset of a sensor is calibrated for its estimator.
    fn subtract_offset(&mut self, watched: &[Watched]) {
        let mut errors = Vec::new();
        for (reports, _) in self
            .pixels
            .iter()
            .zip(watched)
            .filter(|(_, watched)| watched.cycles > 0)
        {
            let weight = 1.0 / reports.kept.len().max(1) as f64;
            errors.extend(reports.kept.iter().map(|error| (*error, weight)));
        }
        let median = weighted_quantile(&mut errors, 0.5);
        if median.is_finite() {
            let kept = self.pixels.iter_mut().flat_map(|reports| &mut reports.kept);
            #[allow(clippy::cast_possible_truncation, reason = "millimetres")]
            kept.for_each(|error| *error -= median as f32);
        }
    }
}

/// The weighted quantile of values (`.0`) with weights (`.1`); infinite without values.
fn weighted_quantile(values: &mut [(f32, f64)], share: f64) -> f64 {
    values.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
    let all: f64 = values.iter().map(|value| value.1).sum();
    let mut sum = 0.0;
    for (value, weight) in values.iter() {
        sum += weight;
        if sum >= share * all {
            return (*value).into();
        }
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::{BinIndex, Count, EchoNumber, Flags, LaserCycle, Neighbours, SubBinOffset};

    /// The time of a pixel that has a target from laser cycle 5,000 to 6,000 and reports at these.
    fn time(reports: &[u64], neighbours: Option<Neighbours>) -> f64 {
        let array = Array::new(1, 1).unwrap();
        let settings = Settings::static_scene(1).configured(|array| array.neighbours = neighbours);
        let event = |cycle: u64| DepthEvent {
            pixel: PixelAddress::new(0),
            level: BlockLevel::PIXEL,
            echo: EchoNumber::FIRST,
            cycle: LaserCycle::new(cycle),
            exposure: 40,
            peak_bin: BinIndex::saturating(60),
            offset: SubBinOffset::MIN,
            peak_count: Count::saturating(5),
            background: Count::saturating(1),
            flags: Flags::NONE,
        };
        let events: Vec<DepthEvent> = reports.iter().map(|&cycle| event(cycle - 1)).collect();
        let range = range_mm(&events[0], &settings.ranges(array).unwrap());
        let truth = Truth::Ranges(vec![Some(range)]);
        let mut tally = Tally::new(&truth, &Stress::NONE, array, &settings, 6000).unwrap();
        tally.add(&events);
        let watched = Watched {
            from: 5000,
            cycles: 1000,
        };
        tally.finish(&[watched]).cycles
    }

    #[test]
    fn with_neighbours_the_time_is_at_least_that_from_the_target_to_the_first_report() {
        let eight = Some(Neighbours::Eight);
        let late = [5500, 5510, 5520, 5530];
        assert_eq!(time(&late, None), 250.0);
        assert_eq!(time(&late, eight), 500.0);
        let early = [5050, 5510];
        assert_eq!(time(&early, None), 500.0);
        assert_eq!(time(&early, eight), 500.0);
    }
}

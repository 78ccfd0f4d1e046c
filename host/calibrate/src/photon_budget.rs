//! How many photons to use for an event, where true distances are known.
//!
//! The recording is replayed. With more photons an event is more exact, but later. The budget is the
//! number of photons that an event of the paper's rule takes with its own minimum, 5 in the highest bin:
//! within it, the minimum count goes up, then X. The window is the one for the pulse, or a wider one if
//! that is more exact with the same photons. The median error of the events is taken off the range
//! offset: few photons of an asymmetric pulse lie elsewhere than many.

use anyhow::{Context, Result};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{AnyRule, Array, Count, DepthEstimator, PaperRule, PixelAddress, WindowRule};

use super::find::significance::median;
use super::{Length, Observed, WindowDetection};
use dtof_data::photons::recorded::{RecordedHistograms, RecordingLength};
use dtof_data::photons::source::{PhotonSource, Slice};
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_light::progress::{Part, Progress};

/// The most laser cycles that are replayed, and the most photons.
const MAX_CYCLES: u16 = 10_000;
const MAX_PHOTONS: f64 = 2e7;
/// The fewest events that are evaluated.
const MIN_EVENTS: usize = 200;
/// A wider window costs more instructions: its error has to be below this share of that before.
const GAIN: f64 = 0.97;
/// The highest minimum count that is tried.
const MAX_MIN_COUNT: u16 = 200;

/// Settings that use the budget, and the events that they give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonBudget {
    /// Bins in the window of the rule.
    pub window: u8,
    /// The fewest photons in the window.
    pub min_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// Mean number of photons of all bins that an event takes.
    pub photons: f64,
    /// Median absolute error of an event, in millimetres.
    pub error_mm: f64,
    /// Millimetres to add to the range offset.
    pub offset_mm: f64,
}

impl PhotonBudget {
    /// The error times the square root of the photons, which does not depend on their number.
    fn error_of_one_photon(&self) -> f64 {
        self.error_mm * self.photons.sqrt()
    }
}

/// A replay of the pixels with a true distance.
pub struct Replay<'a> {
    settings: Settings,
    slice: Slice,
    /// True ranges, without the offset of each pixel.
    truth: Vec<f64>,
    detection: &'a WindowDetection,
}

impl<'a> Replay<'a> {
    /// A replay with the settings that were found so far; `None` without true distances or laser cycles.
    ///
    /// # Errors
    /// Fails if the recording cannot be replayed, or if the bin width or the offset is out of range.
    pub fn new(
        observed: &Observed,
        detection: &'a WindowDetection,
        hot: &[usize],
        (gate, bin_width_ps): ((u16, u16), f64),
        (offset_mm, offsets_mm): (f64, &[f64]),
        seed: u64,
    ) -> Result<Option<Self>> {
        let Some(truth) = observed.truth_mm else {
            return Ok(None);
        };
        let length = match observed.length {
            Length::Cycles(cycles) => RecordingLength::Cycles(cycles),
            Length::PhotonsPerCycle(rate) => RecordingLength::PhotonsPerCycle(rate),
            Length::Unknown => return Ok(None),
        };
        let (array, histograms) = (observed.array, observed.histograms);
        let pixels = array.pixels();
        let of_captures = (0..=u16::MAX).take(histograms.len());
        let is_left_out = |pixel: &u16| {
            hot.contains(&((u32::from(*pixel) % pixels) as usize))
                || observed.is_masked((*pixel).into())
        };
        let left_out: Vec<u16> = of_captures.filter(is_left_out).collect();
        let cycles = MAX_CYCLES.into();
        let mut photons =
            RecordedHistograms::with_masked(array, histograms, length, cycles, seed, &left_out)?;
        let cycles = MAX_PHOTONS / photons.photons_per_cycle().max(1e-9);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let slice = photons.next_slice(cycles.clamp(1.0, MAX_CYCLES.into()) as u16)?;
        let with_truth = slice.pixels.into_iter().zip(truth);
        let own = |place: usize| offsets_mm.get(place % pixels as usize).copied();
        // The range without the offset of the pixel.
        let with_truth = with_truth
            .enumerate()
            .filter(|(place, _)| !observed.is_masked(*place))
            .filter_map(|(place, (pixel, truth))| {
                let bias = observed.bias(place % pixels as usize);
                Some((pixel, (*truth)? + bias - own(place).unwrap_or(0.0)))
            });
        let (pixels, truth): (Vec<_>, Vec<f64>) = with_truth.unzip();
        let bin_width_ps = U16F16::checked_from_num(bin_width_ps).context("the bin width")?;
        let offset_mm = I24F8::checked_from_num(offset_mm).context("the offset")?;
        let default = SettingsFile::default().settings(observed.bins())?;
        let settings = default
            .for_pulse(detection.sigma_bins)
            .configured(|of_range| {
                of_range.gate = gate;
                (of_range.bin_width_ps, of_range.offset_mm) = (bin_width_ps, offset_mm);
                (of_range.x, of_range.l1, of_range.l2) = (detection.x, detection.l1, detection.l2);
                if let Some(window) = detection.half_widths {
                    of_range.estimator = DepthEstimator::CentredWindow(window);
                }
            });
        let slice = Slice {
            first_cycle: 0,
            pixels,
        };
        Ok((truth.len() > 1).then_some(Self {
            settings,
            slice,
            truth,
            detection,
        }))
    }

    /// The best window, minimum count and X; `None` if there are too few events.
    ///
    /// # Errors
    /// Fails if the settings are invalid, or if `progress` ends the calculation.
    pub fn best(&self, progress: Progress) -> Result<Option<PhotonBudget>> {
        let least = self.detection.min_count;
        let windows = self.detection.window..=WindowRule::MAX_WIDTH;
        let part = Part::new(progress, windows.len() as u64)?;
        let paper = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(least.into()));
        let Some(paper) = self.replay(paper.into(), (1, least, self.settings.configuration.x))?
        else {
            return Ok(None);
        };
        let mut best: Option<PhotonBudget> = None;
        let mut first = least;
        for window in windows {
            let found = self.with_window(window, first, paper.photons, &part)?;
            part.next()?;
            let Some(found) = found else {
                continue;
            };
            // A wider window holds more photons.
            first = found.min_count;
            let is_better = |best: PhotonBudget| {
                found.photons <= paper.photons
                    && found.error_of_one_photon() < GAIN * best.error_of_one_photon()
            };
            if best.is_none_or(is_better) {
                best = Some(found);
            }
        }
        Ok(best)
    }

    /// The highest minimum count from `first` on whose events take at most `budget` photons, or `first`,
    /// then the highest X; `None` if there are too few events.
    fn with_window(
        &self,
        window: u8,
        first: u16,
        budget: f64,
        part: &Part,
    ) -> Result<Option<PhotonBudget>> {
        let mut best = None;
        let z = U4F12::saturating_from_num(self.detection.z.unwrap_or(0.0));
        let with = |minimum: u16, x: u16| {
            part.check()?;
            let rule = WindowRule::new(window, z, Count::saturating(minimum.into()))?;
            self.replay(rule.into(), (window, minimum, x))
        };
        for minimum in first..=MAX_MIN_COUNT {
            let found = with(minimum, self.settings.configuration.x)?;
            if found.is_none_or(|found| best.is_some() && found.photons > budget) {
                break;
            }
            best = found;
        }
        // The rest of the budget allows a larger X.
        while let Some(last) = best.filter(|last| last.x < self.settings.configuration.l2 / 4) {
            let found = with(last.min_count, last.x + 1)?;
            if found.is_none_or(|found| found.photons > budget) {
                break;
            }
            best = found;
        }
        Ok(best)
    }

    fn replay(
        &self,
        rule: AnyRule,
        (window, min_count, x): (u8, u16, u16),
    ) -> Result<Option<PhotonBudget>> {
        let settings = self.settings.clone().configured(|faster| {
            (faster.rule, faster.x) = (rule, x);
            faster.l1 = faster.l1.max(x);
        });
        let pixels = u16::try_from(self.truth.len())?;
        let array = Array::new(pixels.into(), 1).context("no pixels")?;
        let addresses: Vec<PixelAddress> = (0..pixels).map(PixelAddress::new).collect();
        let mut engine = host_engine(&settings, array, &addresses)?;
        let events = engine.run(&self.slice)?;
        if events.len() < MIN_EVENTS {
            return Ok(None);
        }
        let ranges = settings.ranges(array)?;
        let errors = || {
            events.iter().map(|event| {
                let range = ranges.of(event.pixel, event.level, event.position());
                range.to_num::<f64>() - self.truth[usize::from(event.pixel.raw())]
            })
        };
        let off = median(errors());
        let [statistics, _] = engine.statistics();
        Ok(Some(PhotonBudget {
            window,
            min_count,
            x,
            photons: statistics.photons() as f64 / events.len() as f64,
            error_mm: median(errors().map(|error| (error - off).abs())),
            offset_mm: -off,
        }))
    }
}

//! How many photons an event is worth, where true distances are known.
//!
//! The recording is replayed. More photons an event make its distance better and come later. As
//! many are spent as the paper's rule takes with its own minimum, 5 in the highest bin: the minimum
//! goes up, then looks become fewer. The window is the one that suits the pulse, or a wider one if
//! that does more with as many photons. What events are off by in the median is taken off the range
//! offset: the place of a few photons of a pulse that is not symmetric differs from that of many.

use anyhow::{Context, Result};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{AnyRule, Array, Count, PaperRule, PixelAddress, WindowRule};

use super::find::limits::median;
use super::{Detection, Length, Observed};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::settings::SettingsFile;
use dtof_photons::recorded::{RecordedHistograms, RecordingLength, Whole};
use dtof_photons::source::{PhotonSource, Slice};

/// Laser cycles that are replayed, and photons, at most.
const CYCLES: u16 = 10_000;
const PHOTONS: f64 = 2e7;
/// Fewer events say nothing.
const LEAST: usize = 200;
/// A wider window costs more a look: its error has to be below this share.
const WIDER: f64 = 0.97;
/// The highest minimum that is tried.
const MOST: u16 = 200;

/// What events come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spent {
    /// Bins of the rule's window.
    pub window: u8,
    /// Photons in it, at least.
    pub min_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// Photons that an event takes, of all bins.
    pub photons: f64,
    /// Median of what single events are off by, in millimetres.
    pub error_mm: f64,
    /// To be added to the range offset, in millimetres.
    pub offset_mm: f64,
    /// Events it was found from.
    pub events: usize,
}

impl Spent {
    /// The error, as if one photon decided: with more it falls by their square root.
    fn for_a_photon(&self) -> f64 {
        self.error_mm * self.photons.sqrt()
    }
}

/// Replays the pixels with a true distance.
pub struct Replay<'a> {
    settings: Settings,
    slice: Slice,
    truth: Vec<f64>,
    detection: &'a Detection,
}

impl<'a> Replay<'a> {
    /// With the settings that were found so far; `None` if nothing can be said.
    ///
    /// # Errors
    /// If the recording cannot be replayed.
    pub fn new(
        observed: &Observed,
        detection: &'a Detection,
        hot: &[usize],
        (gate, bin_width_ps, offset_mm): ((u16, u16), f64, f64),
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
        let whole = Whole::of(observed.array, observed.captures)?;
        let all = u64::from(CYCLES);
        let pixels = observed.array.pixels();
        let hot =
            (0..whole.array.pixels()).filter(|pixel| hot.contains(&((pixel % pixels) as usize)));
        let hot = hot.map(u16::try_from).collect::<Result<_, _>>();
        let known = whole.with_masked(hot?);
        let mut photons = RecordedHistograms::part(&known, observed.captures, length, all, seed)?;
        let most = (PHOTONS / photons.photons_per_cycle().max(1e-9)).clamp(1.0, CYCLES.into());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let slice = photons.next_slice(most as u16)?;
        let known = slice.pixels.into_iter().zip(truth);
        let known = known.filter_map(|(pixel, truth)| Some((pixel, (*truth)?)));
        let (pixels, truth): (Vec<_>, Vec<f64>) = known.unzip();
        let settings = Settings {
            gate: Some(gate),
            bin_width_ps: U16F16::checked_from_num(bin_width_ps).context("the bin width")?,
            offset_mm: I24F8::checked_from_num(offset_mm).context("the offset")?,
            sigma_bins: Some(detection.sigma_bins),
            half_widths: detection.half_widths,
            l1: detection.l1,
            l2: detection.l2,
            x: detection.x,
            ..SettingsFile::default().settings(observed.bins())?
        };
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

    /// The best window and minimum; `None` if there are too few events.
    ///
    /// # Errors
    /// If the settings cannot be.
    pub fn best(&self) -> Result<Option<Spent>> {
        let least = self.detection.min_count;
        let papers = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(least.into()));
        let Some(papers) = self.replay(papers.into(), (1, least, self.settings.x))? else {
            return Ok(None);
        };
        let mut best: Option<Spent> = None;
        let mut first = least;
        for window in self.detection.window..=WindowRule::MAX_WIDTH {
            let Some(found) = self.of_window(window, first, papers.photons)? else {
                continue;
            };
            // A wider window holds more.
            first = found.min_count;
            let is_better = |best: Spent| {
                found.photons <= papers.photons
                    && found.for_a_photon() < WIDER * best.for_a_photon()
            };
            if best.is_none_or(is_better) {
                best = Some(found);
            }
        }
        Ok(best)
    }

    /// With the highest minimum, from `first` on, whose events take no more than `most` photons, or
    /// with `first`; `None` if there are too few events.
    fn of_window(&self, window: u8, first: u16, most: f64) -> Result<Option<Spent>> {
        let mut best = None;
        let z = U4F12::saturating_from_num(self.detection.z.unwrap_or(0.0));
        let with = |minimum: u16, x: u16| {
            let rule = WindowRule::new(window, z, Count::saturating(minimum.into()))?;
            self.replay(rule.into(), (window, minimum, x))
        };
        for minimum in first..=MOST {
            let found = with(minimum, self.settings.x)?;
            if found.is_none_or(|found| best.is_some() && found.photons > most) {
                break;
            }
            best = found;
        }
        // What is left goes into fewer looks.
        while let Some(last) = best.filter(|last| last.x < self.settings.l2 / 4) {
            let found = with(last.min_count, last.x + 1)?;
            if found.is_none_or(|found| found.photons > most) {
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
    ) -> Result<Option<Spent>> {
        let settings = Settings {
            rule,
            x,
            l1: self.settings.l1.max(x),
            ..self.settings.clone()
        };
        let pixels = u16::try_from(self.truth.len())?;
        let array = Array::new(pixels.into(), 1).context("no pixels")?;
        let addresses: Vec<PixelAddress> = (0..pixels).map(PixelAddress).collect();
        let mut engine = host_engine(&settings, array, &addresses)?;
        let events = engine.run(&self.slice)?;
        if events.len() < LEAST {
            return Ok(None);
        }
        let scale = settings.range_scale()?;
        let errors = || {
            events.iter().map(|event| {
                let range: f64 = scale.range(event.position()).to_num();
                range - self.truth[usize::from(event.pixel.0)]
            })
        };
        let off = median(errors());
        let [statistics, _] = engine.statistics();
        Ok(Some(Spent {
            window,
            min_count,
            x,
            photons: statistics.photons() as f64 / events.len() as f64,
            error_mm: median(errors().map(|error| (error - off).abs())),
            offset_mm: -off,
            events: events.len(),
        }))
    }
}

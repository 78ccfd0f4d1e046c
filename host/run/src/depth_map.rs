//! The depth map of a run: one decision a pixel, on all photons.
//!
//! Recorded histograms give all of their photons. Those of a photon list or a simulation are counted as they come, twice:
//! in all laser cycles, and in the first half of them. If the two halves see different surfaces, something has moved.

use anyhow::Result;
use dtof_core::{
    Array, BinPosition, BlockLevel, Detection, DetectionRule, EchoNumber, Flags, PixelAddress,
};

use dtof_data::photons::pixel_counts::{AllPhotons, PixelCounts, RecordedCounts};
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::source::Slice;
use dtof_engine::once::{OnceDecision, decide_once};
use dtof_engine::settings::{Settings, SettingsFile};

/// Two surfaces are more than so many bins apart.
pub(crate) const SURFACE_BINS: u16 = 3;
/// Photons have surely changed if they differ by more than so many standard deviations.
const SURELY: f64 = 4.0;

/// There is a second clear surface; the depth is that of the highest bin.
pub const SECOND_SURFACE: u8 = 1;
/// The halves of the recording contradict each other.
pub const CONTRADICTION: u8 = 2;

/// How the depth map of a run is decided.
pub struct MapInput {
    settings: Settings,
    /// The gate without that of a cover glass that was found: what moves in front may look like one.
    given_gate: Option<(u16, u16)>,
    /// All photons of recorded histograms.
    counts: Option<RecordedCounts>,
}

impl MapInput {
    /// The map of a run with these settings, each pixel by itself if they have blocks; `None` if they read frames.
    /// `counts` are all photons of recorded histograms; others are counted during the run. `given` are the settings before
    /// others were found in the recording: a z that was found is for many looks.
    ///
    /// # Errors
    /// Fails if settings contradict each other.
    pub fn new(
        requested: &SettingsFile,
        settings: &Settings,
        counts: Option<RecordedCounts>,
        given: &SettingsFile,
    ) -> Result<Option<Self>> {
        if settings.frame.is_some() {
            return Ok(None);
        }
        let mut once = requested.clone().deciding_once();
        if once.detection.z.is_none() {
            once.detection.false_alarm = once.detection.false_alarm.or(given.detection.false_alarm);
        }
        let once = once.settings(settings.bins)?;
        Ok(Some(Self {
            settings: Settings {
                offsets_mm: settings.offsets_mm.clone(),
                ..once
            },
            given_gate: given.sensor.gate,
            counts,
        }))
    }

    /// Whether photons are to be counted during the run.
    pub(crate) const fn counts_run(&self) -> bool {
        self.counts.is_none()
    }
}

/// The photons of a run so far.
pub(crate) struct RunCounts {
    halves: [PixelCounts; 2],
    /// The laser cycle with which the second half begins.
    half: u64,
}

impl RunCounts {
    pub(crate) fn new(pixels: usize, bins: usize, cycles: u64) -> Self {
        Self {
            halves: [0; 2].map(|_| PixelCounts::new(pixels, bins)),
            half: cycles / 2,
        }
    }

    pub(crate) fn add(&mut self, slice: &Slice) {
        let [first, second] = &mut self.halves;
        first.add_span(slice, 0..self.half);
        second.add_span(slice, self.half..u64::MAX);
    }

    /// The pixels whose halves contradict each other.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub(crate) fn contradictions(
        &self,
        input: &MapInput,
        array: Array,
        addresses: &[PixelAddress],
    ) -> Result<Vec<bool>> {
        let mut contradicts = vec![false; addresses.len()];
        let all = input.settings.clone().with_bins(input.settings.bins);
        let other = all.configured(|other| other.gate = input.given_gate.unwrap_or(other.gate));
        let has_other = other.configuration.gate != input.settings.configuration.gate;
        for settings in [&input.settings]
            .into_iter()
            .chain(has_other.then_some(&other))
        {
            let decide =
                |half: &PixelCounts| decide_once(settings, array, addresses, half, |_| false);
            let [first, second] = self.halves.each_ref().map(decide);
            let (first, second) = (first?, second?);
            let pairs = first.iter().zip(&second).enumerate();
            for ((place, pair), contradicts) in pairs.zip(&mut contradicts) {
                *contradicts |= have_changed(settings, &self.halves, place, pair);
            }
        }
        Ok(contradicts)
    }

    /// All photons.
    pub(crate) fn all(self) -> PixelCounts {
        let [first, second] = self.halves;
        first.with(&second)
    }
}

/// The map: a value for each place of the array.
#[derive(Clone, Debug)]
pub struct DepthMap {
    /// Where the surface lies, in bins.
    pub positions: Vec<Option<BinPosition>>,
    /// The same in millimetres; not a number without a surface.
    pub depth_mm: Vec<f64>,
    /// The nearest and the farthest surface, if pixels report several.
    pub echoes_mm: Option<[Vec<f64>; 2]>,
    /// The depth of the best window, however unsure; not a number without a photon.
    pub best_mm: Vec<f64>,
    /// How many standard deviations the best window stands above the background; not a number for pixels that are left
    /// out.
    pub confidence: Vec<f64>,
    /// A sum of [`SECOND_SURFACE`] and [`CONTRADICTION`].
    pub flags: Vec<u8>,
}

/// The first echo, and the others that are no tail of one before.
fn surfaces(decided: &OnceDecision) -> impl Iterator<Item = &Detection> {
    let echoes = decided.echoes.iter().map(|(_, echo)| echo).enumerate();
    let is_surface =
        |(at, echo): &(usize, &Detection)| *at == 0 || !echo.depth.flags.contains(Flags::TAIL);
    echoes.filter(is_surface).map(|(_, echo)| echo)
}

impl DepthMap {
    /// Decides on the photons of `input`, or on those of the `run`, of the pixels `addresses`, ascending. Some may
    /// contradict themselves.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub(crate) fn decide(
        input: &MapInput,
        run: Option<&PixelCounts>,
        contradictions: &[bool],
        array: Array,
        addresses: &[PixelAddress],
    ) -> Result<Option<Self>> {
        let settings = &input.settings;
        let counts: &dyn AllPhotons = match (&input.counts, run) {
            (Some(recorded), _) => recorded,
            (None, Some(run)) => run,
            (None, None) => return Ok(None),
        };
        // Two echoes tell whether there is a second surface. The first is the same.
        let two = const { EchoNumber::new(2).unwrap() };
        let echoes = settings.configuration.echoes;
        let with_two = settings
            .clone()
            .configured(|array| array.echoes = echoes.max(two));
        let decided = decide_once(&with_two, array, addresses, counts, |_| false)?;
        let ranges = settings.ranges(array)?;
        let pixels = array.pixels() as usize;
        let empty = || vec![f64::NAN; pixels];
        let mut map = Self {
            positions: vec![None; pixels],
            depth_mm: empty(),
            echoes_mm: (echoes >= two).then(|| [empty(), empty()]),
            best_mm: empty(),
            confidence: empty(),
            flags: vec![0; pixels],
        };
        for (place, (&pixel, decided)) in addresses.iter().zip(&decided).enumerate() {
            map.set(pixel, decided, &ranges);
            if !decided.echoes.is_empty() {
                let flags = &mut map.flags[usize::from(pixel.raw())];
                *flags |= SECOND_SURFACE * u8::from(surfaces(decided).count() > 1);
                let contradicts = contradictions.get(place) == Some(&true);
                *flags |= CONTRADICTION * u8::from(contradicts);
            }
        }
        Ok(Some(map))
    }

    fn set(&mut self, pixel: PixelAddress, decided: &OnceDecision, ranges: &Ranges) {
        let place = usize::from(pixel.raw());
        let mm = |position| {
            ranges
                .of(pixel, BlockLevel::PIXEL, position)
                .to_num::<f64>()
        };
        let positions = || surfaces(decided).map(Detection::position);
        self.positions[place] = positions().next();
        self.depth_mm[place] = positions().next().map_or(f64::NAN, mm);
        self.best_mm[place] = decided.best.map_or(f64::NAN, mm);
        self.confidence[place] = decided.confidence;
        if let Some([nearest, farthest]) = &mut self.echoes_mm {
            nearest[place] = positions().min().map_or(f64::NAN, mm);
            farthest[place] = positions().max().map_or(f64::NAN, mm);
        }
    }

    /// Pixels with a depth.
    #[must_use]
    pub fn pixels_with_depth(&self) -> usize {
        self.positions.iter().flatten().count()
    }

    /// Counts the pixels that see one surface first and another later, if there are any.
    #[must_use]
    pub fn warning(&self, has_looks: bool) -> Option<String> {
        let flags = self.flags.iter();
        let pixels = flags.filter(|&&flags| flags & CONTRADICTION != 0).count();
        let latest = match has_looks {
            true => ", depth-events.npy the latest",
            false => "",
        };
        (pixels > 0).then(|| {
            format!(
                "{pixels} of {} pixels see one surface in the first half of the recording and another in the second: \
                 something moved; depth.npy shows the brighter one{latest}",
                self.flags.len()
            )
        })
    }
}

/// Whether both halves of a recording have a surface, more than [`SURFACE_BINS`] apart, and the light of one surely grew
/// while that of the other surely fell.
fn have_changed(
    settings: &Settings,
    halves: &[PixelCounts; 2],
    place: usize,
    decided: (&OnceDecision, &OnceDecision),
) -> bool {
    let first = |decided: &OnceDecision| decided.echoes.first().map(|&(_, echo)| echo);
    let (Some(one), Some(other)) = (first(decided.0), first(decided.1)) else {
        return false;
    };
    let apart = one.position().raw().abs_diff(other.position().raw());
    // How many standard deviations the photons of a window have grown by. If halves differ in length, so do their
    // weights.
    let growth = |echo: Detection| {
        let [before, after] = halves.each_ref().map(|half| {
            let (bin, reach) = (
                usize::from(echo.peak.bin.raw()),
                usize::from(settings.configuration.rule.window_bins()) / 2,
            );
            let (first, last) = settings.gate().unwrap_or((0, u16::MAX));
            let gate = usize::from(first)..=usize::from(last);
            let histogram = half.histogram(place);
            let bins = (0..)
                .zip(histogram)
                .filter(|&(at, _)| bin.abs_diff(at) <= reach && gate.contains(&at));
            let photons: u64 = bins.map(|(_, &count)| u64::from(count)).sum();
            (photons as f64, half.cycles(place) as f64)
        });
        let ((n1, cycles1), (n2, cycles2)) = (before, after);
        let deviation = (n1 * cycles2 * cycles2 + n2 * cycles1 * cycles1).sqrt();
        (n2 * cycles1 - n1 * cycles2) / deviation
    };
    apart > u32::from(SURFACE_BINS) << 8 && growth(one) < -SURELY && growth(other) > SURELY
}

#[cfg(test)]
mod tests;

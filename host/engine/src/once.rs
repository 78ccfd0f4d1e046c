//! One decision a pixel, on all photons of the recording: what users of frames expect first.
//!
//! The rule is that of asynchronous pixels, and so are depth, echoes and dead time. Only the looks are missing: a pixel
//! decides when the recording has ended. [`decide_once`] decides on given counts, and [`OnceEngine`] on the photons that
//! it receives.
//!
//! With neighbours each pixel also decides on the sum of its histogram and theirs, as a larger pixel would. Each of the
//! two decisions has half of the false alarms.
//!
//! | the pixel alone | with its neighbours | event |
//! |---|---|---|
//! | an echo | one at most two standard deviations of its depth away | the pixel's, with the depth of all photons |
//! | an echo | not that one | the pixel's |
//! | none | an echo that the pixel may share | that echo, [confirmed](Flags::CONFIRMED) |
//!
//! The variance of a depth is `Σ n·(x - x̄)² / a²` of the pixel's photons `n` in the bins `x` that the estimator uses, with
//! `a` above the background. So slopes and edges stay where the pixel sees them.
//!
//! A pixel may share an echo unless its photons above the background are fewer, by more than two standard deviations, than
//! those of the neighbours that have the echo: `Σa² / Σa`, less what chance adds, where `a` are the photons of a neighbour
//! above its background. So a surface does not grow into pixels that do not see it. The photons of an event are always
//! the pixel's own.
//!
//! Of counts that do not fit their counters, the photons of the event are [divided](WholeHistogram) by a power of two.

use std::marker::PhantomData;
use std::ops::Range;

use anyhow::{Result, ensure};
use dtof_core::fixed::types::{U4F12, U24F8};
use dtof_core::rule::{ExcludedBins, LiveCounts};
use dtof_core::{
    AnyRule, Array, BinIndex, BinPosition, Count, CounterWidth, DepthEvent, Detection,
    DetectionRule, EchoNumber, Flags, Histogram, LaserCycle, Neighbours, PixelAddress, PixelConfig,
    Statistics, WholeHistogram, WindowRule,
};

use super::Engine;
use super::decisions::Decision;
use super::parallel::of_each;
use crate::settings::Settings;
use crate::with_widest;
use dtof_data::options::Refused;
use dtof_data::photons::pixel_counts::{AllPhotons, PixelCounts};
use dtof_data::photons::source::Slice;

/// The decision of a pixel.
#[derive(Clone, Debug)]
pub struct OnceDecision {
    /// Its echoes, as they are found: without neighbours the highest peak first.
    pub echoes: Vec<(EchoNumber, Detection)>,
    /// How many standard deviations its best window stands above the background; not a number if it is left out or has
    /// no laser cycles.
    pub confidence: f64,
    /// The first echo, or else the peak of the best window, however unsure; `None` without a photon in the gate.
    pub best: Option<BinPosition>,
    statistics: Statistics,
    /// Its gated photons, if they are kept.
    kept: Option<Vec<u32>>,
}

/// What was decided on a histogram.
#[derive(Clone)]
struct Decided<const BINS: usize, W: CounterWidth> {
    /// Its gated photons.
    histogram: Histogram<BINS, W>,
    statistics: Statistics,
    echoes: Vec<(EchoNumber, Detection)>,
    confidence: f64,
    best: Option<BinPosition>,
}

/// The decisions of the pixels `addresses` of an array, ascending, on their `counts`. The photons of pixels for which
/// `is_kept` is true are kept.
///
/// # Errors
/// Fails if the settings break a constraint.
pub fn decide_once(
    settings: &Settings,
    array: Array,
    addresses: &[PixelAddress],
    counts: &dyn AllPhotons,
    is_kept: impl Fn(PixelAddress) -> bool + Sync,
) -> Result<Vec<OnceDecision>> {
    ensure!(
        settings.configuration.binning.is_none(),
        Refused::new("decide_once", "cannot be used with `binning`")
    );
    let is_masked = |address: &PixelAddress| settings.masked.contains(&address.raw());
    let is_masked: Vec<bool> = addresses.iter().map(is_masked).collect();
    with_widest!(settings.bins, BINS, W => Pixels::<BINS, W> {
        config: settings.config()?,
        any_peak: settings.any_peak().config()?,
        array,
        neighbours: settings.configuration.neighbours,
        addresses,
        is_masked: &is_masked,
        counts,
        counters: PhantomData,
    }.decide_all(&is_kept))
    .map_err(Into::into)
}

impl Settings {
    /// The same with a window rule that takes any peak.
    fn any_peak(&self) -> Self {
        self.clone().configured(|any| {
            if let AnyRule::Window(rule) = any.rule {
                any.rule = WindowRule::new(rule.width(), U4F12::ZERO, Count::saturating(1))
                    .map_or(any.rule, AnyRule::Window);
            }
            any.neighbours = None;
        })
    }
}

/// Pixels that decide.
struct Pixels<'a, const BINS: usize, W: CounterWidth> {
    config: PixelConfig<BINS, AnyRule>,
    /// The same with a rule that takes any peak.
    any_peak: PixelConfig<BINS, AnyRule>,
    array: Array,
    neighbours: Option<Neighbours>,
    /// Ascending.
    addresses: &'a [PixelAddress],
    is_masked: &'a [bool],
    counts: &'a dyn AllPhotons,
    counters: PhantomData<W>,
}

impl<const BINS: usize, W: CounterWidth> Pixels<'_, BINS, W> {
    fn decide_all(&self, is_kept: &(impl Fn(PixelAddress) -> bool + Sync)) -> Vec<OnceDecision> {
        let pixels = self.addresses.len();
        let end = |place: usize, decided: Decided<BINS, W>| {
            let is_used = !self.is_masked[place] && self.counts.cycles(place) > 0;
            let mut statistics = decided.statistics;
            statistics.expired = u64::from(is_used && decided.echoes.is_empty());
            OnceDecision {
                echoes: match is_used {
                    true => decided.echoes,
                    false => Vec::new(),
                },
                confidence: match is_used {
                    true => decided.confidence,
                    false => f64::NAN,
                },
                best: decided.best.filter(|_| is_used),
                statistics,
                kept: is_kept(self.addresses[place]).then(|| counts(&decided.histogram)),
            }
        };
        let alone = |place: usize| self.decide(&self.sum_of(place, &[]), self.counts.cycles(place));
        let Some(neighbours) = self.neighbours else {
            return of_each(pixels, 1, |place| end(place, alone(place)));
        };
        let decided = of_each(pixels, 1, alone);
        of_each(pixels, 1, |place| {
            end(place, self.with_neighbours(neighbours, place, &decided))
        })
    }

    /// The photons of a pixel and of others.
    fn sum_of(&self, place: usize, others: &[usize]) -> [u64; BINS] {
        let mut sum = [0; BINS];
        self.counts.add_to(place, &mut sum);
        for &other in others {
            self.counts.add_to(other, &mut sum);
        }
        sum
    }

    /// The decision on `counts` of so many laser cycles, both divided by a power of two if a count has more than 32 bits.
    fn decide(&self, counts: &[u64; BINS], cycles: u64) -> Decided<BINS, W> {
        let highest = counts.iter().copied().max().unwrap_or(0);
        let shift = 32_u32.saturating_sub(highest.leading_zeros());
        let mut frame = [0_u32; BINS];
        for (count, photons) in frame.iter_mut().zip(counts) {
            *count = u32::try_from(photons >> shift).unwrap_or(u32::MAX);
        }
        let (mut whole, mut statistics) = (WholeHistogram::<BINS, W>::new(), Statistics::new());
        let mut echoes = Vec::new();
        whole.decide(
            &self.config,
            &frame,
            cycles >> shift,
            &mut statistics,
            |number, echo| {
                echoes.push((number, *echo));
            },
        );
        let histogram = whole.photons(&self.config, &frame);
        Decided {
            confidence: confidence(&self.config, &whole, &histogram),
            best: match echoes.first() {
                Some((_, detection)) => Some(detection.position()),
                None => self.best(&whole, &histogram),
            },
            histogram,
            statistics,
            echoes,
        }
    }

    /// The peak of the best window, if there is a photon.
    fn best(
        &self,
        whole: &WholeHistogram<BINS, W>,
        histogram: &Histogram<BINS, W>,
    ) -> Option<BinPosition> {
        let gate = *whole.gate();
        if histogram.total() == 0 {
            return None;
        }
        let mut best = None;
        if self.config.weighs_dead_time() {
            let any_peak = self.any_peak.with_gate(gate);
            let mut histogram = histogram.clone();
            any_peak.detect_echoes(&mut histogram, whole.cycles(), |number, detection| {
                if number == EchoNumber::FIRST {
                    best = Some(detection.position());
                }
            });
        }
        // Without a dead time that is weighed, the highest bin decides.
        best.or_else(|| {
            let peak = histogram.peak();
            let background = self.own_photons(peak.bin, histogram).background;
            let background = U24F8::saturating_from_num(background);
            let estimator = self.config.estimator();
            let depth = estimator.estimate(histogram, &gate, peak, background);
            Some(BinPosition::of(peak.bin, depth.offset))
        })
    }

    /// The decision of pixel number `place` with its neighbours; `decided_alone` are those of all pixels alone.
    fn with_neighbours(
        &self,
        neighbours: Neighbours,
        place: usize,
        decided_alone: &[Decided<BINS, W>],
    ) -> Decided<BINS, W> {
        let own = &decided_alone[place];
        let mut decided = own.clone();
        if self.is_masked[place] {
            return decided;
        }
        let (mut others, mut asked) = (Vec::new(), Vec::new());
        for other in self.array.neighbours(self.addresses[place], neighbours) {
            let other = self.addresses.binary_search(&other);
            if let Some(other) = other.ok().filter(|&other| !self.is_masked[other]) {
                others.push(other);
                asked.push(&decided_alone[other].histogram);
            }
        }
        let sum = self.sum_of(place, &others);
        let all = self.decide(&sum, self.counts.cycles(place));
        let mut uses_sum = false;
        for (_, detection) in &mut decided.echoes {
            let deviation = self.deviation(detection, &own.histogram);
            let is_same = |(_, other): &&(EchoNumber, Detection)| {
                let apart = other.position().raw().abs_diff(detection.position().raw());
                f64::from(apart) / 256.0 <= 2.0 * deviation
            };
            if let Some((_, other)) = all.echoes.iter().find(is_same) {
                *detection = self
                    .own_photons(other.peak.bin, &own.histogram)
                    .of_pixel(other);
                uses_sum = true;
            }
        }
        for (echo, detection) in all.echoes.iter().filter(|_| own.echoes.is_empty()) {
            let bin = detection.peak.bin;
            let own = self.own_photons(bin, &own.histogram);
            let around = asked.iter().map(|other| self.own_photons(bin, other));
            let sums = around.fold([0.0; 2], |[squares, sum], other| {
                let above = other.above();
                // The variance of a Poisson number is its mean.
                [squares + above * above - other.inside, sum + above]
            });
            let of_others = (sums[0] / sums[1]).max(0.0);
            if own.above() >= of_others - 2.0 * (own.expected() + of_others).sqrt() {
                let mut detection = own.of_pixel(detection);
                detection.depth.flags |= Flags::CONFIRMED;
                decided.echoes.push((*echo, detection));
                uses_sum = true;
            }
        }
        // Otherwise the sum saw another surface, or none.
        if uses_sum {
            decided.confidence = own.confidence.max(all.confidence);
        }
        if let Some((_, detection)) = decided.echoes.first() {
            decided.best = Some(detection.position());
        }
        decided.statistics.events = decided.echoes.len() as u64;
        decided
    }

    /// The standard deviation of a depth in bins.
    fn deviation(&self, detection: &Detection, histogram: &Histogram<BINS, W>) -> f64 {
        let (gate, reach) = (self.config.gate(), self.config.estimator().reach());
        let peak = detection.peak.bin.raw();
        let bins = peak.saturating_sub(reach).max(gate.first())..=(peak + reach).min(gate.last());
        let place = f64::from(detection.position().raw()) / 256.0;
        let (mut spread, mut inside, mut width) = (0.0, 0.0, 0.0);
        for bin in bins {
            let photons = f64::from(histogram.count(bin.into()).unwrap_or(0));
            spread += photons * (f64::from(bin) + 0.5 - place).powi(2);
            inside += photons;
            width += 1.0;
        }
        let own = self.own_photons(detection.peak.bin, histogram);
        let above = inside - width * own.background;
        spread.sqrt() / above.max(1.0)
    }

    /// The photons of `histogram` in the window around the bin of a peak.
    fn own_photons(&self, peak: BinIndex, histogram: &Histogram<BINS, W>) -> AroundPeak {
        let (gate, window) = (self.config.gate(), self.window(peak));
        let count = |bin: usize| histogram.count(bin).unwrap_or(0);
        let bins = window.len();
        let inside = window.map(count).sum::<u32>();
        let bins_outside = usize::from(gate.last() + 1 - gate.first()) - bins;
        let outside = histogram.total().saturating_sub(inside);
        AroundPeak {
            peak: count(peak.raw().into()),
            inside: inside.into(),
            bins: bins as f64,
            background: f64::from(outside) / bins_outside as f64,
        }
    }

    /// The bins of the gate in the window around the bin of a peak.
    fn window(&self, peak: BinIndex) -> Range<usize> {
        let (gate, reach) = (
            self.config.gate(),
            usize::from(self.config.rule().window_bins()) / 2,
        );
        let peak = usize::from(peak.raw());
        let first = peak.saturating_sub(reach).max(gate.first().into());
        first..(peak + reach + 1).min(usize::from(gate.last()) + 1)
    }
}

/// The photons of a pixel in the window around a peak.
struct AroundPeak {
    /// Those of the peak's bin.
    peak: u32,
    inside: f64,
    bins: f64,
    /// Those of the background in each bin.
    background: f64,
}

impl AroundPeak {
    /// Photons of the background in the window.
    fn expected(&self) -> f64 {
        self.background * self.bins
    }

    /// Photons above the background.
    fn above(&self) -> f64 {
        self.inside - self.expected()
    }

    /// `detection` with these photons in place of its own.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at most the highest count"
    )]
    fn of_pixel(&self, detection: &Detection) -> Detection {
        let mut detection = *detection;
        detection.peak.count = Count::saturating(self.peak);
        detection.background = Count::saturating(self.background.round() as u32);
        detection
    }
}

/// The engine: it decides on all photons that it receives.
pub struct OnceEngine {
    settings: Settings,
    array: Array,
    addresses: Vec<PixelAddress>,
    counts: PixelCounts,
    is_kept: Vec<bool>,
    statistics: Statistics,
    decisions: Vec<Decision>,
}

impl OnceEngine {
    /// An engine for the pixels `addresses` of an array, ascending.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn new(settings: &Settings, array: Array, addresses: &[PixelAddress]) -> Result<Self> {
        // Fails as it would at the end.
        decide_once(
            settings,
            array,
            &[],
            &PixelCounts::new(0, settings.bins),
            |_| false,
        )?;
        Ok(Self {
            settings: settings.clone(),
            array,
            addresses: addresses.to_vec(),
            counts: PixelCounts::new(addresses.len(), settings.bins),
            is_kept: vec![false; addresses.len()],
            statistics: Statistics::new(),
            decisions: Vec::new(),
        })
    }

    fn is_kept(&self, pixel: PixelAddress) -> bool {
        let place = self.addresses.binary_search(&pixel);
        place.is_ok_and(|place| self.is_kept[place])
    }
}

impl Engine for OnceEngine {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        self.counts.add(slice);
        Ok(Vec::new())
    }

    fn finish(&mut self) -> Vec<DepthEvent> {
        let (addresses, counts) = (&self.addresses, &self.counts);
        let is_kept = |pixel| self.is_kept(pixel);
        let decided = decide_once(&self.settings, self.array, addresses, counts, is_kept);
        self.statistics.rejected = counts.rejected();
        let mut events = Vec::new();
        // The settings were checked.
        for (place, decided) in decided.unwrap_or_default().into_iter().enumerate() {
            let (address, cycles) = (self.addresses[place], counts.cycles(place));
            self.statistics += decided.statistics;
            let last = LaserCycle::new(cycles.saturating_sub(1));
            let exposure = u16::try_from(cycles).unwrap_or(u16::MAX);
            let event = |&(echo, detection): &(EchoNumber, Detection)| DepthEvent {
                echo,
                ..detection.event(address, last, exposure)
            };
            events.extend(decided.echoes.iter().map(event));
            if let (Some(first), Some(counts)) = (decided.echoes.first(), decided.kept) {
                self.decisions.push(Decision {
                    event: event(first),
                    counts,
                    cycles: u32::try_from(cycles).unwrap_or(u32::MAX),
                    expected: None,
                    excluded: ExcludedBins::NONE,
                });
            }
        }
        sort(&mut events);
        events
    }

    fn statistics(&self) -> [Statistics; 2] {
        [self.statistics, Statistics::new()]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for (kept, pixel) in self.is_kept.iter_mut().zip(&self.addresses) {
            *kept = is_kept(*pixel);
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        self.decisions.clone()
    }
}

fn counts<const BINS: usize, W: CounterWidth>(histogram: &Histogram<BINS, W>) -> Vec<u32> {
    let counts = histogram.counts().iter();
    counts.map(|&count| count.into()).collect()
}

/// Sorts by laser cycle and pixel, and leaves echoes in order. Not generic, so that it is compiled once.
fn sort(events: &mut [DepthEvent]) {
    events.sort_by_key(|event| (event.cycle, event.pixel));
}

/// The highest z with which the window rule would still report, whatever its minimum count: how many standard
/// deviations the photons of the best window exceed what the background has there, with the rule's terms for the skew of
/// small counts. Let the gate have `T` photons, and a window `S` of them and the share `p` of the live laser cycles of all
/// bins. Without a target `S` is binomial; see [`WindowRule`](dtof_core::WindowRule). 0 without photons.
fn confidence<const BINS: usize, W: CounterWidth>(
    config: &PixelConfig<BINS, AnyRule>,
    whole: &WholeHistogram<BINS, W>,
    histogram: &Histogram<BINS, W>,
) -> f64 {
    let (gate, none) = (whole.gate(), ExcludedBins::NONE);
    let weighed = match config.weighs_dead_time() {
        true => LiveCounts::new(histogram, gate, &none, whole.cycles(), config.dead_time()),
        false => None,
    };
    let each = (gate.first()..=gate.last()).map(|bin| {
        let photons = histogram.count(bin.into()).unwrap_or(0);
        let live = weighed.as_ref().map_or(1, |counts| counts.live(bin));
        [photons, live].map(f64::from)
    });
    let each: Vec<[f64; 2]> = each.collect();
    let sum = |bins: &[[f64; 2]]| {
        let add = |[a, b]: [f64; 2], [c, d]: &[f64; 2]| [a + c, b + d];
        bins.iter().fold([0.0; 2], add)
    };
    let [total, all_live] = sum(&each);
    // Windows that contain the highest bin, or all of them where bins are weighed.
    // That of an empty histogram is bin 0.
    let peak = usize::from(histogram.peak().bin.raw().saturating_sub(gate.first()));
    let width = usize::from(config.rule().window_bins());
    let is_tested = |start: usize| weighed.is_some() || (start..start + width).contains(&peak);
    let mut best = 0.0;
    for (_, window) in (0..)
        .zip(each.windows(width))
        .filter(|(start, _)| is_tested(*start))
    {
        let [inside, live] = sum(window);
        best = highest_z(inside, total, live / all_live, best);
    }
    best
}

/// The highest z, above `z`, that `inside` of `total` photons in a window with the share `p` still exceed; else `z`.
fn highest_z(inside: f64, total: f64, p: f64, z: f64) -> f64 {
    const MOST: f64 = 1e6;
    let variance = p * (1.0 - p) * total;
    let exceeds = |z: f64| {
        let skew = z * z / 6.0 * (1.0 - 2.0 * p).max(0.0);
        inside - p * total > z * variance / (variance + z * z / 36.0).sqrt() + skew
    };
    // Also false where a window has all of the live laser cycles, or nothing does.
    if !(variance > 0.0 && exceeds(z)) {
        return z;
    }
    let (mut low, mut high) = (z, z + 1.0);
    while high < MOST && exceeds(high) {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        match exceeds(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    low
}

#[cfg(test)]
mod tests;

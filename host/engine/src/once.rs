//! One decision a pixel, on all photons of the recording: what users of frames expect first.
//!
//! The rule is that of asynchronous pixels, and so are depth, echoes and dead time. Only the looks are missing: a pixel
//! decides when the recording has ended.
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
//! A pixel with a full counter has no event, as its depth could be wrong. It counts as an exposure that
//! [ended full](Statistics::ended_full).

use std::marker::PhantomData;

use anyhow::{Result, ensure};
use dtof_core::rule::{ExcludedBins, LiveCounts};
use dtof_core::{
    AnyRule, Array, Count, CounterWidth, DepthEvent, Detection, EchoNumber, Flags, Histogram,
    LaserCycle, Neighbours, PixelAddress, PixelConfig, Statistics,
};

use super::Engine;
use super::decisions::Decision;
use super::neighbours::check;
use super::parallel::{of_each, of_parts};
use crate::settings::Settings;
use dtof_options::Refused;
use dtof_photons::source::Slice;

/// A pixel.
struct Pixel<const BINS: usize> {
    address: PixelAddress,
    /// All photons within the histogram, gated or not.
    counts: Box<[u32; BINS]>,
    /// Photons past the last bin.
    rejected: u64,
    /// Laser cycles.
    cycles: u64,
    is_masked: bool,
    /// Whether its decision is kept.
    is_kept: bool,
}

/// What was decided on a histogram.
#[derive(Clone)]
struct Decided<const BINS: usize, W: CounterWidth> {
    /// Its gated photons.
    histogram: Histogram<BINS, W>,
    statistics: Statistics,
    echoes: Vec<(EchoNumber, Detection)>,
    confidence: f64,
}

/// The engine.
pub struct OnceEngine<const BINS: usize, W: CounterWidth> {
    config: PixelConfig<BINS, AnyRule>,
    array: Array,
    neighbours: Option<Neighbours>,
    /// By address.
    pixels: Vec<Pixel<BINS>>,
    statistics: Statistics,
    /// Of each place of the array.
    confidence: Vec<f64>,
    decisions: Vec<Decision>,
    counters: PhantomData<W>,
}

impl<const BINS: usize, W: CounterWidth> OnceEngine<BINS, W> {
    /// An engine for the pixels `addresses` of an array, ascending.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn new(settings: &Settings, array: Array, addresses: &[PixelAddress]) -> Result<Self> {
        ensure!(
            settings.binning.is_none(),
            Refused::new("decide_once", "cannot be used with `binning`")
        );
        if settings.neighbours.is_some() {
            check(settings)?;
        }
        let pixel = |&address: &PixelAddress| Pixel {
            address,
            counts: Box::new([0; BINS]),
            rejected: 0,
            cycles: 0,
            is_masked: settings.masked.contains(&address.raw()),
            is_kept: false,
        };
        Ok(Self {
            config: settings.config()?,
            array,
            neighbours: settings.neighbours,
            pixels: addresses.iter().map(pixel).collect(),
            statistics: Statistics::new(),
            confidence: vec![f64::NAN; usize::try_from(array.pixels())?],
            decisions: Vec::new(),
            counters: PhantomData,
        })
    }

    /// The decision on `counts` of so many laser cycles.
    fn decide(&self, counts: &[u32; BINS], cycles: u64) -> Decided<BINS, W> {
        let config = &self.config;
        let mut histogram = Histogram::<BINS, W>::new();
        let gated_out = config.add_frame(&mut histogram, counts);
        let mut statistics = Statistics::new();
        statistics.add_photons_of(&histogram, gated_out);
        let cycles = u32::try_from(cycles).unwrap_or(u32::MAX);
        let mut echoes = Vec::new();
        if histogram.saturated() > 0 {
            statistics.ended_full = 1;
        } else {
            let echo = |number, detection: &Detection| echoes.push((number, *detection));
            let is_blind = config.detect_echoes(&mut histogram.clone(), cycles, echo);
            statistics.blind_looks = is_blind.into();
        }
        Decided {
            confidence: confidence(config, &histogram, cycles),
            histogram,
            statistics,
            echoes,
        }
    }

    /// The decision of pixel number `place` with its neighbours; `decided_alone` are those of all pixels alone.
    fn with_neighbours(
        &self,
        neighbours: Neighbours,
        place: usize,
        decided_alone: &[Decided<BINS, W>],
    ) -> Decided<BINS, W> {
        let has_say = |place: usize| {
            !self.pixels[place].is_masked && decided_alone[place].statistics.ended_full == 0
        };
        let (pixel, own) = (&self.pixels[place], &decided_alone[place]);
        let mut decided = own.clone();
        if !has_say(place) {
            return decided;
        }
        let mut sum = pixel.counts.clone();
        let mut asked = Vec::new();
        for other in self.array.neighbours(pixel.address, neighbours) {
            let other = self
                .pixels
                .binary_search_by_key(&other, |other| other.address);
            if let Some(other) = other.ok().filter(|&other| has_say(other)) {
                let counts = self.pixels[other].counts.iter();
                for (sum, &count) in sum.iter_mut().zip(counts) {
                    *sum = sum.saturating_add(count);
                }
                asked.push(&decided_alone[other].histogram);
            }
        }
        let all = self.decide(&sum, pixel.cycles);
        let mut uses_sum = false;
        for (_, detection) in &mut decided.echoes {
            let deviation = self.deviation(detection, &own.histogram);
            let is_same = |(_, other): &&(EchoNumber, Detection)| {
                let apart = other.position().raw().abs_diff(detection.position().raw());
                f64::from(apart) / 256.0 <= 2.0 * deviation
            };
            if let Some((_, other)) = all.echoes.iter().find(is_same) {
                *detection = self.own_photons(other, &own.histogram).of_pixel(other);
                uses_sum = true;
            }
        }
        for (echo, detection) in all.echoes.iter().filter(|_| own.echoes.is_empty()) {
            let own = self.own_photons(detection, &own.histogram);
            let around = asked.iter().map(|other| self.own_photons(detection, other));
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
        let above = inside - width * self.own_photons(detection, histogram).background;
        spread.sqrt() / above.max(1.0)
    }

    /// The photons of `histogram` in the window around a peak.
    fn own_photons(&self, detection: &Detection, histogram: &Histogram<BINS, W>) -> AroundPeak {
        let gate = self.config.gate();
        let (peak, width) = (usize::from(detection.peak.bin.raw()), width(&self.config));
        let first = peak.saturating_sub(width / 2).max(gate.first().into());
        let end = (peak + width / 2 + 1).min(usize::from(gate.last()) + 1);
        let count = |bin: usize| histogram.count(bin).unwrap_or(0);
        let inside = (first..end).map(count).sum::<u32>();
        let bins_outside = usize::from(gate.last() + 1 - gate.first()) - (end - first);
        let outside = histogram.total().saturating_sub(inside);
        AroundPeak {
            peak: count(peak),
            inside: inside.into(),
            bins: (end - first) as f64,
            background: f64::from(outside) / bins_outside as f64,
        }
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

impl<const BINS: usize, W: CounterWidth> Engine for OnceEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        of_parts(&mut self.pixels, 1, |first, pixels| {
            let slice = slice.pixels.iter().skip(first);
            for (pixel, received) in pixels.iter_mut().zip(slice) {
                for photon in &received.photons {
                    match pixel.counts.get_mut(usize::from(photon.code)) {
                        Some(count) => *count = count.saturating_add(1),
                        None => pixel.rejected += 1,
                    }
                }
                pixel.cycles += u64::from(received.cycles);
            }
        });
        Ok(Vec::new())
    }

    fn finish(&mut self) -> Vec<DepthEvent> {
        let mut decided = of_each(self.pixels.len(), |place| {
            let pixel = &self.pixels[place];
            self.decide(&pixel.counts, pixel.cycles)
        });
        if let Some(neighbours) = self.neighbours {
            decided = of_each(decided.len(), |place| {
                self.with_neighbours(neighbours, place, &decided)
            });
        }
        let mut events = Vec::new();
        for (pixel, decided) in self.pixels.iter().zip(&decided) {
            self.statistics += decided.statistics;
            self.statistics.rejected += pixel.rejected;
            let is_used = !pixel.is_masked && pixel.cycles > 0;
            self.statistics.expired += u64::from(is_used && decided.echoes.is_empty());
            if is_used {
                self.confidence[usize::from(pixel.address.raw())] = decided.confidence;
            }
            let last = LaserCycle::new(pixel.cycles.saturating_sub(1));
            let exposure = u16::try_from(pixel.cycles).unwrap_or(u16::MAX);
            let event = |&(echo, detection): &(EchoNumber, Detection)| DepthEvent {
                echo,
                ..detection.event(pixel.address, last, exposure)
            };
            events.extend(decided.echoes.iter().map(event));
            let kept = decided.echoes.first().filter(|_| pixel.is_kept);
            self.decisions.extend(kept.map(|first| Decision {
                event: event(first),
                counts: counts(&decided.histogram),
                cycles: u32::try_from(pixel.cycles).unwrap_or(u32::MAX),
                expected: None,
                excluded: ExcludedBins::NONE,
            }));
        }
        self.statistics.events = events.len() as u64;
        sort(&mut events);
        events
    }

    fn confidence(&self) -> Option<&[f64]> {
        Some(&self.confidence)
    }

    fn statistics(&self) -> [Statistics; 2] {
        [self.statistics, Statistics::new()]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for pixel in &mut self.pixels {
            pixel.is_kept = is_kept(pixel.address);
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

/// Bins of the rule's window: 1 for rules that test the highest bin.
fn width<const BINS: usize>(config: &PixelConfig<BINS, AnyRule>) -> usize {
    match config.rule() {
        AnyRule::Window(rule) => rule.width().into(),
        AnyRule::Paper(_) | AnyRule::Average(_) => 1,
    }
}

/// The highest z with which the window rule would still report, whatever its minimum count: how many standard
/// deviations the photons of the best window exceed what the background has there, with the rule's terms for the skew of
/// small counts. Let the gate have `T` photons, and a window `S` of them and the share `p` of the live laser cycles of all
/// bins. Without a target `S` is binomial; see [`WindowRule`](dtof_core::WindowRule). 0 without photons.
fn confidence<const BINS: usize, W: CounterWidth>(
    config: &PixelConfig<BINS, AnyRule>,
    histogram: &Histogram<BINS, W>,
    cycles: u32,
) -> f64 {
    let (gate, none) = (config.gate(), ExcludedBins::NONE);
    let weighed = match config.weighs_dead_time() {
        true => LiveCounts::new(histogram, gate, &none, cycles, config.dead_time()),
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
    let width = width(config);
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

//! Explains a decision: the threshold, background and window of the rule for a histogram.

use dtof_core::fixed::types::U24F8;
use dtof_core::rule::{ExcludedBins, LiveCounts, LiveWindow};
use dtof_core::{
    AnyRule, BinIndex, BlockLevel, Count, Count8, Count10, Count16, CounterWidth, DetectionRule,
    EchoNumber, Flags, Histogram, Peak, PixelConfig, RangeGate,
};
use serde::Serialize;

use super::decisions::Decision;
use super::frame;
use super::settings::Settings;
use crate::{with_bins, with_widest};

/// The peak of a histogram and what the rule needs to report it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// The highest bin within the gate, and its photons.
    pub peak: (u16, u32),
    /// The fewest photons in that bin with which the rule reports it, all other bins being equal;
    /// `None` if no counter holds so many.
    pub needed: Option<u32>,
    /// The threshold depends on earlier events, as the pixel tracks or reports several echoes, or on
    /// neighbours that confirmed it.
    /// `needed` and `background` are `None` then.
    pub depends: bool,
    /// The background a bin according to the rule, at the photons of the peak or at `needed`,
    /// whichever is more.
    pub background: Option<f64>,
    /// The first bin of each quadrant, and the end of the last.
    pub quadrants: [u16; 5],
    /// Window rule: the first and the last bin of the window with the most photons that contains
    /// the peak. With a dead time, the window that the rule reports.
    pub window: Option<(u16, u16)>,
    /// The dead time by which bins are weighed; 0 if they are not. With one, `needed` is `None`, and
    /// `background` is that of the peak's bin: that of any bin is proportional to its live laser
    /// cycles.
    pub dead_time: u16,
}

/// Explains `counts` of so many laser cycles: a complete histogram of a sensor, or an exposure so far.
/// Returns `None` if the settings are for another number of bins.
#[must_use]
pub fn explain(
    settings: &Settings,
    counts: &[u32],
    cycles: u32,
    is_whole: bool,
) -> Option<Explanation> {
    let bins = counts.len();
    let explanation = match is_whole {
        false => with_bins!(bins, BINS => match settings.counter_bits {
            8 => explain_bins::<BINS, Count8>(settings, counts, cycles),
            _ => explain_bins::<BINS, Count10>(settings, counts, cycles),
        }),
        true => {
            with_widest!(bins, BINS, W => explain_bins::<BINS, W>(settings, counts, cycles))
        }
    };
    let explanation = explanation.ok()??;
    // Complete histograms are not tracked or confirmed, and their first echo does not depend on others.
    let depends = !is_whole
        && (settings.configuration.tracking
            || settings.configuration.neighbours.is_some()
            || settings.configuration.echoes != EchoNumber::FIRST);
    Some(match depends {
        false => explanation,
        true => Explanation {
            depends,
            needed: None,
            background: None,
            ..explanation
        },
    })
}

fn explain_bins<const BINS: usize, W: CounterWidth>(
    settings: &Settings,
    counts: &[u32],
    cycles: u32,
) -> Option<Explanation> {
    let counts: &[u32; BINS] = counts.try_into().ok()?;
    let config = settings.config::<BINS>().ok()?;
    if settings.weighs_dead_time() {
        let input = LiveInput {
            config: &config,
            counts: *counts,
            excluded: ExcludedBins::NONE,
            expected: None,
            cycles,
        };
        return Some(input.explain::<W>());
    }
    let peak = histogram::<BINS, W>(counts, config.gate()).peak();
    let bin = peak.bin.raw();
    let input = DecidedHistogram {
        rule: *config.rule(),
        gate: *config.gate(),
        counts: *counts,
        excluded: ExcludedBins::NONE,
        peak: (bin, peak.count.raw()),
        at: bin,
    };
    Some(input.explain::<W>())
}

/// Explains past decisions, each as its pixel or block made it. `needed` is at most the photons of
/// the peak.
#[must_use]
pub fn explain_decisions(settings: &Settings, decisions: &[Decision]) -> Vec<Explanation> {
    let explanations = match settings.decide_once {
        false => with_bins!(settings.bins, BINS => match settings.counter_bits {
            8 => all::<BINS, Count8>(settings, decisions),
            _ => all::<BINS, Count10>(settings, decisions),
        }),
        true => with_widest!(settings.bins, BINS, W => all::<BINS, W>(settings, decisions)),
    };
    explanations.ok().flatten().unwrap_or_default()
}

fn all<const BINS: usize, W: CounterWidth>(
    settings: &Settings,
    decisions: &[Decision],
) -> Option<Vec<Explanation>> {
    let (pixels, blocks) = (settings.config().ok()?, settings.block_config().ok()?);
    let explanations = decisions.iter().map(|decision| {
        let is_pixel = decision.event.level == BlockLevel::PIXEL;
        let config: &PixelConfig<BINS, AnyRule> = if is_pixel { &pixels } else { &blocks };
        if is_pixel && settings.weighs_dead_time() {
            let input = LiveInput {
                config,
                counts: counts_of(decision),
                excluded: decision.excluded,
                expected: decision.expected,
                cycles: decision.cycles,
            };
            return Some(input.explain::<W>());
        }
        let input = DecidedHistogram::new(config, decision, settings.frame.is_some())?;
        if decision.event.flags.contains(Flags::CONFIRMED) {
            // The peak is that of all pixels; its own photons were too few.
            return Some(Explanation {
                depends: true,
                needed: None,
                background: None,
                ..input.explain::<W>()
            });
        }
        Some(match is_pixel && settings.frame.is_none() {
            true => input.explain::<W>(),
            false => input.explain::<Count16>(),
        })
    });
    explanations.collect()
}

fn histogram<const BINS: usize, W: CounterWidth>(
    counts: &[u32; BINS],
    gate: &RangeGate<BINS>,
) -> Histogram<BINS, W> {
    let mut histogram = Histogram::new();
    histogram.add_frame(counts, gate);
    histogram
}

fn counts_of<const BINS: usize>(decision: &Decision) -> [u32; BINS] {
    let mut counts = [0; BINS];
    for (count, &kept) in counts.iter_mut().zip(&decision.counts) {
        *count = kept;
    }
    counts
}

/// A histogram with a dead time, and the configuration that weighs its bins.
struct LiveInput<'a, const BINS: usize> {
    config: &'a PixelConfig<BINS, AnyRule>,
    /// With the photons before the gate and around earlier echoes.
    counts: [u32; BINS],
    excluded: ExcludedBins,
    /// Where a pixel that tracks expects its event.
    expected: Option<BinIndex>,
    cycles: u32,
}

impl<const BINS: usize> LiveInput<'_, BINS> {
    fn explain<W: CounterWidth>(&self) -> Explanation {
        let Self { config, cycles, .. } = self;
        let mut histogram = Histogram::<BINS, W>::new();
        config.add_frame(&mut histogram, &self.counts);
        let (gate, dead_time) = (config.gate(), config.dead_time());
        let counts = LiveCounts::new(&histogram, gate, &self.excluded, *cycles, dead_time);
        let window = counts.as_ref().and_then(|counts| self.window(counts));
        let count = |bin: u16| histogram.count(bin.into()).unwrap_or(0);
        let highest = histogram.peak();
        let mut explanation = Explanation {
            peak: (highest.bin.raw(), highest.count.raw()),
            needed: None,
            depends: false,
            background: None,
            quadrants: gate.quadrant_starts(),
            window: window.map(|window| (window.first, window.first + window.width - 1)),
            dead_time,
        };
        let Some(counts) = counts else {
            return explanation;
        };
        if let Some((first, last)) = explanation.window {
            let peak = counts.brightest(first, last - first + 1);
            explanation.peak = (peak.bin.raw(), peak.count.raw());
        }
        let (photons, live) = match window {
            Some(window) => (window.photons_outside.into(), window.live_outside),
            None => {
                let bins = (gate.first()..=gate.last()).filter(|&bin| !self.excluded.contains(bin));
                bins.fold((0, 0), |(photons, live), bin| {
                    let [more, longer] = [count(bin), counts.live(bin)].map(u64::from);
                    (photons + more, live + longer)
                })
            }
        };
        let live_of_peak = f64::from(counts.live(explanation.peak.0));
        explanation.background = (live > 0).then(|| photons as f64 / live as f64 * live_of_peak);
        explanation
    }

    /// The window that the rule reports.
    fn window<W: CounterWidth>(&self, counts: &LiveCounts<'_, BINS, W>) -> Option<LiveWindow> {
        if let (Some(tracking), Some(expected)) = (self.config.tracking(), self.expected) {
            return tracking.detect_live(counts, expected).window;
        }
        self.config.rule().detect_live(counts, None).window
    }
}

/// A histogram and the configuration that decides on it.
struct DecidedHistogram<const BINS: usize> {
    rule: AnyRule,
    gate: RangeGate<BINS>,
    counts: [u32; BINS],
    /// The bins around earlier echoes.
    excluded: ExcludedBins,
    /// The bin of the peak, and its photons.
    peak: (u16, u32),
    /// The bin that the rule tests: where a pixel that tracks expects its event, else the peak.
    at: u16,
}

impl<const BINS: usize> DecidedHistogram<BINS> {
    /// The input of `decision`, by `config` or as a frame.
    fn new(
        config: &PixelConfig<BINS, AnyRule>,
        decision: &Decision,
        is_frame: bool,
    ) -> Option<Self> {
        let counts = counts_of(decision);
        let peak = decision.event.peak_bin.raw();
        let mut input = Self {
            rule: *config.rule(),
            gate: *config.gate(),
            excluded: decision.excluded,
            peak: (peak, *counts.get(usize::from(peak))?),
            at: peak,
            counts,
        };
        if is_frame {
            input.rule = frame::ANY.into();
        }
        if let (Some(tracking), Some(expected)) = (config.tracking(), decision.expected) {
            input.rule = *tracking.near();
            input.at = expected.raw();
            let is_near = input.gate.contains(input.at);
            if !is_near || input.answer::<Count16>(input.peak.1).is_none() {
                input.rule = *tracking.far();
                input.at = peak;
            }
        }
        Some(input)
    }

    /// The rule's answer if the peak bin had so many photons.
    fn answer<W: CounterWidth>(&self, photons: u32) -> Option<U24F8> {
        let mut counts = self.counts;
        *counts.get_mut(usize::from(self.peak.0))? = photons;
        let histogram = histogram::<BINS, W>(&counts, &self.gate);
        let peak = Peak {
            bin: BinIndex::saturating(self.at),
            count: Count::saturating(*counts.get(usize::from(self.at))?),
        };
        self.rule
            .detect(&histogram, &self.gate, peak, &self.excluded)
    }

    fn explain<W: CounterWidth>(&self) -> Explanation {
        // The rule is monotonic in the photons of the peak, so bisection finds the threshold.
        let (mut low, mut high) = (0, W::MAX);
        let mut needed = self.answer::<W>(high).map(|_| high);
        while needed.is_some() && low < high {
            let middle = low + (high - low) / 2;
            match self.answer::<W>(middle) {
                None => low = middle + 1,
                Some(_) => high = middle,
            }
            needed = Some(high);
        }
        let background = needed.and_then(|needed| self.answer::<W>(needed.max(self.peak.1)));
        Explanation {
            peak: self.peak,
            needed,
            depends: false,
            background: background.map(U24F8::to_num),
            quadrants: self.gate.quadrant_starts(),
            window: match self.rule {
                AnyRule::Window(rule) => {
                    let width = u16::from(rule.width());
                    window(&self.counts, self.at, width, &self.gate)
                }
                AnyRule::Paper(_) | AnyRule::Average(_) => None,
            },
            dead_time: 0,
        }
    }
}

/// The window of `width` bins that contains `bin` and has the most photons.
fn window<const BINS: usize>(
    counts: &[u32; BINS],
    bin: u16,
    width: u16,
    gate: &RangeGate<BINS>,
) -> Option<(u16, u16)> {
    let first = (bin + 1).saturating_sub(width).max(gate.first());
    let last = bin.min((gate.last() + 1).saturating_sub(width));
    let sum = |start: u16| -> u64 {
        let bins = usize::from(start)..usize::from(start + width);
        counts[bins].iter().map(|&count| u64::from(count)).sum()
    };
    // The first, if several have as many.
    let start = (first..=last).rev().max_by_key(|&start| sum(start))?;
    Some((start, start + width - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::fixed::types::U8F8;
    use dtof_core::rule::detect;
    use dtof_core::{AverageRule, PaperRule, WindowRule};
    use proptest::prelude::*;

    fn counts() -> impl Strategy<Value = Vec<u32>> {
        let counts = prop::collection::vec(0..12_u32, 128);
        (counts, 0..128_usize, 0..60_u32).prop_map(|(mut counts, bin, more)| {
            counts[bin] += more;
            counts
        })
    }

    proptest! {
        /// The rule reports at `needed` photons, and not with one photon less.
        #[test]
        fn the_number_needed_is_the_first_that_is_reported(counts in counts(), which in 0..3, gate in 0..60_u16) {
            let alpha = U8F8::lit("4");
            let minimum = Count::saturating(5);
            let settings = Settings::static_scene(0).configured(|array| { array.rule = match which {
                    0 => PaperRule::new(alpha, minimum).into(),
                    1 => AverageRule::new(alpha, minimum).into(),
                    _ => WindowRule::new(3, "4.5".parse().unwrap(), minimum).unwrap().into(),
                }; array.gate = (gate, 127); });
            let explanation = explain(&settings, &counts, 60, false).unwrap();
            let (bin, peak) = explanation.peak;
            let within = &counts[usize::from(gate)..];
            prop_assert_eq!(peak, *within.iter().max().unwrap());
            let config = settings.config::<128>().unwrap();
            let reports = |photons: u32| {
                let mut counts: [u32; 128] = counts.clone().try_into().unwrap();
                counts[usize::from(bin)] = photons;
                let mut histogram = Histogram::<128>::new();
                histogram.add_frame(&counts, config.gate());
                // Another bin may be the highest with these photons.
                let is_peak = histogram.peak().bin.raw() == bin;
                let found = detect(&histogram, config.gate(), config.rule(), config.estimator());
                (is_peak, found.is_some())
            };
            let needed = explanation.needed.unwrap();
            if let (true, reported) = reports(needed) {
                prop_assert!(reported);
            }
            if let (true, reported) = reports(needed - 1) {
                prop_assert!(!reported);
            }
            prop_assert_eq!(reports(peak).1, peak >= needed);
            if let Some((first, last)) = explanation.window {
                prop_assert!(first >= gate && last < 128 && last - first == 2);
                prop_assert!((first..=last).contains(&bin));
                let sum = |first: u16| (first..first + 3).map(|bin| counts[usize::from(bin)]).sum::<u32>();
                let starts = (gate..126).filter(|start| (*start..start + 3).contains(&bin));
                prop_assert_eq!(starts.map(sum).max(), Some(sum(first)));
            }
            prop_assert_eq!(explanation.window.is_some(), which == 2);
        }
    }

    #[test]
    fn a_threshold_that_depends_on_events_is_not_told() {
        let counts: Vec<u32> = (0..128).map(|bin| u32::from(bin == 40) * 50).collect();
        let explained = |settings: Settings| explain(&settings, &counts, 60, false).unwrap();
        let window = WindowRule::new(3, "4.5".parse().unwrap(), Count::saturating(5)).unwrap();
        let plain = Settings::static_scene(0).configured(|array| array.rule = window.into());
        let first = explained(plain.clone());
        assert!(first.needed.is_some() && !first.depends);
        let tracks = plain.clone().configured(|array| array.tracking = true);
        let echoes = plain.configured(|array| array.echoes = EchoNumber::new(2).unwrap());
        for settings in [tracks, echoes] {
            let explanation = explained(settings);
            assert_eq!(
                (
                    explanation.needed,
                    explanation.background,
                    explanation.depends
                ),
                (None, None, true)
            );
            assert_eq!(
                (explanation.peak, explanation.window),
                (first.peak, first.window)
            );
        }
    }

    /// 1000 laser cycles of a TDC that is blind for 20 bins. One in a hundred live laser cycles has a
    /// photon in each bin, and every second one in bin 60.
    #[test]
    fn the_background_of_a_dead_time_follows_the_live_laser_cycles() {
        let mut counts = vec![0_u32; 128];
        let mut live = vec![0_u32; 128];
        for bin in 0..128_usize {
            live[bin] = 1000 - counts[bin.saturating_sub(20)..bin].iter().sum::<u32>();
            counts[bin] = live[bin] / if bin == 60 { 2 } else { 100 };
        }
        let rule = WindowRule::new(3, "4.5".parse().unwrap(), Count::saturating(5)).unwrap();
        let explained = |gate| {
            let settings = Settings::static_scene(0).configured(|array| {
                array.rule = rule.into();
                array.dead_time = Some(20);
                array.gate = gate;
            });
            explain(&settings, &counts, 1000, false).unwrap()
        };
        for gate in [(0, 127), (30, 127)] {
            let explanation = explained(gate);
            assert_eq!(explanation.peak, (60, counts[60]), "{gate:?}");
            let (first, last) = explanation.window.unwrap();
            assert!((58..=60).contains(&first) && last == first + 2);
            assert_eq!((explanation.needed, explanation.dead_time), (None, 20));
            let background = explanation.background.unwrap();
            let expected = f64::from(live[60]) / 100.0;
            // The counts above are rounded down to whole photons.
            assert!(
                background <= expected && background > 0.9 * expected,
                "{background}"
            );
        }
        // Without a detection it is that of all gated bins.
        let explanation = explained((70, 127));
        assert_eq!(explanation.window, None);
        assert!(explanation.background.is_some());
        // A full counter before the gate: nothing is known.
        counts[3] = 1023;
        let settings = Settings::static_scene(0).configured(|array| {
            array.rule = rule.into();
            array.dead_time = Some(20);
            array.gate = (30, 127);
        });
        let explanation = explain(&settings, &counts, 1000, false).unwrap();
        assert_eq!((explanation.window, explanation.background), (None, None));
    }

    #[test]
    fn other_histograms_have_no_look() {
        assert_eq!(
            explain(&Settings::static_scene(0), &[1; 100], 60, false),
            None
        );
    }
}

//! What the rule makes of a histogram, with the integers of the core.

use dtof_core::fixed::types::U24F8;
use dtof_core::{
    AnyRule, BinIndex, BlockLevel, Count, Count10, Count16, Count24, CounterWidth, DetectionRule,
    EchoNumber, Histogram, Peak, PeeledBins, PixelConfig, RangeGate,
};
use serde::Serialize;

use super::decisions::Decision;
use super::frame;
use super::settings::Settings;
use crate::with_bins;

/// A look at a histogram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Look {
    /// The highest bin within the gate, and its photons.
    pub peak: (u16, u32),
    /// The fewest photons in that bin, all others as they are, that the rule reports; `None` if
    /// no counter holds as many.
    pub needed: Option<u32>,
    /// What is needed depends on the events before, as the pixel tracks or reports more than one
    /// echo: it is not told then.
    pub depends: bool,
    /// The background a bin as the rule has it, at the photons of the peak or, if these are too
    /// few, at the number needed.
    pub background: Option<f64>,
    /// Where the quadrants begin, and where the last ends.
    pub quadrants: [u16; 5],
    /// First and last bin of the window with the peak that has the most photons, of that rule.
    pub window: Option<(u16, u16)>,
}

/// Looks at `counts`, a histogram that came whole from a sensor or an exposure so far; `None` if
/// the settings are for other histograms.
#[must_use]
pub fn look(settings: &Settings, counts: &[u32], is_whole: bool) -> Option<Look> {
    let bins = counts.len();
    let look = match is_whole {
        false => with_bins!(bins, BINS => of::<BINS, Count10>(settings, counts)),
        // All counters together have to fit 32 bits.
        true => {
            with_bins!(bins, of 8 16 32 64 128 256, BINS => of::<BINS, Count24>(settings, counts))
                .or_else(|_| with_bins!(bins, BINS => of::<BINS, Count16>(settings, counts)))
        }
    };
    let look = look.ok()??;
    // Whole histograms are not tracked, and their first echo is decided from themselves.
    let depends = !is_whole && (settings.tracking || settings.echoes != EchoNumber::FIRST);
    Some(match depends {
        false => look,
        true => Look {
            depends,
            needed: None,
            background: None,
            ..look
        },
    })
}

fn of<const BINS: usize, W: CounterWidth>(settings: &Settings, counts: &[u32]) -> Option<Look> {
    let counts: &[u32; BINS] = counts.try_into().ok()?;
    let config = settings.config::<BINS>().ok()?;
    let peak = histogram::<BINS, W>(counts, config.gate()).peak();
    let bin = peak.bin.raw();
    let shown = Shown {
        rule: *config.rule(),
        gate: *config.gate(),
        counts: *counts,
        peeled: PeeledBins::NONE,
        peak: (bin, peak.count.raw()),
        at: bin,
    };
    Some(shown.look::<W>())
}

/// Looks once more at what events were decided from, one after the other, as their pixels and
/// blocks did: `needed` is at most the photons of the peak.
#[must_use]
pub fn look_back(settings: &Settings, decisions: &[Decision]) -> Vec<Look> {
    let looks = with_bins!(settings.bins, BINS => all::<BINS>(settings, decisions));
    looks.ok().flatten().unwrap_or_default()
}

fn all<const BINS: usize>(settings: &Settings, decisions: &[Decision]) -> Option<Vec<Look>> {
    let (pixels, blocks) = (settings.config().ok()?, settings.block_config().ok()?);
    let looks = decisions.iter().map(|decision| {
        let of_pixel = decision.event.level == BlockLevel::PIXEL;
        let config: &PixelConfig<BINS, AnyRule> = if of_pixel { &pixels } else { &blocks };
        let shown = Shown::of(config, decision, settings.frame.is_some())?;
        Some(match of_pixel && settings.frame.is_none() {
            true => shown.look::<Count10>(),
            false => shown.look::<Count16>(),
        })
    });
    looks.collect()
}

fn histogram<const BINS: usize, W: CounterWidth>(
    counts: &[u32; BINS],
    gate: &RangeGate<BINS>,
) -> Histogram<BINS, W> {
    let mut histogram = Histogram::new();
    histogram.add_frame(counts, gate);
    histogram
}

/// A histogram, and how it is decided upon.
struct Shown<const BINS: usize> {
    rule: AnyRule,
    gate: RangeGate<BINS>,
    counts: [u32; BINS],
    /// The bins around earlier echoes.
    peeled: PeeledBins,
    /// The bin of the peak, and its photons.
    peak: (u16, u32),
    /// The bin that the rule is asked about: where a pixel that tracks expects its event, else
    /// the peak.
    at: u16,
}

impl<const BINS: usize> Shown<BINS> {
    /// What `decision` was decided from, by `config` or as a frame.
    fn of(
        config: &PixelConfig<BINS, AnyRule>,
        decision: &Decision,
        is_frame: bool,
    ) -> Option<Self> {
        let mut counts = [0; BINS];
        for (count, &kept) in counts.iter_mut().zip(&decision.counts) {
            *count = kept.into();
        }
        let peak = decision.event.peak_bin.raw();
        let mut shown = Self {
            rule: *config.rule(),
            gate: *config.gate(),
            peeled: decision.peeled,
            peak: (peak, *counts.get(usize::from(peak))?),
            at: peak,
            counts,
        };
        if is_frame {
            shown.rule = frame::ANY.into();
        }
        if let (Some(tracking), Some(expected)) = (config.tracking(), decision.expected) {
            shown.rule = *tracking.near();
            shown.at = expected.raw();
            let is_near = shown.gate.contains(shown.at);
            if !is_near || shown.answer::<Count16>(shown.peak.1).is_none() {
                shown.rule = *tracking.far();
                shown.at = peak;
            }
        }
        Some(shown)
    }

    /// The rule's answer if the peak bin held so many.
    fn answer<W: CounterWidth>(&self, photons: u32) -> Option<U24F8> {
        let mut counts = self.counts;
        *counts.get_mut(usize::from(self.peak.0))? = photons;
        let histogram = histogram::<BINS, W>(&counts, &self.gate);
        let peak = Peak {
            bin: BinIndex::saturating(self.at),
            count: Count::saturating(*counts.get(usize::from(self.at))?),
        };
        match self.peeled.echoes() {
            0 => self.rule.detect(&histogram, &self.gate, peak),
            _ => {
                let Self { rule, gate, .. } = self;
                rule.detect_without(&histogram, gate, peak, &self.peeled)
            }
        }
    }

    fn look<W: CounterWidth>(&self) -> Look {
        // More photons in the peak never make it less clear.
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
        Look {
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
        }
    }
}

/// The window of so many bins with the peak in `bin` that has the most photons.
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
    // Of several the first.
    let start = (first..=last).rev().max_by_key(|&start| sum(start))?;
    Some((start, start + width - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::fixed::types::U8F8;
    use dtof_core::{AverageRule, PaperRule, WindowRule, detect};
    use proptest::prelude::*;

    fn counts() -> impl Strategy<Value = Vec<u32>> {
        let counts = prop::collection::vec(0..12_u32, 128);
        (counts, 0..128_usize, 0..60_u32).prop_map(|(mut counts, bin, more)| {
            counts[bin] += more;
            counts
        })
    }

    proptest! {
        /// The rule itself reports at the number that is told, and with one photon less does not.
        #[test]
        fn the_number_needed_is_the_first_that_is_reported(counts in counts(), which in 0..3, gate in 0..60_u16) {
            let alpha = U8F8::lit("4");
            let minimum = Count::saturating(5);
            let settings = Settings {
                rule: match which {
                    0 => PaperRule::new(alpha, minimum).into(),
                    1 => AverageRule::new(alpha, minimum).into(),
                    _ => WindowRule::new(3, "4.5".parse().unwrap(), minimum).unwrap().into(),
                },
                gate: Some((gate, 127)),
                ..Settings::static_scene(0)
            };
            let look = look(&settings, &counts, false).unwrap();
            let (bin, peak) = look.peak;
            let within = &counts[usize::from(gate)..];
            prop_assert_eq!(peak, *within.iter().max().unwrap());
            let config = settings.config::<128>().unwrap();
            let reports = |photons: u32| {
                let mut counts: [u32; 128] = counts.clone().try_into().unwrap();
                counts[usize::from(bin)] = photons;
                let mut histogram = Histogram::<128>::new();
                histogram.add_frame(&counts, config.gate());
                // Another bin may be the highest then.
                let is_peak = histogram.peak().bin.raw() == bin;
                let found = detect(&histogram, config.gate(), config.rule(), config.estimator());
                (is_peak, found.is_some())
            };
            let needed = look.needed.unwrap();
            if let (true, reported) = reports(needed) {
                prop_assert!(reported);
            }
            if let (true, reported) = reports(needed - 1) {
                prop_assert!(!reported);
            }
            prop_assert_eq!(reports(peak).1, peak >= needed);
            if let Some((first, last)) = look.window {
                prop_assert!(first >= gate && last < 128 && last - first == 2);
                prop_assert!((first..=last).contains(&bin));
                let sum = |first: u16| (first..first + 3).map(|bin| counts[usize::from(bin)]).sum::<u32>();
                let starts = (gate..126).filter(|start| (*start..start + 3).contains(&bin));
                prop_assert_eq!(starts.map(sum).max(), Some(sum(first)));
            }
            prop_assert_eq!(look.window.is_some(), which == 2);
        }
    }

    #[test]
    fn a_threshold_that_depends_on_events_is_not_told() {
        let counts: Vec<u32> = (0..128).map(|bin| u32::from(bin == 40) * 50).collect();
        let look = |settings: Settings| look(&settings, &counts, false).unwrap();
        let window = WindowRule::new(3, "4.5".parse().unwrap(), Count::saturating(5)).unwrap();
        let plain = Settings {
            rule: window.into(),
            ..Settings::static_scene(0)
        };
        let told = look(plain.clone());
        assert!(told.needed.is_some() && !told.depends);
        let tracks = Settings {
            tracking: true,
            ..plain.clone()
        };
        let echoes = Settings {
            echoes: EchoNumber::new(2).unwrap(),
            ..plain
        };
        for settings in [tracks, echoes] {
            let look = look(settings);
            assert_eq!(
                (look.needed, look.background, look.depends),
                (None, None, true)
            );
            assert_eq!((look.peak, look.window), (told.peak, told.window));
        }
    }

    #[test]
    fn other_histograms_have_no_look() {
        assert_eq!(look(&Settings::static_scene(0), &[1; 100], false), None);
    }
}

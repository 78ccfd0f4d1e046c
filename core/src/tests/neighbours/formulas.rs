//! The decision of a pixel and its neighbours by the formulas of `core/src/detect/confirm.rs`, in floating point.

use dtof_core::fixed::types::U24F8;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Count, Count16, Detection, Flags, Histogram, Peak, PixelConfig, RangeGate, WindowRule,
};

use crate::tests::window::exceeds;

/// Bins to either side of an echo that are left out.
pub const GUARD: u16 = 3;

/// What a pixel knows: its photons, and the peaks of its echoes.
#[derive(Clone)]
pub struct Known<const BINS: usize> {
    pub counts: [u32; BINS],
    pub echoes: Vec<u16>,
    pub cycles: u16,
}

impl<const BINS: usize> Known<BINS> {
    /// Whether a bin up to `beside` from `bin` is left out.
    fn leaves_out(&self, bin: usize, beside: u16) -> bool {
        let reach = GUARD + beside;
        self.echoes
            .iter()
            .any(|&peak| peak.abs_diff(bin as u16) <= reach)
    }

    fn sum(&self, start: usize, width: usize) -> u32 {
        self.counts[start..start + width].iter().sum()
    }
}

/// [`exceeds`] for photons of a pixel.
fn surely(inside: u32, total: u32, width: usize, bins: usize, z: f64) -> Option<bool> {
    exceeds(inside.into(), total.into(), width as u64, bins as u64, z)
}

/// A confirmed window: where it begins, the photons of the pixel and of all there, and of all in how many bins.
struct Confirmed<const BINS: usize> {
    start: usize,
    own: u32,
    all: u32,
    total: u32,
    bins: usize,
    asked: Vec<Known<BINS>>,
    /// How many neighbours were left out because they are brighter.
    brighter: u32,
}

/// What a comparison shows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// The pixel's own photons are a detection.
    pub is_alone: bool,
    pub is_confirmed: bool,
    /// Rounding decides.
    pub is_close: bool,
    /// Neighbours of a confirmed window that were left out because they are brighter.
    pub brighter: u32,
}

/// Checks the decision of `own` and its neighbours.
pub fn compare<const BINS: usize>(
    detection: Option<Detection>,
    own: &Known<BINS>,
    others: &[Known<BINS>],
    config: &PixelConfig<BINS, WindowRule>,
    rule: &NeighbourConfig,
) -> Found {
    let is_confirmed = detection.is_some_and(|found| found.depth.flags.contains(Flags::CONFIRMED));
    let is_alone = detection.is_some() && !is_confirmed;
    let alone = alone(own, config.gate(), config.rule());
    let mut found = Found {
        is_alone,
        is_confirmed,
        is_close: alone.is_none(),
        brighter: 0,
    };
    if let Some(expected) = alone {
        assert_eq!(is_alone, expected, "{:?}", own.counts);
    }
    if own.echoes.is_empty() {
        // Peak, background and depth are those without neighbours.
        let mut histogram = Histogram::<BINS, Count16>::new();
        histogram.add_frame(&own.counts.map(|count| count as u16), config.gate());
        let expected = config.detect(&histogram);
        if is_alone || expected.is_some() {
            assert_eq!(detection, expected, "{:?}", own.counts);
        }
    }
    if is_alone {
        return found;
    }
    let Some(expected) = confirms(own, others, config, rule) else {
        found.is_close = true;
        return found;
    };
    assert_eq!(is_confirmed, expected.is_some(), "{:?}", own.counts);
    if let (Some(detection), Some(window)) = (&detection, &expected) {
        check(detection, own, window, config);
        found.brighter = window.brighter;
    }
    found
}

/// Whether a pixel's own photons are a detection of the window rule; `None` if rounding decides.
fn alone<const BINS: usize>(
    own: &Known<BINS>,
    gate: &RangeGate<BINS>,
    rule: &WindowRule,
) -> Option<bool> {
    let width = usize::from(rule.width());
    let gated = usize::from(gate.first())..usize::from(gate.last()) + 1;
    let bins = gated.clone().filter(|&bin| !own.leaves_out(bin, 0)).count();
    let highest = *own.counts.iter().max()?;
    let peak = own.counts.iter().position(|&count| count == highest)?;
    let starts = gated.start..=gated.end - width;
    let most = starts
        .filter(|&start| (start..start + width).contains(&peak))
        .map(|start| own.sum(start, width))
        .max()?;
    let total = own.counts.iter().sum();
    let is_enough = bins >= 8 && most >= rule.minimum_count().raw();
    Some(is_enough && surely(most, total, width, bins, rule.z().to_num())?)
}

/// The window that the neighbours confirm; the outer `None` if it is too close.
fn confirms<const BINS: usize>(
    own: &Known<BINS>,
    others: &[Known<BINS>],
    config: &PixelConfig<BINS, WindowRule>,
    rule: &NeighbourConfig,
) -> Option<Option<Confirmed<BINS>>> {
    let (gate, reach) = (config.gate(), config.estimator().reach());
    let width = usize::from(config.rule().width());
    let gated = usize::from(gate.first())..usize::from(gate.last()) + 1;
    let left = |pixels: &[&Known<BINS>]| -> Vec<usize> {
        let is_left = |bin: &usize| pixels.iter().all(|pixel| !pixel.leaves_out(*bin, 0));
        gated.clone().filter(is_left).collect()
    };
    let own_left = left(&[own]);
    let own_total: u32 = own.counts.iter().sum();
    let highest = *own.counts.iter().max()?;
    let peak = own.counts.iter().position(|&count| count == highest)?;
    let gated_starts: Vec<usize> = (gated.start..=gated.end - width).collect();
    let starts: Vec<usize> = gated_starts
        .iter()
        .copied()
        .filter(|&start| highest <= 2 || (start..start + width).contains(&peak))
        .collect();
    let most = starts.iter().map(|&start| own.sum(start, width)).max()?;
    if most < 2 || own_left.len() < 8 || !surely(most, own_total, width, own_left.len(), 2.5)? {
        return Some(None);
    }
    let first = *starts
        .iter()
        .find(|&&start| own.sum(start, width) == most)?;
    let run: Vec<usize> = (first..first + width)
        .take_while(|start| gated_starts.contains(start) && own.sum(*start, width) == most)
        .collect();
    let end = run.last()? + width;
    let mut asked = Vec::new();
    let (mut bins, mut total, mut brighter) = (own_left.len(), own_total, 0);
    // Photons above the background in the bins of these windows, times the bins left; and laser cycles times those.
    let bright = |counts: &[u32; BINS], left: &[usize], cycles: u16| {
        let there = (first..end).filter(|&bin| !own.leaves_out(bin, 0));
        let (inside, wide) = (
            there.clone().map(|bin| counts[bin]).sum::<u32>(),
            there.count(),
        );
        let all = left.iter().map(|&bin| counts[bin]).sum::<u32>();
        let above =
            (i128::from(inside) * left.len() as i128 - i128::from(all) * wide as i128).max(0);
        (inside, above, i128::from(cycles) * left.len() as i128)
    };
    let (_, own_above, own_cycles) = bright(&own.counts, &own_left, own.cycles);
    for other in others {
        let knows = !(first..end).any(|bin| other.leaves_out(bin, reach));
        let both = left(&[own, other]);
        if !knows || both.len() < 8 {
            continue;
        }
        let (inside, above, cycles) = bright(&other.counts, &both, other.cycles);
        if inside >= 2 && above * own_cycles > 2 * own_above * cycles {
            brighter += 1;
            continue;
        }
        bins = bins.min(both.len());
        total += both.iter().map(|&bin| other.counts[bin]).sum::<u32>();
        let mut other = other.clone();
        for bin in (0..BINS).filter(|&bin| own.leaves_out(bin, 0)) {
            other.counts[bin] = 0;
        }
        asked.push(other);
    }
    let all = |start: usize| {
        most + asked
            .iter()
            .map(|other| other.sum(start, width))
            .sum::<u32>()
    };
    let highest = run.iter().map(|&start| all(start)).max()?;
    let start = *run.iter().find(|&&start| all(start) == highest)?;
    let z = rule.rule().z(own_total, total).to_num();
    let is_confirmed = highest > most
        && highest >= rule.rule().own().minimum_count().raw()
        && surely(highest, total, width, bins, z)?;
    let window = Confirmed {
        start,
        own: most,
        all: highest,
        total,
        bins,
        asked,
        brighter,
    };
    Some(is_confirmed.then_some(window))
}

/// Checks the detection of `own` in the window that the model found.
fn check<const BINS: usize>(
    detection: &Detection,
    own: &Known<BINS>,
    window: &Confirmed<BINS>,
    config: &PixelConfig<BINS, WindowRule>,
) {
    let width = usize::from(config.rule().width());
    let mut sum = own.counts;
    for other in &window.asked {
        for (sum, count) in sum.iter_mut().zip(other.counts) {
            *sum += count;
        }
    }
    let bins = window.start..window.start + width;
    let highest = bins.clone().map(|bin| sum[bin]).max().unwrap();
    let peak = bins.clone().find(|&bin| sum[bin] == highest).unwrap();
    assert_eq!(usize::from(detection.peak.bin.raw()), peak);
    assert_eq!(detection.peak.count.raw(), window.own);
    let outside = f64::from(own.counts.iter().sum::<u32>() - window.own);
    let left = (usize::from(config.gate().first())..=usize::from(config.gate().last()))
        .filter(|&bin| !own.leaves_out(bin, 0))
        .count();
    let background = outside * width as f64 / (left - width) as f64;
    assert!((f64::from(detection.background.raw()) - background).abs() <= 0.51);
    assert!(detection.depth.flags.contains(Flags::CONFIRMED));
    if own.echoes.is_empty() {
        // That of one histogram with the photons of all.
        let mut all = Histogram::<BINS, Count16>::new();
        all.add_frame(&sum.map(|count| count as u16), config.gate());
        let outside =
            U24F8::from_bits(((window.total - window.all) << 8) / (window.bins - width) as u32);
        let peak = Peak {
            bin: detection.peak.bin,
            count: Count::saturating(highest),
        };
        let expected = config
            .estimator()
            .estimate(&all, config.gate(), peak, outside);
        assert_eq!(detection.depth.offset, expected.offset);
        assert_eq!(detection.depth.flags, expected.flags | Flags::CONFIRMED);
    }
}

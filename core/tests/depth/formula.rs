//! The centred window as its formula has it, in real numbers, and histograms to try it on.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{BinIndex, CentredWindow, Count, CounterWidth, Depth, Histogram, Peak, RangeGate};
use proptest::prelude::*;

pub const BINS: usize = 32;

pub fn histogram<W: CounterWidth>(counts: &[u32; BINS]) -> Histogram<BINS, W> {
    let mut histogram = Histogram::new();
    histogram.add_frame(counts, &RangeGate::full());
    histogram
}

/// A window with these half widths, in 1/256 bin.
pub fn window((before, after): (u16, u16)) -> CentredWindow {
    CentredWindow::with_sides(U8F8::from_bits(before), U8F8::from_bits(after)).unwrap()
}

/// `bin` as the peak.
pub fn peak(counts: &[u32; BINS], bin: usize) -> Peak {
    Peak {
        bin: BinIndex::new(bin as u16).unwrap(),
        count: Count::new(counts[bin]).unwrap(),
    }
}

/// What a window finds about `bin`.
pub fn depth<W: CounterWidth>(
    counts: &[u32; BINS],
    bin: usize,
    sides: (u16, u16),
    background: U24F8,
) -> Depth {
    let gate = RangeGate::full();
    let histogram = histogram::<W>(counts);
    window(sides).estimate(&histogram, &gate, peak(counts, bin), background)
}

/// Where the window is after each step, from the start of `bin` in 1/256 bin; each step
/// rounded as documented. With half widths that differ a step is one of the
/// weighted mean whose weights are 1 over the square of the half width.
pub fn path(
    counts: &[u32; BINS],
    bin: usize,
    (before, after): (u16, u16),
    background: f64,
) -> Vec<f64> {
    let narrow = f64::from(before.min(after));
    let middle = bin as f64;
    let mut x = middle + 0.5;
    let steps = if before == after { 3 } else { 5 };
    let step = |_: u32| {
        let (mut photons, mut moment, mut even) = (0.0, 0.0, 0.0);
        for (half_width, sign) in [(before, -1.0), (after, 1.0)] {
            let half = f64::from(half_width) / 256.0;
            let weight = (narrow / f64::from(half_width)).powi(2);
            let (from, to) = if sign < 0.0 {
                (x - half, x)
            } else {
                (x, x + half)
            };
            even += weight * half;
            for (bin, &count) in counts.iter().enumerate() {
                let start = (bin as f64).max(from);
                let end = (bin as f64 + 1.0).min(to);
                let inside = weight * f64::from(count) * (end - start).max(0.0);
                photons += inside;
                moment += inside * ((start + end) / 2.0 - x);
            }
        }
        let signal = (photons - even * background).max(photons / 4.0);
        if signal > 0.0 {
            x += ((moment / signal).clamp(-1.0, 1.0) * 256.0).round() / 256.0;
        }
        x = x.clamp(middle - 2.0, middle + 511.0 / 256.0);
        (x - middle) * 256.0
    };
    (0..steps).map(step).collect()
}

/// Where it is in the end.
pub fn rest(counts: &[u32; BINS], bin: usize, sides: (u16, u16), background: f64) -> f64 {
    path(counts, bin, sides, background)
        .last()
        .copied()
        .unwrap()
}

/// Whether it came near the ends of what an offset holds, or of the mirror image of that.
pub fn is_near_limit(path: &[f64]) -> bool {
    path.iter()
        .any(|&offset| !(-250.0..506.0).contains(&offset))
}

/// Counts of a pulse somewhere in the middle, the others low.
pub fn counts(highest: u32) -> impl Strategy<Value = [u32; BINS]> {
    prop::array::uniform32(0..=highest / 8).prop_flat_map(move |counts| {
        prop::array::uniform5(0..=highest).prop_map(move |pulse| {
            let mut counts = counts;
            counts[14..19].copy_from_slice(&pulse);
            counts
        })
    })
}

pub fn highest(counts: &[u32; BINS]) -> usize {
    (8..24).max_by_key(|&bin| counts[bin]).unwrap()
}

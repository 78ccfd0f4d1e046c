//! The centred window as its formula has it, in real numbers, and histograms to try it on.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{
    BinIndex, CentredWindow, Count, CounterWidth, DepthEstimate, Histogram, Peak, RangeGate,
};
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
) -> DepthEstimate {
    let gate = RangeGate::full();
    let histogram = histogram::<W>(counts);
    window(sides).estimate(&histogram, &gate, peak(counts, bin), background)
}

/// What the photons of a bin from `start` to `end` after the place count: twice their distance, over
/// the square of the half width, as far as the window reaches.
fn weight(start: f64, end: f64, [before, after]: [f64; 2]) -> f64 {
    let side = |from: f64, to: f64, half: f64| {
        let within = |distance: f64| distance.clamp(0.0, half) / half;
        within(to).powi(2) - within(from).powi(2)
    };
    side(start, end, after) - side(-end, -start, before)
}

/// The moment about a place.
fn moment(counts: impl Fn(i32) -> f64, place: f64, sides: [f64; 2]) -> f64 {
    let bins = -8..BINS as i32 + 8;
    bins.map(|bin| {
        let start = f64::from(bin) - place;
        counts(bin) * weight(start, start + 1.0, sides)
    })
    .sum()
}

/// How much steeper the moment about the start of the next bin is than that about the middle, of the
/// Gaussian pulse that a window suits, a quarter of a bin after the middle.
fn gain(half: f64) -> f64 {
    let pulse = |bin: i32| {
        let below = |x: f64| libm::erfc((10.75 - x) / ((half - 0.5) / 2.0) / 2f64.sqrt()) / 2.0;
        below(f64::from(bin) + 1.0) - below(f64::from(bin))
    };
    let about = |place| moment(pulse, place, [half, half]);
    -about(11.0) / about(10.5)
}

/// The gain of the narrower side, on straight lines between widths of whole sixteenths.
fn gain_between([before, after]: [f64; 2]) -> f64 {
    let sixteenths = before.min(after) * 16.0;
    let (whole, rest) = (sixteenths.floor(), sixteenths.fract());
    gain(whole / 16.0) * (1.0 - rest) + gain((whole + 1.0) / 16.0) * rest
}

/// Where the window comes to rest, from the start of `bin` in 1/256 bin, and how far the integer
/// code may be from it: half of the last bit, and what weights of 1/4096 that are rounded change.
/// `None` if so small a change may turn the window around.
pub fn rest(counts: &[u32; BINS], bin: usize, (before, after): (u16, u16)) -> Option<(f64, f64)> {
    let sides = [before, after].map(|half| f64::from(half) / 256.0);
    let gain = gain_between(sides);
    let counts = |bin: i32| {
        usize::try_from(bin).map_or(0.0, |bin| {
            counts.get(bin).map_or(0.0, |&count| count.into())
        })
    };
    let start = bin as f64;
    let unsure = (-8..=8).map(|near| counts(bin as i32 + near)).sum::<f64>() / 2000.0;
    // In half bins from the middle.
    let about = |place: i32| {
        let gain = if place % 2 == 0 { gain } else { 1.0 };
        let moment = gain * moment(counts, start + 0.5 + f64::from(place) / 2.0, sides);
        (moment.abs() < 1e-9 || moment.abs() > unsure).then_some(moment)
    };
    let mut here = about(0)?;
    if here.abs() < 1e-9 {
        return Some((128.0, 0.0));
    }
    let step = if here > 0.0 { 1 } else { -1 };
    let mut place = 0;
    while (-5..3).contains(&(place + step.min(0))) {
        let there = about(place + step)?;
        if there * here < 1e-9 {
            let whole = here.abs() + there.abs();
            let part = 128.0 * here.abs() / whole;
            let offset = f64::from(128 + 128 * place) + f64::from(step) * part;
            return Some((offset.clamp(-512.0, 511.0), 0.51 + 128.0 * unsure / whole));
        }
        (place, here) = (place + step, there);
    }
    Some((if step > 0 { 511.0 } else { -512.0 }, 0.0))
}

/// Whether an offset is near the ends of what one holds, or of the mirror image of that.
pub fn is_near_limit(offset: i16) -> bool {
    !(-250..506).contains(&offset)
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

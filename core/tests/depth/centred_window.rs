//! The centred window against its formula in real numbers, and what must hold
//! whatever the photons.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{
    BinIndex, CentredWindow, Count, Count10, Count16, Count24, CounterWidth, Depth, Flags,
    Histogram, Peak, RangeGate, SubBinOffset,
};
use proptest::prelude::*;

const BINS: usize = 32;

fn histogram<W: CounterWidth>(counts: &[u32; BINS]) -> Histogram<BINS, W> {
    let mut histogram = Histogram::new();
    histogram.add_frame(counts, &RangeGate::full());
    histogram
}

fn window(half_width: u16) -> CentredWindow {
    CentredWindow::new(U8F8::from_bits(half_width)).unwrap()
}

fn peak(counts: &[u32; BINS], bin: usize) -> Peak {
    Peak {
        bin: BinIndex::new(bin as u16).unwrap(),
        count: Count::new(counts[bin]).unwrap(),
    }
}

fn depth<W: CounterWidth>(
    counts: &[u32; BINS],
    bin: usize,
    half_width: u16,
    background: U24F8,
) -> Depth {
    let gate = RangeGate::full();
    let histogram = histogram::<W>(counts);
    window(half_width).estimate(&histogram, &gate, peak(counts, bin), background)
}

/// Where the window comes to rest, from the start of `bin` in 1/256 bin; each step
/// rounded as documented.
fn as_written(counts: &[u32; BINS], bin: usize, half_width: u16, background: f64) -> f64 {
    let half = f64::from(half_width) / 256.0;
    let middle = bin as f64;
    let mut x = middle + 0.5;
    for _ in 0..3 {
        let (mut photons, mut moment) = (0.0, 0.0);
        for (bin, &count) in counts.iter().enumerate() {
            let start = (bin as f64).max(x - half);
            let end = (bin as f64 + 1.0).min(x + half);
            let inside = f64::from(count) * (end - start).max(0.0);
            photons += inside;
            moment += inside * ((start + end) / 2.0 - x);
        }
        let signal = (photons - 2.0 * half * background).max(photons / 4.0);
        if signal > 0.0 {
            x += ((moment / signal).clamp(-1.0, 1.0) * 256.0).round() / 256.0;
        }
        x = x.clamp(middle - 2.0, middle + 511.0 / 256.0);
    }
    (x - middle) * 256.0
}

/// Counts of a pulse somewhere in the middle, the others low.
fn counts(highest: u32) -> impl Strategy<Value = [u32; BINS]> {
    prop::array::uniform32(0..=highest / 8).prop_flat_map(move |counts| {
        prop::array::uniform5(0..=highest).prop_map(move |pulse| {
            let mut counts = counts;
            counts[14..19].copy_from_slice(&pulse);
            counts
        })
    })
}

fn highest(counts: &[u32; BINS]) -> usize {
    (8..24).max_by_key(|&bin| counts[bin]).unwrap()
}

#[test]
fn only_widths_that_can_be_used() {
    for bits in 0..=u16::MAX {
        let window = CentredWindow::new(U8F8::from_bits(bits));
        assert_eq!(window.is_some(), (256..=1024).contains(&bits));
        if let Some(window) = window {
            assert_eq!(window.half_width().to_bits(), bits);
        }
        let expected = (2 * u32::from(bits) + 128).clamp(256, 1024);
        let window = CentredWindow::for_pulse(U8F8::from_bits(bits));
        assert_eq!(u32::from(window.half_width().to_bits()), expected);
    }
}

#[test]
fn the_widest_pulse_has_the_widest_window() {
    let widest = CentredWindow::WIDEST_PULSE;
    let width = |sigma| CentredWindow::for_pulse(sigma).half_width();
    assert_eq!(width(widest), CentredWindow::MAX);
    assert!(width(widest - U8F8::DELTA) < CentredWindow::MAX);
}

/// All pulses of four bins of up to 5 photons.
#[test]
fn all_small_pulses_are_as_written() {
    for number in 0..6usize.pow(4) {
        let mut counts = [0; BINS];
        for (place, bin) in (14..18).enumerate() {
            counts[bin] = (number / 6usize.pow(place as u32) % 6) as u32;
        }
        for half_width in [256, 333, 512, 640, 900, 1024] {
            for bin in 14..18 {
                let depth = depth::<Count10>(&counts, bin, half_width, U24F8::ZERO);
                let expected = as_written(&counts, bin, half_width, 0.0);
                let error = (f64::from(depth.offset.raw()) - expected).abs();
                // A step that rounds the other way leads to a neighbouring path.
                assert!(error <= 2.0, "{counts:?} {half_width}: off by {error}/256");
            }
        }
    }
}

#[test]
fn an_even_pulse_stays_where_it_is() {
    for centre in 0..1024 {
        for half_width in (256..=1024).step_by(59) {
            let mut counts = [0; BINS];
            counts[15..18].copy_from_slice(&[centre / 3, centre, centre / 3]);
            let depth = depth::<Count10>(&counts, 16, half_width, U24F8::ZERO);
            assert_eq!(depth.offset, SubBinOffset::CENTRE);
        }
    }
}

#[test]
fn nothing_at_all_lies_in_the_middle() {
    for background in [U24F8::ZERO, U24F8::ONE, U24F8::MAX] {
        let depth = depth::<Count10>(&[0; BINS], 16, 640, background);
        let Depth { offset, flags } = depth;
        assert_eq!((offset, flags), (SubBinOffset::CENTRE, Flags::NONE));
    }
}

/// The extremes of counts, background, width and place: nothing overflows, and the
/// offset is one.
#[test]
fn extremes() {
    fn all<W: CounterWidth>() {
        for pattern in 0..1 << 12u32 {
            let counts: [u32; BINS] = core::array::from_fn(|bin| {
                let set = pattern >> ((bin + 2) % 12) & 1 == 1;
                if set { W::MAX } else { 0 }
            });
            for half_width in [256, 257, 1023, 1024] {
                for background in [U24F8::ZERO, U24F8::from_num(W::MAX), U24F8::MAX] {
                    for bin in [0, 1, 16, 30, 31] {
                        let _ = depth::<W>(&counts, bin, half_width, background);
                    }
                }
            }
        }
    }
    all::<Count10>();
    all::<Count16>();
    all::<Count24>();
}

#[test]
fn a_window_past_the_gate_is_clipped() {
    let counts = [7; BINS];
    let histogram = histogram::<Count10>(&counts);
    let level = const { U24F8::lit("7") };
    for (first, last) in [(0u16, 31u16), (0, 9), (22, 31), (5, 20)] {
        let gate = RangeGate::new(first, last).unwrap();
        for bin in first..=last {
            for half_width in [256u16, 384, 512, 640, 1024] {
                let peak = peak(&counts, bin.into());
                let depth = window(half_width).estimate(&histogram, &gate, peak, level);
                // Past the gate is as much as inside.
                assert_eq!(depth.offset, SubBinOffset::CENTRE);
                let (from, to) = (bin * 256 + 128, bin * 256 + 128 + half_width);
                let clipped = from < first * 256 + half_width || to > (last + 1) * 256;
                let found = depth.flags.contains(Flags::CLIPPED);
                assert_eq!(found, clipped, "{bin} {half_width}");
            }
        }
    }
}

#[test]
fn a_full_counter_is_flagged() {
    fn flags<W: CounterWidth>(count: u32) -> Flags {
        let mut counts = [0; BINS];
        counts[16] = count;
        depth::<W>(&counts, 16, 512, U24F8::ZERO).flags
    }
    assert_eq!(flags::<Count10>(1022), Flags::NONE);
    assert_eq!(flags::<Count10>(1023), Flags::SATURATED);
    assert_eq!(flags::<Count16>(1023), Flags::NONE);
    assert_eq!(flags::<Count16>(65_535), Flags::SATURATED);
    assert_eq!(flags::<Count24>(65_535), Flags::NONE);
    assert_eq!(flags::<Count24>(0x00ff_ffff), Flags::SATURATED);
}

proptest! {
    #[test]
    fn it_is_as_written(counts in counts(1023), half_width in 256u16..=1024, level in 0u32..2560) {
        let bin = highest(&counts);
        let found = depth::<Count10>(&counts, bin, half_width, U24F8::from_bits(level));
        let expected = as_written(&counts, bin, half_width, f64::from(level) / 256.0);
        prop_assert!((f64::from(found.offset.raw()) - expected).abs() <= 3.0);
    }

    #[test]
    fn seen_in_a_mirror(counts in counts(1023), half_width in 256u16..=1024, level in 0u32..9999) {
        let bin = highest(&counts);
        let level = U24F8::from_bits(level);
        let offset = depth::<Count10>(&counts, bin, half_width, level).offset.raw();
        let mut mirrored = counts;
        mirrored.reverse();
        let seen = depth::<Count10>(&mirrored, BINS - 1 - bin, half_width, level).offset.raw();
        // Only the ends of what an offset holds are not each other's image.
        prop_assert!(seen == 256 - offset || offset <= -255 || seen <= -255);
    }

    #[test]
    fn a_bin_further_on(counts in counts(1023), half_width in 256u16..=1024, level in 0u32..9999) {
        let bin = highest(&counts);
        let level = U24F8::from_bits(level);
        let mut shifted = counts;
        shifted.rotate_right(1);
        // Both windows lie within the histogram.
        prop_assume!((8..23).contains(&bin));
        prop_assert_eq!(
            depth::<Count10>(&counts, bin, half_width, level).offset,
            depth::<Count10>(&shifted, bin + 1, half_width, level).offset
        );
    }

    /// Wide counters drop what 10 bits do not hold.
    #[test]
    fn only_ratios_count(counts in counts(1023), half_width in 256u16..=1024, shift in 0u32..14) {
        let bin = highest(&counts);
        let narrow = depth::<Count10>(&counts, bin, half_width, U24F8::ONE);
        let wide = counts.map(|count| count << shift);
        let level = U24F8::from_bits(256 << shift);
        let wide = depth::<Count24>(&wide, bin, half_width, level);
        // As many bits as are dropped were added.
        prop_assume!(counts[bin] >= 512);
        prop_assert_eq!(wide.offset, narrow.offset);
    }
}

/// Of every peak and gate, and widths from the least to the largest.
#[test]
fn the_background_outside_is_the_mean_of_the_bins_not_reached() {
    let counts: [u32; BINS] = std::array::from_fn(|bin| (bin as u32 * 7919) % 101);
    for (first, last) in [(0, 31), (0, 7), (5, 13), (24, 31), (3, 30)] {
        let gate = RangeGate::<BINS>::new(first, last).unwrap();
        let mut histogram = Histogram::<BINS>::new();
        histogram.add_frame(&counts, &gate);
        for half_width in [256, 257, 512, 640, 1024] {
            for bin in 0..BINS {
                let window = window(half_width);
                let found = window.background_outside(&histogram, &gate, peak(&counts, bin), 0);
                let reach = usize::from(half_width.div_ceil(256));
                let gated = usize::from(first)..=usize::from(last);
                let outside = gated.clone().filter(|other| other.abs_diff(bin) > reach);
                let (mut sum, mut bins) = (0, 0);
                for other in outside {
                    sum += counts[other];
                    bins += 1;
                }
                let mean = (sum << 8).checked_div(bins).map(U24F8::from_bits);
                let expected = mean.filter(|_| gated.contains(&bin));
                assert_eq!(found, expected, "{first} to {last}, {half_width}, {bin}");
            }
        }
    }
}

//! The centred window against its formula in real numbers, and what must hold
//! whatever the photons.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{
    CentredWindow, Count10, Count16, Count24, CounterWidth, DepthEstimate, DepthEstimator, Flags,
    Histogram, RangeGate, SubBinOffset,
};
use proptest::prelude::*;

use super::formula::{self, BINS, counts, highest, histogram, is_near_limit, peak, rest};

fn window(half_width: u16) -> CentredWindow {
    CentredWindow::new(U8F8::from_bits(half_width)).unwrap()
}

fn depth<W: CounterWidth>(
    counts: &[u32; BINS],
    bin: usize,
    half_width: u16,
    background: U24F8,
) -> DepthEstimate {
    formula::depth::<W>(counts, bin, (half_width, half_width), background)
}

#[test]
fn only_widths_that_can_be_used() {
    let widths = 256..=1024;
    for bits in 0..=u16::MAX {
        let half = U8F8::from_bits(bits);
        let window = CentredWindow::new(half);
        assert_eq!(window.is_some(), widths.contains(&bits));
        if let Some(window) = window {
            assert_eq!((window.before(), window.after()), (half, half));
        }
        for other in [0, 255, 256, 700, 1024, 1025, u16::MAX] {
            let sides = CentredWindow::with_sides(half, U8F8::from_bits(other));
            let are_some = widths.contains(&bits) && widths.contains(&other);
            assert_eq!(sides.is_some(), are_some);
            let turned = CentredWindow::with_sides(U8F8::from_bits(other), half);
            let sides = sides.map(|sides| (sides.before(), sides.after()));
            assert_eq!(
                turned.map(|turned| (turned.after(), turned.before())),
                sides
            );
        }
        let expected = (2 * u32::from(bits) + 128).clamp(256, 1024);
        let window = CentredWindow::for_pulse(half);
        assert_eq!(u32::from(window.before().to_bits()), expected);
        assert_eq!(window.after(), window.before());
    }
}

#[test]
fn the_widest_pulse_has_the_widest_window() {
    let widest = CentredWindow::WIDEST_PULSE;
    let width = |sigma| CentredWindow::for_pulse(sigma).after();
    assert_eq!(width(widest), CentredWindow::MAX);
    assert!(width(widest - U8F8::DELTA) < CentredWindow::MAX);
}

/// All pulses of four bins of up to 5 photons.
#[test]
fn all_small_pulses_are_as_written() {
    let (mut number_of, mut compared) = (0, 0);
    for number in 0..6usize.pow(4) {
        let mut counts = [0; BINS];
        for (place, bin) in (14..18).enumerate() {
            counts[bin] = (number / 6usize.pow(place as u32) % 6) as u32;
        }
        for half_width in [256, 333, 512, 640, 900, 1024] {
            for bin in 14..18 {
                number_of += 1;
                let depth = depth::<Count10>(&counts, bin, half_width, U24F8::ZERO);
                let Some((expected, error)) = rest(&counts, bin, (half_width, half_width)) else {
                    continue;
                };
                compared += 1;
                let off = (f64::from(depth.offset.raw()) - expected).abs();
                assert!(off <= error, "{counts:?} {half_width}: off by {off}/256");
            }
        }
    }
    assert!(compared > number_of * 9 / 10, "{compared} of {number_of}");
}

/// So many photons of the Gaussian pulse that a window suits, at `place` in bins.
fn suiting_pulse(half_width: u16, place: f64, photons: f64) -> [u32; BINS] {
    let sigma = (f64::from(half_width) / 256.0 - 0.5) / 2.0;
    let below = |x: f64| libm::erfc((place - x) / sigma / 2f64.sqrt()) / 2.0;
    core::array::from_fn(|bin| {
        let share = below(bin as f64 + 1.0) - below(bin as f64);
        (photons * share).round() as u32
    })
}

/// A Gaussian pulse that suits the window, a quarter of a bin to either side.
#[test]
fn a_pulse_that_suits_the_window_is_found() {
    for half_width in 288..=1024u16 {
        for (quarter, offset) in [(0.25, 64), (0.5, 128), (0.75, 192)] {
            let counts = suiting_pulse(half_width, 16.0 + quarter, 1000.0);
            let found = depth::<Count10>(&counts, 16, half_width, U24F8::ZERO);
            let off = (found.offset.raw() - offset).abs();
            assert!(off <= 2, "{half_width} {quarter}: off by {off}/256");
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
        let DepthEstimate { offset, flags } = depth;
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
                        for other in [256, 1024] {
                            let _ =
                                formula::depth::<W>(&counts, bin, (half_width, other), background);
                        }
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

/// In the middle of the histogram only an offset at its limit is.
#[test]
fn an_offset_at_its_limit_is_clipped() {
    let mut at_limits = [0; 2];
    for bin in 12..=20 {
        let mut counts = [0; BINS];
        counts[bin] = 900;
        let DepthEstimate { offset, flags } = depth::<Count10>(&counts, 16, 1024, U24F8::ZERO);
        let limits = [SubBinOffset::MIN, SubBinOffset::MAX].map(|limit| offset == limit);
        assert_eq!(
            flags.contains(Flags::CLIPPED),
            limits != [false; 2],
            "{bin}"
        );
        for (sum, is_at) in at_limits.iter_mut().zip(limits) {
            *sum += u32::from(is_at);
        }
    }
    assert!(at_limits.iter().all(|&sum| sum > 0), "{at_limits:?}");
}

/// The last offset is one, too, if the photons balance there and not beyond.
#[test]
fn an_offset_that_is_just_its_limit_is_clipped() {
    let mut balanced = 0;
    for (fewer, more) in (0..40).flat_map(|more| (1..=900).map(move |fewer| (fewer, more))) {
        let mut counts = [0; BINS];
        counts[17..19].copy_from_slice(&[fewer + more, fewer]);
        for half_width in [256, 512, 1024] {
            let depth = depth::<Count10>(&counts, 16, half_width, U24F8::ZERO);
            let is_at_limit = depth.offset == SubBinOffset::MAX;
            assert_eq!(depth.flags.contains(Flags::CLIPPED), is_at_limit);
            // With as many photons on both sides of the limit they balance past the last offset, at two bins.
            balanced += u32::from(is_at_limit && more > 0);
        }
    }
    assert!(balanced > 0);
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
        let expected = rest(&counts, bin, (half_width, half_width));
        prop_assume!(expected.is_some());
        let (expected, error) = expected.unwrap();
        prop_assert!((f64::from(found.offset.raw()) - expected).abs() <= error);
    }

    #[test]
    fn seen_in_a_mirror(counts in counts(1023), half_width in 256u16..=1024, level in 0u32..9999) {
        let bin = highest(&counts);
        let level = U24F8::from_bits(level);
        let offset = depth::<Count10>(&counts, bin, half_width, level).offset.raw();
        let mut mirrored = counts;
        mirrored.reverse();
        let seen = depth::<Count10>(&mirrored, BINS - 1 - bin, half_width, level).offset.raw();
        // The ends of what an offset holds are not each other's image.
        if is_near_limit(offset) {
            return Ok(());
        }
        prop_assert_eq!(seen, 256 - offset);
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

    /// Whatever is in them.
    #[test]
    fn bins_outside_the_gate_count_as_background(
        counts in counts(1023),
        first in 0u16..12,
        last in 19u16..32,
        half_width in 256u16..=1024,
        level in 0u32..4,
    ) {
        let gate = RangeGate::<BINS>::new(first, last).unwrap();
        let mut filled = counts;
        for (bin, count) in (0..).zip(&mut filled) {
            if !gate.contains(bin) {
                *count = level;
            }
        }
        let mean = U24F8::from_bits(level << 8);
        for bin in first..=last {
            let peak = peak(&counts, bin.into());
            let gated = window(half_width).estimate(&histogram::<Count10>(&counts), &gate, peak, mean);
            let full = depth::<Count10>(&filled, bin.into(), half_width, mean);
            prop_assert_eq!(gated.offset, full.offset, "bin {}", bin);
        }
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

/// For every peak and gate, and widths from the least to the largest.
#[test]
fn the_background_is_the_mean_of_the_bins_not_reached() {
    let counts: [u32; BINS] = std::array::from_fn(|bin| (bin as u32 * 7919) % 101);
    for (first, last) in [(0, 31), (0, 7), (5, 13), (24, 31), (3, 30)] {
        let gate = RangeGate::<BINS>::new(first, last).unwrap();
        let mut histogram = Histogram::<BINS>::new();
        histogram.add_frame(&counts, &gate);
        for (before, after) in [
            (256, 256),
            (257, 257),
            (512, 1024),
            (640, 256),
            (1024, 1024),
        ] {
            for bin in 0..BINS {
                let window = formula::window((before, after));
                let peak = peak(&counts, bin);
                let [below, above] = [before, after].map(|half| usize::from(half.div_ceil(256)));
                let gated = usize::from(first)..=usize::from(last);
                let inside = bin.saturating_sub(below)..=bin + above;
                let outside = gated.clone().filter(|other| !inside.contains(other));
                let (mut sum, mut bins) = (0, 0);
                for other in outside {
                    sum += counts[other];
                    bins += 1;
                }
                let mean = (sum << 8).checked_div(bins).map(U24F8::from_bits);
                let mean = mean.filter(|_| gated.contains(&bin));
                for given in [U24F8::ZERO, U24F8::lit("200")] {
                    let found = DepthEstimator::CentredWindow(window)
                        .estimate(&histogram, &gate, peak, given);
                    let expected = window.estimate(&histogram, &gate, peak, mean.unwrap_or(given));
                    assert_eq!(
                        found, expected,
                        "{first} to {last}, {before} {after}, {bin}"
                    );
                }
            }
        }
    }
}

/// The table of gains has one for every sixteenth of a bin. A wrong one shows on average: that of
/// the widest window changes the place by up to 0.9 of 1/256 bin.
#[test]
fn no_width_is_off_on_average() {
    for half in (256..=1024).step_by(16) {
        let (mut sum, mut number) = (0.0, 0.0);
        // All over the second half of a bin.
        for place in 0..400 {
            let counts = suiting_pulse(half, 16.5 + f64::from(place) / 800.0, 4e6);
            let found = depth::<Count24>(&counts, 16, half, U24F8::ZERO);
            if let Some((expected, _)) = rest(&counts, 16, (half, half)) {
                sum += f64::from(found.offset.raw()) - expected;
                number += 1.0;
            }
        }
        assert!(number > 300.0 && (sum / number).abs() < 0.05, "{half}");
    }
}

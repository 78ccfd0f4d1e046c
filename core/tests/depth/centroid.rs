//! The centroid against the real-valued formula.

use dtof_core::fixed::types::U24F8;
use dtof_core::paper::centroid;
use dtof_core::{
    BinIndex, Count, Count10, Count16, Count24, CounterWidth, DepthEstimate, Flags, Histogram,
    Peak, RangeGate, SubBinOffset,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn peak_at(bin: u16, count: u32) -> Peak {
    Peak {
        bin: BinIndex::new(bin).unwrap(),
        count: Count::new(count).unwrap(),
    }
}

/// The depth of a pulse of three bins in the middle of a histogram.
fn depth<W: CounterWidth>([left, centre, right]: [u32; 3], background: u32) -> DepthEstimate {
    let gate = RangeGate::full();
    let mut histogram = Histogram::<8, W>::new();
    histogram.add_frame(&[0, 0, 0, left, centre, right, 0, 0], &gate);
    let background = U24F8::from_num(background);
    centroid(&histogram, &gate, peak_at(4, centre), background)
}

/// In bins from the start of the peak bin.
fn real_offset(counts: [u32; 3], background: u32) -> f64 {
    let [left, centre, right] = counts.map(|count| f64::from(count.saturating_sub(background)));
    let sum = left + centre + right;
    if sum == 0.0 {
        0.5
    } else {
        0.5 + (right - left) / sum
    }
}

fn check<W: CounterWidth>(counts: [u32; 3], background: u32, bound: f64) {
    let depth = depth::<W>(counts, background);
    let offset = f64::from(depth.offset.raw()) / 256.0;
    let error = (offset - real_offset(counts, background)).abs();
    assert!(
        error <= bound + 1e-9,
        "{counts:?} - {background}: off by {error}"
    );
    let saturated = counts[1] == W::MAX;
    assert_eq!(depth.flags.contains(Flags::SATURATED), saturated);
    assert!(!depth.flags.contains(Flags::CLIPPED));
    if counts[1] >= counts[0] && counts[1] >= counts[2] {
        assert!((0..=256).contains(&depth.offset.raw()), "{counts:?}");
    }
    // Seen in a mirror.
    let [left, centre, right] = counts;
    let mirrored = self::depth::<W>([right, centre, left], background);
    assert_eq!(mirrored.offset.raw(), 256 - depth.offset.raw());
}

/// A random count of any magnitude up to `max`.
fn any_count(rng: &mut Pcg32, max: u32) -> u32 {
    rng.next_u32() % ((max >> (rng.next_u32() % 24)) + 1)
}

/// Two in three with the highest bin in the middle, above the background.
fn random_pulses<W: CounterWidth>(bound: f64, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    for round in 0..450_000 {
        let centre = any_count(&mut rng, W::MAX);
        let most = if round % 3 == 0 { W::MAX } else { centre };
        let [left, right, background] = [0; 3].map(|_| any_count(&mut rng, most));
        check::<W>([left, centre, right], background, bound);
    }
}

/// The division, where there is no background: 256 · |r - l| / (l + c + r), halves up.
fn divided([left, centre, right]: [u32; 3]) -> i16 {
    let sum = u64::from(left) + u64::from(centre) + u64::from(right);
    let part = u64::from(right.abs_diff(left));
    let share = (512 * part + sum).checked_div(2 * sum).unwrap_or(0);
    let share = i16::try_from(share).unwrap();
    128 + if right < left { -share } else { share }
}

/// Processors that do not divide get there bit by bit. So does the one this runs on.
#[test]
fn it_is_the_division_to_the_last_bit() {
    for number in 0..64u32.pow(3) {
        let counts = [1, 64, 64 * 64].map(|step| number / step % 64);
        assert_eq!(
            depth::<Count10>(counts, 0).offset.raw(),
            divided(counts),
            "{counts:?}"
        );
    }
    let mut rng = Pcg32::seed_from_u64(4);
    for _ in 0..450_000 {
        let counts = [0; 3].map(|_| any_count(&mut rng, Count10::MAX));
        assert_eq!(
            depth::<Count10>(counts, 0).offset.raw(),
            divided(counts),
            "{counts:?}"
        );
        // As wide as counts may be of which no bit is dropped.
        let counts = [0; 3].map(|_| any_count(&mut rng, 0x3fff));
        assert_eq!(
            depth::<Count16>(counts, 0).offset.raw(),
            divided(counts),
            "{counts:?}"
        );
    }
}

const NARROW: f64 = 1.0 / 512.0;
const WIDE: f64 = 1.0 / 256.0;

#[test]
fn all_small_pulses_whether_or_not_the_middle_is_highest() {
    for number in 0..14u32.pow(4) {
        let [left, centre, right, background] =
            [1, 14, 14 * 14, 14 * 14 * 14].map(|step| number / step % 14);
        check::<Count10>([left, centre, right], background, NARROW);
        check::<Count16>([left, centre, right], background, NARROW);
        check::<Count24>([left, centre, right], background, WIDE);
    }
}

#[test]
fn random_pulses_of_every_width() {
    random_pulses::<Count10>(NARROW, 1);
    random_pulses::<Count16>(NARROW, 2);
    random_pulses::<Count24>(WIDE, 3);
}

#[test]
fn extreme_pulses() {
    fn all<W: CounterWidth>(bound: f64) {
        let counts = [0, 1, W::MAX / 2, W::MAX - 1, W::MAX];
        for left in counts {
            for centre in counts {
                for right in counts {
                    for background in counts {
                        check::<W>([left, centre, right], background, bound);
                    }
                }
            }
        }
    }
    all::<Count10>(NARROW);
    all::<Count16>(NARROW);
    all::<Count24>(WIDE);
}

#[test]
fn a_symmetric_pulse_lies_exactly_in_the_middle() {
    for centre in 0..1024 {
        for side in 0..=centre {
            let offset = depth::<Count10>([side, centre, side], side / 2).offset;
            assert_eq!(offset, SubBinOffset::CENTRE);
        }
    }
}

#[test]
fn nothing_above_the_background_lies_in_the_middle() {
    for background in [0, 1, 30, 1023] {
        for left in [0, background / 2, background] {
            let offset = depth::<Count10>([left, background, background], background).offset;
            assert_eq!(offset, SubBinOffset::CENTRE);
        }
    }
}

#[test]
fn a_pulse_on_the_edge_between_two_bins_lies_on_the_edge() {
    assert_eq!(depth::<Count10>([0, 9, 9], 0).offset.raw(), 256);
    assert_eq!(depth::<Count10>([9, 9, 0], 0).offset.raw(), 0);
}

#[test]
fn a_window_past_the_gate_is_clipped_and_empty_there() {
    // Every count is different, so that a wrong neighbour shows.
    let counts: [u32; 16] = core::array::from_fn(|bin| 40 + u32::try_from(bin).unwrap());
    let mut histogram = Histogram::<16>::new();
    histogram.add_frame(&counts, &RangeGate::full());
    for (first, last) in [(0, 15), (0, 7), (3, 12), (8, 15), (1, 14)] {
        let gate = RangeGate::new(first, last).unwrap();
        for bin in first..=last {
            let count = |bin: u16| counts[usize::from(bin)];
            let left = if bin == first { 0 } else { count(bin - 1) };
            let right = if bin == last { 0 } else { count(bin + 1) };
            let peak = peak_at(bin, count(bin));
            let depth = centroid(&histogram, &gate, peak, U24F8::ZERO);
            let clipped = bin == first || bin == last;
            assert_eq!(depth.flags.contains(Flags::CLIPPED), clipped, "{bin}");
            let offset = f64::from(depth.offset.raw()) / 256.0;
            let expected = real_offset([left, count(bin), right], 0);
            assert!((offset - expected).abs() <= NARROW);
        }
    }
}

#[test]
fn a_full_counter_is_flagged() {
    assert_eq!(depth::<Count10>([5, 1022, 5], 0).flags, Flags::NONE);
    assert_eq!(depth::<Count10>([5, 1023, 5], 0).flags, Flags::SATURATED);
    assert_eq!(depth::<Count16>([5, 1023, 5], 0).flags, Flags::NONE);
    assert_eq!(depth::<Count16>([5, 65_535, 5], 0).flags, Flags::SATURATED);
    assert_eq!(depth::<Count24>([5, 65_535, 5], 0).flags, Flags::NONE);
    let full = depth::<Count24>([5, 0x00ff_ffff, 5], 0);
    assert_eq!(full.flags, Flags::SATURATED);
}

#[test]
fn both_flags_at_once() {
    let gate = RangeGate::full();
    let mut histogram = Histogram::<8>::new();
    histogram.add_frame(&[2000u16, 0, 0, 0, 0, 0, 0, 0], &gate);
    let depth = centroid(&histogram, &gate, histogram.peak(), U24F8::ZERO);
    assert_eq!(depth.flags, Flags::SATURATED | Flags::CLIPPED);
    assert_eq!(depth.offset, SubBinOffset::CENTRE);
}

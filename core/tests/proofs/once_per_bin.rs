//! Once per bin: every short sequence of TDC codes, with laser cycles that end anywhere and calls that are split anywhere.

use std::collections::BTreeSet;

use dtof_core::fixed::types::U4F12;
use dtof_core::{
    AsyncPixel, Count, LaserCycle, OncePerBin, PixelAddress, PixelConfig, RangeGate, Statistics,
    WindowRule,
};

use crate::common::parallel;

/// The gated bins are 4 to 11. One code lies before them, one behind, and two are of no bin: of none in the words of the
/// bitmap, too, or of one there.
const CODES: [u16; 12] = [4, 5, 6, 7, 8, 9, 10, 11, 3, 12, 16, 600];
const BINS: usize = 16;
const FIRST: u16 = 4;

type Config = PixelConfig<BINS, WindowRule>;

fn config(dead_time: u16) -> Config {
    let rule = WindowRule::new(2, U4F12::lit("4"), Count::saturating(5)).unwrap();
    PixelConfig::with_rule(rule)
        .gate(RangeGate::new(FIRST, 11).unwrap())
        .dead_time(dead_time)
        .build()
        .unwrap()
}

/// What follows a code: another of the same call, another call, or another laser cycle.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Then {
    Same,
    Call,
    LaserCycle,
}

/// Counts `codes`, and checks each bin and number against sets of bins.
fn compare<const LENGTH: usize>(config: &Config, codes: &[u16; LENGTH], then: &[Then; LENGTH]) {
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    let mut bins = OncePerBin::<{ OncePerBin::words(BINS) }>::new();
    let mut statistics = Statistics::default();
    let (mut counts, mut before, mut outside, mut rejected, mut repeated) = ([0; BINS], 0, 0, 0, 0);
    let mut set = BTreeSet::new();
    let mut start = 0;
    for (number, &code) in codes.iter().enumerate() {
        let is_first = set.insert(code);
        match code {
            // Each is rejected.
            16.. => rejected += 1,
            _ if !is_first => repeated += 1,
            4..=11 => counts[usize::from(code)] += 1,
            _ => {
                outside += 1;
                before += u16::from(code < FIRST);
            }
        }
        if then[number] != Then::Same {
            let call = &codes[start..=number];
            pixel.count_once_per_bin(config, &mut statistics, &mut bins, call);
            start = number + 1;
        }
        if then[number] == Then::LaserCycle {
            bins.end_laser_cycle();
            pixel.end_laser_cycle(config, &mut statistics, LaserCycle::new(0));
            set.clear();
        }
    }
    // With a dead time photons before the gate stay in their counters.
    if config.weighs_dead_time() {
        counts[3] = before;
    }
    assert_eq!(pixel.histogram().counts(), &counts, "{codes:?}");
    pixel.add_photons_to(&mut statistics);
    let counted = counts[4..].iter().copied().map(u64::from).sum();
    let found = [
        statistics.counted,
        statistics.gated_out,
        statistics.rejected,
        statistics.repeated,
    ];
    assert_eq!(found, [counted, outside, rejected, repeated], "{codes:?}");
    assert_eq!(statistics.photons(), codes.len() as u64);
}

/// The digits of a number to a base, as many as there are places.
fn digits<const PLACES: usize>(mut number: u64, base: u64) -> [usize; PLACES] {
    std::array::from_fn(|_| {
        let digit = number % base;
        number /= base;
        digit as usize
    })
}

/// All sequences of `LENGTH` of the first `codes`, with each of `then` between any two, with a dead time and without.
fn all<const LENGTH: usize>(codes: u64, then: &[Then]) -> u64 {
    let configs = [config(0), config(3)];
    let ways = then.len() as u64;
    let sequences = codes.pow(LENGTH as u32);
    let gaps = ways.pow(LENGTH as u32 - 1);
    parallel::for_each(gaps, |gap| {
        // Behind the last code the laser cycle ends.
        let mut then: [Then; LENGTH] = digits(gap, ways).map(|way| then[way]);
        then[LENGTH - 1] = Then::LaserCycle;
        for sequence in 0..sequences {
            let sequence: [u16; LENGTH] = digits(sequence, codes).map(|code| CODES[code]);
            for config in &configs {
                compare(config, &sequence, &then);
            }
        }
    });
    sequences * gaps * configs.len() as u64
}

const ENDS: [Then; 2] = [Then::Same, Then::LaserCycle];
const ANY: [Then; 3] = [Then::Same, Then::Call, Then::LaserCycle];
/// Of [`CODES`]: those of gated bins, all.
const GATED: u64 = 8;
const ALL: u64 = CODES.len() as u64;

fn print(cases: u64) {
    println!("proofs: once per bin: {cases} cases, 0 within rounding");
}

#[test]
fn short_sequences_count_once_per_bin() {
    let few = all::<1>(ALL, &ANY) + all::<2>(ALL, &ANY) + all::<3>(ALL, &ANY);
    print(few + all::<4>(GATED, &ENDS));
}

#[test]
#[ignore = "takes a minute: `.ci/long proofs`"]
fn all_sequences_of_six_photons_count_once_per_bin() {
    let few = all::<4>(ALL, &ANY) + all::<5>(ALL, &ANY);
    print(few + all::<6>(GATED, &ENDS));
}

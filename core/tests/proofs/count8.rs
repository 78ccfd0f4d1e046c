//! Counters of 8 bits: every histogram of eight bins, each of them with few photons, or one less than full, full, or one more.
//!
//! Until a counter has lost a photon a pixel decides as with 10 bits. Then no look gives an event: the exposure ends and is
//! counted.

use std::sync::Mutex;

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AsyncPixel, AverageRule, Count, Count8, Count10, CounterWidth, DepthEvent, LaserCycle,
    Look, PaperRule, PixelAddress, PixelConfig, RangeGate, Statistics, WindowRule,
};

use crate::common::parallel;
use crate::common::small::{HISTOGRAMS, histogram};

/// More than all photons, so that they do not contradict a dead time.
const CYCLES: u16 = 3000;

/// What came of some cases.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    cases: u64,
    events: u64,
    /// A counter has lost a photon.
    lost: u64,
}

/// All rules, windows of 1 to 3 bins, and dead times from one bin to the first photon only.
fn configs<const BINS: usize>(gate: RangeGate<BINS>) -> Vec<PixelConfig<BINS, AnyRule>> {
    let least = Count::saturating(3);
    let window = |width, z| WindowRule::new(width, z, least).unwrap().into();
    let (alpha, z) = (U8F8::lit("1.5"), U4F12::lit("2"));
    let mut rules: Vec<(AnyRule, u16)> = vec![
        (PaperRule::new(alpha, least).into(), 0),
        (AverageRule::new(alpha, least).into(), 0),
    ];
    for width in 1..=3 {
        rules.extend([0, 1, 4, BINS as u16].map(|dead_time| (window(width, z), dead_time)));
    }
    let config = |(rule, dead_time)| {
        let config = PixelConfig::with_rule(rule).x(1).l1(1).l2(u16::MAX);
        config.gate(gate).dead_time(dead_time).build().unwrap()
    };
    rules.into_iter().map(config).collect()
}

/// What a pixel does at a look after all photons, and its counts of them.
fn look<const BINS: usize, W: CounterWidth>(
    config: &PixelConfig<BINS, AnyRule>,
    counts: &[u32; BINS],
) -> (Look, Option<DepthEvent>, Statistics) {
    let mut pixel = AsyncPixel::<BINS, W>::new(PixelAddress::new(0));
    let mut statistics = Statistics::default();
    pixel.count_frame(config, counts);
    let look = pixel.end_laser_cycles(config, &mut statistics, LaserCycle::new(0), CYCLES);
    let event = pixel.take_event();
    if look != Look::NoPeak {
        assert_eq!((pixel.exposure(), pixel.histogram().total()), (0, 0));
    }
    pixel.add_photons_to(&mut statistics);
    (look, event, statistics)
}

fn compare<const BINS: usize>(
    config: &PixelConfig<BINS, AnyRule>,
    counts: &[u32; BINS],
    seen: &mut Seen,
) {
    let narrow = look::<BINS, Count8>(config, counts);
    seen.cases += 1;
    let (first, last) = (config.gate().first().into(), config.gate().last().into());
    let lost: u32 = counts[first..=last]
        .iter()
        .map(|count| count.saturating_sub(255))
        .sum();
    // Those before the gate blind the TDC, and are full from 255 on: whether they have lost one is not known.
    let is_unknown = config.weighs_dead_time() && counts[..first].iter().any(|&count| count >= 255);
    if lost == 0 && !is_unknown {
        assert_eq!(
            narrow,
            look::<BINS, Count10>(config, counts),
            "{counts:?} {config:?}"
        );
        seen.events += u64::from(narrow.1.is_some());
        return;
    }
    let (look, event, statistics) = narrow;
    assert_eq!(
        (look, event),
        (Look::Expired, None),
        "{counts:?} {config:?}"
    );
    assert_eq!((statistics.ended_full, statistics.expired), (1, 1));
    assert_eq!(statistics.saturated, u64::from(lost));
    let photons: u32 = counts.iter().sum();
    assert_eq!(statistics.photons(), u64::from(photons));
    seen.lost += 1;
}

/// Every `step`-th histogram of eight gated bins with four of `counts`, behind `before` photons in the bin before.
fn all<const BINS: usize>(
    gate: RangeGate<BINS>,
    step: u64,
    counts: [u32; 4],
    before: &[u32],
) -> Seen {
    let configs = configs(gate);
    let seen = Mutex::new(Seen::default());
    let first = usize::from(gate.first());
    parallel::for_each(HISTOGRAMS.div_ceil(step), |number| {
        let mut here = Seen::default();
        let gated = histogram(number * step).map(|count| counts[count as usize]);
        for &before in before {
            let mut counts = [0; BINS];
            counts[first..first + 8].copy_from_slice(&gated);
            if first > 0 {
                counts[first - 1] = before;
            }
            for config in &configs {
                compare(config, &counts, &mut here);
            }
        }
        let mut seen = seen.lock().unwrap();
        seen.cases += here.cases;
        seen.events += here.events;
        seen.lost += here.lost;
    });
    seen.into_inner().unwrap()
}

fn prove(step: u64) {
    let behind = RangeGate::<16>::new(8, 15).unwrap();
    let parts = [
        all::<8>(RangeGate::full(), step, [0, 1, 2, 3], &[0]),
        all::<8>(RangeGate::full(), step, [1, 200, 254, 255], &[0]),
        all::<8>(RangeGate::full(), step, [2, 254, 255, 256], &[0]),
        all::<16>(behind, step, [2, 9, 200, 255], &[254, 255, 256]),
    ];
    let sum = |of: fn(&Seen) -> u64| parts.iter().map(of).sum::<u64>();
    let [cases, events, lost] = [
        sum(|seen| seen.cases),
        sum(|seen| seen.events),
        sum(|seen| seen.lost),
    ];
    println!(
        "proofs: 8-bit counters: {cases} cases, 0 within rounding; {events} events, {lost} past a full counter"
    );
    assert!(events * 10 > cases && lost * 10 > cases);
}

#[test]
fn counters_of_eight_bits_decide_as_those_of_ten_until_one_overflows() {
    prove(61);
}

#[test]
#[ignore = "takes some seconds: `.ci/long proofs`"]
fn all_counters_of_eight_bits_decide_as_those_of_ten_until_one_overflows() {
    prove(1);
}

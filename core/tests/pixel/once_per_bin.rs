//! Photons of one laser cycle in one bin count once: against sets of bins, and in rain.

use std::collections::BTreeSet;

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, Count, DepthEstimator, LaserCycle, OncePerBin, PixelAddress, PixelConfig,
    RangeGate, Statistics, WindowRule, z_for,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg32;

#[test]
fn every_bin_has_a_bit() {
    for bins in 8..=1024 {
        let words = OncePerBin::words(bins);
        assert!(words * 32 >= bins && (words - 1) * 32 < bins, "{bins}");
    }
}

/// Laser cycles whose photons come in parts of `split`.
fn once<const WORDS: usize>(
    cycles: &[Vec<u16>],
    split: usize,
    first: u16,
) -> Result<(), TestCaseError> {
    let gate = RangeGate::<64>::new(first, 63).unwrap();
    let config = PixelConfig::<64>::paper().gate(gate).build().unwrap();
    let mut pixel = AsyncPixel::<64>::new(PixelAddress::new(0));
    let mut bins = OncePerBin::<WORDS>::new();
    let mut statistics = Statistics::default();
    let mut expected = [0u16; 64];
    let (mut gated_out, mut rejected) = (0, 0);
    for cycle in cycles {
        for codes in cycle.chunks(split) {
            pixel.count_once_per_bin(&config, &mut statistics, &mut bins, codes);
        }
        bins.end_laser_cycle();
        let set: BTreeSet<u16> = cycle.iter().copied().filter(|&code| code < 64).collect();
        for code in set {
            if code < first {
                gated_out += 1;
            } else {
                expected[usize::from(code)] += 1;
            }
        }
        rejected += cycle.iter().filter(|&&code| code >= 64).count();
    }
    prop_assert_eq!(pixel.histogram().counts(), &expected);
    pixel.add_photons_to(&mut statistics);
    let all: usize = cycles.iter().map(Vec::len).sum();
    prop_assert_eq!(statistics.photons(), all as u64);
    prop_assert_eq!(
        (statistics.gated_out, statistics.rejected),
        (gated_out, rejected as u64)
    );
    Ok(())
}

proptest! {
    /// However the photons of a laser cycle are split over calls.
    #[test]
    fn every_bin_counts_once_a_laser_cycle(
        cycles in prop::collection::vec(prop::collection::vec(prop_oneof![0u16..70, Just(9), any::<u16>()], 0..60), 1..6),
        split in 1usize..20,
        first in 0u16..20,
    ) {
        once::<2>(&cycles, split, first)?;
        // More words than bins need.
        once::<4>(&cycles, split, first)?;
    }
}

/// What a pixel reports of a target in 80.3.
#[derive(Default)]
struct Outcome {
    events: f64,
    wrong: f64,
    cycles: f64,
}

/// Rain: in one of 200 laser cycles a drop in a random place sends 30 photons back.
fn run(signal: f64, has_rain: bool, is_once: bool, events: f64) -> Outcome {
    let gate = RangeGate::<128>::full();
    let rule = WindowRule::new(3, z_for(100, &gate, 4, 40, 2000), Count::saturating(5)).unwrap();
    let config =
        PixelConfig::<128, _>::with_rule(rule).estimator(DepthEstimator::for_pulse(U8F8::ONE));
    let config = config.build().unwrap();
    let mut rng = Pcg32::seed_from_u64(7);
    let pulse = Normal::new(80.3, 1.0).unwrap();
    let [background, signal, drop] =
        [0.05 * 128.0, signal, 30.0].map(|mean| Poisson::new(mean).unwrap());
    let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(0));
    let mut bins = OncePerBin::<4>::new();
    let mut statistics = Statistics::default();
    let mut outcome = Outcome::default();
    let mut codes = Vec::new();
    while outcome.events < events {
        codes.clear();
        let photons = background.sample(&mut rng) as usize;
        codes.extend((0..photons).map(|_| (rng.next_u32() >> 25) as u16));
        let photons = signal.sample(&mut rng) as usize;
        codes.extend((0..photons).map(|_| pulse.sample(&mut rng) as u16));
        if has_rain && rng.next_u32().is_multiple_of(200) {
            let place = f64::from(4 + rng.next_u32() % 60);
            let pulse = Normal::new(place, 1.0).unwrap();
            let photons = drop.sample(&mut rng) as usize;
            codes.extend((0..photons).map(|_| pulse.sample(&mut rng) as u16));
        }
        if is_once {
            pixel.count_once_per_bin(&config, &mut statistics, &mut bins, &codes);
            bins.end_laser_cycle();
        } else {
            pixel.count_batch(&config, &codes);
        }
        outcome.cycles += 1.0;
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(0));
        if let Some(event) = pixel.take_event() {
            outcome.events += 1.0;
            let error = f64::from(event.position().raw()) / 256.0 - 80.3;
            outcome.wrong += f64::from(u8::from(error.abs() > 3.0));
        }
    }
    outcome
}

/// Drops are no longer events, and the target takes hardly longer in the dry.
#[test]
fn rain_makes_no_events() {
    for (signal, events) in [(0.5, 4000.0), (0.145, 1000.0)] {
        let share = |one: &Outcome| one.wrong / one.events;
        let each = |one: &Outcome| one.cycles / (one.events - one.wrong);
        let [counted, once, dry, dry_once] =
            [(true, false), (true, true), (false, false), (false, true)]
                .map(|(has_rain, is_once)| run(signal, has_rain, is_once, events));
        println!(
            "signal {signal}: wrong {:.2} % → {:.3} % of {events}; dry {:.1} → {:.1} laser cycles",
            100.0 * share(&counted),
            100.0 * share(&once),
            each(&dry),
            each(&dry_once)
        );
        assert!(share(&counted) > 0.1 && share(&once) <= 0.012);
        assert!(each(&dry_once) <= 1.15 * each(&dry));
    }
}

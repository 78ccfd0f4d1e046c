//! One z, the wanted rate of false alarms, whatever the background, the width of the
//! window and the number of bins. Shown with `--nocapture`.

use dtof_core::{
    AsyncPixel, Count, LaserCycle, Look, PixelAddress, PixelConfig, RangeGate, Statistics,
    WindowRule, z_for,
};
use rand_core::SeedableRng;
use rand_distr::Poisson;
use rand_pcg::Pcg64Mcg;

use crate::common::light;

/// When a pixel looks.
#[derive(Clone, Copy, Debug)]
struct Looks {
    x: u16,
    l1: u16,
    l2: u16,
}

/// Exposures of `exposures` without a target that brought an event.
fn false_events<const BINS: usize>(
    looks: Looks,
    one_in: u32,
    width: u8,
    background: f64,
    exposures: u32,
) -> f64 {
    let gate = RangeGate::<BINS>::full();
    let Looks { x, l1, l2 } = looks;
    let z = z_for(one_in, &gate, x, l1, l2);
    let rule = WindowRule::new(width, z, Count::default()).unwrap();
    let config = PixelConfig::with_rule(rule).x(x).l1(l1).l2(l2);
    let config = config.gate(gate).build().unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(width));
    let photons = Poisson::new(background * BINS as f64 * f64::from(x)).unwrap();
    let (mut events, mut statistics) = (0.0, Statistics::default());
    let mut codes = Vec::new();
    for _ in 0..exposures {
        let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
        let mut last = LaserCycle::new(0);
        loop {
            codes.clear();
            light::draw::<BINS>(&photons, &mut rng, &mut codes);
            pixel.count_batch(&config, &codes);
            last = LaserCycle::new(last.raw() + u64::from(x));
            match pixel.end_laser_cycles(&config, &mut statistics, last, x) {
                Look::Event => events += 1.0,
                Look::Expired => {}
                _ => continue,
            }
            break;
        }
    }
    events
}

/// At least `least` times the wanted rate and at most 1.5 times, but for three standard
/// deviations.
fn check<const BINS: usize>(
    looks: Looks,
    one_in: u32,
    width: u8,
    background: f64,
    exposures: u32,
    least: f64,
) {
    let events = false_events::<BINS>(looks, one_in, width, background, exposures);
    let wanted = f64::from(exposures) / f64::from(one_in);
    println!(
        "{looks:?}, {BINS} bins, width {width}, background {background}: {:.2} times 1 in {one_in}",
        events / wanted
    );
    let (low, high) = (wanted * least, wanted * 1.5);
    assert!(
        (low - 3.0 * low.sqrt()..high + 3.0 * high.sqrt()).contains(&events),
        "{events} events, wanted {wanted}"
    );
}

const LOOKS: Looks = Looks {
    x: 4,
    l1: 40,
    l2: 1000,
};

/// 0.4 photons a bin at the first look of the lowest background, 200 at the last of the
/// highest.
#[test]
fn from_half_a_photon_a_bin_to_two_hundred() {
    for background in [0.01, 0.03, 0.1, 0.2] {
        for width in [1, 2, 3, 5, 7] {
            check::<128>(LOOKS, 100, width, background, 3000, 0.5);
        }
    }
}

/// However few bins lie outside the window, and however few photons in them: 0.1 to 8
/// a bin at the first look.
#[test]
fn never_more_with_few_bins_and_photons() {
    for background in [0.0025, 0.01, 0.05, 0.2] {
        for width in [1, 2, 3, 5, 7] {
            check::<8>(LOOKS, 100, width, background, 6000, 0.0);
            check::<16>(LOOKS, 100, width, background, 6000, 0.0);
            check::<32>(LOOKS, 100, width, background, 3000, 0.0);
        }
    }
}

#[test]
fn whatever_the_looks() {
    for (x, l1, l2) in [
        (40, 40, 81),
        (4, 40, 80),
        (10, 100, 1000),
        (1, 40, 200),
        (2, 2, 100),
    ] {
        check::<128>(Looks { x, l1, l2 }, 100, 3, 0.1, 8000, 0.5);
    }
}

#[test]
fn whatever_the_number_of_bins() {
    for width in [1, 2, 5] {
        check::<16>(LOOKS, 100, width, 0.05, 6000, 0.5);
        check::<1024>(LOOKS, 100, width, 0.02, 1200, 0.4);
    }
}

#[test]
fn seldomer() {
    let looks = Looks { l2: 300, ..LOOKS };
    for width in [2, 5] {
        check::<128>(looks, 1000, width, 0.05, 20_000, 0.5);
        check::<16>(LOOKS, 1000, width, 0.01, 20_000, 0.0);
    }
}

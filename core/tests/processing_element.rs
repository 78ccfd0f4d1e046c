//! A processing element is four lone pixels, each looked at in its turn.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, ConfigError, Count, LaserCycle, Look, Macropixel, PaperRule, PixelAddress,
    PixelConfig, ProcessingElement, RangeGate, Statistics,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const ADDRESSES: [PixelAddress; 4] = [
    PixelAddress(40),
    PixelAddress(41),
    PixelAddress(80),
    PixelAddress(81),
];

fn config(x: u16, l1: u16, l2: u16, alpha: u16) -> PixelConfig<16> {
    let rule = PaperRule::new(U8F8::from_bits(alpha), Count::saturating(4));
    let gate = RangeGate::new(1, 14).unwrap();
    PixelConfig::new(x, l1, l2, gate, rule).unwrap()
}

/// One laser cycle of all four.
#[derive(Clone, Debug)]
struct Cycle {
    /// Which macropixel, and the TDC code.
    photons: Vec<(usize, u16)>,
    acknowledge: [bool; 4],
}

/// Runs an element and four lone pixels, which are given whole stretches of
/// laser cycles from one of their turns to the next: k + 1 cycles up to the
/// first, then 4. With X = 1 every end of a stretch is a look.
fn compare(l1: u16, l2: u16, alpha: u16, cycles: &[Cycle]) -> Statistics {
    let of_lone = config(1, l1, l2, alpha);
    let mut element = ProcessingElement::<16>::new(config(4, l1, l2, alpha), ADDRESSES).unwrap();
    let mut lone = ADDRESSES.map(AsyncPixel::<16>::new);
    let mut stretch = [0u16; 4];
    for (number, cycle) in cycles.iter().enumerate() {
        for &(k, code) in &cycle.photons {
            element.count(Macropixel::ALL[k], code);
            lone[k].count(&of_lone, code);
        }
        let before = Macropixel::ALL.map(|m| element.pixel(m).statistics());
        let (served, look) = element.end_laser_cycle(LaserCycle(number as u64));

        let turn = number % 4;
        assert_eq!(served, Macropixel::ALL[turn]);
        for (k, stretch) in stretch.iter_mut().enumerate() {
            *stretch += 1;
            let pixel = element.pixel(Macropixel::ALL[k]);
            if k == turn {
                assert_eq!(*stretch, if number < 4 { k as u16 + 1 } else { 4 });
                let cycle = LaserCycle(number as u64);
                assert_eq!(look, lone[k].end_laser_cycles(&of_lone, cycle, *stretch));
                assert_eq!(pixel.exposure(), lone[k].exposure());
                *stretch = 0;
            } else {
                // No other decides or begins anew in this laser cycle.
                assert_eq!(pixel.statistics(), before[k]);
                assert_eq!(pixel.exposure(), lone[k].exposure() + *stretch);
            }
            assert_eq!(pixel.address(), ADDRESSES[k]);
            assert_eq!(pixel.histogram().counts(), lone[k].histogram().counts());
            assert_eq!(pixel.request(), lone[k].request());
            assert_eq!(pixel.statistics(), lone[k].statistics());
        }
        for (k, _) in cycle
            .acknowledge
            .iter()
            .enumerate()
            .filter(|&(_, &ack)| ack)
        {
            assert_eq!(
                element.acknowledge(Macropixel::ALL[k]),
                lone[k].acknowledge()
            );
        }
    }
    let mut sum = Statistics::default();
    for pixel in lone {
        let Statistics {
            events,
            deferred,
            expired,
            ..
        } = pixel.statistics();
        sum.events += events;
        sum.deferred += deferred;
        sum.expired += expired;
    }
    sum
}

#[test]
fn each_macropixel_is_a_lone_pixel_looked_at_in_its_turn() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = Statistics::default();
    for _ in 0..200 {
        let l1 = 4 + (rng.next_u32() % 40) as u16;
        let l2 = l1 + 5 + (rng.next_u32() % 100) as u16;
        let alpha = (rng.next_u32() % 2048) as u16;
        let pulses: [u32; 4] = core::array::from_fn(|_| rng.next_u32() % 16);
        let cycles: Vec<Cycle> = (0..1000)
            .map(|_| Cycle {
                photons: (0..rng.next_u32() % 12)
                    .map(|_| {
                        let k = (rng.next_u32() % 4) as usize;
                        let noise = rng.next_u32() % 18;
                        (
                            k,
                            if rng.next_u32().is_multiple_of(4) {
                                noise
                            } else {
                                pulses[k]
                            } as u16,
                        )
                    })
                    .collect(),
                acknowledge: [0; 4].map(|_| rng.next_u32().is_multiple_of(40)),
            })
            .collect();
        let one = compare(l1, l2, alpha, &cycles);
        seen.events += one.events;
        seen.deferred += one.deferred;
        seen.expired += one.expired;
    }
    assert!(
        seen.events > 1000 && seen.deferred > 1000 && seen.expired > 1000,
        "{seen:?}"
    );
}

#[test]
fn x_must_be_four() {
    for x in 1..=20 {
        let element = ProcessingElement::<16>::new(config(x, 40, 2000, 1024), ADDRESSES);
        assert_eq!(
            element.err(),
            (x != 4).then_some(ConfigError::XNotFour),
            "{x}"
        );
    }
}

#[test]
fn the_first_looks_fall_on_one_to_four_laser_cycles() {
    let config = config(4, 4, 2000, 0);
    let mut element = ProcessingElement::<16>::new(config, ADDRESSES).unwrap();
    for macropixel in Macropixel::ALL {
        for _ in 0..4 {
            element.count(macropixel, 9);
        }
    }
    // N > L1 = 4 is first met by A at N = 5, B at 6, C at 7, D at 8.
    for n in 1..=8u16 {
        let (served, look) = element.end_laser_cycle(LaserCycle(n.into()));
        assert_eq!(look == Look::Event, n > 4);
        if look == Look::Event {
            assert_eq!(element.acknowledge(served).unwrap().exposure, n);
        }
    }
}

fn cycle() -> impl Strategy<Value = Cycle> {
    let photon = (0usize..4, prop_oneof![0u16..18, Just(6)]);
    let photons = prop::collection::vec(photon, 0..10);
    let acknowledge = prop::array::uniform4(prop::bool::weighted(0.1));
    (photons, acknowledge).prop_map(|(photons, acknowledge)| Cycle {
        photons,
        acknowledge,
    })
}

proptest! {
    #[test]
    fn any_photons_and_acknowledge_times(
        l1 in 4u16..20,
        more in 5u16..40,
        alpha in 0u16..1024,
        cycles in prop::collection::vec(cycle(), 0..150),
    ) {
        compare(l1, l1 + more, alpha, &cycles);
    }
}

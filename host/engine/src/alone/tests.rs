use proptest::prelude::*;

use super::*;
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{Count, Count10, EchoNumber, PaperRule, RangeGate, WindowRule};
use dtof_data::photons::source::Photon;

/// The pixel laser cycle by laser cycle, as hardware would.
fn one_by_one(
    config: &PixelConfig<16, AnyRule>,
    first: u64,
    received: &PixelPhotons,
) -> (Vec<DepthEvent>, Statistics) {
    let mut pixel = AsyncPixel::<16>::new(PixelAddress::new(3));
    let (mut events, mut statistics) = (Vec::new(), Statistics::new());
    for cycle in 0..received.cycles {
        let now = received
            .photons
            .iter()
            .filter(|photon| photon.cycle == cycle);
        now.for_each(|photon| pixel.count(config, photon.code));
        let cycle = LaserCycle::new(first + u64::from(cycle));
        pixel.end_laser_cycle(config, &mut statistics, cycle);
        events.extend(pixel.take_event());
    }
    pixel.add_photons_to(&mut statistics);
    (events, statistics)
}

proptest! {
    /// Looks that are skipped and slices of any length change nothing.
    #[test]
    fn a_pixel_decides_as_it_does_laser_cycle_by_laser_cycle(
        photons in prop::collection::vec((0u16..600, prop_oneof![Just(5u16), 0u16..20]), 0..900),
        (x, l1, more) in (1u16..40, 0u16..200, 1u16..200),
        (echoes, echo_wait) in (1u8..4, prop_oneof![Just(255u8), 1u8..6]),
        (has_gate, has_window, tracks) in any::<(bool, bool, bool)>(),
        dead_time in prop_oneof![3 => Just(0u16), 1 => 1u16..20],
        slices in prop::collection::vec(1u16..200, 1..8),
        first in 0u64..1 << 40,
    ) {
        let l1 = l1.max(x);
        let rule = if has_window {
            AnyRule::from(WindowRule::new(3, U4F12::lit("2.5"), Count::saturating(4)).unwrap())
        } else {
            AnyRule::from(PaperRule::new(U8F8::lit("1"), Count::saturating(4)))
        };
        let gate = if has_gate { RangeGate::new(2, 11).unwrap() } else { RangeGate::full() };
        let tracking = if tracks { rule.tracking(&gate) } else { None };
        let config = PixelConfig::with_rule(rule).tracking(tracking).dead_time(dead_time);
        let config = config.x(x).l1(l1).l2(l1 + x + more).gate(gate);
        let config = config.echoes(EchoNumber::new(echoes).unwrap(), 1).echo_wait(echo_wait);
        let config = config.build().unwrap();
        let mut all = PixelPhotons { cycles: 600, photons: Vec::new() };
        all.photons = photons.iter().map(|&(cycle, code)| Photon { cycle, code }).collect();
        all.photons.sort_by_key(|photon| photon.cycle);
        let (events, statistics) = one_by_one(&config, first, &all);

        let mut engine = LoneEngine::<16, Count10>::new(config, &[PixelAddress::new(3)]);
        let (mut found, mut begin) = (Vec::new(), 0);
        for length in slices.into_iter().chain([600]) {
            let end = (begin + length).min(600);
            let of_slice = all.photons.iter().filter(|photon| (begin..end).contains(&photon.cycle));
            let moved = of_slice.map(|photon| Photon { cycle: photon.cycle - begin, ..*photon });
            let pixels = vec![PixelPhotons { cycles: end - begin, photons: moved.collect() }];
            found.extend(engine.run(&Slice { first_cycle: first + u64::from(begin), pixels }).unwrap());
            begin = end;
        }
        let counted = engine.statistics()[0];
        prop_assert_eq!(found, events);
        prop_assert_eq!(counted, statistics);
    }
}

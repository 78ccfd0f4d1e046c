//! Pile-up is flagged where the TDC takes one photon a laser cycle.

use dtof_core::{Flags, Look, PixelConfig, RangeGate};

use super::model::Lone;

/// More than half of 44 laser cycles, whatever became of the photons, and those of
/// the exposure alone.
#[test]
fn pile_up_is_more_than_a_photon_in_every_other_laser_cycle() {
    let gate = RangeGate::new(1, 15).unwrap();
    let multi = PixelConfig::<16>::paper().build().unwrap();
    let multi = multi.with_gate(gate);
    assert_eq!(multi.gate(), &gate);
    let one_hit = multi.with_dead_time(u16::MAX);
    assert!(one_hit.is_first_photon_only() && !multi.is_first_photon_only());
    // In the peak, gated out, past the last bin.
    for (photons, is_flagged) in [
        ([22, 0, 0], false),
        ([23, 0, 0], true),
        ([10, 12, 22], false),
        ([10, 13, 0], true),
    ] {
        for (config, may_be_flagged) in [(&multi, false), (&one_hit, true)] {
            let mut pixel = Lone::<16>::new(0);
            for exposure in 0..2 {
                for (code, photons) in [9, 0, 16].into_iter().zip(photons) {
                    (0..photons).for_each(|_| pixel.pixel.count(config, code));
                }
                let last = exposure * 44 + 43;
                assert_eq!(pixel.end(config, last, 44), Look::Event);
                let flags = pixel.pixel.take_event().unwrap().flags;
                let expected = is_flagged && may_be_flagged;
                assert_eq!(flags.contains(Flags::PILE_UP), expected, "{photons:?}");
            }
        }
    }
}

/// A full counter counts no more, but its photons came.
#[test]
fn photons_that_met_a_full_counter_pile_up_too() {
    let config = PixelConfig::<8>::paper().l2(4000).build();
    let config = config.unwrap().with_dead_time(u16::MAX);
    for (photons, is_flagged) in [(1500, false), (1501, true)] {
        let mut pixel = Lone::<8>::new(0);
        (0..photons).for_each(|_| pixel.pixel.count(&config, 5));
        assert_eq!(pixel.end(&config, 2999, 3000), Look::Event);
        let flags = pixel.pixel.take_event().unwrap().flags;
        assert_eq!(flags.contains(Flags::PILE_UP), is_flagged);
        assert!(flags.contains(Flags::SATURATED));
    }
}

//! How a rate of false alarms is shared out: near the last event and elsewhere, among pixels
//! and blocks. Held against the normal distribution, and tracking against a simulation.

use dtof_core::fixed::types::U4F12;
use dtof_core::rule::{ExcludedBins, HIGHEST_Z, z_for_levels};
use dtof_core::{
    BinIndex, BlockLevel, Count, DetectionRule, Histogram, Peak, RangeGate, WindowRule, z_for,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The lowest z of `z_for`: that of 64 trials.
const LOWEST: u16 = 8822;
/// What one step of 1/256 in the logarithm of trials is worth at most.
const STEP: u16 = 5;

fn rule(z: u16) -> WindowRule {
    WindowRule::new(3, U4F12::from_bits(z), Count::saturating(5)).unwrap()
}

/// The rate of `rule` as the normal distribution has it.
fn rate(rule: &WindowRule) -> f64 {
    libm::erfc(rule.z().to_num::<f64>() / std::f64::consts::SQRT_2) / 2.0
}

fn levels() -> impl Iterator<Item = BlockLevel> {
    (0..=3).map(BlockLevel::saturating)
}

/// For every z there is.
fn tracking_of_all_z<const BINS: usize>(gate: &RangeGate<BINS>) {
    let mut before = (0, 0);
    for z in 0..=u16::MAX {
        let all = rule(z);
        let tracking = all.tracking(gate);
        let (near, far) = (tracking.near(), tracking.far());
        assert_eq!(tracking.reach(), 2);
        for shared in [near, far] {
            assert_eq!(
                (shared.width(), shared.minimum_count()),
                (3, Count::saturating(5))
            );
        }
        let bits = (near.z().to_bits(), far.z().to_bits());
        assert!(bits.0 <= z && z <= bits.1, "{z}");
        assert!(before.0 <= bits.0 && before.1 <= bits.1, "{z}");
        if (LOWEST + 10..HIGHEST_Z.to_bits() - 10).contains(&z) {
            assert!(bits.0 < z && z < bits.1, "{z}");
            assert!(
                bits.0 - before.0 <= STEP && bits.1 - before.1 <= STEP,
                "{z}"
            );
        }
        before = bits;
    }
}

#[test]
fn near_is_below_and_far_above_for_every_z() {
    tracking_of_all_z(&RangeGate::<8>::full());
    tracking_of_all_z(&RangeGate::<128>::full());
    tracking_of_all_z(&RangeGate::<128>::new(9, 29).unwrap());
    tracking_of_all_z(&RangeGate::<1024>::full());
}

/// Far: half of the rate. Near: the other half, of two bins instead of all.
#[test]
fn each_of_both_has_half_of_the_false_alarms() {
    for z in LOWEST + 3500..HIGHEST_Z.to_bits() - 1000 {
        for last in [7, 15, 30, 127, 500, 1023] {
            let gate = RangeGate::<1024>::new(0, last).unwrap();
            let (all, tracking) = (rule(z), rule(z).tracking(&gate));
            // Wherever the gate begins.
            let end = RangeGate::<1024>::new(1023 - last, 1023).unwrap();
            assert_eq!(all.tracking(&end), tracking);
            let far = rate(tracking.far()) / rate(&all);
            assert!((0.48..0.52).contains(&far), "{z} {last}: {far}");
            let near = rate(tracking.near());
            let share = 2.0 * near / (rate(&all) * f64::from(last + 1));
            // The lowest z there is leaves less than half.
            assert!(
                share < 0.55 && (share > 0.45 || tracking.near().z().to_bits() == LOWEST),
                "{z} {last}: {share}"
            );
        }
    }
}

/// With eight bins near has twice the trials of all less those of four bins: half of them. Far
/// of that is what one began with.
#[test]
fn trials_and_z_are_inverse_within_a_step() {
    let gate = RangeGate::<8>::full();
    for z in LOWEST + 1500..HIGHEST_Z.to_bits() - 1500 {
        let there = *rule(z).tracking(&gate).near();
        let back = *there.tracking(&gate).far();
        assert!(
            back.z().to_bits().abs_diff(z) <= 2 * STEP,
            "{z}: {}",
            back.z().to_bits()
        );
    }
}

#[test]
fn blocks_have_a_third_of_the_false_alarms_of_pixels() {
    for z in 0..=u16::MAX {
        let mut before = z;
        for level in levels() {
            let blocks = rule(z).of_blocks(level);
            let bits = blocks.z().to_bits();
            assert!(before <= bits, "{z} {level}");
            before = bits;
            let is_covered = (LOWEST..HIGHEST_Z.to_bits() - 2500).contains(&z);
            if is_covered && level > BlockLevel::PIXEL {
                // One level has them all; a block of each has a quarter more than a pixel.
                let expected = 1.0 / 3.0 / 1.25 / f64::from(level.raw());
                let share = rate(&blocks) / rate(&rule(z)) / expected;
                assert!((0.9..1.1).contains(&share), "{z} {level}: {share}");
            }
        }
    }
}

#[test]
fn pixels_have_three_quarters_where_there_are_blocks() {
    for one_in in [10, 100, 1000, 1_000_000, u32::MAX] {
        for l2 in [44, 100, 1000, 2000, u16::MAX] {
            for last in [7, 30, 127, 1023] {
                let gate = RangeGate::<1024>::new(0, last).unwrap();
                let alone = z_for(one_in, &gate, 4, 40, l2);
                for level in levels() {
                    let z = z_for_levels(one_in, &gate, 4, 40, l2, level);
                    let share = rate(&rule(z.to_bits())) / rate(&rule(alone.to_bits()));
                    if level == BlockLevel::PIXEL {
                        assert_eq!(z, alone);
                    } else if z < HIGHEST_Z {
                        assert!(
                            (0.72..0.78).contains(&share),
                            "{one_in} {l2} {last}: {share}"
                        );
                    } else {
                        // Nearly as high alone.
                        assert!(alone <= z && HIGHEST_Z - alone < U4F12::lit("0.1"));
                    }
                }
            }
        }
    }
}

/// A pixel without a target that expects an event in one bin, over exposures of 240 looks:
/// how many times as many false alarms as one in `one_in`.
fn false_alarms(width: u8, expected: u16, background: f64, exposures: u32) -> f64 {
    let gate = RangeGate::<128>::full();
    let z = z_for(20, &gate, 4, 40, 1000);
    let rule = WindowRule::new(width, z, Count::default()).unwrap();
    let tracking = rule.tracking(&gate);
    let mut rng = Pcg64Mcg::seed_from_u64(width.into());
    let none = (-background * 128.0).exp();
    let mut events = 0.0;
    for _ in 0..exposures {
        let mut histogram = Histogram::<128>::new();
        for cycle in 1..1000 {
            // A Poisson number of photons.
            let mut left = none;
            loop {
                let uniform = (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0;
                left /= uniform;
                if left > 1.0 {
                    break;
                }
                histogram.add((rng.next_u32() >> 25) as u16);
            }
            if cycle <= 40 || cycle % 4 > 0 {
                continue;
            }
            let count = Count::saturating(histogram.count(expected.into()).unwrap());
            let bin = BinIndex::saturating(expected);
            let near =
                tracking
                    .near()
                    .detect(&histogram, &gate, Peak { bin, count }, &ExcludedBins::NONE);
            let far =
                tracking
                    .far()
                    .detect(&histogram, &gate, histogram.peak(), &ExcludedBins::NONE);
            if near.is_some() || far.is_some() {
                events += 1.0;
                break;
            }
        }
    }
    20.0 * events / f64::from(exposures)
}

/// As many as without tracking: at most 1.5 times the rate, and not far fewer.
#[test]
fn an_expectation_brings_no_more_false_alarms() {
    for width in [1, 3, 5, 7] {
        for background in [0.02, 0.1] {
            let share = false_alarms(width, 50, background, 2000);
            println!("width {width}, background {background}: {share:.2} times 1 in 20");
            assert!((0.5..1.6).contains(&share), "{width} {background}: {share}");
        }
    }
}

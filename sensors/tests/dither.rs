//! The random lengths of laser cycles.

use dtof_sensors::dither::Dither;
use dtof_sensors::photon_timer::{BINS, Config, Settings};

fn lengths(range: u16, seed: u64) -> [u8; Dither::LENGTHS] {
    let mut added = Dither::new(range, seed).unwrap().added();
    core::array::from_fn(|_| added.next().unwrap())
}

#[test]
fn ranges_that_cannot_be_are_refused() {
    for range in 0..=u16::MAX {
        let is_valid = range <= 254 && range % 2 == 0;
        let dither = Dither::new(range, 9);
        let is = dither.map(|dither| (dither.range(), dither.seed()));
        assert_eq!(is.ok(), is_valid.then_some((range, 9)), "{range}");
    }
    assert_eq!(Dither::new(0, 9).unwrap().added().take(2000).max(), Some(0));
}

#[test]
fn lengths_are_uniform_and_their_mean_is_half_the_range() {
    for range in [2, 16, 64, 128, 254] {
        let values = usize::from(range) + 1;
        let mut seen = [0u32; 255];
        let seeds = 200;
        for seed in 0..seeds {
            let lengths = lengths(range, seed);
            let sum: u32 = lengths.iter().copied().map(u32::from).sum();
            assert_eq!(sum, 512 * u32::from(range));
            for added in lengths {
                seen[usize::from(added)] += 1;
            }
        }
        assert!(seen[values..].iter().all(|&count| count == 0));
        // Each value and its mirror image come as often: half the degrees of freedom.
        let expected = 512.0 * seeds as f64 * 2.0 / values as f64;
        let pairs = (0..values / 2).map(|value| f64::from(seen[value]));
        let squares: f64 = pairs
            .map(|count| (count - expected).powi(2) / expected)
            .sum();
        let freedom = f64::from(range) / 2.0;
        assert!(
            (squares - freedom).abs() < 5.0 * (2.0 * freedom).sqrt() + 5.0,
            "{range}: {squares}"
        );
    }
}

#[test]
fn a_length_says_nothing_of_the_next() {
    let mut sum = 0.0;
    for seed in 0..50 {
        let lengths = lengths(128, seed).map(|added| f64::from(added) - 64.0);
        let half = &lengths[..512];
        sum += half.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    }
    // Each product varies by the product of the variances of two uniform whole numbers.
    let variance = (129.0f64.powi(2) - 1.0) / 12.0;
    let limit = 5.0 * variance * (50.0 * 511.0f64).sqrt();
    assert!(sum.abs() < limit, "{sum} of {limit}");
}

/// PCG-XSH-RR 64/32 of M. O'Neill, as `docs/link-format.md` has it.
struct Pcg {
    state: u64,
    increment: u64,
}

impl Pcg {
    fn new(seed: u64, stream: u64) -> Self {
        let increment = (stream << 1) | 1;
        let mut pcg = Self {
            state: seed.wrapping_add(increment),
            increment,
        };
        pcg.step();
        pcg
    }

    fn step(&mut self) {
        let product = self.state.wrapping_mul(6_364_136_223_846_793_005);
        self.state = product.wrapping_add(self.increment);
    }

    #[allow(clippy::cast_possible_truncation, reason = "the lower half")]
    fn next(&mut self) -> u32 {
        let state = self.state;
        self.step();
        let mixed = (((state >> 18) ^ state) >> 27) as u32;
        mixed.rotate_right((state >> 59) as u32)
    }
}

/// Every range, every length of the sequence and of its repetition, by the formula of the link's format.
#[test]
fn all_lengths_of_all_ranges_are_those_of_the_formula() {
    let mut cases = 0u64;
    for range in (0..=Dither::MOST).step_by(2) {
        let mut reached = [false; 255];
        for seed in (0..200).chain([u64::MAX, 1 << 63]) {
            let mut pcg = Pcg::new(seed, 0x6469_7468);
            let half: Vec<u8> = (0..512)
                .map(|_| {
                    let bins = (u64::from(pcg.next()) * (u64::from(range) + 1)) >> 32;
                    u8::try_from(bins).unwrap()
                })
                .collect();
            let mirrored = half.iter().map(|bins| range - bins);
            let once: Vec<u8> = half.iter().copied().chain(mirrored).collect();
            let added = Dither::new(range.into(), seed).unwrap().added();
            for (found, expected) in added.zip(once.iter().chain(&once)) {
                assert_eq!(found, *expected, "{range}, {seed}");
                reached[usize::from(found)] = true;
                cases += 1;
            }
        }
        let values = usize::from(range) + 1;
        assert!(reached[..values].iter().all(|&is_reached| is_reached));
    }
    println!("proofs: dither, lengths: {cases} cases, 0 within rounding");
}

/// Every range and every number of bins that it adds to a laser cycle of the photon timer: laser and shift registers
/// stay in step, and all bins are sampled.
#[test]
fn laser_and_bins_stay_in_step_at_every_length() {
    let mut cases = 0u64;
    for (laser_hz, pulse_ns) in [
        (1, 16),
        (1000, 1000),
        (100_000, 100),
        (192_307, 104),
        (800_000, 16),
        (922_509, 16),
    ] {
        let config = Config::new(Settings { laser_hz, pulse_ns }).unwrap();
        for range in (0..=u16::from(config.most_dither())).step_by(2) {
            for added in 0..=u32::from(range) {
                // A counter from n takes n + 1 clocks, and 1 to load. What the dither adds takes 2 to load.
                let [pulse, pause] = config.laser_counters(range);
                let laser = (1 + pulse + 1) + (1 + pause + 1) + (2 + added + 1);
                // The level before, and to hand over; two clocks for each of 64 bins of one register.
                let samples = 3 + 2 * 64;
                let register = samples + (1 + config.sampler_counter(range) + 1) + (2 + added + 1);
                let expected = config.period() - u32::from(range) / 2 + added;
                assert_eq!(
                    [laser, register],
                    [expected; 2],
                    "{laser_hz}, {range}, {added}"
                );
                assert!(expected >= BINS + 8 && 1 + pulse + 1 == config.pulse());
                cases += 1;
            }
        }
    }
    println!("proofs: dither, laser cycles: {cases} cases, 0 within rounding");
}

/// Computed with another program from the link's format.
#[test]
fn lengths_are_those_of_the_link_format() {
    let document = include_str!("../../docs/link-format.md");
    for (range, seed, first) in [
        (64, 5, [36, 13, 30, 33, 28, 2, 31, 18]),
        (128, 7, [105, 37, 128, 16, 25, 40, 21, 19]),
    ] {
        let lengths = lengths(range, seed);
        assert_eq!(lengths[..8], first, "{range}, {seed}");
        let mirrored = first.map(|bins| u8::try_from(range).unwrap() - bins);
        assert_eq!(lengths[512..520], mirrored, "{range}, {seed}");
        let row = |numbers: [u8; 8]| numbers.map(|number| number.to_string()).join(" ");
        let row = format!("| {range} | {seed} | {} | {} |", row(first), row(mirrored));
        assert!(document.contains(&row), "{row}");
    }
}

/// As the module says of an equal clock.
#[test]
fn the_other_pulse_wanders_for_512_laser_cycles_and_comes_back_in_as_many() {
    let squares = |cycles: usize| {
        let moved = |seed| {
            let of_cycle = |added: u8| i64::from(added) - 64;
            lengths(128, seed)[..cycles]
                .iter()
                .copied()
                .map(of_cycle)
                .sum::<i64>()
        };
        (0..400).map(|seed| moved(seed).pow(2) as f64).sum::<f64>() / 400.0
    };
    for cycles in [16, 128, 512] {
        // 129 whole numbers; a mean square of 400 is off by 7 %.
        let expected = cycles as f64 * (129.0f64.powi(2) - 1.0) / 12.0;
        let off = squares(cycles) / expected - 1.0;
        assert!(off.abs() < 0.3, "{cycles}: {off}");
    }
    assert_eq!(squares(Dither::LENGTHS), 0.0);
}

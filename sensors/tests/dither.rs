//! The random lengths of laser cycles.

use dtof_sensors::dither::Dither;

fn lengths(range: u16, seed: u64) -> [u8; Dither::LENGTHS] {
    let mut added = Dither::new(range, seed).unwrap().added();
    core::array::from_fn(|_| added.next().unwrap())
}

#[test]
fn ranges_that_cannot_be_are_refused() {
    for range in 0..=u16::MAX {
        let is_valid = range <= 254 && range % 2 == 0;
        assert_eq!(Dither::new(range, 1).is_ok(), is_valid, "{range}");
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

#[test]
fn one_seed_gives_one_sequence_which_repeats() {
    let dither = Dither::new(64, 5).unwrap();
    assert_eq!(lengths(64, 5), lengths(64, 5));
    assert_ne!(lengths(64, 5), lengths(64, 6));
    let second = dither.added().skip(Dither::LENGTHS).take(Dither::LENGTHS);
    assert!(second.eq(lengths(64, 5)));
}

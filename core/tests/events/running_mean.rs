//! The running mean against sums over all events.

use dtof_core::BinPosition;
use dtof_core::events::RunningMean;
use proptest::prelude::*;

fn check<const N: usize>(positions: &[i32]) {
    let mut mean = RunningMean::<N>::new();
    assert_eq!(mean.mean(), None);
    for end in 1..=positions.len() {
        mean.push(BinPosition::new(positions[end - 1]).unwrap());
        let last = &positions[end.saturating_sub(N)..end];
        let sum: i64 = last.iter().copied().map(i64::from).sum();
        assert_eq!(i64::from(mean.sum()), sum);
        assert_eq!((mean.len(), mean.is_full()), (last.len(), end >= N));
        // To the nearest, halves up, of twice as much: exact.
        let length = last.len() as i64;
        let nearest = (2 * sum + length).div_euclid(2 * length);
        assert_eq!(mean.mean().map(|mean| i64::from(mean.raw())), Some(nearest));
    }
}

#[test]
fn at_the_extremes_nothing_overflows() {
    let (least, most) = (BinPosition::MIN.raw(), BinPosition::MAX.raw());
    for position in [least, most] {
        check::<1>(&[position; 5]);
        check::<255>(&[position; 600]);
    }
    let ends: Vec<i32> = (0..1000)
        .map(|index| if index % 300 < 150 { least } else { most })
        .collect();
    check::<255>(&ends);
    assert_eq!(BinPosition::new(least - 1), None);
    assert_eq!(BinPosition::new(most + 1), None);
}

#[test]
fn it_takes_the_memory_it_says() {
    assert_eq!(size_of::<RunningMean<3>>(), 4 * 3 + 4);
    assert_eq!(size_of::<RunningMean<10>>(), 4 * 10 + 4);
}

proptest! {
    #[test]
    fn it_is_the_mean_of_the_last(positions in prop::collection::vec(-512i32..=262_399, 0..60)) {
        check::<1>(&positions);
        check::<2>(&positions);
        check::<3>(&positions);
        check::<10>(&positions);
    }
}

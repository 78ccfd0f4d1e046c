//! Bins that are left out, against a plain set of bins; and a histogram emptied there against
//! one that never counted those photons.

use std::collections::BTreeSet;

use dtof_core::rule::ExcludedBins;
use dtof_core::{BinIndex, Count10, Count16, Count24, CounterWidth, Histogram, RangeGate};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn excluded(peaks: &[u16], reach: u8) -> ExcludedBins {
    let mut excluded = ExcludedBins::new(reach);
    for &peak in peaks {
        excluded.push(BinIndex::new(peak).unwrap());
    }
    excluded
}

/// The bins up to `reach` from one of the peaks, those before bin 0 and past the last too.
fn set(peaks: &[u16], reach: u8) -> BTreeSet<i32> {
    let (peaks, reach) = (peaks.iter().map(|&peak| i32::from(peak)), i32::from(reach));
    peaks.flat_map(|peak| peak - reach..=peak + reach).collect()
}

/// Every answer, for a histogram of `BINS` bins.
fn check<const BINS: usize>(peaks: &[u16], reach: u8) {
    let (found, set) = (excluded(peaks, reach), set(peaks, reach));
    assert_eq!(usize::from(found.echoes()), peaks.len());
    for bin in 0..BINS as u16 {
        let at = i32::from(bin);
        let context = format!("{peaks:?} ± {reach}, bin {bin}");
        assert_eq!(found.contains(bin), set.contains(&at), "{context}");
        for beside in 0..4 {
            let touches = (at - beside..=at + beside).any(|bin| set.contains(&bin));
            assert_eq!(found.touches(bin, beside as u16), touches, "{context}");
        }
        // 1 to `reach` bins behind the last bin around one of the peaks.
        let is_tail = peaks.iter().any(|&peak| {
            let last = i32::from(peak) + i32::from(reach);
            (last + 1..=last + i32::from(reach)).contains(&at)
        });
        assert_eq!(
            found.is_tail(BinIndex::new(bin).unwrap()),
            is_tail,
            "{context}"
        );
    }
    for first in 0..BINS as u16 - 7 {
        for last in first + 7..BINS as u16 {
            let gate = RangeGate::<BINS>::new(first, last).unwrap();
            let left = (first..=last).filter(|&bin| !set.contains(&bin.into()));
            let left = Some(left.count() as u32).filter(|&left| left >= 8 || peaks.is_empty());
            assert_eq!(
                found.bins_left(&gate),
                left,
                "{peaks:?} ± {reach}, {gate:?}"
            );
        }
    }
}

/// No, one, two and three peaks anywhere: apart, overlapping, alike, cut off at either end.
#[test]
fn all_peaks_of_sixteen_bins() {
    for reach in [0, 1, 2, 3, 7, 16, u8::MAX] {
        check::<16>(&[], reach);
        for one in 0..16 {
            check::<16>(&[one], reach);
            for two in 0..16 {
                check::<16>(&[one, two], reach);
                for three in (0..16).step_by(3) {
                    check::<16>(&[one, two, three], reach);
                }
            }
        }
    }
}

#[test]
fn bins_as_far_as_can_be() {
    for reach in [0, 1, u8::MAX] {
        let found = excluded(&[1023], reach);
        for bin in [0, 767, 768, 769, 1022, 1023, u16::MAX] {
            let contains = bin <= 1023 + u16::from(reach) && bin >= 1023 - u16::from(reach);
            assert_eq!(found.contains(bin), contains, "{bin} {reach}");
        }
        assert!(found.touches(0, u16::MAX) && found.touches(u16::MAX, u16::MAX));
    }
}

#[test]
fn there_are_no_more_than_three() {
    let mut found = excluded(&[1, 11, 21], 2);
    let before = found;
    found.push(BinIndex::saturating(31));
    assert_eq!((found, found.echoes()), (before, 3));
    assert!(!ExcludedBins::NONE.contains(0) && ExcludedBins::NONE.echoes() == 0);
}

/// Counts photons, empties some bins, counts on and empties again. The other histogram never
/// has the photons of the bins left out, but for those that met a full counter.
fn emptied<const BINS: usize, W: CounterWidth>(peaks: &[u16], reach: u8, rng: &mut Pcg32) {
    let (found, set) = (excluded(peaks, reach), set(peaks, reach));
    let mut histogram = Histogram::<BINS, W>::new();
    let mut without = Histogram::<BINS, W>::new();
    let (mut offered, mut held) = (0u64, 0u64);
    for _ in 0..3 {
        // From few photons a bin to more than a counter holds.
        let most = 2 + rng.next_u32() % (W::MAX >> (rng.next_u32() % (W::BITS - 1)));
        let mut frame = [0u32; BINS];
        frame.fill_with(|| rng.next_u32() % most * (rng.next_u32() % 2));
        let mut rest = frame;
        for (bin, photons) in (0..).zip(&mut rest) {
            if set.contains(&bin) {
                *photons = 0;
            }
        }
        let codes: Vec<u16> = (0..50)
            .map(|_| (rng.next_u32() % (BINS as u32 + 2)) as u16)
            .collect();
        offered += frame.iter().map(|&photons| u64::from(photons)).sum::<u64>() + 50;
        histogram.add_frame(&frame, &RangeGate::full());
        without.add_frame(&rest, &RangeGate::full());
        for &code in &codes {
            histogram.add(code);
            if usize::from(code) >= BINS || !set.contains(&code.into()) {
                without.add(code);
            }
        }
        let full = u64::from(histogram.saturated());
        held += u64::from(found.empty(&mut histogram));
        assert_eq!(histogram.counts(), without.counts());
        assert_eq!(histogram.total(), without.total());
        assert_eq!(histogram.peak(), without.peak());
        assert_eq!(histogram.rejected(), without.rejected());
        // No photon is lost.
        assert_eq!(u64::from(histogram.saturated()), full);
        let counted = u64::from(histogram.total()) + u64::from(histogram.rejected());
        assert_eq!(counted + full + held, offered);
        // Nothing is left to empty.
        assert_eq!(found.empty(&mut histogram), 0);
        assert_eq!(
            (histogram.counts(), histogram.peak()),
            (without.counts(), without.peak())
        );
    }
}

fn emptied_often<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    for round in 0..rounds {
        let peaks: Vec<u16> = (0..round % 4)
            .map(|_| (rng.next_u32() % BINS as u32) as u16)
            .collect();
        let reach = (rng.next_u32() >> (rng.next_u32() % 32)) as u8;
        emptied::<BINS, W>(&peaks, reach % 32, &mut rng);
    }
}

#[test]
fn an_emptied_histogram_has_never_counted_those_photons() {
    emptied_often::<8, Count10>(2000, 1);
    emptied_often::<8, Count24>(2000, 2);
    emptied_often::<128, Count10>(1000, 3);
    emptied_often::<128, Count16>(1000, 4);
    emptied_often::<256, Count24>(500, 5);
    emptied_often::<1024, Count10>(200, 6);
    emptied_often::<1024, Count16>(200, 7);
}

/// Every bin of eight as the only one that is not empty, under every range.
#[test]
fn the_peak_is_found_again_wherever_it_is() {
    for peak in 0..8 {
        for reach in 0..9 {
            for bin in 0..8u16 {
                let mut histogram = Histogram::<8>::new();
                histogram.add_batch(&[bin, bin, 0, 1, 2, 3, 4, 5, 6, 7]);
                excluded(&[peak], reach).empty(&mut histogram);
                let left = |bin: &u16| bin.abs_diff(peak) > u16::from(reach);
                let highest = Some(bin).filter(left).map(|bin| (bin, 3));
                let highest = highest.or_else(|| (0..8).find(left).map(|bin| (bin, 1)));
                let found = (histogram.peak().bin.raw(), histogram.peak().count.raw());
                assert_eq!(found, highest.unwrap_or((0, 0)));
            }
        }
    }
}

proptest! {
    #[test]
    fn any_peaks_of_64_bins(peaks in prop::collection::vec(0u16..64, 0..=3), reach in 0u8..40) {
        check::<64>(&peaks, reach);
    }

    #[test]
    fn any_histogram_emptied(
        peaks in prop::collection::vec(0u16..32, 0..=3), reach in 0u8..20, seed in any::<u64>(),
    ) {
        emptied::<32, Count16>(&peaks, reach, &mut Pcg32::seed_from_u64(seed));
    }
}

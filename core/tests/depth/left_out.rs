//! The depth of a later echo: bins around the ones before it are left out of its background.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{BinIndex, Count10, DepthEstimator, Histogram, PeeledBins, RangeGate};
use proptest::prelude::*;

use super::formula::{BINS, counts, highest, histogram, peak};

proptest! {
    /// The window's own background is the mean of the bins that are in the gate, farther from the
    /// peak than a half width, and not left out. Without such a bin it is the one that was given.
    #[test]
    fn the_background_is_that_of_the_other_bins(
        mut photons in counts(30),
        echoes in prop::collection::vec(0..BINS as u16, 1..=3),
        reach in 0..12u8,
        gate in (0..BINS as u16 - 8).prop_flat_map(|first| (Just(first), first + 7..BINS as u16)),
        sigma in 0..600u16,
        given in 0..4096u32,
    ) {
        let mut peeled = PeeledBins::new(reach);
        echoes.iter().for_each(|&echo| peeled.push(BinIndex::new(echo).unwrap()));
        for (bin, count) in (0..).zip(&mut photons) {
            if peeled.contains(bin) || !(gate.0..=gate.1).contains(&bin) {
                *count = 0;
            }
        }
        let bin = highest(&photons);
        prop_assume!(photons[bin] > 0);

        let estimator = DepthEstimator::for_pulse(U8F8::from_bits(sigma));
        let DepthEstimator::CentredWindow(window) = estimator else { unreachable!() };
        let half = window.before().to_bits().div_ceil(256);
        let others: Vec<u32> = (gate.0..=gate.1)
            .filter(|&other| other.abs_diff(bin as u16) > half && !peeled.contains(other))
            .map(|other| photons[usize::from(other)])
            .collect();
        let sum: u32 = others.iter().sum();
        let mean = (sum * 256).checked_div(others.len() as u32).unwrap_or(given);

        let histogram: Histogram<BINS, Count10> = histogram(&photons);
        let (gate, peak) = (RangeGate::new(gate.0, gate.1).unwrap(), peak(&photons, bin));
        let given = U24F8::from_bits(given);
        prop_assert_eq!(
            estimator.estimate_without(&histogram, &gate, peak, given, &peeled),
            window.estimate(&histogram, &gate, peak, U24F8::from_bits(mean))
        );
    }
}

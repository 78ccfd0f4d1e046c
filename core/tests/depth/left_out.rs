//! The depth of a later echo: bins around the ones before it are left out of its background.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::rule::ExcludedBins;
use dtof_core::{
    Count10, CounterWidth, DepthEstimator, DetectionRule, EchoNumber, Flags, Histogram, Peak,
    PixelConfig, RangeGate,
};
use proptest::prelude::*;

use super::formula::{BINS, histogram, peak};

/// Any photon is a detection above this background.
#[derive(Clone, Copy)]
struct Background(U24F8);

impl DetectionRule for Background {
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        _: &Histogram<BINS, W>,
        _: &RangeGate<BINS>,
        peak: Peak,
        _: &ExcludedBins,
    ) -> Option<U24F8> {
        (peak.count.raw() > 0).then_some(self.0)
    }
}

proptest! {
    /// The window's own background is the mean of the bins that are in the gate, farther from the
    /// peak than a half width, and not left out. Without such a bin it is the rule's.
    #[test]
    fn the_background_is_that_of_the_other_bins(
        mut photons in prop::array::uniform32(0..=30u32),
        echoes in 1..=4u8,
        guard in 0..12u8,
        (first, last) in (0..BINS as u16 - 8).prop_flat_map(|first| (Just(first), first + 7..BINS as u16)),
        sigma in 0..600u16,
        given in 0..4096u32,
    ) {
        let gate = RangeGate::new(first, last).unwrap();
        let given = U24F8::from_bits(given);
        let estimator = DepthEstimator::for_pulse(U8F8::from_bits(sigma));
        let DepthEstimator::CentredWindow(window) = estimator else { unreachable!() };
        let half = window.before().to_bits().div_ceil(256);
        let config = PixelConfig::<BINS, _>::with_rule(Background(given))
            .gate(gate)
            .estimator(estimator)
            .echoes(EchoNumber::new(echoes).unwrap(), guard)
            .build()
            .unwrap();
        let mut found = Vec::new();
        let mut whole = Histogram::<BINS, Count10>::new();
        whole.add_frame(&photons, &gate);
        config.detect_echoes(&mut whole, 1, |_, detection| found.push(*detection));

        let mut excluded = ExcludedBins::new(guard);
        for detection in found {
            for (bin, count) in (0..).zip(&mut photons) {
                if excluded.contains(bin) || !(first..=last).contains(&bin) {
                    *count = 0;
                }
            }
            let bin = detection.peak.bin;
            let others: Vec<u32> = (first..=last)
                .filter(|&other| other.abs_diff(bin.raw()) > half && !excluded.contains(other))
                .map(|other| photons[usize::from(other)])
                .collect();
            let sum: u32 = others.iter().sum();
            let mean = (sum * 256).checked_div(others.len() as u32);
            let mean = mean.map_or(given, U24F8::from_bits);

            let peak = peak(&photons, bin.raw().into());
            let mut expected = window.estimate(&histogram::<Count10>(&photons), &gate, peak, mean);
            if excluded.touches(bin.raw(), half) {
                expected.flags |= Flags::CLIPPED;
            }
            if excluded.is_tail(bin) {
                expected.flags |= Flags::TAIL;
            }
            prop_assert_eq!(detection.depth, expected);
            excluded.push(bin);
        }
    }
}

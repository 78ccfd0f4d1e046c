//! What the tests of more than one rule need.

use dtof_core::fixed::types::U24F8;
use dtof_core::rule::{ExcludedBins, detect};
use dtof_core::{CounterWidth, DepthEstimator, DetectionRule, Histogram, RangeGate};
use rand_core::Rng;
use rand_pcg::Pcg32;

/// A histogram with a peak that stands more or less clear, any gate or, in every third
/// round, none, and a count about as high as the peak's.
pub fn histogram<const BINS: usize, W: CounterWidth>(
    rng: &mut Pcg32,
    round: u32,
) -> (RangeGate<BINS>, Histogram<BINS, W>, u32) {
    let width = 8 + rng.next_u32() % (BINS as u32 - 7);
    let first = (rng.next_u32() % (BINS as u32 - width + 1)) as u16;
    let gate = match round % 3 {
        0 => RangeGate::full(),
        _ => RangeGate::new(first, first + width as u16 - 1).unwrap(),
    };
    // Up to what a counter holds, and past it.
    let most = 2 + rng.next_u32() % (W::MAX >> (rng.next_u32() % W::BITS));
    let mut frame: [u32; BINS] = core::array::from_fn(|_| rng.next_u32() % most);
    let above = rng.next_u32() % (2 * most);
    if let Some(count) = frame.get_mut(rng.next_u32() as usize % BINS) {
        *count += above;
    }
    let mut histogram = Histogram::new();
    histogram.add_frame(&frame, &gate);
    (gate, histogram, most)
}

/// The rule gives the background `expected`, and a detection that one rounded. Whether it
/// fires.
#[track_caller]
pub fn gives<const BINS: usize, W: CounterWidth>(
    rule: &impl DetectionRule,
    histogram: &Histogram<BINS, W>,
    gate: &RangeGate<BINS>,
    expected: Option<U24F8>,
) -> bool {
    assert_eq!(
        rule.detect(histogram, gate, histogram.peak(), &ExcludedBins::NONE),
        expected
    );
    let detection = detect(histogram, gate, rule, &DepthEstimator::default());
    let rounded = detection.map(|detection| detection.background.raw());
    assert_eq!(rounded, expected.map(|level| (level.to_bits() + 128) >> 8));
    expected.is_some()
}

/// So many of the rounds fired that both answers came often.
#[track_caller]
pub fn both_often(fired: u32, rounds: u32) {
    let often = rounds / 20..rounds - rounds / 20;
    assert!(often.contains(&fired), "{fired} of {rounds}");
}

//! The rules where some bins are left out: as if the histogram had never had them.

use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::rule::ExcludedBins;
use dtof_core::{
    AnyRule, AverageRule, BinIndex, Count, Count10, Count16, Count24, CounterWidth, DetectionRule,
    Histogram, PaperRule, Peak, RangeGate, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::{average, window};

/// Some bins left out of a histogram that stands more or less clear.
struct Case<const BINS: usize, W: CounterWidth> {
    gate: RangeGate<BINS>,
    /// Empty where bins are left out.
    histogram: Histogram<BINS, W>,
    excluded: ExcludedBins,
    /// Which of the bins are left out.
    is_out: Vec<bool>,
    /// About the highest count.
    most: u32,
}

impl<const BINS: usize, W: CounterWidth> Case<BINS, W> {
    fn random(rng: &mut Pcg32, round: u32) -> Self {
        let (gate, mut histogram, most) = super::rules::histogram::<BINS, W>(rng, round);
        let reach = rng.next_u32() % (BINS as u32 / 8).min(20);
        let peaks: Vec<u32> = (0..rng.next_u32() % 4)
            .map(|_| rng.next_u32() % BINS as u32)
            .collect();
        let mut excluded = ExcludedBins::new(reach as u8);
        for &peak in &peaks {
            excluded.push(BinIndex::saturating(peak as u16));
        }
        excluded.empty(&mut histogram);
        let is_out =
            (0..BINS as u32).map(|bin| peaks.iter().any(|peak| peak.abs_diff(bin) <= reach));
        Self {
            gate,
            histogram,
            excluded,
            is_out: is_out.collect(),
            most,
        }
    }

    /// How many of these bins are left out.
    fn left_out(&self, bins: core::ops::Range<u16>) -> usize {
        bins.filter(|&bin| self.is_out[usize::from(bin)]).count()
    }

    /// What the rule has to give: nothing with fewer than eight bins.
    fn check(
        &self,
        rule: &(impl DetectionRule + Into<AnyRule>),
        peak: Peak,
        expected: impl FnOnce(usize) -> Option<U24F8>,
    ) -> bool {
        let (first, end) = (self.gate.first(), self.gate.last() + 1);
        let left_out = self.left_out(first..end);
        let is_enough = usize::from(end - first) - left_out >= 8;
        let expected = if is_enough { expected(left_out) } else { None };
        let found = rule.detect(&self.histogram, &self.gate, peak, &self.excluded);
        assert_eq!(found, expected);
        let any: AnyRule = (*rule).into();
        assert_eq!(
            any.detect(&self.histogram, &self.gate, peak, &self.excluded),
            expected
        );
        expected.is_some()
    }
}

/// The highest bin of all is asked about, and for the window rule any of the gate.
fn windows<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = [0, 0];
    for round in 0..rounds {
        let case = Case::<BINS, W>::random(&mut rng, round);
        let z = U4F12::from_bits(rng.next_u32() as u16 >> (rng.next_u32() % 16));
        let minimum = rng.next_u32() % (2 * case.most) * (round % 2);
        let width = 1 + (rng.next_u32() % 7) as u8;
        let rule = WindowRule::new(width, z, Count::saturating(minimum)).unwrap();
        let (gate, highest) = (&case.gate, case.histogram.peak());
        let bins = u32::from(gate.last() - gate.first() + 1);
        let near = BinIndex::saturating(gate.first() + (rng.next_u32() % bins) as u16);
        let near = Peak {
            bin: near,
            count: Count::saturating(case.histogram.count(near.raw().into()).unwrap()),
        };
        for (peak, fired) in [highest, near].into_iter().zip(&mut fired) {
            if case.histogram.total() == 0 {
                continue;
            }
            *fired += u32::from(case.check(&rule, peak, |left_out| {
                window::as_written(&rule, &case.histogram, gate, peak.bin, left_out)
            }));
        }
    }
    super::rules::both_often(fired[0], rounds);
    assert!(fired[1] > 0);
}

#[test]
fn the_window_rule_without_some_bins() {
    windows::<8, Count10>(10_000, 1);
    windows::<32, Count10>(10_000, 2);
    windows::<128, Count16>(5000, 3);
    windows::<128, Count24>(5000, 4);
    windows::<1024, Count10>(500, 5);
}

fn averages<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut fired = 0;
    for round in 0..rounds {
        let case = Case::<BINS, W>::random(&mut rng, round);
        let alpha = U8F8::from_bits(rng.next_u32() as u16 >> (rng.next_u32() % 16));
        let minimum = rng.next_u32() % (2 * case.most) * (round % 2);
        let rule = AverageRule::new(alpha, Count::saturating(minimum));
        fired += u32::from(case.check(&rule, case.histogram.peak(), |left_out| {
            average::as_written(&rule, &case.histogram, &case.gate, left_out)
        }));
    }
    super::rules::both_often(fired, rounds);
}

#[test]
fn the_average_rule_without_some_bins() {
    averages::<8, Count10>(10_000, 1);
    averages::<32, Count10>(10_000, 2);
    averages::<128, Count16>(5000, 3);
    averages::<128, Count24>(5000, 4);
    averages::<1024, Count10>(500, 5);
}

/// The paper's rule: of the two quadrants of the half without the peak those count of which at
/// most half is left out, and without one nothing is a detection.
fn quadrants<const BINS: usize, W: CounterWidth>(rounds: u32, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let (mut fired, mut of_one, mut of_none) = (0, 0, 0);
    for round in 0..rounds {
        let case = Case::<BINS, W>::random(&mut rng, round);
        let alpha = rng.next_u32() as u16 >> (rng.next_u32() % 16);
        let minimum = rng.next_u32() % (2 * case.most) * (round % 2);
        let rule = PaperRule::new(U8F8::from_bits(alpha), Count::saturating(minimum));
        let peak = case.histogram.peak();
        let (first, bins) = (case.gate.first(), case.gate.last() + 1 - case.gate.first());
        let start = |quadrant: u16| first + (quadrant * bins) / 4;
        let other_half = if peak.bin.raw() < start(2) { 2 } else { 0 };
        let maxima = [other_half, other_half + 1].map(|quadrant| {
            let quadrant = start(quadrant)..start(quadrant + 1);
            let most = quadrant
                .clone()
                .map(|bin| case.histogram.count(bin.into()).unwrap())
                .max();
            most.filter(|_| 2 * case.left_out(quadrant.clone()) <= quadrant.len())
        });
        let background = maxima.iter().flatten().min();
        of_one += u32::from(maxima.iter().flatten().count() == 1);
        of_none += u32::from(background.is_none());
        let expected = background.filter(|&&background| {
            let level = f64::from(background)
                + f64::from(alpha) / 256.0 * f64::from(background).sqrt().floor();
            f64::from(peak.count.raw()) > level && peak.count >= rule.threshold().minimum_count()
        });
        let expected = expected.map(|&background| U24F8::from_num(background));
        let found = rule.detect(&case.histogram, &case.gate, peak, &case.excluded);
        assert_eq!(found, expected, "{:?} {:?}", case.excluded, case.gate);
        fired += u32::from(found.is_some());
    }
    super::rules::both_often(fired, rounds);
    assert!(of_one > rounds / 50 && of_none > 0, "{of_one} {of_none}");
}

#[test]
fn the_papers_rule_without_some_bins() {
    quadrants::<16, Count10>(10_000, 1);
    quadrants::<32, Count10>(10_000, 2);
    quadrants::<128, Count16>(5000, 3);
    quadrants::<128, Count24>(5000, 4);
}

/// Whatever is left out, and were it all: an answer, no panic.
#[test]
fn no_bins_at_all() {
    let gate = RangeGate::<16>::new(3, 12).unwrap();
    let rules: [AnyRule; 3] = [
        WindowRule::new(7, U4F12::ZERO, Count::default())
            .unwrap()
            .into(),
        AverageRule::new(U8F8::ZERO, Count::default()).into(),
        PaperRule::new(U8F8::ZERO, Count::default()).into(),
    ];
    for reach in 0..20 {
        let mut histogram = Histogram::<16>::new();
        histogram.add_frame(&[9u8; 16], &gate);
        let mut excluded = ExcludedBins::new(reach);
        excluded.push(BinIndex::saturating(7));
        excluded.empty(&mut histogram);
        let bins = (3..=12u8).filter(|bin| bin.abs_diff(7) > reach).count();
        assert_eq!(
            excluded.bins_left(&gate),
            (bins >= 8).then_some(bins as u32)
        );
        for rule in rules {
            let found = rule.detect(&histogram, &gate, histogram.peak(), &excluded);
            assert!(found.is_none(), "{rule:?}");
        }
    }
}

//! Decisions for a TDC with a dead time, in integers and in floating point, on random histograms.
//!
//! Photons are expected in 1/256, so close decisions may differ: the test allows that within
//! [`margin`] of the threshold only, and counts them.

use dtof_core::rule::{ExcludedBins, LiveCounts, LiveDecision};
use dtof_core::{
    AnyRule, Count, Count10, Count16, CounterWidth, DetectionRule, Histogram, PixelAddress,
    PixelConfig, RangeGate, WindowRule,
};
use dtof_data::random::pixel_rng;
use dtof_host_tests::reference::{LiveHistogram, LiveTest};
use rand_core::Rng;

use crate::slow_or_quick;

const BINS: usize = 128;

/// Random settings and light.
struct Draw {
    dead_time: u16,
    gate: (u16, u16),
    cycles: u32,
    width: u8,
    z: f64,
    minimum: u32,
    light: Vec<f64>,
}

fn unit(rng: &mut impl Rng) -> f64 {
    (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0
}

fn one_of<T: Copy>(rng: &mut impl Rng, values: &[T]) -> T {
    values[rng.next_u32() as usize % values.len()]
}

fn draw(rng: &mut impl Rng) -> Draw {
    let total = one_of(rng, &[0.1, 0.5, 1.0, 3.0, 6.0]);
    let signal = one_of(rng, &[0.0, 0.05, 0.1, 0.2, 0.5]);
    let place = unit(rng) * BINS as f64;
    let pulse = |bin: usize| {
        let off = bin as f64 + 0.5 - place;
        0.4 * (-off * off / 2.0).exp()
    };
    Draw {
        dead_time: one_of(rng, &[1, 5, 20, 60, 127, 128, u16::MAX]),
        gate: one_of(rng, &[(0, 127), (0, 127), (20, 127), (40, 100), (64, 71)]),
        cycles: one_of(rng, &[44, 100, 400, 1996]),
        width: one_of(rng, &[1, 2, 3, 5, 7]),
        z: one_of(rng, &[2.0, 3.0, 3.5, 4.5]),
        minimum: one_of(rng, &[1, 5]),
        light: (0..BINS)
            .map(|bin| total / BINS as f64 + signal * pulse(bin))
            .collect(),
    }
}

/// The counts of a TDC that is blind for some bins after each photon.
fn counts(draw: &Draw, rng: &mut impl Rng) -> [u32; BINS] {
    let mut counts = [0; BINS];
    for _ in 0..draw.cycles {
        let mut bin = 0;
        let mut until = -unit(rng).ln();
        while let Some(light) = draw.light.get(bin) {
            until -= light;
            bin += 1;
            if until < 0.0 {
                counts[bin - 1] += 1;
                bin += usize::from(draw.dead_time);
                until = -unit(rng).ln();
            }
        }
    }
    counts
}

/// How far a decision may be off, in photons.
fn margin(window: &LiveTest) -> f64 {
    0.06 + 0.01 * window.level
}

#[derive(Debug, Default)]
struct Tally {
    decisions: u32,
    detections: u32,
    blind: u32,
    full: u32,
    contradictions: u32,
    close: u32,
}

fn decide<W: CounterWidth>(draw: &Draw, counts: &[u32; BINS]) -> Option<LiveDecision> {
    let z = draw.z.to_string().parse().unwrap();
    let rule: AnyRule = WindowRule::new(draw.width, z, Count::saturating(draw.minimum))
        .unwrap()
        .into();
    let gate = RangeGate::new(draw.gate.0, draw.gate.1).unwrap();
    let config = PixelConfig::<BINS, _>::with_rule(rule)
        .gate(gate)
        .dead_time(draw.dead_time)
        .build()
        .unwrap();
    let mut histogram = Histogram::<BINS, W>::new();
    config.add_frame(&mut histogram, counts);
    let excluded = ExcludedBins::NONE;
    let live = LiveCounts::new(&histogram, &gate, &excluded, draw.cycles, draw.dead_time)?;
    Some(rule.detect_live(&live, None))
}

fn check(draw: &Draw, counts: &[u32; BINS], decision: &LiveDecision, tally: &mut Tally) {
    let floats = counts.map(f64::from);
    let reference = LiveHistogram {
        counts: &floats,
        cycles: draw.cycles.into(),
        dead_time: draw.dead_time.into(),
        first: draw.gate.0.into(),
        last: draw.gate.1.into(),
    };
    tally.decisions += 1;
    if reference.contradicts() {
        assert_eq!(*decision, LiveDecision::BLIND);
        tally.contradictions += 1;
        return;
    }
    let windows = reference.windows(draw.width.into(), draw.z);
    let (width, minimum) = (f64::from(draw.width), f64::from(draw.minimum));
    let least = (f64::from(draw.cycles) * width / 1024.0).max(minimum);
    let is_blind = reference.fewest_empty() * width < least;
    assert_eq!(decision.is_blind, is_blind);
    tally.blind += u32::from(is_blind);
    let may_be_tested = |window: &&LiveTest| window.live >= least && window.photons >= minimum;
    let tested = windows.iter().filter(may_be_tested);
    let clear = tested.filter(|window| window.clearance() > margin(window));
    let best = clear.max_by(|one, other| one.score().total_cmp(&other.score()));
    let Some(found) = decision.window else {
        assert!(best.is_none(), "only the reference detects {best:?}");
        let is_close = |window: &LiveTest| may_be_tested(&window) && window.clearance() > 0.0;
        tally.close += u32::from(windows.iter().any(is_close));
        return;
    };
    tally.detections += 1;
    let window = &windows[usize::from(found.first - draw.gate.0)];
    assert!(may_be_tested(&window), "{window:?}");
    assert!(
        window.clearance() > -margin(window),
        "only the integers detect {window:?}"
    );
    // Else all are close to the threshold.
    let best = best.unwrap_or(window);
    // Another window with almost the same score: the integers round what is expected up to 1/256 photon.
    let rounded = LiveTest {
        expected: best.expected + 1.0 / 256.0,
        ..*best
    };
    let is_other = (window.start, found.width) != (best.start, draw.width.into());
    assert!(
        !is_other || window.score() > 0.99 * rounded.score() - 0.1,
        "{window:?} in place of {best:?}"
    );
    tally.close += u32::from(is_other || window.clearance() <= 0.0);
    // What lies outside.
    let gated = usize::from(draw.gate.0)..=usize::from(draw.gate.1);
    let photons: f64 = floats[gated.clone()].iter().sum::<f64>() - window.photons;
    let live: f64 = gated.map(|bin| reference.live(bin)).sum::<f64>() - window.live;
    let outside = (f64::from(found.photons_outside), found.live_outside as f64);
    assert_eq!(outside, (photons, live));
}

#[test]
fn integers_and_the_float_reference_decide_alike() {
    let mut rng = pixel_rng(7, PixelAddress::new(0));
    let mut tally = Tally::default();
    for number in 0..slow_or_quick(200_000, 10_000) {
        let draw = draw(&mut rng);
        let mut counts = counts(&draw, &mut rng);
        if number % 10 == 0 {
            // Counts that such a TDC cannot have.
            counts[20 + number % 20] += draw.cycles;
        }
        match decide::<Count16>(&draw, &counts) {
            Some(decision) => check(&draw, &counts, &decision, &mut tally),
            None => panic!("no counter of 16 bits is full"),
        }
        // Narrow counters decide the same, unless one is full.
        let gated = usize::from(draw.gate.0)..=usize::from(draw.gate.1);
        let is_full = counts[..usize::from(draw.gate.0)]
            .iter()
            .any(|&count| count >= 1023)
            || counts[gated].iter().any(|&count| count > 1023);
        match decide::<Count10>(&draw, &counts) {
            Some(decision) => {
                assert!(!is_full);
                check(&draw, &counts, &decision, &mut tally);
            }
            None => {
                assert!(is_full);
                tally.full += 1;
            }
        }
    }
    println!("{tally:?}");
    // Every branch of the comparison was taken, and few decisions are close.
    assert!(tally.detections > 1000 && tally.blind > 100, "{tally:?}");
    assert!(tally.full > 100 && tally.contradictions > 100, "{tally:?}");
    assert!(500 * tally.close < tally.decisions, "{tally:?}");
}

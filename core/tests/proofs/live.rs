//! Dead time: every histogram of eight bins with 0 to 3 photons each.
//!
//! A photon blinds the bins of one dead time behind it, and no bin has more than seven before it. So from a dead time of 7
//! on nothing changes; 8 is that of the first photon only.

use std::ops::AddAssign;
use std::sync::Mutex;

use dtof_core::fixed::types::U4F12;
use dtof_core::rule::{ExcludedBins, LiveCounts};
use dtof_core::{
    BinIndex, Count, Count10, Count24, CounterWidth, DetectionRule, Histogram, RangeGate,
    WindowRule,
};

use crate::common::live::Exposure;
use crate::common::parallel;
use crate::common::small::{HISTOGRAMS, histogram};

/// What came of some cases.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    cases: u64,
    fired: u64,
    blind: u64,
    contradictions: u64,
    /// Rounding decides.
    close: u64,
    tied: u64,
}

impl AddAssign for Seen {
    fn add_assign(&mut self, other: Self) {
        self.cases += other.cases;
        self.fired += other.fired;
        self.blind += other.blind;
        self.contradictions += other.contradictions;
        self.close += other.close;
        self.tied += other.tied;
    }
}

/// z and minimum count: seldom and often met.
const LEVELS: [(&str, u32); 5] = [("1.2", 0), ("2", 5), ("2.5", 1), ("3", 3), ("4", 0)];

/// A rule, and the bin that its windows must contain, if any.
type Look = (WindowRule, Option<BinIndex>);

/// All widths at all levels, and windows that contain the fourth of the bins from `first` on.
fn looks(first: u16) -> Vec<Look> {
    let rule = |width, (z, minimum): (&str, u32)| {
        let z: U4F12 = z.parse().unwrap();
        WindowRule::new(width, z, Count::saturating(minimum)).unwrap()
    };
    let expected = BinIndex::saturating(first + 3);
    let of_width = |width| {
        let anywhere = LEVELS.map(|level| (rule(width, level), None));
        let there = (rule(width, LEVELS[0]), Some(expected));
        anywhere.into_iter().chain([there])
    };
    (1..=3).flat_map(of_width).collect()
}

/// No bins; those around one echo, or two.
fn excluded(reach: u8, echoes: &[u16]) -> ExcludedBins {
    let mut excluded = ExcludedBins::new(reach);
    for &echo in echoes {
        excluded.push(BinIndex::saturating(echo));
    }
    excluded
}

/// From one too few for these counts on: the fewest, more, so many that the counts hardly matter, and the most.
fn laser_cycles(counts: &[u32], gate: (usize, usize), dead_time: usize) -> Vec<u32> {
    let blind_or_hit = |bin: usize| counts[bin.saturating_sub(dead_time)..=bin].iter().sum();
    let fewest: u32 = (gate.0..=gate.1).map(blind_or_hit).max().unwrap();
    let mut cycles = vec![
        fewest,
        fewest + 1,
        fewest + 5,
        1500,
        LiveCounts::<8, Count10>::MAX_CYCLES,
    ];
    cycles.extend(fewest.checked_sub(1));
    cycles
}

/// Compares all decisions on `counts`, with `gate` and at one dead time.
fn compare<const BINS: usize, W: CounterWidth>(
    counts: &[u32; BINS],
    gate: &RangeGate<BINS>,
    dead_time: u16,
    looks: &[Look],
    excluded: &[ExcludedBins],
) -> Seen {
    let mut seen = Seen::default();
    let mut histogram = Histogram::<BINS, W>::new();
    // Photons before the gate stay in their counters.
    let _ = histogram.add_frame(counts, &RangeGate::full());
    let bins = (gate.first().into(), gate.last().into());
    for cycles in laser_cycles(counts, bins, dead_time.into()) {
        for excluded in excluded {
            let exposure = Exposure::new(counts, bins, excluded, cycles, dead_time.into());
            let live = LiveCounts::new(&histogram, gate, excluded, cycles, dead_time).unwrap();
            seen.contradictions += u64::from(exposure.contradicts());
            for &(rule, expected) in looks {
                let decision = rule.detect_live(&live, expected);
                let found = exposure.check(&rule, expected, &decision);
                seen.cases += 1;
                seen.fired += u64::from(found.fires);
                seen.blind += u64::from(decision.is_blind);
                seen.close += u64::from(found.is_close);
                seen.tied += u64::from(found.is_tied);
                if let Some(window) = decision.window {
                    let peak = live.brightest(window.first, window.width);
                    let is_right = exposure.has_most_light(window.first, window.width, peak.bin);
                    assert!(is_right, "{peak:?} in {window:?} of {counts:?}");
                    let count = counts[usize::from(peak.bin.raw())];
                    assert_eq!(peak.count.raw(), count);
                }
            }
        }
    }
    seen
}

/// Compares every `step`-th histogram: `counts` makes those of all bins of it.
fn all<const BINS: usize, W: CounterWidth>(
    step: u64,
    gate: &RangeGate<BINS>,
    dead_times: &[u16],
    excluded: &[ExcludedBins],
    counts: impl Fn([u32; 8]) -> [u32; BINS] + Sync,
) -> Seen {
    let looks = looks(gate.first());
    let seen = Mutex::new(Seen::default());
    parallel::for_each(HISTOGRAMS.div_ceil(step), |number| {
        let mut here = Seen::default();
        let counts = counts(histogram(number * step));
        for &dead_time in dead_times {
            here += compare::<BINS, W>(&counts, gate, dead_time, &looks, excluded);
        }
        *seen.lock().unwrap() += here;
    });
    seen.into_inner().unwrap()
}

/// Eight bins, with echoes and without; and behind five bins with some photons.
fn prove(step: u64) {
    let (gate, none) = (RangeGate::full(), ExcludedBins::NONE);
    let dead_times: Vec<u16> = (0..=8).collect();
    let echoes = [none, excluded(1, &[5]), excluded(0, &[1, 6])];
    let mut seen = all::<8, Count10>(step, &gate, &dead_times, &echoes, |counts| counts);
    seen += all::<8, Count24>(step, &gate, &dead_times, &echoes[..2], |counts| counts);
    let behind = RangeGate::new(5, 12).unwrap();
    let dead_times = [1, 4, 6, 9, 16];
    seen += all::<16, Count10>(
        step,
        &behind,
        &dead_times,
        &[none],
        |[a, b, c, d, e, f, g, h]| [2, 0, 1, 0, 4, a, b, c, d, e, f, g, h, 0, 0, 7],
    );
    println!(
        "proofs: dead time: {} cases, {} within rounding; {seen:?}",
        seen.cases, seen.close
    );
    assert!(seen.fired * 20 > seen.cases && seen.blind > 0 && seen.contradictions > 0);
    assert!(seen.close * 100 < seen.cases);
}

#[test]
fn small_histograms_are_decided_by_the_formula() {
    prove(61);
}

#[test]
#[ignore = "takes minutes: `.ci/long proofs`"]
fn all_small_histograms_are_decided_by_the_formula() {
    prove(1);
}

//! The decision on live counts by the formulas of `core/src/detect/live.rs`, in floating point.
//!
//! The integers are rounded as written there, all in 1/256: the photons expected up; the skew, the variance and both terms of
//! `V - V·c/(V + c)` down; the share to 1/2¹⁶ and `z²` to 1/4096, both down. So each window has two thresholds, one
//! with all that raises it and one with all that lowers it. Between them both answers are right.

use dtof_core::rule::{ExcludedBins, LiveDecision};
use dtof_core::{BinIndex, WindowRule};

const UNIT: f64 = 1.0 / 256.0;
/// Floating point.
const CLOSE: f64 = 1e-9;

/// The counts of an exposure.
pub struct Exposure<'a> {
    counts: &'a [u32],
    /// First and last bin.
    gate: (usize, usize),
    excluded: &'a ExcludedBins,
    cycles: u32,
    /// Laser cycles in which each bin was live; below 0 if the counts contradict the dead time.
    pub live: Vec<i64>,
    /// Photons of the gated bins that are not excluded, and their live laser cycles.
    photons: f64,
    all_live: f64,
    /// The fewest laser cycles in which a gated bin was live and had no photon.
    fewest_empty: i64,
}

/// A window by the formulas.
#[derive(Clone, Copy, Debug)]
struct Window {
    first: usize,
    inside: u32,
    live: i64,
    /// Whether it stands clear, however it is rounded; and whether it does if it is rounded so.
    is_clear: bool,
    may_be_clear: bool,
    /// `(S - E)²/E`, at least and at most.
    score: [f64; 2],
}

/// What a comparison shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    pub fires: bool,
    /// Rounding decides whether there is a detection, or which of two windows it is.
    pub is_close: bool,
    /// Several windows have the same photons and live laser cycles, and no other has a larger score.
    pub is_tied: bool,
}

impl<'a> Exposure<'a> {
    pub fn new(
        counts: &'a [u32],
        gate: (usize, usize),
        excluded: &'a ExcludedBins,
        cycles: u32,
        dead_time: usize,
    ) -> Self {
        // `N - Σ counts of the D bins before b`.
        let live = |bin: usize| {
            let before = &counts[bin.saturating_sub(dead_time)..bin];
            i64::from(cycles) - before.iter().copied().map(i64::from).sum::<i64>()
        };
        let live: Vec<i64> = (0..counts.len()).map(live).collect();
        let gated = gate.0..=gate.1;
        let empty = gated.clone().map(|bin| live[bin] - i64::from(counts[bin]));
        let fewest_empty = empty.min().unwrap();
        let (mut photons, mut all_live) = (0, 0);
        for bin in gated.filter(|&bin| !excluded.contains(bin as u16)) {
            photons += i64::from(counts[bin]);
            all_live += live[bin];
        }
        Self {
            counts,
            gate,
            excluded,
            cycles,
            live,
            photons: photons as f64,
            all_live: all_live as f64,
            fewest_empty,
        }
    }

    /// The fewest live laser cycles of a window that is not left out.
    fn least(&self, rule: &WindowRule) -> i64 {
        let bins = u64::from(self.cycles) * u64::from(rule.width());
        let share = bins.div_ceil(1024).cast_signed();
        share.max(rule.minimum_count().raw().into())
    }

    /// Whether nothing is decided: a bin was blind or had a photon in more laser cycles than there were, or no bin that
    /// is not excluded was ever live.
    pub fn contradicts(&self) -> bool {
        self.fewest_empty < 0 || self.all_live <= 0.0
    }

    /// The window at `first`, if it may be a detection.
    fn window(&self, first: usize, rule: &WindowRule, z: f64, least: i64) -> Option<Window> {
        let bins = first..first + usize::from(rule.width());
        let inside: u32 = self.counts[bins.clone()].iter().sum();
        let live: i64 = self.live[bins.clone()].iter().sum();
        let is_excluded = |bin: usize| self.excluded.contains(bin as u16);
        if live < least
            || inside < rule.minimum_count().raw()
            || self.excluded.echoes() > 0 && bins.clone().any(is_excluded)
        {
            return None;
        }
        let share = live as f64 / self.all_live;
        let expected = self.photons * share;
        // Photons a live laser cycle have 40 bits after the point, or 64 significant ones.
        let bits = (self.photons as u64).leading_zeros().min(40);
        let expected = [
            expected - live as f64 / (1u64 << bits) as f64,
            expected + UNIT,
        ];
        let excess = expected.map(|expected| f64::from(inside) - expected);
        if excess[0] <= 0.0 {
            return None;
        }
        let c = z * z / 36.0;
        let spread = |variance: f64, c: f64| match variance + c {
            sum if sum > 0.0 => variance * variance / sum,
            _ => 0.0,
        };
        let skew = |share: f64| (z * z / 6.0 * (1.0 - 2.0 * share)).max(0.0);
        // What lowers the threshold: fewer photons expected, and less of everything.
        let least_variance = (expected[0] * (1.0 - share) - UNIT).max(0.0);
        let above = excess[0] - (skew(share) - UNIT).max(0.0) + CLOSE;
        let level = (z * z - 1.0 / 4096.0).max(0.0) * spread(least_variance, c);
        let may_be_clear = above > 0.0 && above * above > level * (1.0 - CLOSE);
        // What raises it: more photons expected, a smaller share, and less taken off.
        let most_variance = expected[1] * (1.0 - share + 1.0 / 65_536.0);
        let above = excess[1] - skew(share - 1.0 / 65_536.0) - CLOSE;
        let level = z * z * (spread(most_variance, (c - UNIT).max(0.0)) + UNIT);
        let is_clear = above > 0.0 && above * above > level * (1.0 + CLOSE);
        Some(Window {
            first,
            inside,
            live,
            is_clear,
            may_be_clear,
            score: [
                excess[1].max(0.0).powi(2) / expected[1],
                excess[0].powi(2) / expected[0],
            ],
        })
    }

    /// All windows that may be a detection, of those that contain `expected`.
    fn windows(&self, rule: &WindowRule, expected: Option<BinIndex>) -> Vec<Window> {
        let width = usize::from(rule.width());
        let (z, least) = (rule.z().to_num::<f64>(), self.least(rule));
        let contains = |first: usize| {
            let bins = first..first + width;
            expected.is_none_or(|bin| bins.contains(&usize::from(bin.raw())))
        };
        (self.gate.0..=self.gate.1 + 1 - width)
            .filter(|&first| contains(first))
            .filter_map(|first| self.window(first, rule, z, least))
            .filter(|window| window.may_be_clear)
            .collect()
    }

    /// Checks the decision of `rule` in the windows that contain `expected`.
    pub fn check(
        &self,
        rule: &WindowRule,
        expected: Option<BinIndex>,
        decision: &LiveDecision,
    ) -> Found {
        if self.contradicts() {
            assert_eq!(decision, &LiveDecision::BLIND);
            return Found::default();
        }
        let is_blind = self.fewest_empty * i64::from(rule.width()) < self.least(rule);
        assert_eq!(decision.is_blind, is_blind, "{:?}", self.counts);
        let mut windows = self.windows(rule, expected);
        let is_sure = windows.iter().any(|one| one.is_clear);
        let Some(found) = &decision.window else {
            assert!(!is_sure, "missed one of {windows:?} {:?}", self.counts);
            return Found {
                is_close: !windows.is_empty(),
                ..Found::default()
            };
        };
        // The one with the largest score is reported. The score so far is rounded down, so that a later window with nearly the
        // same takes its place: by up to 1/256; from 2²⁴ photons on by up to 1, because the quotient is multiplied
        // by 256, and by 1 in 10⁸, because the excess is rounded down to 1/16.
        let kept = |one: &Window| {
            if one.inside >= 1 << 24 {
                one.score[0] * (1.0 - 1e-8) - 1.0
            } else {
                one.score[0] * (1.0 - CLOSE) - UNIT
            }
        };
        let clear = windows.iter().filter(|one| one.is_clear);
        let highest = clear.fold(0.0, |highest: f64, one| highest.max(kept(one)));
        windows.retain(|one| one.score[1] >= highest);
        let is_found = |one: &&Window| one.first == usize::from(found.first);
        let window = windows.iter().find(is_found);
        let window = window.unwrap_or_else(|| panic!("{found:?} of {windows:?} {:?}", self.counts));
        // What is outside is exact.
        assert_eq!(found.width, u16::from(rule.width()));
        let outside = [
            f64::from(found.photons_outside) + f64::from(window.inside),
            found.live_outside as f64 + window.live as f64,
        ];
        assert_eq!(outside, [self.photons, self.all_live]);
        let is_same = |one: &&Window| (one.inside, one.live) == (window.inside, window.live);
        let same = windows.iter().filter(is_same).count();
        // The last of equals.
        let last = windows.iter().rfind(is_same).map(|one| one.first);
        assert_eq!(last, Some(window.first), "{:?}", self.counts);
        Found {
            fires: true,
            is_close: !is_sure || windows.len() > same,
            is_tied: same > 1,
        }
    }

    /// Whether `peak` is the bin with the most light, a photon in the largest share of its live laser cycles, of the
    /// bins of a window; the lowest of several. Light is exact to 1 in 40,000, and rounded down ten times.
    pub fn has_most_light(&self, first: u16, width: u16, peak: BinIndex) -> bool {
        let of = |bin: u16| {
            (
                self.live[usize::from(bin)],
                self.counts[usize::from(bin)].into(),
            )
        };
        let light = |bin: u16| {
            let (live, count): (i64, i64) = of(bin);
            if live * 1024 < i64::from(self.cycles) {
                return 0.0;
            }
            // A bin with a photon in each laser cycle counts as half a cycle short of that.
            let empty = ((live - count) as f64).max(0.5);
            (live as f64 / empty).ln()
        };
        let most = light(peak.raw());
        let most = most + most / 40_000.0 + 10.0 / f64::from(1 << 24);
        (first..first + width).all(|bin| {
            let is_same = of(bin) == of(peak.raw());
            light(bin) <= most && (!is_same || bin >= peak.raw())
        })
    }
}

//! Settings for a wanted rate of false alarms: α and L1, and what to expect of
//! them.
//!
//! α is the smallest whose probability of a false alarm in an exposure is not
//! above the wanted one. That probability comes from the simulated [`Table`]; its
//! upper limit has to be below by the table's [`MARGIN`]; where the table saw no events,
//! or was not made for the settings, from the sum over looks of the exact
//! single-look probability, which it cannot exceed. Of all L1 the one with the shortest mean
//! time to an event is taken, found by simulating exposures ([`average`] and [`window`] do
//! the same for the other rules).

pub mod average;
mod shortest;
pub mod window;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    BlockLevel, Count, Count10, CounterWidth, DepthEstimator, PaperRule, PixelConfig, Threshold,
};

use self::shortest::shortest;
use crate::counts::poisson::Poisson;
use crate::looks::detections::{Decisions, Detections};
use crate::looks::exposure::Looks;
use crate::looks::repeated_looks::{BINS, Bounds, MINIMUM_COUNT, RepeatedLooks, single_looks};
use crate::looks::single_look::SingleLook;
use crate::looks::table::{MARGIN, Table};

/// The wanted limit on false alarms of a pixel without a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// In one exposure.
    PerExposure(f64),
    /// In one laser cycle.
    PerCycle(f64),
}

impl Wanted {
    /// As a probability for one exposure.
    fn in_an_exposure(self, looks: Looks) -> f64 {
        match self {
            Self::PerExposure(probability) => probability,
            // An exposure without an event lasts until it expires, one with an
            // event at least until the first look: P / mean length <= rate.
            Self::PerCycle(rate) => {
                let [expiry, first] = [looks.expiry(), looks.first * looks.x].map(f64::from);
                rate * expiry / (1.0 + rate * (expiry - first))
            }
        }
    }
}

/// What is to be tuned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Background photons a bin and laser cycle (B), above 0.
    pub background: f64,
    /// Signal photons a laser cycle (A), above 0.
    pub signal: f64,
    /// Standard deviation of the pulse in bins (σ).
    pub sigma: f64,
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: u16,
    /// Photons a reported peak holds at least.
    pub minimum_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// L1, if it is given.
    pub l1: Option<u16>,
    /// The exposure at which a pixel starts over without an event.
    pub l2: u16,
    /// The limit on false alarms.
    pub wanted: Wanted,
    /// With a window rule: the largest blocks of adaptive binning, which share that limit with
    /// the pixels.
    pub levels: BlockLevel,
    /// Seed of the simulated exposures.
    pub seed: u64,
}

/// Where a probability comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Interpolated from the simulated table.
    Table,
    /// Not above this, the least the simulated table saw.
    TableAtMost,
    /// Not above this: the sum of the exact single-look probabilities.
    Bound,
}

/// The settings and what to expect of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// α.
    pub alpha: U8F8,
    /// L1.
    pub l1: u16,
    /// The looks that L1, L2 and X come to.
    pub looks: Looks,
    /// The wanted probability of a false alarm in an exposure.
    pub wanted: f64,
    /// The probability with this α.
    pub false_alarms: f64,
    /// Where it comes from.
    pub source: Source,
    /// Between what it lies, exactly.
    pub bounds: Bounds,
    /// Exposures simulated with the target.
    pub detections: Detections,
}

/// The chance that one of the counters is full at the last look.
const MOST_SATURATED: f64 = 0.01;

/// Looks of an exposure: half a minute's work.
const MOST_LOOKS: u16 = 5000;

/// Finds α and L1.
///
/// # Errors
/// What about the request cannot be met, in one line.
pub fn tune(request: &Request, table: &Table) -> Result<Tuned> {
    check(request)?;
    let mean_a_step = request.background * f64::from(request.x);
    let last = u32::from(request.l2 - 1) / u32::from(request.x);
    let steps = single_looks(request.bins.into(), mean_a_step, last);

    let minimum_count = Count::saturating(request.minimum_count.into());
    let all: Vec<(Decisions, Tuned)> = candidates(request)
        .into_iter()
        .filter_map(|l1| {
            let looks = Looks::new(request.x, l1, request.l2);
            let tuned = calibrated(request, table, &steps, l1, looks)?;
            let decisions = Decisions {
                looks,
                rule: PaperRule::new(tuned.alpha, minimum_count).into(),
                estimator: DepthEstimator::Centroid3,
            };
            Some((decisions, tuned))
        })
        .collect();
    ensure!(
        !all.is_empty(),
        "no α keeps false alarms below the wanted rate with so little background: raise --min-count \
         or --l1"
    );
    let (tuned, detections) = shortest(request, &all)?;
    Ok(Tuned {
        detections,
        ..tuned
    })
}

/// Refuses what cannot work.
fn check(request: &Request) -> Result<()> {
    let &Request {
        background,
        bins,
        x,
        l2,
        ..
    } = request;
    ensure!(
        (8..=1024).contains(&bins) && bins.is_power_of_two(),
        "--bins {bins}: must be a power of two from 8 to 1024"
    );
    if let Some(l1) = request.l1 {
        PixelConfig::<8>::paper()
            .x(x)
            .l1(l1)
            .l2(l2)
            .build()
            .with_context(|| format!("--x {x} --l1 {l1} --l2 {l2}"))?;
    } else {
        ensure!(
            x > 0 && u32::from(l2) > 2 * u32::from(x),
            "--x {x} --l2 {l2}: L2 must be greater than 2 X, so that there is a look"
        );
    }
    let looks = (l2 - 1) / x;
    ensure!(
        looks <= MOST_LOOKS,
        "--x {x} --l2 {l2}: {looks} looks an exposure, at most {MOST_LOOKS} looks are calculated; \
         raise --x"
    );
    let last = f64::from(looks * x);
    // A mean that is far too high need not be tabulated to say so.
    let mean = (background * last).min(5000.0);
    let full = Poisson::new(mean).highest_at_least(Count10::MAX, bins.into());
    if full > MOST_SATURATED {
        // A mean of 860 at the last look leaves them room.
        let fits = (860.0 / background).floor();
        let least = request.l1.map_or(2.0 * f64::from(x), f64::from);
        let way_out = if fits > least {
            format!("lower --l2 to {fits}")
        } else {
            "lower --l1, --x or the background".to_owned()
        };
        bail!(
            "a background of {} photons a bin fills the 10-bit counters before L2 = {l2}: {way_out}",
            short(background)
        );
    }
    let signal = request.signal;
    ensure!(
        signal <= f64::from(Count10::MAX),
        "a signal of {} photons fills a 10-bit counter within a laser cycle",
        short(signal)
    );
    let (Wanted::PerExposure(wanted) | Wanted::PerCycle(wanted)) = request.wanted;
    ensure!(
        wanted > 0.0 && wanted < 1.0,
        "the wanted false alarms must be more than 0 and less than 1 an exposure or laser cycle"
    );
    Ok(())
}

/// A number of any size in a few characters.
fn short(value: f64) -> String {
    if (1e-4..1e6).contains(&value) {
        format!("{value}")
    } else {
        format!("{value:.3e}")
    }
}

/// The L1 to compare: the one given, or from X on, each half as much again.
fn candidates(request: &Request) -> Vec<u16> {
    if let Some(l1) = request.l1 {
        return vec![l1];
    }
    let mut candidates = Vec::new();
    let mut steps = 1;
    // Half of the exposure at most, and at least one.
    while steps == 1 || u32::from(steps) * 2 * u32::from(request.x) < u32::from(request.l2) {
        candidates.push(steps * request.x);
        steps += (steps / 2).max(1);
    }
    candidates
}

/// The smallest α that keeps false alarms down, or `None` if none does.
fn calibrated(
    request: &Request,
    table: &Table,
    steps: &[SingleLook],
    l1: u16,
    looks: Looks,
) -> Option<Tuned> {
    let wanted = request.wanted.in_an_exposure(looks);
    let repeated = RepeatedLooks::new(steps, looks.first, looks.last);
    let first_mean = request.background * f64::from(looks.first * looks.x);
    let tabulated = usize::from(request.bins) == BINS && request.minimum_count == MINIMUM_COUNT;
    // It, what it may be at most, and where it comes from.
    let probability = |alpha: u16| {
        let minimum_count = Count::saturating(request.minimum_count.into());
        let threshold = Threshold::new(U8F8::from_bits(alpha), minimum_count);
        let bounds = repeated.bounds(&threshold);
        let found = if tabulated {
            table.look_up(first_mean, looks.first, looks.last, bounds.independent)
        } else {
            None
        };
        // Never below what one look alone gives.
        match found {
            Some(found) if found.probability < bounds.sum => {
                let source = if found.seen {
                    Source::Table
                } else {
                    Source::TableAtMost
                };
                let [probability, at_most] =
                    [found.probability, found.at_most].map(|found| found.max(bounds.worst_look));
                // Whatever the table is off by, not above the bound.
                let most = (at_most * MARGIN).min(bounds.sum);
                (probability, most, source, bounds)
            }
            _ => (bounds.sum, bounds.sum, Source::Bound, bounds),
        }
    };
    let kept = |alpha: u16| probability(alpha).1 <= wanted;
    let (mut low, mut high) = (0u16, u16::MAX);
    if !kept(high) {
        return None;
    }
    while low < high {
        let middle = low + (high - low) / 2;
        if kept(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    let (false_alarms, _, source, bounds) = probability(high);
    Some(Tuned {
        alpha: U8F8::from_bits(high),
        l1,
        looks,
        wanted,
        false_alarms,
        source,
        bounds,
        detections: Detections::default(),
    })
}

#[cfg(test)]
mod tests;

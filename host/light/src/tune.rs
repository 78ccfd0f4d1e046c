//! Settings for a required rate of false alarms: α and L1, and the performance to expect.
//!
//! α is the smallest value that keeps the probability of a false alarm in an exposure within
//! the limit. The probability comes from the simulated [`Table`]: its upper confidence limit
//! times [`MARGIN`] must not exceed the limit. Where the table has no events or does not cover
//! the settings, the sum of the exact single-look probabilities is used, an upper bound.
//! Of all L1, simulated exposures choose the one with the shortest mean time to an event.
//! [`average`] and [`window`] do the same for the other rules.

pub mod average;
mod shortest;
pub mod window;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::paper::Threshold;
use dtof_core::{BlockLevel, Count, Count10, CounterWidth, DepthEstimator, PaperRule, PixelConfig};
use rayon::prelude::*;

use self::shortest::shortest;
use crate::counts::poisson::Poisson;
use crate::looks::detections::{DetectionSettings, Detections};
use crate::looks::exposure::Looks;
use crate::looks::repeated_looks::{BINS, Bounds, MINIMUM_COUNT, RepeatedLooks};
use crate::looks::single_look::SingleLook;
use crate::looks::table::{MARGIN, Table};
use crate::progress::{Part, Progress};

/// The limit on false alarms of a pixel without a target, as a probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FalseAlarmLimit {
    /// In one exposure.
    PerExposure(f64),
    /// In one laser cycle.
    PerCycle(f64),
}

impl FalseAlarmLimit {
    /// As a probability for one exposure.
    fn per_exposure(self, looks: Looks) -> f64 {
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

/// The scene and the settings to tune.
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
    /// The fewest photons of a reported peak.
    pub minimum_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// L1, if it is fixed.
    pub l1: Option<u16>,
    /// L2: laser cycles after which an exposure without an event expires.
    pub l2: u16,
    /// The limit on false alarms.
    pub limit: FalseAlarmLimit,
    /// With a window rule: the largest blocks of adaptive binning. Blocks and pixels share the
    /// limit.
    pub levels: BlockLevel,
    /// Seed of the simulated exposures.
    pub seed: u64,
}

/// The origin of a probability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Interpolated from the simulated table.
    Table,
    /// An upper bound: the smallest probability in the simulated table.
    TableAtMost,
    /// An upper bound: the sum of the exact single-look probabilities.
    Bound,
}

/// The settings and the performance to expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// α.
    pub alpha: U8F8,
    /// L1.
    pub l1: u16,
    /// The looks that follow from L1, L2 and X.
    pub looks: Looks,
    /// The limit on the probability of a false alarm in an exposure.
    pub limit: f64,
    /// The probability with this α.
    pub false_alarms: f64,
    /// Where that probability comes from.
    pub source: Source,
    /// Exact bounds of that probability.
    pub bounds: Bounds,
    /// Exposures simulated with the target.
    pub detections: Detections,
}

/// The highest probability that a counter is full at the last look.
const MAX_SATURATED: f64 = 0.01;

/// The most looks of an exposure: they take half a minute.
const MAX_LOOKS: u32 = 5000;

/// Finds α and L1.
///
/// # Errors
/// Fails if the request is invalid or cannot be met, or if `progress` ends the calculation; the message is
/// one line.
pub fn tune(request: &Request, table: &Table, progress: Progress) -> Result<Tuned> {
    check(request)?;
    let mean_a_step = request.background * f64::from(request.x);
    let Looks { last, .. } = Looks::new(request.x, request.x, request.l2);
    let part = Part::new(progress, last.into())?;
    let look = |step: u32| {
        let look = SingleLook::new(request.bins.into(), mean_a_step * f64::from(step));
        part.next().map(|()| look)
    };
    let steps: Vec<SingleLook> = (1..=last)
        .into_par_iter()
        .map(look)
        .collect::<Result<_>>()?;

    let minimum_count = Count::saturating(request.minimum_count.into());
    let candidates = candidates(request);
    let part = Part::new(progress, candidates.len() as u64 * BISECTIONS)?;
    let mut all = Vec::new();
    for l1 in candidates {
        let looks = Looks::new(request.x, l1, request.l2);
        if let Some(tuned) = calibrated(request, table, &steps, (l1, looks), &part)? {
            let settings = DetectionSettings {
                looks,
                rule: PaperRule::new(tuned.alpha, minimum_count).into(),
                estimator: DepthEstimator::Centroid3,
            };
            all.push((settings, tuned));
        }
    }
    ensure!(
        !all.is_empty(),
        "no α keeps false alarms below the wanted rate with so little background: raise --min-count \
         or --l1"
    );
    let (tuned, detections) = shortest(request, &all, progress)?;
    Ok(Tuned {
        detections,
        ..tuned
    })
}

/// Checks the request.
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
    let looks = Looks::new(x, x, l2).last;
    ensure!(
        looks <= MAX_LOOKS,
        "--x {x} --l2 {l2}: {looks} looks an exposure, at most {MAX_LOOKS} looks are calculated; \
         raise --x"
    );
    let last = f64::from(looks * u32::from(x));
    // Limits the size of the Poisson table; such a mean is far too high anyway.
    let mean = (background * last).min(5000.0);
    let full = Poisson::new(mean).highest_at_least(Count10::MAX, bins.into());
    if full > MAX_SATURATED {
        // With a mean of 860 at the last look, counters rarely fill.
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
    let (FalseAlarmLimit::PerExposure(limit) | FalseAlarmLimit::PerCycle(limit)) = request.limit;
    ensure!(
        limit > 0.0 && limit < 1.0,
        "the limit on false alarms must be more than 0 and less than 1 an exposure or laser cycle"
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

/// The L1 to compare: the fixed one, or values from X on that grow by half.
fn candidates(request: &Request) -> Vec<u16> {
    if let Some(l1) = request.l1 {
        return vec![l1];
    }
    let mut candidates = Vec::new();
    let mut steps = 1;
    // Up to half of the exposure, at least one value.
    while steps == 1 || u32::from(steps) * 2 * u32::from(request.x) < u32::from(request.l2) {
        candidates.push(steps * request.x);
        steps += (steps / 2).max(1);
    }
    candidates
}

/// Halvings of the range of α, 16 bits.
const BISECTIONS: u64 = 16;

/// The smallest α that keeps false alarms within the limit; `None` if none does.
fn calibrated(
    request: &Request,
    table: &Table,
    steps: &[SingleLook],
    (l1, looks): (u16, Looks),
    part: &Part,
) -> Result<Option<Tuned>> {
    let limit = request.limit.per_exposure(looks);
    let repeated = RepeatedLooks::new(steps, looks.first, looks.last);
    let first_mean = request.background * f64::from(looks.first * looks.x);
    let tabulated = usize::from(request.bins) == BINS && request.minimum_count == MINIMUM_COUNT;
    // The probability, its upper limit, and where it comes from.
    let probability = |alpha: u16| {
        let minimum_count = Count::saturating(request.minimum_count.into());
        let threshold = Threshold::new(U8F8::from_bits(alpha), minimum_count);
        let bounds = repeated.bounds(&threshold);
        let found = if tabulated {
            table.look_up(first_mean, looks.first, looks.last, bounds.independent)
        } else {
            None
        };
        // Never below the probability of one look alone.
        match found {
            Some(found) if found.probability < bounds.sum => {
                let source = if found.is_observed {
                    Source::Table
                } else {
                    Source::TableAtMost
                };
                let [probability, upper_limit] = [found.probability, found.upper_limit]
                    .map(|found| found.max(bounds.worst_look));
                // The bound holds despite the interpolation error.
                let upper_limit = (upper_limit * MARGIN).min(bounds.sum);
                (probability, upper_limit, source, bounds)
            }
            _ => (bounds.sum, bounds.sum, Source::Bound, bounds),
        }
    };
    let is_within_limit = |alpha: u16| probability(alpha).1 <= limit;
    let (mut low, mut high) = (0u16, u16::MAX);
    if !is_within_limit(high) {
        return Ok(None);
    }
    while low < high {
        part.next()?;
        let middle = low + (high - low) / 2;
        if is_within_limit(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    let (false_alarms, _, source, bounds) = probability(high);
    Ok(Some(Tuned {
        alpha: U8F8::from_bits(high),
        l1,
        looks,
        limit,
        false_alarms,
        source,
        bounds,
        detections: Detections::default(),
    }))
}

#[cfg(test)]
mod tests;

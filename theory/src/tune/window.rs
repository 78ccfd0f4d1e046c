//! Settings of the window rule for a wanted rate of false alarms.
//!
//! Window and estimator are those that suit the pulse, z is that of [`z_for_levels`]. Of all L1
//! the one with the shortest mean time to an event is taken, of those whose first look
//! has a background that it holds for if there are any. False alarms are counted
//! in simulated exposures without a target.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{Count, DepthEstimator, HIGHEST_Z, RangeGate, WindowRule, z_for_levels};

use super::shortest::{false_alarms, shortest};
use super::{Request, candidates, check};
use crate::looks::detections::{Decisions, Detections};
use crate::looks::exposure::Looks;

/// Background counts a bin at the first look that [`z_for_levels`] holds for.
const BACKGROUND: std::ops::RangeInclusive<f64> = 0.4..=200.0;

/// The settings and what to expect of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// The standard deviation of the pulse in bins, as it can be given.
    pub sigma: U8F8,
    /// Bins in the window.
    pub window: u8,
    /// Standard deviations of the background.
    pub z: U4F12,
    /// Wanted is a false alarm in so many exposures.
    pub one_in: u32,
    /// L1.
    pub l1: u16,
    /// How the depth is found.
    pub estimator: DepthEstimator,
    /// Exposures of a pixel without a target that were simulated, and those with an event. Of
    /// blocks come a third as many.
    pub false_alarms: (u64, u64),
    /// Exposures simulated with the target.
    pub detections: Detections,
}

/// The exposures of which `share` is one, rounded up: what [`z_for_levels`] takes. Limited to what
/// a `u32` holds.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub fn one_in(share: f64) -> u32 {
    (1.0 / share).ceil() as u32
}

/// Finds z and L1.
///
/// # Errors
/// What about the request cannot be met, in one line.
pub fn tune(request: &Request) -> Result<Tuned> {
    check(request)?;
    let sigma = U8F8::saturating_from_num(request.sigma).max(U8F8::DELTA);
    let window = WindowRule::width_for_pulse(sigma);
    let estimator = DepthEstimator::for_pulse(sigma);
    let minimum_count = Count::saturating(request.minimum_count.into());
    // z takes the number of bins from it only.
    let gate = RangeGate::<1024>::new(0, request.bins - 1)?;

    let mut candidates = candidates(request);
    let background = |l1: u16| {
        let looks = Looks::new(request.x, l1, request.l2);
        request.background * f64::from(looks.first * looks.x)
    };
    let holds = |&l1: &u16| BACKGROUND.contains(&background(l1));
    if candidates.iter().any(holds) {
        candidates.retain(holds);
    }
    let mut all = Vec::new();
    for l1 in candidates {
        let looks = Looks::new(request.x, l1, request.l2);
        let one_in = one_in(request.wanted.in_an_exposure(looks));
        ensure!(
            one_in >= 10,
            "a false alarm in {one_in} exposures: there is a z for one in 10 or fewer"
        );
        let z = z_for_levels(one_in, &gate, request.x, l1, request.l2, request.levels);
        ensure!(
            z < HIGHEST_Z,
            "a false alarm in {one_in} exposures: there is no z for so few"
        );
        let decisions = Decisions {
            looks,
            rule: WindowRule::new(window, z, minimum_count)?.into(),
            estimator,
        };
        all.push((decisions, (decisions, l1, one_in, z)));
    }
    let ((decisions, l1, one_in, z), detections) = shortest(request, &all)?;
    Ok(Tuned {
        sigma,
        window,
        z,
        one_in,
        l1,
        estimator,
        false_alarms: false_alarms(request, &decisions)?,
        detections,
    })
}

//! Settings of the window rule for a required rate of false alarms.
//!
//! Window and estimator follow from the pulse, z from [`z_for_levels`]. The L1 with the shortest
//! mean time to an event wins; values whose background at the first look (the first decision after L1)
//! is in the range of [`z_for_levels`] take precedence. False alarms are counted in simulated exposures
//! without a target.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::rule::{HIGHEST_Z, z_for_levels};
use dtof_core::{Count, DepthEstimator, RangeGate, WindowRule};
use dtof_data::options::numbers::one_in;

use super::shortest::{false_alarms, shortest};
use super::{Request, candidates, check};
use crate::looks::detections::{DetectionSettings, Detections};
use crate::looks::exposure::Looks;
use crate::progress::Progress;

/// Background counts a bin at the first look for which [`z_for_levels`] is valid.
const BACKGROUND: std::ops::RangeInclusive<f64> = 0.4..=200.0;

/// The settings and the performance to expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// The standard deviation of the pulse in bins, rounded to the format of the option.
    pub sigma: U8F8,
    /// Bins in the window.
    pub window: u8,
    /// Standard deviations of the background.
    pub z: U4F12,
    /// The limit: one false alarm in this many exposures.
    pub one_in: u32,
    /// L1: the laser cycles that an exposure must exceed before the first look.
    pub l1: u16,
    /// The depth estimator.
    pub estimator: DepthEstimator,
    /// Simulated exposures of a pixel without a target, and how many had an event. The blocks
    /// of adaptive binning add a third as many false alarms.
    pub false_alarms: (u64, u64),
    /// Exposures simulated with the target.
    pub detections: Detections,
}

/// Finds z and L1.
///
/// # Errors
/// Fails if the request is invalid or cannot be met, or if `progress` ends the calculation; the message is
/// one line.
pub fn tune(request: &Request, progress: Progress) -> Result<Tuned> {
    check(request)?;
    let sigma = U8F8::saturating_from_num(request.sigma).max(U8F8::DELTA);
    let window = WindowRule::width_for_pulse(sigma);
    let estimator = DepthEstimator::for_pulse(sigma);
    let minimum_count = Count::saturating(request.minimum_count.into());
    // z uses only its number of bins.
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
        let one_in = one_in(request.limit.per_exposure(looks));
        ensure!(
            one_in >= 10,
            "a false alarm in {one_in} exposures: there is a z for one in 10 or fewer"
        );
        let z = z_for_levels(one_in, &gate, request.x, l1, request.l2, request.levels);
        ensure!(
            z < HIGHEST_Z,
            "a false alarm in {one_in} exposures: there is no z for so few"
        );
        let settings = DetectionSettings {
            looks,
            rule: WindowRule::new(window, z, minimum_count)?.into(),
            estimator,
        };
        all.push((settings, (settings, l1, one_in, z)));
    }
    let ((settings, l1, one_in, z), detections) = shortest(request, &all, progress)?;
    Ok(Tuned {
        sigma,
        window,
        z,
        one_in,
        l1,
        estimator,
        false_alarms: false_alarms(request, &settings, progress)?,
        detections,
    })
}

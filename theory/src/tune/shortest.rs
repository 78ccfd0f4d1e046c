//! Of some settings those with the shortest time to an event, by simulated exposures.

use anyhow::{Context, Result};
use rayon::prelude::*;

use super::Request;
use crate::looks::detections::{Decisions, Detections};
use crate::rates::Rates;

/// The function for so many bins, which [`check`](super::check) has let through.
macro_rules! of_bins {
    ($bins:expr, $($function:ident)::+) => {
        match $bins {
            8 => $($function)::+::<8>,
            16 => $($function)::+::<16>,
            32 => $($function)::+::<32>,
            64 => $($function)::+::<64>,
            128 => $($function)::+::<128>,
            256 => $($function)::+::<256>,
            512 => $($function)::+::<512>,
            _ => $($function)::+::<1024>,
        }
    };
}
pub(super) use of_bins;

/// Places of the pulse within a bin that are simulated, evenly spread.
const POSITIONS: u16 = 8;
/// Exposures at each place to compare settings with, and for those chosen.
const EXPOSURES: (u32, u32) = (50, 500);
/// An exposure reports the target less often than this: too weak.
const LEAST_DETECTED: f64 = 0.01;
/// Photons of all exposures without a target, about, which take a second.
const PHOTONS: f64 = 1e8;

/// Of `all` what has the shortest mean time to an event, and what to expect of it.
///
/// # Errors
/// If the signal is too weak for all of them.
pub fn shortest<T: Copy>(request: &Request, all: &[(Decisions, T)]) -> Result<(T, Detections)> {
    let mut best: Option<(&(Decisions, T), f64)> = None;
    for one in all {
        let detections = detections(request, &one.0, 0, EXPOSURES.0)?;
        let time = detections.cycles_to_event();
        if detections.near > 0 && best.is_none_or(|best| time < best.1) {
            best = Some((one, time));
        }
    }
    let mut found = None;
    if let Some(((decisions, settings), _)) = best {
        // Other photons than those it was chosen by, which flatter it.
        let detections = detections(request, decisions, POSITIONS, EXPOSURES.1)?;
        found = Some((*settings, detections));
    }
    found
        .filter(|(_, detections)| detections.detected() >= LEAST_DETECTED)
        .with_context(|| {
            format!(
                "the signal is too weak: fewer than {} % of exposures report the target before L2 = {}",
                LEAST_DETECTED * 100.0,
                request.l2
            )
        })
}

/// Exposures without a target, as many as do not take long, and those of them with an
/// event.
///
/// # Errors
/// If the background cannot be simulated.
pub fn false_alarms(request: &Request, decisions: &Decisions) -> Result<(u64, u64)> {
    let without_target = Request {
        signal: 0.0,
        ..*request
    };
    let last = f64::from(decisions.looks.last * decisions.looks.x);
    let photons = request.background * f64::from(request.bins) * last;
    let most = f64::from(EXPOSURES.1);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let exposures = (PHOTONS / photons / f64::from(POSITIONS)).clamp(50.0, most) as u32;
    let found = detections(&without_target, decisions, 2 * POSITIONS, exposures)?;
    Ok((found.exposures, found.near + found.far))
}

/// Exposures with the target, at all places within a bin: trials `first_trial` on.
fn detections(
    request: &Request,
    decisions: &Decisions,
    first_trial: u16,
    exposures: u32,
) -> Result<Detections> {
    let trial = of_bins!(request.bins, Detections::trial);
    let trials: Vec<Detections> = (0..POSITIONS)
        .into_par_iter()
        .map(|place| {
            // In the second quadrant, clear of the middle and of both ends.
            let bin = f64::from(request.bins / 8 * 3);
            let rates = Rates {
                background: request.background,
                signal: request.signal,
                position: bin + (f64::from(place) + 0.5) / f64::from(POSITIONS),
                sigma: request.sigma,
            };
            let number = first_trial + place;
            trial(request.seed, number, &rates, decisions, exposures)
        })
        .collect::<Result<_>>()?;
    let mut sum = Detections::default();
    for trial in trials {
        sum += trial;
    }
    Ok(sum)
}

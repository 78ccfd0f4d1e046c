//! The settings with the shortest time to an event, by simulated exposures.

use std::ops::Range;

use anyhow::{Context, Result};
use rayon::prelude::*;

use super::Request;
use crate::looks::detections::{DetectionSettings, Detections};
use crate::progress::{Part, Progress};
use crate::rates::Rates;

/// The function for this number of bins, which [`check`](super::check) has validated.
macro_rules! for_bins {
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
pub(super) use for_bins;

/// Simulated positions of the pulse within a bin, evenly spread.
const POSITIONS: u16 = 8;
/// Trials, one for each position: to compare settings, for the chosen one, and without a target. Those of one have no
/// photon of another.
const COMPARED: Range<u16> = 0..POSITIONS;
const CHOSEN: Range<u16> = POSITIONS..2 * POSITIONS;
const WITHOUT_TARGET: Range<u16> = 2 * POSITIONS..3 * POSITIONS;
/// Exposures at each position: to compare settings, and for the chosen one.
const EXPOSURES: (u32, u32) = (50, 500);
/// The signal is too weak if a smaller share of exposures reports the target.
const MIN_DETECTED: f64 = 0.01;
/// Approximate photons of all exposures without a target, which take a second.
const PHOTONS: f64 = 1e8;

/// The entry of `all` with the shortest mean time to an event, and its detections.
///
/// # Errors
/// Fails if the signal is too weak for all of them, or if `progress` ends the calculation.
pub fn shortest<T: Copy>(
    request: &Request,
    all: &[(DetectionSettings, T)],
    progress: Progress,
) -> Result<(T, Detections)> {
    let exposures = u64::from(EXPOSURES.0) * all.len() as u64 + u64::from(EXPOSURES.1);
    let part = Part::new(progress, u64::from(POSITIONS) * exposures)?;
    let mut best: Option<(&(DetectionSettings, T), f64)> = None;
    for entry in all {
        let detections = detections(request, &entry.0, COMPARED, EXPOSURES.0, &part)?;
        // Infinite without an event.
        let time = detections.cycles_to_event();
        if best.is_none_or(|best| time < best.1) {
            best = Some((entry, time));
        }
    }
    let mut found = None;
    if let Some(((settings, value), _)) = best {
        // Fresh photons: those that chose it would flatter it.
        let detections = detections(request, settings, CHOSEN, EXPOSURES.1, &part)?;
        found = Some((*value, detections));
    }
    found
        .filter(|(_, detections)| detections.detected() >= MIN_DETECTED)
        .with_context(|| {
            format!(
                "the signal is too weak: fewer than {} % of exposures report the target before L2 = {}",
                MIN_DETECTED * 100.0,
                request.l2
            )
        })
}

/// Simulates exposures without a target for about a second: their number, and how many had an
/// event.
///
/// # Errors
/// Fails if the background cannot be simulated, or if `progress` ends the calculation.
pub fn false_alarms(
    request: &Request,
    settings: &DetectionSettings,
    progress: Progress,
) -> Result<(u64, u64)> {
    let without_target = Request {
        signal: 0.0,
        ..*request
    };
    let last = f64::from(settings.looks.last * settings.looks.x);
    let photons = request.background * f64::from(request.bins) * last;
    let most = f64::from(EXPOSURES.1);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let exposures = (PHOTONS / photons / f64::from(POSITIONS)).clamp(50.0, most) as u32;
    let part = Part::new(progress, (u32::from(POSITIONS) * exposures).into())?;
    let found = detections(&without_target, settings, WITHOUT_TARGET, exposures, &part)?;
    Ok((found.exposures, found.near + found.far))
}

/// Exposures with the target at all positions within a bin, in as many trials.
fn detections(
    request: &Request,
    settings: &DetectionSettings,
    trials: Range<u16>,
    exposures: u32,
    part: &Part,
) -> Result<Detections> {
    let trial = for_bins!(request.bins, Detections::trial);
    let trials: Vec<Detections> = (0..POSITIONS)
        .into_par_iter()
        .zip(trials)
        .map(|(index, number)| {
            let rates = Rates {
                background: request.background,
                signal: request.signal,
                position: position(request.bins, index),
                sigma: request.sigma,
            };
            trial(request.seed, number, &rates, settings, exposures, part)
        })
        .collect::<Result<_>>()?;
    let mut sum = Detections::default();
    for trial in trials {
        sum += trial;
    }
    Ok(sum)
}

/// The middle of an eighth of a bin in the second quadrant, clear of the middle and of both ends.
fn position(bins: u16, index: u16) -> f64 {
    f64::from(bins / 8 * 3) + (f64::from(index) + 0.5) / f64::from(POSITIONS)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::tune::average;

    #[test]
    fn no_trial_has_the_photons_of_another() {
        let all = [COMPARED, CHOSEN, WITHOUT_TARGET];
        assert!(
            all.iter()
                .all(|trials| trials.len() == usize::from(POSITIONS))
        );
        let all: Vec<u16> = all
            .into_iter()
            .chain([average::NUMBERS])
            .flatten()
            .collect();
        let different: BTreeSet<u16> = all.iter().copied().collect();
        assert_eq!(different.len(), all.len());
    }

    #[test]
    fn positions_are_spread_over_a_bin() {
        for (bins, bin) in [(8, 3.0), (128, 48.0), (1024, 384.0)] {
            let all = (0..POSITIONS).map(|index| position(bins, index));
            let eighths = (0..8).map(|eighth| bin + f64::from(eighth) / 8.0 + 1.0 / 16.0);
            assert!(all.eq(eighths), "{bins}");
        }
    }
}

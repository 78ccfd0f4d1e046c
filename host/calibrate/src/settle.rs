//! Settings from the findings: gate, window, z, L1 and L2.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::U4F12;
use dtof_core::{BlockLevel, WindowRule};
use dtof_light::progress::Progress;
use dtof_light::tune::{FalseAlarmLimit, Request, window};

use super::false_alarms;
use super::find::pulse::Pulse;
use super::photon_budget::PhotonBudget;
use super::used_pulse::{PulseSource, UsedPulse};
use super::{CalibrationOptions, WindowDetection};
use dtof_data::options::Refused;

/// Laser cycles of an exposure, if counters can hold so much background.
const L2: u16 = 2000;
/// Laser cycles between looks.
const X: u16 = 4;
/// L1 where the signal is not known.
const L1: u16 = 40;
/// The lowest z that is written. A lower one would give false alarms as soon as there is more light.
const MIN_Z: U4F12 = U4F12::lit("3");
/// The fewest photons in the window.
const MIN_COUNT: u16 = 5;
/// The most background photons of a bin in an exposure: their noise still fits a counter of 10 bits.
const MAX_BACKGROUND: f64 = 860.0;

/// What settings are derived from.
pub struct Findings<'a> {
    /// Bins of a histogram.
    pub bins: usize,
    /// First and last bin of the gate.
    pub gate: (u16, u16),
    /// The pulse that was measured, if a peak is bright enough.
    pub measured: Option<&'a Pulse>,
    /// The pulse that the settings are for.
    pub pulse: UsedPulse,
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// Whether rates are absolute, not relative to the brightest pixel.
    pub is_absolute: bool,
    /// The options of the user.
    pub options: &'a CalibrationOptions,
}

/// Laser cycles of an exposure with `background` photons a bin and laser cycle.
#[must_use]
pub fn l2(background: f64) -> u16 {
    let most = MAX_BACKGROUND / background.max(1e-9);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let most = most.min(L2.into()) as u16;
    most.max(4 * X)
}

/// The gate from bin `first` to bin `last`.
///
/// # Errors
/// Fails if it has fewer than 8 bins.
pub fn gate(last: usize, first: usize) -> Result<(u16, u16)> {
    let (first, last) = (u16::try_from(first)?, u16::try_from(last)?);
    ensure!(
        first + 7 <= last,
        Refused::input(format!(
            "the cover glass reaches up to bin {first}, the last bin is {last}: no gate leaves it \
             out; set `glass` to no if it is not a cover glass"
        ))
    );
    Ok((first, last))
}

/// A gate that the user gives.
///
/// # Errors
/// Fails if it ends past the last of `bins` bins, or has fewer than 8.
pub fn given_gate((first, last): (u16, u16), bins: usize) -> Result<(u16, u16)> {
    let refused = |reason| Refused::value("gate", format_args!("{first}..{last}"), reason);
    ensure!(
        usize::from(last) < bins,
        refused(format!("there are {bins} bins"))
    );
    ensure!(
        last.checked_sub(first).is_some_and(|more| more >= 7),
        refused("a gate has 8 bins or more".to_owned())
    );
    Ok((first, last))
}

/// The settings of the window rule, with window, minimum count and X of `budget` if there is one.
///
/// # Errors
/// Fails if so few false alarms cannot be simulated, or if `progress` ends the calculation.
pub fn detection(
    found: &Findings,
    budget: Option<PhotonBudget>,
    progress: Progress,
) -> Result<WindowDetection> {
    let Findings {
        background,
        options,
        pulse,
        ..
    } = *found;
    let l2 = l2(background);
    let width = || WindowRule::width_for_pulse(pulse.sigma_bins);
    let x = budget.map_or(X, |budget| budget.x);
    let mut detection = WindowDetection {
        window: budget.map_or_else(width, |budget| budget.window),
        z: None,
        is_by_count: false,
        exposures: 0,
        false_alarm: options.false_alarm,
        min_count: budget.map_or(MIN_COUNT, |budget| budget.min_count),
        l1: L1.min(l2 / 2),
        l2,
        x,
        sigma_bins: pulse.sigma_bins,
        half_widths: pulse.half_widths,
        pulse_source: pulse.source,
    };
    if !found.is_absolute {
        return Ok(detection);
    }
    let bins = u16::try_from(found.bins)?;
    if let Some(measured) = found.measured {
        let sigma = match pulse.source {
            PulseSource::Given => pulse.sigma_bins.to_num(),
            _ => measured.sigma,
        };
        let request = Request {
            background: background.max(1e-6),
            signal: measured.signal,
            sigma: sigma.min(f64::from(bins) / 4.0),
            bins,
            minimum_count: MIN_COUNT,
            x,
            l1: None,
            l2,
            limit: FalseAlarmLimit::PerExposure(options.false_alarm),
            levels: BlockLevel::PIXEL,
            seed: options.seed,
        };
        // If the signal is too weak for any L1, the default stays. If `progress` has ended it, `z` fails at once.
        if let Ok(tuned) = window::tune(&request, progress) {
            detection.l1 = tuned.l1;
        }
    }
    let exposures = false_alarms::ExposureSettings {
        background,
        bins: found.bins,
        gate: found.gate,
        window: detection.window,
        min_count: detection.min_count,
        looks: (detection.l1, l2, x),
        share: options.false_alarm,
        seed: options.seed,
    };
    let (z, exposures) = false_alarms::z(&exposures, progress)?;
    detection.is_by_count = z < MIN_Z;
    detection.z = Some(z.max(MIN_Z).to_num());
    detection.exposures = exposures;
    Ok(detection)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_given_gate_has_eight_bins_that_are_there() {
        for gate in [(0, 7), (120, 127), (0, 127)] {
            assert_eq!(given_gate(gate, 128).unwrap(), gate);
        }
        for (gate, reason) in [
            ((0, 6), "a gate has 8 bins or more"),
            ((121, 127), "a gate has 8 bins or more"),
            ((u16::MAX, 20), "a gate has 8 bins or more"),
            ((0, 128), "there are 128 bins"),
            ((0, u16::MAX), "there are 128 bins"),
        ] {
            let error = given_gate(gate, 128).unwrap_err().to_string();
            assert!(error.ends_with(reason), "{gate:?}: {error}");
        }
    }
}

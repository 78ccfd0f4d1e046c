//! Detections in simulated exposures with a target.

use anyhow::Result;
use dtof_core::{AnyRule, BinPosition, DepthEstimator};

use crate::looks::exposure::{Exposures, Looks};
use crate::progress::Part;
use crate::rates::Rates;
use dtof_data::random::trial_rng;

/// When a pixel looks, and how it decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DetectionSettings {
    /// When the pixel looks.
    pub looks: Looks,
    /// The rule that decides about an event.
    pub rule: AnyRule,
    /// The depth estimator.
    pub estimator: DepthEstimator,
}

/// The outcome of a number of exposures. All fields are integer sums, so the order of
/// addition does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Detections {
    /// Number of exposures.
    pub exposures: u64,
    /// Laser cycles of all exposures.
    pub cycles: u64,
    /// Exposures with an event whose depth lies within [`Self::NEAR_BINS`] of the
    /// target.
    pub near: u64,
    /// Exposures with an event elsewhere.
    pub far: u64,
    /// Laser cycles of the exposures counted in `near`.
    pub near_cycles: u64,
    /// Squared depth errors of the events in `near`, in (1/256 bin)².
    pub squared_errors: u64,
}

impl Detections {
    /// An event farther from the target is a false alarm.
    pub const NEAR_BINS: f64 = 3.0;

    /// Simulates `exposures` exposures with the random numbers of trial `trial`. Each is an item of `part`.
    ///
    /// # Errors
    /// Fails if a rate is negative or not a number, or if the part ends the calculation.
    pub fn trial<const BINS: usize>(
        seed: u64,
        trial: u16,
        rates: &Rates,
        settings: &DetectionSettings,
        exposures: u32,
        part: &Part,
    ) -> Result<Self> {
        let DetectionSettings {
            looks,
            rule,
            estimator,
        } = settings;
        let bins = u16::try_from(BINS)?;
        let simulated = Exposures::new(rates, bins, *looks)?;
        let mut rng = trial_rng(seed, trial);
        let mut sum = Self::default();
        for _ in 0..exposures {
            let (cycles, event) = simulated.event::<BINS>(rule, estimator, &mut rng);
            part.next()?;
            sum.exposures += 1;
            sum.cycles += u64::from(cycles);
            let Some(event) = event else { continue };
            let found = BinPosition::of(event.peak.bin, event.depth.offset);
            let error = f64::from(found.raw()) - rates.position * 256.0;
            if error.abs() > Self::NEAR_BINS * 256.0 {
                sum.far += 1;
                continue;
            }
            sum.near += 1;
            sum.near_cycles += u64::from(cycles);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            {
                sum.squared_errors += error.powi(2).round() as u64;
            }
        }
        Ok(sum)
    }

    /// Mean laser cycles to an event near the target, including expired exposures and
    /// those with a false alarm.
    #[must_use]
    pub fn cycles_to_event(&self) -> f64 {
        self.cycles as f64 / self.near as f64
    }

    /// Root mean square depth error of the events near the target, in bins.
    #[must_use]
    pub fn depth_error_bins(&self) -> f64 {
        (self.squared_errors as f64 / self.near as f64).sqrt() / 256.0
    }

    /// The share of exposures with an event near the target.
    #[must_use]
    pub fn detected(&self) -> f64 {
        self.near as f64 / self.exposures as f64
    }
}

impl std::ops::AddAssign for Detections {
    fn add_assign(&mut self, other: Self) {
        self.exposures += other.exposures;
        self.cycles += other.cycles;
        self.near += other.near;
        self.far += other.far;
        self.near_cycles += other.near_cycles;
        self.squared_errors += other.squared_errors;
    }
}

#[cfg(test)]
mod tests {
    use dtof_core::fixed::types::U8F8;
    use dtof_core::{Count, PaperRule};

    use super::*;
    use crate::progress::NONE;

    fn trial(signal: f64, alpha: &str) -> Detections {
        let rates = Rates {
            background: 0.05,
            signal,
            position: 40.25,
            sigma: 1.0,
        };
        trial_at(&rates, alpha, 200)
    }

    fn trial_at(rates: &Rates, alpha: &str, exposures: u32) -> Detections {
        let settings = DetectionSettings {
            looks: Looks::new(4, 40, 1000),
            rule: PaperRule::new(alpha.parse::<U8F8>().unwrap(), Count::saturating(2)).into(),
            estimator: DepthEstimator::Centroid3,
        };
        let part = Part::new(NONE, exposures.into()).unwrap();
        Detections::trial::<128>(3, 7, rates, &settings, exposures, &part).unwrap()
    }

    #[test]
    fn a_bright_target_is_found_at_the_first_look() {
        let found = trial(3.0, "4");
        let expected = Detections {
            exposures: 200,
            cycles: 200 * 44,
            near: 200,
            far: 0,
            near_cycles: 200 * 44,
            squared_errors: found.squared_errors,
        };
        assert_eq!(found, expected);
        assert_eq!((found.detected(), found.cycles_to_event()), (1.0, 44.0));
        // 132 photons, σ of one bin: a tenth, plus the bias of the centroid of three bins.
        let error = found.depth_error_bins();
        assert!((0.05..0.3).contains(&error), "{error}");
        let squares = found.squared_errors as f64 / 200.0;
        assert!(((error * 256.0).powi(2) / squares - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_dim_target_is_found_in_a_part_of_the_exposures() {
        let found = trial(0.1, "4");
        assert!((20..180).contains(&found.near), "{found:?}");
        let share = found.near as f64 / 200.0;
        assert!((found.detected() - share).abs() < 1e-12);
    }

    /// Two photons in a bin, and most often none beside it, are an event in the middle of the bin.
    #[test]
    fn an_event_just_three_bins_away_is_near() {
        let rates = Rates {
            background: 0.0005,
            signal: 0.0,
            position: 40.5,
            sigma: 1.0,
        };
        let found = trial_at(&rates, "0", 20_000);
        let events = found.near + found.far;
        assert!(events > 10_000, "{found:?}");
        // Seven bins of 128, but for events that a photon beside them moves away.
        let near = 128 * found.near;
        assert!((6 * events..8 * events).contains(&near), "{found:?}");
    }

    #[test]
    fn false_alarms_are_anywhere_and_parts_add_up() {
        let found = trial(0.0, "1");
        // One event in twenty lies within three bins by chance.
        assert!(found.far > 120 && found.near < found.far / 4, "{found:?}");
        assert!(found.near_cycles < found.cycles);

        let other = trial(3.0, "4");
        let mut sum = found;
        sum += other;
        let of = |of: &Detections| {
            [
                of.exposures,
                of.cycles,
                of.near,
                of.far,
                of.near_cycles,
                of.squared_errors,
            ]
        };
        let expected: Vec<u64> = of(&found)
            .iter()
            .zip(of(&other))
            .map(|(a, b)| a + b)
            .collect();
        assert_eq!(of(&sum).to_vec(), expected);
    }
}

//! The results of a rule in a scene.

use anyhow::Result;

use super::pixel::Pixel;
use super::{BACKGROUNDS, ESTIMATORS, SIGMAS, pixels};
use crate::studies::methods::passage::Rule;
use crate::sweep::mean::Measured;
use crate::sweep::{Part, PointTally};
use dtof_light::bounds::cramer_rao::Pulse;

/// The errors of an estimator on the events whose peak is in the pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthErrors {
    /// Root mean square error, in bins.
    pub error: Measured,
    /// Mean error, in bins; negative is too near.
    pub bias: Measured,
    /// Ratio of `error` to the Cramér-Rao bound of a fixed exposure with the mean counts of the
    /// events. It may be below 1, because the exposure of events is not fixed.
    pub over_bound: Measured,
}

/// A rule in a scene.
#[derive(Clone, Copy, Debug)]
pub struct EventDepthOutcome {
    /// Standard deviation of the pulse in bins.
    pub sigma: f64,
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// The first look, in laser cycles.
    pub first_look: u32,
    /// The rule.
    pub rule: Rule,
    /// α or z.
    pub threshold: f64,
    /// Events per exposure without a target.
    pub false_share: Measured,
    /// Number of events.
    pub events: u64,
    /// Events per exposure with a target.
    pub event_share: Measured,
    /// The share of events whose peak is in the pulse. The fields below refer to these.
    pub in_pulse: Measured,
    /// Mean laser cycles.
    pub cycles: f64,
    /// Mean photons of the pulse.
    pub signal: f64,
    /// The errors of [`ESTIMATORS`].
    pub errors: [DepthErrors; 2],
    /// Mean of the paired difference of squared errors, second estimator minus first, in bins².
    pub excess: Measured,
}

impl EventDepthOutcome {
    /// The index of the significantly better estimator, if there is one.
    #[must_use]
    pub fn better(&self) -> Option<usize> {
        let (low, high) = self.excess.interval;
        if low > 0.0 {
            Some(0)
        } else {
            (high < 0.0).then_some(1)
        }
    }

    fn new(scene: (f64, f64), pixel: &Pixel, without: &[&PointTally], with: &PointTally) -> Self {
        let (sigma, background) = scene;
        let name = pixel.name();
        let of = |point: &PointTally, what: &str| point.count(&format!("{name} {what}"));
        let sum = |what: &str| without.iter().map(|point| point.count(what)).sum();
        let false_share = Measured::share(sum(&format!("{name} events")), sum("exposures"));
        let events = of(with, "events");
        let near = events - of(with, "elsewhere");
        let [cycles, signal] = ["cycles", "signal"].map(|what| of(with, what) as f64 / near as f64);
        let bound = Pulse {
            signal,
            background: background * cycles,
            sigma,
        };
        let bound = bound.position_error();
        let errors = ESTIMATORS.map(|(estimator, _)| {
            let name = format!("{name} {estimator}");
            let error = Measured::root_mean_square(with, &name).times(1.0 / 256.0);
            DepthErrors {
                error,
                bias: Measured::mean(with, &name).times(1.0 / 256.0),
                over_bound: error.times(1.0 / bound),
            }
        });
        Self {
            sigma,
            background,
            first_look: pixel.first_look,
            rule: pixel.rule,
            threshold: pixel.threshold,
            false_share,
            events,
            event_share: Measured::share(events, with.count("exposures")),
            in_pulse: Measured::share(near, events),
            cycles,
            signal,
            errors,
            excess: Measured::mean(with, &format!("{name} excess")).times(1.0 / 65536.0),
        }
    }
}

/// Every rule in every scene, by first look, pulse and background.
///
/// # Errors
/// Fails if a threshold is out of range.
pub fn outcomes(part: &Part) -> Result<Vec<EventDepthOutcome>> {
    let mut outcomes = Vec::new();
    for sigma in SIGMAS {
        for background in BACKGROUNDS {
            let scene = [("sigma", sigma), ("background", background)];
            let with = part.one([scene[0], scene[1], ("target", 1.0)]);
            for pixel in pixels(sigma, background)? {
                // The paper's rule does not depend on the pulse: all parts count.
                let all = part.at([scene[1], ("target", 0.0)]);
                let without: Vec<&PointTally> = all
                    .filter(|point| pixel.rule == Rule::Paper || point.is_at([scene[0]]))
                    .collect();
                outcomes.push(EventDepthOutcome::new(
                    (sigma, background),
                    &pixel,
                    &without,
                    with,
                ));
            }
        }
    }
    outcomes.sort_by_key(|outcome| outcome.first_look);
    Ok(outcomes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::mean::{add, add_error, add_value};
    use crate::sweep::tally;

    /// 400 events in 1000 exposures, 40 of them elsewhere. The centre of mass is half a bin off to
    /// either side, the window `centred` / 256 bins too far.
    fn outcome(centred: i64) -> EventDepthOutcome {
        let pixel = Pixel::new(Rule::Paper, 40, 0.05).unwrap();
        let mut with = tally([("exposures", 1000)]);
        let sums = [
            ("events", 400),
            ("elsewhere", 40),
            ("cycles", 360 * 200),
            ("signal", 360 * 60),
        ];
        for (what, sum) in sums {
            add(&mut with, "paper 40", what, sum);
        }
        for index in 0..360 {
            let mass = if index % 2 == 0 { 128 } else { -128 };
            add_error(&mut with, "paper 40 mass3", mass);
            add_error(&mut with, "paper 40 centred", centred);
            let excess = centred * centred - mass * mass;
            add_value(&mut with, "paper 40 excess", excess);
        }
        let without = tally([("exposures", 500), ("paper 40 events", 5)]).into();
        EventDepthOutcome::new((1.0, 0.05), &pixel, &[&without, &without], &with.into())
    }

    #[test]
    fn sums_become_errors_over_the_bound_of_mean_counts() {
        let outcome = outcome(64);
        assert!((outcome.false_share.value - 0.01).abs() < 1e-12);
        assert!((outcome.event_share.value - 0.4).abs() < 1e-12);
        assert!((outcome.in_pulse.value - 0.9).abs() < 1e-12);
        assert_eq!((outcome.cycles, outcome.signal), (200.0, 60.0));
        let [mass, centred] = outcome.errors;
        let value = |of: f64, expected: f64| assert!((of - expected).abs() < 1e-9, "{of}");
        value(mass.error.value, 0.5);
        value(mass.bias.value, 0.0);
        assert!(mass.bias.interval.1 > 0.06, "{:?}", mass.bias);
        value(centred.error.value, 0.25);
        value(centred.bias.value, 0.25);
        value(outcome.excess.value, 0.0625 - 0.25);
        // 10 background photons a bin in 200 laser cycles.
        let bound = Pulse {
            signal: 60.0,
            background: 10.0,
            sigma: 1.0,
        };
        value(mass.over_bound.value, 0.5 / bound.position_error());
    }

    #[test]
    fn the_better_is_that_with_the_smaller_square_event_by_event() {
        assert_eq!(outcome(64).better(), Some(1));
        assert_eq!(outcome(129).better(), Some(0));
        assert_eq!(outcome(128).better(), None);
    }
}

//! One pass over photons: all methods decide on the same ones.

use std::ops::ControlFlow;

use anyhow::{Result, ensure};
use rayon::prelude::*;

use super::cost::instructions;
use super::method::Method;
use super::stress::Stress;
use super::tally::{Figures, Tally, Watched};
use super::truth::Truth;
use dtof_data::photons::source::PhotonSource;
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::slices::each_slice;

/// A method with its settings.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Index of the method.
    pub method: usize,
    /// The fewest photons of a peak, or the laser cycles of a frame.
    pub effort: u16,
    /// The settings for both.
    pub settings: Settings,
}

/// The outcome of a trial.
#[derive(Clone, Debug)]
pub struct TrialOutcome {
    /// The trial.
    pub trial: Trial,
    /// Times and errors.
    pub figures: Figures,
    /// Instructions a laser cycle and pixel.
    pub instructions: f64,
}

/// A trial under way.
struct Running<'a> {
    trial: &'a Trial,
    engine: Box<dyn Engine>,
    tally: Tally<'a>,
}

/// Runs all `trials` of `methods` on the photons of `source`, which are under `stress`. `progress` takes the share
/// that is done, 0 to 1.
///
/// # Errors
/// Fails if `progress` fails, if a trial is of no method, if settings are invalid, or if the photons cannot be read.
pub fn measure(
    source: &mut dyn PhotonSource,
    methods: &[Method],
    trials: &[Trial],
    truth: &Truth,
    stress: &Stress,
    progress: &dyn Fn(f64) -> Result<()>,
) -> Result<Vec<TrialOutcome>> {
    ensure!(
        trials.iter().all(|trial| trial.method < methods.len()),
        "a trial of a method that does not exist"
    );
    let array = source.array();
    let masked = trials
        .first()
        .map_or(&[][..], |trial| &trial.settings.masked);
    let addresses = source.addresses();
    let cycles = source.cycles();
    let running = trials.iter().map(|trial| {
        let settings = &trial.settings;
        Ok(Running {
            trial,
            engine: host_engine(settings, array, &addresses)?,
            tally: Tally::new(truth, stress, array, settings, cycles)?,
        })
    });
    let mut running: Vec<Running> = running.collect::<Result<_>>()?;
    let mut watched = vec![Watched::default(); array.pixels() as usize];
    let mut pixel_cycles = 0;
    each_slice(
        source,
        |slice| {
            running.par_iter_mut().try_for_each(|running| {
                let events = running.engine.run(slice)?;
                running.tally.add(&events);
                Ok(())
            })
        },
        |slice, (), done| {
            for (address, pixel) in addresses.iter().zip(&slice.pixels) {
                let here = u64::from(pixel.cycles);
                pixel_cycles += here;
                if !masked.contains(&address.raw()) && truth.has_target(*address, slice.first_cycle)
                {
                    let watched = &mut watched[usize::from(address.raw())];
                    if watched.cycles == 0 {
                        watched.from = slice.first_cycle;
                    }
                    watched.cycles += here;
                }
            }
            progress(done as f64 / cycles.max(1) as f64)?;
            Ok(ControlFlow::Continue(()))
        },
    )?;
    let outcomes = running.into_par_iter().map(|running| {
        let Running {
            trial,
            engine,
            tally,
        } = running;
        let method = &methods[trial.method];
        let figures = tally.finish(&watched);
        TrialOutcome {
            instructions: instructions(
                method,
                &trial.settings,
                &engine.statistics(),
                pixel_cycles.max(1),
            ),
            figures,
            trial: trial.clone(),
        }
    });
    Ok(outcomes.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::Array;
    use dtof_engine::settings::Settings;
    use dtof_light::demo;

    #[test]
    fn a_trial_of_a_method_that_does_not_exist_is_refused() {
        let mut source = demo::photons(Array::new(2, 2).unwrap(), 1, 10).unwrap();
        let trial = Trial {
            method: 0,
            effort: 5,
            settings: Settings::static_scene(1),
        };
        let truth = Truth::Ranges(Vec::new());
        let refused = measure(&mut source, &[], &[trial], &truth, &Stress::NONE, &|_| {
            Ok(())
        });
        let error = refused.unwrap_err().to_string();
        assert_eq!(error, "a trial of a method that does not exist");
    }
}

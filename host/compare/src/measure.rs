//! One pass over photons: every method decides on the same ones.

use anyhow::Result;
use rayon::prelude::*;

use super::cost::instructions;
use super::method::Method;
use super::stress::Stress;
use super::tally::{Figures, Tally};
use super::truth::Truth;
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_engine::slices::each_slice;
use dtof_photons::source::PhotonSource;

/// A method with its settings.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Its number among the methods.
    pub method: usize,
    /// Photons of a peak, at least, or laser cycles of a frame.
    pub effort: u16,
    /// The settings that it runs with.
    pub settings: Settings,
}

/// What a trial came to.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The trial.
    pub trial: Trial,
    /// How it did.
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

/// Runs all `trials` on the photons of `source`.
///
/// # Errors
/// What is wrong with the settings or the recording.
pub fn measure(
    source: &mut dyn PhotonSource,
    methods: &[Method],
    trials: &[Trial],
    truth: &Truth,
    stress: &Stress,
) -> Result<Vec<Outcome>> {
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
    let mut watched = vec![0; array.pixels() as usize];
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
        |slice, (), _| {
            for (address, pixel) in addresses.iter().zip(&slice.pixels) {
                let here = u64::from(pixel.cycles);
                pixel_cycles += here;
                if !masked.contains(&address.0) && truth.has_target(*address, slice.first_cycle) {
                    watched[usize::from(address.0)] += here;
                }
            }
            Ok(())
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
        Outcome {
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

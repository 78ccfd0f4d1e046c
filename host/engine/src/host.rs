//! `dtof-core` on this computer.

use anyhow::Result;
use dtof_core::{Array, Count8, Count10, CounterWidth, DepthEvent, PixelAddress, Statistics};

use super::Engine;
use super::decisions::{self, Decision};
use super::frame::FrameEngine;
use super::group::{Configs, Done, Group, sort};
use super::neighbours::NeighbourEngine;
use super::once::OnceEngine;
use super::once_per_bin::OncePerBinEngine;
use super::parallel::of_parts;
use crate::settings::Settings;
use crate::with_bins;
use dtof_photons::source::Slice;

/// Runs groups of pixels on all threads.
#[derive(Debug)]
struct HostEngine<const BINS: usize, W: CounterWidth> {
    configs: Configs<BINS>,
    groups: Vec<Group<BINS, W>>,
    /// The counts of all pixels, without the current exposures.
    pixels: Statistics,
    /// The counts of all blocks.
    blocks: Statistics,
}

/// An engine on this computer for the pixels `addresses` of an array.
///
/// # Errors
/// Fails if the settings break a constraint.
pub fn host_engine(
    settings: &Settings,
    array: Array,
    addresses: &[PixelAddress],
) -> Result<Box<dyn Engine>> {
    let engine = if settings.decide_once {
        OnceEngine::new(settings, array, addresses).map(|engine| Box::new(engine) as _)
    } else {
        with_bins!(settings.bins, BINS => match settings.counter_bits {
            8 => HostEngine::<BINS, Count8>::boxed(settings, array, addresses),
            _ => HostEngine::<BINS, Count10>::boxed(settings, array, addresses),
        })?
    }?;
    Ok(match settings.counts_once_per_bin() {
        true => Box::new(OncePerBinEngine::new(engine, settings.bins)),
        false => engine,
    })
}

impl<const BINS: usize, W: CounterWidth> HostEngine<BINS, W> {
    fn boxed(
        settings: &Settings,
        array: Array,
        addresses: &[PixelAddress],
    ) -> Result<Box<dyn Engine>> {
        if let Some(length) = settings.frame {
            return Ok(Box::new(FrameEngine::<BINS>::new(
                settings, length, addresses,
            )?));
        }
        Ok(match settings.neighbours {
            Some(neighbours) => Box::new(NeighbourEngine::<BINS, W>::new(
                settings, neighbours, array, addresses,
            )?),
            None => Box::new(Self::new(settings, array, addresses)?),
        })
    }

    fn new(settings: &Settings, array: Array, addresses: &[PixelAddress]) -> Result<Self> {
        let groups = match settings.binning {
            Some(binning) => Group::for_array(array, binning, addresses)?,
            None => {
                let numbered = addresses.iter().enumerate();
                numbered
                    .map(|(number, &address)| Group::single(number, address))
                    .collect()
            }
        };
        Ok(Self {
            configs: Configs {
                pixels: settings.config()?,
                blocks: settings.block_config()?,
                patience: settings.binning.map_or(0, |binning| binning.patience),
            },
            groups,
            pixels: Statistics::new(),
            blocks: Statistics::new(),
        })
    }
}

impl<const BINS: usize, W: CounterWidth> Engine for HostEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let configs = &self.configs;
        let parts = of_parts(&mut self.groups, 1, |_, groups| -> Vec<Done> {
            let groups = groups.iter_mut();
            groups
                .map(|group| group.run(configs, slice.first_cycle, &slice.pixels))
                .collect()
        });
        let mut events = Vec::new();
        for done in parts.into_iter().flatten() {
            events.extend(done.events);
            self.pixels += done.pixels;
            self.blocks += done.blocks;
        }
        sort(&mut events, slice.first_cycle);
        Ok(events)
    }

    fn statistics(&self) -> [Statistics; 2] {
        let [mut pixels, mut blocks] = [self.pixels, self.blocks];
        for group in &self.groups {
            group.add_photons_to(&mut pixels, &mut blocks);
        }
        [pixels, blocks]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for group in &mut self.groups {
            group.keep_decisions(is_kept);
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        let mut all = Vec::new();
        for group in &self.groups {
            all.extend(group.decisions());
        }
        decisions::sort(&mut all);
        all
    }
}

#[cfg(test)]
mod tests;

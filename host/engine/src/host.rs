//! `dtof-core` on this computer.

use anyhow::Result;
use dtof_core::{Array, Count8, Count10, CounterWidth, PixelAddress};

use super::Engine;
use super::alone::LoneEngine;
use super::array::ArrayEngine;
use super::frame::FrameEngine;
use super::once::OnceEngine;
use super::once_per_bin::OncePerBinEngine;
use crate::settings::Settings;
use crate::with_bins;

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
            8 => asynchronous::<BINS, Count8>(settings, array, addresses),
            _ => asynchronous::<BINS, Count10>(settings, array, addresses),
        })?
    }?;
    Ok(match settings.counts_once_per_bin() {
        true => Box::new(OncePerBinEngine::new(engine, settings.bins)),
        false => engine,
    })
}

fn asynchronous<const BINS: usize, W: CounterWidth + Sync + 'static>(
    settings: &Settings,
    array: Array,
    addresses: &[PixelAddress],
) -> Result<Box<dyn Engine>> {
    type Arrays<const BINS: usize, W> = ArrayEngine<BINS, W>;
    Ok(
        match (
            settings.frame,
            settings.configuration.neighbours,
            settings.configuration.binning,
        ) {
            (Some(length), ..) => Box::new(FrameEngine::<BINS>::new(settings, length, addresses)?),
            (None, Some(_), _) => Box::new(Arrays::<BINS, W>::with_neighbours(
                settings, array, addresses,
            )?),
            (None, None, Some(binning)) => Box::new(Arrays::<BINS, W>::with_blocks(
                settings, binning, array, addresses,
            )?),
            (None, None, None) => {
                Box::new(LoneEngine::<BINS, W>::new(settings.config()?, addresses))
            }
        },
    )
}

#[cfg(test)]
mod tests;

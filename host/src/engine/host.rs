//! The core on this computer.

use anyhow::{Result, bail};
use dtof_core::{
    AnyRule, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig, Statistics,
};
use rayon::prelude::*;

use super::Engine;
use super::frame::FrameEngine;
use crate::engine::settings::Settings;
use crate::input::source::{PixelPhotons, Slice};

/// `dtof-core` on this computer, pixels spread over its threads.
#[derive(Debug)]
struct HostEngine<const BINS: usize> {
    config: PixelConfig<BINS, AnyRule>,
    pixels: Vec<AsyncPixel<BINS>>,
    /// Of all pixels, without the exposures that have not ended.
    statistics: Statistics,
}

/// An engine on this computer for the pixels `addresses`.
///
/// # Errors
/// The constraint the settings break.
pub fn host_engine(settings: &Settings, addresses: &[PixelAddress]) -> Result<Box<dyn Engine>> {
    Ok(match settings.bins {
        8 => HostEngine::<8>::boxed(settings, addresses)?,
        16 => HostEngine::<16>::boxed(settings, addresses)?,
        32 => HostEngine::<32>::boxed(settings, addresses)?,
        64 => HostEngine::<64>::boxed(settings, addresses)?,
        128 => HostEngine::<128>::boxed(settings, addresses)?,
        256 => HostEngine::<256>::boxed(settings, addresses)?,
        512 => HostEngine::<512>::boxed(settings, addresses)?,
        1024 => HostEngine::<1024>::boxed(settings, addresses)?,
        bins => bail!("{bins} bins: must be a power of two from 8 to 1024"),
    })
}

impl<const BINS: usize> HostEngine<BINS> {
    fn boxed(settings: &Settings, addresses: &[PixelAddress]) -> Result<Box<dyn Engine>> {
        if let Some(length) = settings.frame {
            return Ok(Box::new(FrameEngine::<BINS>::new(
                settings, length, addresses,
            )?));
        }
        Ok(Box::new(Self {
            config: settings.config()?,
            pixels: addresses.iter().copied().map(AsyncPixel::new).collect(),
            statistics: Statistics::new(),
        }))
    }
}

impl<const BINS: usize> Engine for HostEngine<BINS> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let config = &self.config;
        let of_pixels: Vec<(Vec<DepthEvent>, Statistics)> = self
            .pixels
            .par_iter_mut()
            .zip(&slice.pixels)
            .map(|(pixel, received)| run_pixel(pixel, config, slice.first_cycle, received))
            .collect();
        let mut events = Vec::new();
        for (of_pixel, statistics) in of_pixels {
            events.extend(of_pixel);
            self.statistics += statistics;
        }
        events.sort_unstable_by_key(|event| (event.cycle, event.pixel));
        Ok(events)
    }

    fn statistics(&self) -> Statistics {
        let mut sum = self.statistics;
        for pixel in &self.pixels {
            pixel.add_photons_to(&mut sum);
        }
        sum
    }
}

/// One pixel through one slice, whose link takes each event at once: its events, and what
/// it has done.
fn run_pixel<const BINS: usize>(
    pixel: &mut AsyncPixel<BINS>,
    config: &PixelConfig<BINS, AnyRule>,
    first_cycle: u64,
    received: &PixelPhotons,
) -> (Vec<DepthEvent>, Statistics) {
    let (mut events, mut statistics) = (Vec::new(), Statistics::new());
    let mut photons = received.photons.iter().peekable();
    for cycle in 0..received.cycles {
        while let Some(photon) = photons.next_if(|photon| photon.cycle == cycle) {
            pixel.count(config, photon.code);
        }
        let now = LaserCycle(first_cycle + u64::from(cycle));
        pixel.end_laser_cycle(config, &mut statistics, now);
        events.extend(pixel.acknowledge());
    }
    (events, statistics)
}

//! Pixels that decide alone: each runs a slice at once, on any thread.
//!
//! Looks that find nothing for want of a photon are skipped, so that dark laser cycles cost nothing.

use anyhow::Result;
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, AsyncPixel, CounterWidth, DepthEvent, LaserCycle, Look, PixelAddress, PixelConfig,
    Statistics,
};

use super::Engine;
use super::decisions::{Decision, LastDecision};
use super::parallel::of_parts;
use dtof_data::photons::source::{PixelPhotons, Slice};

#[derive(Debug)]
struct LonePixel<const BINS: usize, W: CounterWidth> {
    pixel: AsyncPixel<BINS, W>,
    since_look: u16,
    /// The last look found nothing, and no photon has come since.
    is_dark: bool,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision>>,
}

/// The engine.
#[derive(Debug)]
pub struct LoneEngine<const BINS: usize, W: CounterWidth> {
    config: PixelConfig<BINS, AnyRule>,
    pixels: Vec<LonePixel<BINS, W>>,
    /// Without the current exposures.
    statistics: Statistics,
}

impl<const BINS: usize, W: CounterWidth> LonePixel<BINS, W> {
    fn new(address: PixelAddress) -> Self {
        Self {
            pixel: AsyncPixel::new(address),
            since_look: 0,
            is_dark: false,
            last: None,
        }
    }

    /// Runs a slice that begins with laser cycle `first`. Events are taken at once. The photons up to the first look that
    /// may find something are counted at once.
    fn run(
        &mut self,
        config: &PixelConfig<BINS, AnyRule>,
        first: u64,
        received: &PixelPhotons,
        events: &mut Vec<DepthEvent>,
        statistics: &mut Statistics,
    ) {
        let mut photons = &received.photons[..];
        let mut cycle = 0;
        while cycle < received.cycles {
            let next = photons.first();
            let next = next.map_or(received.cycles, |photon| photon.cycle) - cycle;
            // Photons before L1 may wait for the first look after it.
            let early = config.l1().saturating_sub(self.pixel.exposure());
            let dark = match self.is_dark || early > 0 {
                true => self.pixel.dark_cycles(config, false).min(next),
                false => 0,
            };
            let step = self.step(config.x(), dark.max(early), received.cycles - cycle);
            cycle += step;
            self.is_dark &= step <= next;
            while let Some((photon, later)) = photons.split_first()
                && photon.cycle < cycle
            {
                self.pixel.count(config, photon.code);
                photons = later;
            }
            let last = LaserCycle::new(first + u64::from(cycle) - 1);
            self.end_laser_cycles(config, last, step, events, statistics);
        }
    }

    /// The laser cycles up to and with the first look after more than `dark` of them. If only `left` ones are left, up to
    /// the last look of these, or else all.
    fn step(&self, x: u16, dark: u16, left: u16) -> u16 {
        let (since, x) = (u32::from(self.since_look), u32::from(x));
        let to_look = (since + u32::from(dark)) / x * x + x - since;
        let to_last_look = (since + u32::from(left)) / x * x;
        match u16::try_from(to_look) {
            Ok(to_look) if to_look <= left => to_look,
            _ => match to_last_look.checked_sub(since) {
                Some(cycles) if cycles > 0 => u16::try_from(cycles).unwrap_or(left),
                _ => left,
            },
        }
    }

    fn end_laser_cycles(
        &mut self,
        config: &PixelConfig<BINS, AnyRule>,
        last: LaserCycle,
        cycles: u16,
        events: &mut Vec<DepthEvent>,
        statistics: &mut Statistics,
    ) {
        let kept = &mut self.last;
        let observe = |input: &DecisionInput<'_, BINS, _>| {
            if let Some(kept) = kept {
                kept.record_input(input);
            }
        };
        let blind_looks = statistics.blind_looks;
        let pixel = &mut self.pixel;
        let look = pixel.end_laser_cycles_with(config, statistics, last, cycles, observe);
        if look == Look::NotDue {
            // Only the end of a slice.
            self.since_look += cycles;
            return;
        }
        self.since_look = 0;
        self.is_dark = look == Look::NoPeak && statistics.blind_looks == blind_looks;
        if let Some(event) = self.pixel.take_event() {
            if let Some(kept) = &mut self.last {
                kept.record_event(event);
            }
            events.push(event);
        }
    }
}

impl<const BINS: usize, W: CounterWidth> LoneEngine<BINS, W> {
    /// An engine for these pixels.
    #[must_use]
    pub fn new(config: PixelConfig<BINS, AnyRule>, addresses: &[PixelAddress]) -> Self {
        Self {
            config,
            pixels: addresses.iter().copied().map(LonePixel::new).collect(),
            statistics: Statistics::new(),
        }
    }
}

impl<const BINS: usize, W: CounterWidth> Engine for LoneEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let config = &self.config;
        let parts = of_parts(&mut self.pixels, 1, |number, pixels| {
            let (mut events, mut statistics) = (Vec::new(), Statistics::new());
            for (pixel, received) in pixels.iter_mut().zip(&slice.pixels[number..]) {
                let first = slice.first_cycle;
                pixel.run(config, first, received, &mut events, &mut statistics);
            }
            (events, statistics)
        });
        let mut all = Vec::new();
        for (events, statistics) in parts {
            all.extend(events);
            self.statistics += statistics;
        }
        sort(&mut all, slice.first_cycle);
        Ok(all)
    }

    fn statistics(&self) -> [Statistics; 2] {
        let mut statistics = self.statistics;
        for pixel in &self.pixels {
            pixel.pixel.add_photons_to(&mut statistics);
        }
        [statistics, Statistics::new()]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for pixel in &mut self.pixels {
            pixel.last = LastDecision::allocate(is_kept(pixel.pixel.address()));
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        let kept = self.pixels.iter().filter_map(|pixel| pixel.last.as_ref());
        kept.filter_map(|last| last.decision()).collect()
    }
}

/// Sorts by laser cycle, level and pixel. Not generic, so that it is compiled once.
pub(super) fn sort(events: &mut [DepthEvent], first_cycle: u64) {
    // One number compares faster than three.
    events.sort_unstable_by_key(|event| {
        let cycle = event.cycle.raw() - first_cycle;
        cycle << 24 | u64::from(event.level.raw()) << 16 | u64::from(event.pixel.raw())
    });
}

#[cfg(test)]
mod tests;

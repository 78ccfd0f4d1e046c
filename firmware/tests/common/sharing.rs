//! Pixels and blocks of them, written from the description of adaptive binning: who is silent
//! for a patience counts in the block around it as well.

use std::collections::BTreeMap;

use dtof_core::{
    AnyRule, AsyncPixel, BlockLevel, Count16, DepthEvent, LaserCycle, Look, PixelAddress,
    PixelConfig, RangeGate, Statistics,
};
use dtof_link::Configuration;
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::host::Call;

/// Photons of pixels that see a bright surface, a dim one in front of another, or nothing.
/// Now and then some empty laser cycles follow.
pub fn script(length: usize, pixels: u16, rng: &mut Pcg32) -> Vec<Vec<Call>> {
    let mut cycle = || {
        let mut calls = Vec::new();
        for pixel in 0..pixels {
            // Of 256.
            let (near, far) = [(90, 0), (30, 30), (12, 12), (0, 0)][usize::from(pixel % 4)];
            let random = rng.next_u32();
            let blurred = (random >> 24) as u16 % 3;
            for (chance, code) in [
                (near, 30 + blurred),
                (far, 80 + blurred),
                (24, (random >> 16) as u16 % 130),
            ] {
                if rng.next_u32() % 256 < chance {
                    calls.push(Call::Photon(pixel, code));
                }
            }
        }
        let is_last_of_ten = rng.next_u32().is_multiple_of(10);
        calls.push(Call::End(if is_last_of_ten { 7 } else { 1 }));
        calls
    };
    (0..length).map(|_| cycle()).collect()
}

/// What feeds a block, or is one.
struct Cell<W: dtof_core::CounterWidth> {
    pixel: AsyncPixel<128, W>,
    has_reported: bool,
    feeds: bool,
}

impl<W: dtof_core::CounterWidth> Cell<W> {
    fn new(first: usize) -> Self {
        Self {
            pixel: AsyncPixel::new(PixelAddress::new(first.try_into().unwrap())),
            has_reported: false,
            feeds: false,
        }
    }

    fn end(
        &mut self,
        config: &PixelConfig<128, AnyRule>,
        statistics: &mut Statistics,
        cycle: u64,
    ) -> Option<DepthEvent> {
        let cycle = LaserCycle::new(cycle);
        let look = self.pixel.end_laser_cycle(config, statistics, cycle);
        let event = self.pixel.take_event();
        assert_eq!(look == Look::Event, event.is_some());
        // An exposure with an echo has ended: the pixel is not silent.
        let has_reported = matches!(look, Look::Event | Look::Ended);
        self.has_reported |= has_reported;
        self.feeds &= !has_reported;
        event
    }

    fn tick(&mut self) {
        // An exposure that goes on after its first echo is not silent.
        self.feeds = !self.has_reported && !self.pixel.has_reported();
        self.has_reported = false;
    }
}

/// What pixels and blocks have done whose events leave at once.
#[derive(Default)]
pub struct Expected {
    pub events: Vec<DepthEvent>,
    pub pixels: Statistics,
    pub blocks: Statistics,
}

/// The same for pixels and for blocks, whose rule may be another.
pub fn configs(requested: &Configuration) -> [PixelConfig<128, AnyRule>; 2] {
    let gate = RangeGate::new(requested.gate.0, requested.gate.1).unwrap();
    let levels = requested.binning.map_or(BlockLevel::PIXEL, |of| of.levels);
    [requested.rule, requested.rule.of_blocks(levels)].map(|rule| {
        let config = PixelConfig::with_rule(rule).x(requested.x).l1(requested.l1);
        let config = config
            .l2(requested.l2)
            .gate(gate)
            .estimator(requested.estimator);
        let config = config
            .echoes(requested.echoes, requested.echo_guard_bins)
            .echo_wait(requested.echo_wait);
        let tracking = rule.tracking(&gate).filter(|_| requested.tracking);
        config.tracking(tracking).build().unwrap()
    })
}

/// The events of all, in order.
pub fn expected(script: &[Vec<Call>], requested: &Configuration) -> Expected {
    let [of_pixels, of_blocks] = configs(requested);
    let columns = usize::from(requested.columns);
    let binning = requested.binning.unwrap();
    let levels = usize::from(binning.levels.raw());
    // Level, row and column of a block; ticks when all look.
    let block_of = |pixel: usize, level: usize| {
        (
            level,
            (pixel / columns) >> level,
            (pixel % columns) >> level,
        )
    };
    let tick = u64::from(binning.patience.next_multiple_of(requested.x));

    let mut pixels: Vec<Cell<_>> = Vec::new();
    let mut blocks: BTreeMap<_, Cell<Count16>> = BTreeMap::new();
    for pixel in 0..usize::from(requested.pixels) {
        pixels.push(Cell::<dtof_core::Count10>::new(pixel));
        for level in 1..=levels {
            // The first pixel of a block is the first to come.
            let block = blocks.entry(block_of(pixel, level));
            block.or_insert_with(|| Cell::new(pixel));
        }
    }
    let mut done = Expected::default();
    let mut cycle = 0;
    for call in script.iter().flatten() {
        match *call {
            Call::Photon(pixel, code) => {
                let pixel = usize::from(pixel);
                pixels[pixel].pixel.count(&of_pixels, code);
                let mut feeds = pixels[pixel].feeds;
                for level in 1..=levels {
                    let block = blocks.get_mut(&block_of(pixel, level)).unwrap();
                    if feeds {
                        block.pixel.count(&of_blocks, code);
                    }
                    feeds &= block.feeds;
                }
            }
            Call::End(cycles) => {
                for _ in 0..cycles {
                    for pixel in &mut pixels {
                        let event = pixel.end(&of_pixels, &mut done.pixels, cycle);
                        done.events.extend(event);
                    }
                    for (&(level, ..), block) in &mut blocks {
                        let event = block.end(&of_blocks, &mut done.blocks, cycle);
                        let level = BlockLevel::saturating(level.try_into().unwrap());
                        done.events
                            .extend(event.map(|event| DepthEvent { level, ..event }));
                    }
                    cycle += 1;
                    if cycle.is_multiple_of(tick) {
                        pixels.iter_mut().for_each(Cell::tick);
                        blocks.values_mut().for_each(Cell::tick);
                    }
                }
            }
            Call::Frame(_) | Call::Histogram(..) => unreachable!(),
        }
    }
    for cell in &pixels {
        cell.pixel.add_photons_to(&mut done.pixels);
    }
    for cell in blocks.values() {
        cell.pixel.add_photons_to(&mut done.blocks);
    }
    done
}

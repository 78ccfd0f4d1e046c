//! Pixels that decide together: a single one, or those of a block of the highest level with all its
//! blocks. Groups are independent, so each may run on its own thread.

use anyhow::{Context, Result};
use dtof_core::binning::{
    Binning, Block, BlockLink, BlockPlace, count_in_blocks, end_laser_cycles_of_blocks_with,
};
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, Array, AsyncPixel, BlockLevel, Count16, CounterWidth, DepthEvent, EchoNumber,
    LaserCycle, Look, PixelAddress, PixelConfig, Statistics,
};
use dtof_link::AdaptiveBinning;

use super::decisions::{Decision, LastDecision};
use dtof_photons::source::PixelPhotons;

/// The configurations of pixels and blocks.
#[derive(Clone, Copy, Debug)]
pub struct Configs<const BINS: usize> {
    /// Of pixels.
    pub pixels: PixelConfig<BINS, AnyRule>,
    /// Of blocks.
    pub blocks: PixelConfig<BINS, AnyRule>,
    /// Laser cycles between ticks.
    pub patience: u16,
}

/// A pixel of a group.
#[derive(Clone, Debug)]
struct Member<const BINS: usize, W: CounterWidth> {
    /// Its index among the pixels of the source.
    number: usize,
    pixel: AsyncPixel<BINS, W>,
    link: Option<BlockLink>,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision<BINS>>>,
}

impl<const BINS: usize, W: CounterWidth> Member<BINS, W> {
    /// Runs a single pixel, `since_look` laser cycles after its last look. Looks before L1 decide
    /// nothing, and a look without a new photon decides as the last did, so the photons up to the first
    /// look that can decide otherwise are counted at once.
    fn run(
        &mut self,
        configs: &Configs<BINS>,
        first: u64,
        received: &PixelPhotons,
        since_look: &mut u16,
        done: &mut Done,
    ) {
        let (config, x) = (&configs.pixels, configs.pixels.x());
        // With a dead time, or after an echo, a decision depends on the laser cycles, too.
        let by_photons = !config.weighs_dead_time() && config.echoes() == EchoNumber::FIRST;
        let mut has_no_peak = false;
        let mut photons = &received.photons[..];
        let mut cycle = 0;
        while cycle < received.cycles {
            let left = received.cycles - cycle;
            let mut cycles = x - *since_look;
            let exposure = self.pixel.exposure();
            let mut early = config.l1().saturating_sub(exposure);
            if has_no_peak && by_photons {
                let next = photons
                    .first()
                    .map_or(received.cycles, |photon| photon.cycle);
                early = (next - cycle).min(config.l2() - 1 - exposure);
            }
            if early >= cycles {
                cycles = cycles
                    .saturating_add((early - cycles) / x * x)
                    .saturating_add(x);
            }
            if cycles > left {
                // Up to the last look in the slice, if there is one, and then to its end.
                let after_look = after(*since_look, left, x);
                cycles = if left > after_look {
                    left - after_look
                } else {
                    left
                };
            }
            cycle += cycles;
            while let Some((photon, later)) = photons.split_first()
                && photon.cycle < cycle
            {
                self.pixel.count(config, photon.code);
                photons = later;
            }
            let last = LaserCycle::new(first + u64::from(cycle) - 1);
            let look = self.end_laser_cycles(config, done, last, cycles);
            has_no_peak = look == Look::NoPeak;
            *since_look = match look {
                Look::NotDue => *since_look + cycles,
                _ => 0,
            };
        }
    }

    /// Ends `cycles` laser cycles, up to `last`. Takes the event at once.
    fn end_laser_cycles(
        &mut self,
        config: &PixelConfig<BINS, AnyRule>,
        done: &mut Done,
        last: LaserCycle,
        cycles: u16,
    ) -> Look {
        let kept = &mut self.last;
        let observe = |input: &DecisionInput<'_, BINS, _>| {
            if let Some(kept) = kept {
                kept.record_input(input);
            }
        };
        let look =
            self.pixel
                .end_laser_cycles_with(config, &mut done.pixels, last, cycles, observe);
        if let Some(event) = self.pixel.take_event() {
            if let Some(kept) = &mut self.last {
                kept.record_event(event);
            }
            done.events.push(event);
        }
        look
    }
}

/// Laser cycles since the last look, `cycles` later, with a look every `x`.
fn after(since_look: u16, cycles: u16, x: u16) -> u16 {
    let rest = (u32::from(since_look) + u32::from(cycles)) % u32::from(x);
    u16::try_from(rest).unwrap_or(0)
}

/// Pixels and blocks in the order in which they report.
#[derive(Clone, Debug)]
pub struct Group<const BINS: usize, W: CounterWidth> {
    members: Vec<Member<BINS, W>>,
    blocks: Vec<Block<BINS>>,
    /// The last decision of each block, if it is kept.
    block_decisions: Vec<Option<Box<LastDecision<BINS>>>>,
    /// Laser cycles since the last look, and of blocks since the last tick.
    since_look: u16,
    since_tick: u16,
}

/// The events and counts of a group in a slice.
#[derive(Clone, Debug, Default)]
pub struct Done {
    /// In no particular order.
    pub events: Vec<DepthEvent>,
    /// Counts of its pixels.
    pub pixels: Statistics,
    /// Counts of its blocks.
    pub blocks: Statistics,
}

impl<const BINS: usize, W: CounterWidth> Group<BINS, W> {
    /// A single pixel with its index among the pixels of the source.
    #[must_use]
    pub fn single(number: usize, address: PixelAddress) -> Self {
        let member = Member {
            number,
            pixel: AsyncPixel::new(address),
            link: None,
            last: None,
        };
        Self {
            members: vec![member],
            blocks: Vec::new(),
            block_decisions: Vec::new(),
            since_look: 0,
            since_tick: 0,
        }
    }

    /// The groups of an array whose pixels `addresses` exist, ascending.
    ///
    /// # Errors
    /// Fails if there are no levels of blocks.
    pub fn for_array(
        array: Array,
        binning: AdaptiveBinning,
        addresses: &[PixelAddress],
    ) -> Result<Vec<Self>> {
        let top = binning.levels;
        let groups = (0..array.blocks(top)).map(|block| {
            let pixels: Vec<PixelAddress> =
                array.pixels_of(array.first_of(block, top), top).collect();
            Self::for_block(array, top, &pixels, addresses)
        });
        groups.collect()
    }

    /// The pixels of one block of the highest level, row by row.
    fn for_block(
        array: Array,
        top: BlockLevel,
        pixels: &[PixelAddress],
        addresses: &[PixelAddress],
    ) -> Result<Self> {
        // Addresses as if the block were an array.
        let row = |pixel: &PixelAddress| u32::from(pixel.raw()) / array.columns();
        let rows = match pixels {
            [first, .., last] => row(last) - row(first) + 1,
            _ => 1,
        };
        let columns = u32::try_from(pixels.len())? / rows;
        let part = Array::new(columns, rows).context("a block without pixels")?;
        let binning = Binning::new(part, top).context("an array without blocks")?;
        let local = (0..=u16::MAX).map(PixelAddress::new);
        let members = local.zip(pixels).filter_map(|(local, &address)| {
            let number = addresses.binary_search(&address).ok()?;
            Some(Member {
                number,
                pixel: AsyncPixel::new(address),
                link: Some(binning.link_of(local)),
                last: None,
            })
        });
        let blocks = binning.blocks().map(|place| {
            Block::new(BlockPlace {
                first: pixels[usize::from(place.first.raw())],
                ..place
            })
        });
        let blocks: Vec<_> = blocks.collect();
        Ok(Self {
            members: members.collect(),
            block_decisions: vec![None; blocks.len()],
            blocks,
            since_look: 0,
            since_tick: 0,
        })
    }

    /// Runs a slice that begins with laser cycle `first`. Events are taken at once.
    pub fn run(&mut self, configs: &Configs<BINS>, first: u64, photons: &[PixelPhotons]) -> Done {
        let mut done = Done::default();
        if let ([member], []) = (&mut self.members[..], &self.blocks[..]) {
            let photons = &photons[member.number];
            member.run(configs, first, photons, &mut self.since_look, &mut done);
            return done;
        }
        let photons_of = |member: &Member<BINS, W>| &photons[member.number];
        let cycles = self.members.iter().map(|member| photons_of(member).cycles);
        let cycles = cycles.max().unwrap_or(0);
        let mut next = vec![0; self.members.len()];
        for cycle in 0..cycles {
            let now = LaserCycle::new(first + u64::from(cycle));
            for (member, next) in self.members.iter_mut().zip(&mut next) {
                let received = &photons[member.number];
                while let Some(photon) = received.photons.get(*next)
                    && photon.cycle == cycle
                {
                    *next += 1;
                    member.pixel.count(&configs.pixels, photon.code);
                    if let Some(link) = &member.link {
                        count_in_blocks(&mut self.blocks, link, &configs.blocks, photon.code);
                    }
                }
                if cycle < received.cycles {
                    let look = member.end_laser_cycles(&configs.pixels, &mut done, now, 1);
                    // It is not silent: it reports, or has reported in this exposure.
                    let has_reported = matches!(look, Look::Event | Look::Ended);
                    if let Some(link) = member.link.as_mut().filter(|_| has_reported) {
                        link.reported();
                    }
                }
            }
            if !self.blocks.is_empty() {
                self.end_laser_cycle_of_blocks(configs, now, &mut done);
            }
        }
        done
    }

    fn end_laser_cycle_of_blocks(
        &mut self,
        configs: &Configs<BINS>,
        now: LaserCycle,
        done: &mut Done,
    ) {
        let (blocks, statistics) = (&mut self.blocks, &mut done.blocks);
        let block_decisions = &mut self.block_decisions;
        let observe = |number: usize, input: &DecisionInput<'_, BINS, Count16>| {
            if let Some(Some(last)) = block_decisions.get_mut(number) {
                last.record_input(input);
            }
        };
        if end_laser_cycles_of_blocks_with(blocks, &configs.blocks, statistics, now, 1, observe) {
            for (block, last) in blocks.iter_mut().zip(block_decisions) {
                let Some(event) = block.take_event() else {
                    continue;
                };
                if let Some(last) = last {
                    last.record_event(event);
                }
                done.events.push(event);
            }
        }
        self.since_look += 1;
        if self.since_look < configs.pixels.x() {
            return;
        }
        self.since_tick = self.since_tick.saturating_add(self.since_look);
        self.since_look = 0;
        if self.since_tick >= configs.patience {
            self.since_tick = 0;
            for member in &mut self.members {
                if let Some(link) = &mut member.link {
                    link.tick(member.pixel.has_reported());
                }
            }
            self.blocks.iter_mut().for_each(Block::tick);
        }
    }

    /// Keeps the last decision of pixels for which `is_kept` is true, and of blocks that begin with
    /// one.
    pub fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for member in &mut self.members {
            member.last = LastDecision::allocate(is_kept(member.pixel.address()));
        }
        for (block, last) in self.blocks.iter().zip(&mut self.block_decisions) {
            *last = LastDecision::allocate(is_kept(block.pixel().address()));
        }
    }

    /// The decisions that were kept.
    pub fn decisions(&self) -> impl Iterator<Item = Decision> {
        let of_members = self.members.iter().map(|member| &member.last);
        let all = of_members.chain(&self.block_decisions).flatten();
        all.filter_map(|last| last.decision())
    }

    /// Adds the photons of exposures that have not ended.
    pub fn add_photons_to(&self, pixels: &mut Statistics, blocks: &mut Statistics) {
        for member in &self.members {
            member.pixel.add_photons_to(pixels);
        }
        for block in &self.blocks {
            block.pixel().add_photons_to(blocks);
        }
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

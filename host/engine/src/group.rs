//! Pixels that decide together: a single one, or those of a block of the highest level with all its
//! blocks. Groups are independent, so each may run on its own thread.

use anyhow::{Context, Result};
use dtof_core::binning::{Binning, Block, BlockLink, BlockPlace, count_in_blocks};
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, Array, AsyncPixel, BlockLevel, CounterWidth, DepthEvent, LaserCycle, Look,
    PixelAddress, PixelConfig, Statistics,
};
use dtof_link::AdaptiveBinning;

use super::decisions::{Decision, LastDecision};
use super::jump::{after, has_too_few_photons, idle_cycles, look_after, within};
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
    /// The last look found no peak, and a later one does not without a photon. None has come since.
    has_no_peak: bool,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision<BINS>>>,
}

/// A block of a group.
type BlockMember<const BINS: usize> = Block<BINS, OfBlock<BINS>>;

/// What is kept beside a block.
#[derive(Clone, Debug, Default)]
struct OfBlock<const BINS: usize> {
    /// The photons of the last look, if it found no peak.
    without_peak: Option<u32>,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision<BINS>>>,
}

/// A pixel or a block, which looks for itself while no photon comes.
trait Looks<const BINS: usize> {
    /// Laser cycles from now on in which its looks decide nothing.
    fn idle_cycles(&self, configs: &Configs<BINS>) -> u16;

    /// Ends `cycles` laser cycles, up to `last`. Takes the event at once.
    fn end_laser_cycles(
        &mut self,
        configs: &Configs<BINS>,
        done: &mut Done,
        last: LaserCycle,
        cycles: u16,
    ) -> Look;

    /// Ends `cycles` laser cycles from `first` on, whose photons are counted: they are all in those up to the first look.
    fn advance(
        &mut self,
        configs: &Configs<BINS>,
        done: &mut Done,
        first: u64,
        cycles: u16,
        mut since_look: u16,
    ) {
        let (x, mut ended) = (configs.pixels.x(), 0);
        while ended < cycles {
            let idle = self.idle_cycles(configs).into();
            let step = look_after(idle, since_look, x);
            let step = within(cycles - ended, step, since_look, x);
            ended += step;
            let last = LaserCycle::new(first + u64::from(ended) - 1);
            self.end_laser_cycles(configs, done, last, step);
            since_look = after(since_look, step, x);
        }
    }
}

impl<const BINS: usize, W: CounterWidth> Member<BINS, W> {
    fn new(number: usize, address: PixelAddress, link: Option<BlockLink>) -> Self {
        Self {
            number,
            pixel: AsyncPixel::new(address),
            link,
            has_no_peak: false,
            last: None,
        }
    }

    /// Runs a single pixel, `since_look` laser cycles after its last look. The photons up to the first look that can
    /// decide otherwise than the last are counted at once.
    fn run(
        &mut self,
        configs: &Configs<BINS>,
        first: u64,
        received: &PixelPhotons,
        since_look: &mut u16,
        done: &mut Done,
    ) {
        let (config, x) = (&configs.pixels, configs.pixels.x());
        let mut photons = &received.photons[..];
        let mut cycle = 0;
        while cycle < received.cycles {
            let next = photons.first();
            let next = next.map_or(received.cycles, |photon| photon.cycle) - cycle;
            // Photons before L1 may wait for the first look after it.
            let early = config.l1().saturating_sub(self.pixel.exposure());
            let idle = self.idle_cycles(configs).min(next).max(early);
            let step = look_after(idle.into(), *since_look, x);
            let step = within(received.cycles - cycle, step, *since_look, x);
            cycle += step;
            if next < step {
                self.has_no_peak = false;
            }
            while let Some((photon, later)) = photons.split_first()
                && photon.cycle < cycle
            {
                self.pixel.count(config, photon.code);
                photons = later;
            }
            let last = LaserCycle::new(first + u64::from(cycle) - 1);
            self.end_laser_cycles(configs, done, last, step);
            *since_look = after(*since_look, step, x);
        }
    }
}

impl<const BINS: usize, W: CounterWidth> Looks<BINS> for Member<BINS, W> {
    fn idle_cycles(&self, configs: &Configs<BINS>) -> u16 {
        let config = &configs.pixels;
        let is_empty = self.pixel.histogram().total() == 0 && !config.weighs_dead_time();
        idle_cycles(&self.pixel, config, self.has_no_peak || is_empty)
    }

    fn end_laser_cycles(
        &mut self,
        configs: &Configs<BINS>,
        done: &mut Done,
        last: LaserCycle,
        cycles: u16,
    ) -> Look {
        let (config, kept, statistics) = (&configs.pixels, &mut self.last, &mut done.pixels);
        let observe = |input: &DecisionInput<'_, BINS, _>| {
            if let Some(kept) = kept {
                kept.record_input(input);
            }
        };
        let blind_looks = statistics.blind_looks;
        let pixel = &mut self.pixel;
        let look = pixel.end_laser_cycles_with(config, statistics, last, cycles, observe);
        match look {
            // Only the end of a slice.
            Look::NotDue => {}
            Look::NoPeak if config.weighs_dead_time() => {
                let is_blind = statistics.blind_looks > blind_looks;
                self.has_no_peak = !is_blind && has_too_few_photons(pixel, config);
            }
            look => self.has_no_peak = look == Look::NoPeak,
        }
        // It is not silent: it reports, or has reported in this exposure.
        let has_reported = matches!(look, Look::Event | Look::Ended);
        if let Some(link) = self.link.as_mut().filter(|_| has_reported) {
            link.reported();
        }
        if let Some(event) = self.pixel.take_event() {
            if let Some(kept) = &mut self.last {
                kept.record_event(event);
            }
            done.events.push(event);
        }
        look
    }
}

/// The photons that a block decides on: more whenever one comes.
fn photons<const BINS: usize>(block: &BlockMember<BINS>) -> u32 {
    let histogram = block.pixel().histogram();
    histogram.total().wrapping_add(histogram.saturated())
}

impl<const BINS: usize> Looks<BINS> for BlockMember<BINS> {
    fn idle_cycles(&self, configs: &Configs<BINS>) -> u16 {
        let photons = photons(self);
        let has_no_peak = photons == 0 || self.data.without_peak == Some(photons);
        idle_cycles(self.pixel(), &configs.blocks, has_no_peak)
    }

    fn end_laser_cycles(
        &mut self,
        configs: &Configs<BINS>,
        done: &mut Done,
        last: LaserCycle,
        cycles: u16,
    ) -> Look {
        let (config, statistics) = (&configs.blocks, &mut done.blocks);
        let mut kept = self.data.last.take();
        let observe = |input: &DecisionInput<'_, BINS, _>| {
            if let Some(kept) = &mut kept {
                kept.record_input(input);
            }
        };
        let look = self.end_laser_cycles_with(config, statistics, last, cycles, observe);
        if look != Look::NotDue {
            self.data.without_peak = (look == Look::NoPeak).then(|| photons(self));
        }
        if let Some(event) = self.take_event() {
            if let Some(kept) = &mut kept {
                kept.record_event(event);
            }
            done.events.push(event);
        }
        self.data.last = kept;
        look
    }
}

/// Pixels and blocks in the order in which they report.
#[derive(Clone, Debug)]
pub struct Group<const BINS: usize, W: CounterWidth> {
    members: Vec<Member<BINS, W>>,
    blocks: Vec<BlockMember<BINS>>,
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
        Self {
            members: vec![Member::new(number, address, None)],
            blocks: Vec::new(),
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
            Some(Member::new(number, address, Some(binning.link_of(local))))
        });
        let blocks = binning.blocks().map(|place| {
            Block::new(BlockPlace {
                first: pixels[usize::from(place.first.raw())],
                ..place
            })
        });
        Ok(Self {
            members: members.collect(),
            blocks: blocks.collect(),
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
        let of_slice = self.members.iter();
        let cycles = of_slice.map(|member| photons[member.number].cycles);
        let cycles = cycles.max().unwrap_or(0);
        let mut next = vec![0; self.members.len()];
        let mut from = 0;
        while from < cycles {
            let step = self.step(configs, photons, &next, from, cycles);
            let to = from + step;
            self.count(configs, photons, &mut next, to);
            let first = first + u64::from(from);
            for member in &mut self.members {
                let recorded = photons[member.number].cycles;
                let cycles = to.min(recorded).saturating_sub(from);
                member.advance(configs, &mut done, first, cycles, self.since_look);
            }
            for block in &mut self.blocks {
                block.advance(configs, &mut done, first, step, self.since_look);
            }
            self.end_step(configs, step);
            from = to;
        }
        done
    }

    /// Laser cycles that the pixels and blocks may end each for itself, from laser cycle `from` of a slice of `cycles` on:
    /// up to the next look, tick or end. Without a photon before that look, up to the last look before one.
    fn step(
        &self,
        configs: &Configs<BINS>,
        photons: &[PixelPhotons],
        next: &[usize],
        from: u16,
        cycles: u16,
    ) -> u16 {
        let x = configs.pixels.x();
        let of_members = self.members.iter().zip(next);
        let next =
            of_members.filter_map(|(member, &next)| photons[member.number].photons.get(next));
        let photon = next.map(|photon| photon.cycle).min();
        let to_look = u64::from(x - self.since_look);
        let dark = u64::from(photon.unwrap_or(cycles).min(cycles) - from);
        let up_to_look = dark.max(to_look) - (dark.max(to_look) - to_look) % u64::from(x);
        // A tick comes with a look.
        let to_tick = configs.patience.saturating_sub(self.since_tick);
        let looks_to_tick = to_tick.div_ceil(x).max(1);
        let to_tick = to_look + u64::from(looks_to_tick - 1) * u64::from(x);
        within(cycles - from, up_to_look.min(to_tick), self.since_look, x)
    }

    /// Counts the photons before laser cycle `to` of a slice.
    fn count(
        &mut self,
        configs: &Configs<BINS>,
        photons: &[PixelPhotons],
        next: &mut [usize],
        to: u16,
    ) {
        for (member, next) in self.members.iter_mut().zip(next) {
            let received = &photons[member.number];
            while let Some(photon) = received.photons.get(*next)
                && photon.cycle < to
            {
                *next += 1;
                member.has_no_peak = false;
                member.pixel.count(&configs.pixels, photon.code);
                if let Some(link) = &member.link {
                    count_in_blocks(&mut self.blocks, link, &configs.blocks, photon.code);
                }
            }
        }
    }

    /// All have ended `cycles` laser cycles, up to a look or the end of a slice. A tick comes after a look.
    fn end_step(&mut self, configs: &Configs<BINS>, cycles: u16) {
        let x = configs.pixels.x();
        let before = self.since_look;
        self.since_look = after(before, cycles, x);
        // Laser cycles up to the last look.
        let looked = (u32::from(before) + u32::from(cycles)) - u32::from(self.since_look);
        if looked == 0 {
            return;
        }
        let looked = u16::try_from(looked).unwrap_or(u16::MAX);
        self.since_tick = self.since_tick.saturating_add(looked);
        if self.since_tick >= configs.patience {
            self.since_tick = 0;
            for member in &mut self.members {
                if let Some(link) = &mut member.link {
                    link.tick(member.pixel.has_reported());
                }
            }
            for block in &mut self.blocks {
                block.tick();
            }
        }
    }

    /// Keeps the last decision of pixels for which `is_kept` is true, and of blocks that begin with
    /// one.
    pub fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for member in &mut self.members {
            member.last = LastDecision::allocate(is_kept(member.pixel.address()));
        }
        for member in &mut self.blocks {
            let address = member.pixel().address();
            member.data.last = LastDecision::allocate(is_kept(address));
        }
    }

    /// The decisions that were kept.
    pub fn decisions(&self) -> impl Iterator<Item = Decision> {
        let of_members = self.members.iter().map(|member| &member.last);
        let of_blocks = self.blocks.iter().map(|member| &member.data.last);
        let all = of_members.chain(of_blocks).flatten();
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

//! Pixels that decide together, with blocks or with neighbours: [`PixelArray`]s that are driven.
//!
//! Blocks of the highest level are independent of each other: each is an array, and runs on any thread. Neighbours make one
//! array, whose decisions run on all threads.

use anyhow::{Context, Result, ensure};
use dtof_core::binning::Block;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, Array, ArrayConfig, ArrayState, CounterWidth, DepthEvent, Neighbours, PixelAddress,
    PixelArray, PixelData, PixelPlace, Statistics, WindowRule,
};
use dtof_link::AdaptiveBinning;

use super::Engine;
use super::alone::sort;
use super::decisions::{self, Decision, LastDecision};
use super::parallel::{of_each, of_parts};
use crate::settings::Settings;
use dtof_options::Refused;
use dtof_photons::source::Slice;

/// Decisions with neighbours that are worth a thread.
const DECISIONS: usize = 256;

/// The last decision of a pixel or a block, if it is kept.
#[derive(Debug, Default)]
struct Kept(Option<Box<LastDecision>>);

impl PixelData for Kept {
    fn decides<const BINS: usize, W: CounterWidth>(&mut self, input: &DecisionInput<'_, BINS, W>) {
        if let Some(last) = &mut self.0 {
            last.record_input(input);
        }
    }
}

/// A pixel of the source.
#[derive(Debug)]
struct Member {
    /// Its place in the array, and its index among the pixels of the source.
    place: usize,
    number: usize,
    /// The next photon of the slice.
    next: usize,
}

/// An array, and where its pixels are in that of the source.
#[derive(Debug)]
struct Part<const BINS: usize, W: CounterWidth> {
    places: Vec<PixelPlace<BINS, W, Kept>>,
    blocks: Vec<Block<BINS, Kept>>,
    state: ArrayState<BINS, AnyRule>,
    /// The address of each place.
    addresses: Vec<PixelAddress>,
    members: Vec<Member>,
    statistics: [Statistics; 2],
}

/// The engine.
#[derive(Debug)]
pub struct ArrayEngine<const BINS: usize, W: CounterWidth> {
    parts: Vec<Part<BINS, W>>,
}

/// The rule for neighbours.
///
/// # Errors
/// Fails if neighbours cannot be used with the other settings.
pub fn neighbour_rule(settings: &Settings) -> Result<&WindowRule> {
    let AnyRule::Window(rule) = &settings.rule else {
        return Err(Refused::new("neighbours", "is for `rule` window").into());
    };
    ensure!(
        settings.binning.is_none(),
        Refused::new("neighbours", "cannot be used with `binning`")
    );
    ensure!(
        !settings.weighs_dead_time(),
        Refused::new("neighbours", "cannot be used with a dead time")
    );
    Ok(rule)
}

impl<const BINS: usize, W: CounterWidth> Part<BINS, W> {
    /// The pixels at `addresses`, of which those of the `source` exist. These ascend.
    fn new(
        config: &ArrayConfig<BINS, AnyRule>,
        addresses: Vec<PixelAddress>,
        source: &[PixelAddress],
    ) -> Result<Self> {
        let [pixels, blocks] = config.room();
        let mut places: Vec<_> = (0..pixels).map(|_| PixelPlace::new()).collect();
        let mut blocks: Vec<_> = (0..blocks).map(|_| Block::default()).collect();
        let mut array = PixelArray::new(&mut places, &mut blocks);
        array.configure(config)?;
        let mut members = Vec::new();
        for (place, address) in addresses.iter().enumerate() {
            match source.binary_search(address) {
                Ok(number) => members.push(Member {
                    place,
                    number,
                    next: 0,
                }),
                Err(_) => array.leave_out(place),
            }
        }
        let state = array.into_state();
        Ok(Self {
            places,
            blocks,
            state,
            addresses,
            members,
            statistics: [Statistics::new(); 2],
        })
    }

    /// Runs a slice. Events are taken at once.
    fn run(&mut self, slice: &Slice) -> Vec<DepthEvent> {
        let state = std::mem::take(&mut self.state);
        let mut array = PixelArray::resume(&mut self.places, &mut self.blocks, state);
        // Numbers the laser cycles as the source does.
        array.lost(0, slice.first_cycle.saturating_sub(array.cycles()));
        let mut cycles = 0;
        for member in &mut self.members {
            member.next = 0;
            cycles = cycles.max(slice.pixels[member.number].cycles);
        }
        let (mut events, mut from) = (Vec::new(), 0);
        while from < cycles {
            // Up to the next look; if there are no photons then, up to the next one.
            let to = from + array.to_look().min(cycles - from);
            let mut end = cycles;
            for member in &mut self.members {
                let received = &slice.pixels[member.number];
                let mut next = received.photons.get(member.next);
                while let Some(photon) = next.filter(|photon| photon.cycle < to) {
                    array.photon(member.place, photon.code);
                    member.next += 1;
                    next = received.photons.get(member.next);
                }
                if received.cycles < to {
                    // Its recording has ended.
                    array.leave_out(member.place);
                } else {
                    end = end.min(next.map_or(received.cycles, |photon| photon.cycle));
                }
            }
            let end = end.max(to);
            let mut left = end - from;
            while left > 0 {
                left = array.end_laser_cycles_shared(left, |pixels, decide| {
                    let found = of_each(pixels, DECISIONS, decide);
                    let numbered = found.into_iter().enumerate();
                    numbered.filter_map(|(pixel, found)| Some((pixel, found?)))
                });
                while let Some(event) = array.next_event() {
                    let kept = array.data_of(&event);
                    let pixel = self.addresses[usize::from(event.pixel.raw())];
                    let event = DepthEvent { pixel, ..event };
                    if let Some(Kept(Some(last))) = kept {
                        last.record_event(event);
                    }
                    events.push(event);
                }
            }
            from = end;
        }
        self.statistics = array.statistics();
        self.state = array.into_state();
        events
    }

    /// What is kept of the pixels and blocks, with the address of each.
    fn kept(&mut self) -> impl Iterator<Item = (PixelAddress, &mut Kept)> {
        let addresses = &self.addresses;
        let places = addresses.iter().zip(&mut self.places);
        let places = places.map(|(&address, place)| (address, &mut place.data));
        let blocks = self.blocks.iter_mut().map(|block| {
            let first = block.pixel().address();
            (addresses[usize::from(first.raw())], &mut block.data)
        });
        places.chain(blocks)
    }
}

impl<const BINS: usize, W: CounterWidth> ArrayEngine<BINS, W> {
    /// An engine for the pixels `source` of an array, ascending, with blocks.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn with_blocks(
        settings: &Settings,
        binning: AdaptiveBinning,
        array: Array,
        source: &[PixelAddress],
    ) -> Result<Self> {
        let (pixels, blocks) = (settings.config()?, settings.block_config()?);
        let top = binning.levels;
        let parts = (0..array.blocks(top)).map(|block| {
            let addresses = array.pixels_of(array.first_of(block, top), top);
            let addresses: Vec<PixelAddress> = addresses.collect();
            let row = |pixel: &PixelAddress| u32::from(pixel.raw()) / array.columns();
            let rows = match &addresses[..] {
                [first, .., last] => row(last) - row(first) + 1,
                _ => 1,
            };
            let columns = u32::try_from(addresses.len())? / rows;
            let layout = Array::new(columns, rows).context("a block without pixels")?;
            let config = ArrayConfig::new(layout, pixels).blocks(top, blocks, binning.patience)?;
            Part::new(&config, addresses, source)
        });
        Ok(Self {
            parts: parts.collect::<Result<_>>()?,
        })
    }

    /// The same with neighbours.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn with_neighbours(
        settings: &Settings,
        neighbours: Neighbours,
        array: Array,
        source: &[PixelAddress],
    ) -> Result<Self> {
        let rule = neighbour_rule(settings)?;
        let neighbours = NeighbourConfig::new(array, neighbours, rule);
        let config = ArrayConfig::new(array, settings.config()?).neighbours(neighbours)?;
        let addresses = (0..=u16::MAX).map(PixelAddress::new);
        let addresses = addresses.take(usize::try_from(array.pixels())?).collect();
        Ok(Self {
            parts: vec![Part::new(&config, addresses, source)?],
        })
    }
}

impl<const BINS: usize, W: CounterWidth> Engine for ArrayEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let events = of_parts(&mut self.parts, 1, |_, parts| -> Vec<DepthEvent> {
            parts.iter_mut().flat_map(|part| part.run(slice)).collect()
        });
        let mut events: Vec<DepthEvent> = events.into_iter().flatten().collect();
        sort(&mut events, slice.first_cycle);
        Ok(events)
    }

    fn statistics(&self) -> [Statistics; 2] {
        let mut all = [Statistics::new(); 2];
        for part in &self.parts {
            all[0] += part.statistics[0];
            all[1] += part.statistics[1];
        }
        all
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for (address, kept) in self.parts.iter_mut().flat_map(Part::kept) {
            *kept = Kept(LastDecision::allocate(is_kept(address)));
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        let mut all = Vec::new();
        for part in &self.parts {
            let of_pixels = part.places.iter().map(|place| &place.data);
            let of_blocks = part.blocks.iter().map(|block| &block.data);
            let kept = of_pixels
                .chain(of_blocks)
                .filter_map(|kept| kept.0.as_ref());
            all.extend(kept.filter_map(|last| last.decision()));
        }
        decisions::sort(&mut all);
        all
    }
}

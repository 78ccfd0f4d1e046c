//! Pixels that decide together, with blocks or with neighbours: [`PixelArray`]s that are driven.
//!
//! Blocks of the highest level are independent of each other: each is an array, and runs on any thread. Neighbours make one
//! array, whose decisions run on all threads.

use anyhow::{Context, Result};
use dtof_core::binning::Block;
use dtof_core::rule::DecisionInput;
use dtof_core::{
    AnyRule, Array, ArrayConfig, ArrayState, CounterWidth, DepthEvent, PixelAddress, PixelArray,
    PixelData, PixelPlace, Statistics,
};
use dtof_link::AdaptiveBinning;

use super::Engine;
use super::alone::sort;
use super::decisions::{self, Decision, LastDecision};
use super::parallel::{AllThreads, of_parts};
use crate::settings::Settings;
use dtof_data::photons::source::Slice;

/// A pixel or a block.
#[derive(Debug, Default)]
struct Member {
    /// Its index among the pixels of the source, if it is one of these.
    number: Option<usize>,
    /// Its next photon of the slice.
    next: usize,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision>>,
}

impl PixelData for Member {
    fn decided_from<const BINS: usize, W: CounterWidth>(
        &mut self,
        input: &DecisionInput<'_, BINS, W>,
    ) {
        if let Some(last) = &mut self.last {
            last.record_input(input);
        }
    }
}

impl Member {
    /// Takes the codes of its next photons before laser cycle `end` of the slice. Returns how many these are.
    fn next(&mut self, slice: &Slice, end: u16, codes: &mut [u16]) -> usize {
        let photons = self
            .number
            .map(|number| &slice.pixels[number].photons[self.next..]);
        let photons = photons.unwrap_or_default().iter();
        let mut number = 0;
        for (code, photon) in codes
            .iter_mut()
            .zip(photons.take_while(|photon| photon.cycle < end))
        {
            *code = photon.code;
            number += 1;
        }
        self.next += number;
        number
    }

    /// If its recording has `end` laser cycles of the slice or more, those before its next photon, or all.
    fn dark(&self, slice: &Slice, end: u16) -> Option<u16> {
        let received = &slice.pixels[self.number?];
        let next = received.photons.get(self.next);
        let dark = next.map_or(received.cycles, |photon| photon.cycle);
        (received.cycles >= end).then_some(dark)
    }
}

/// An array, and where its pixels are in that of the source.
#[derive(Debug)]
struct Part<const BINS: usize, W: CounterWidth> {
    places: Vec<PixelPlace<BINS, W, Member>>,
    blocks: Vec<Block<BINS, Member>>,
    state: ArrayState<BINS, AnyRule, W, Member>,
    /// The address of each place.
    addresses: Vec<PixelAddress>,
    statistics: [Statistics; 2],
}

/// The engine.
#[derive(Debug)]
pub struct ArrayEngine<const BINS: usize, W: CounterWidth> {
    parts: Vec<Part<BINS, W>>,
}

impl<const BINS: usize, W: CounterWidth> Part<BINS, W> {
    /// The pixels at `addresses`, of which those of the `source` exist. These ascend.
    fn new(
        config: &ArrayConfig<BINS, AnyRule, W, Member>,
        addresses: Vec<PixelAddress>,
        source: &[PixelAddress],
    ) -> Result<Self> {
        let [pixels, number_of_blocks] = config.room();
        let mut places: Vec<PixelPlace<BINS, W, Member>> = Vec::new();
        places.resize_with(pixels, PixelPlace::new);
        let mut blocks = Vec::new();
        blocks.resize_with(number_of_blocks, Block::default);
        let mut array = PixelArray::new(&mut places, &mut blocks);
        array.configure(config)?;
        let mut numbers = Vec::new();
        for (place, address) in addresses.iter().enumerate() {
            let number = source.binary_search(address).ok();
            if number.is_none() {
                array.leave_out(place);
            }
            numbers.push(number);
        }
        let state = array.into_state();
        for (place, number) in places.iter_mut().zip(numbers) {
            place.data.number = number;
        }
        Ok(Self {
            places,
            blocks,
            state,
            addresses,
            statistics: [Statistics::new(); 2],
        })
    }

    /// Runs a slice. Events are taken at once.
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let (mut cycles, mut shortest) = (0, u16::MAX);
        for member in self.places.iter_mut().map(|place| &mut place.data) {
            member.next = 0;
            if let Some(number) = member.number {
                let recorded = slice.pixels[number].cycles;
                (cycles, shortest) = (cycles.max(recorded), shortest.min(recorded));
            }
        }
        let state = std::mem::take(&mut self.state);
        let mut array = PixelArray::resume(&mut self.places, &mut self.blocks, state)?;
        // Numbers the laser cycles as the source does.
        array.lost(0, slice.first_cycle.saturating_sub(array.cycles()));
        let (mut events, mut from) = (Vec::new(), 0);
        while from < cycles {
            let to = from + array.to_look().min(cycles - from);
            if shortest < to {
                // The last photons of a recording that ends before the look still count.
                let ended = |(place, member): (usize, &mut Member)| {
                    let received = &slice.pixels[member.number?];
                    let left = received.photons.get(member.next..)?;
                    let has_ended = received.cycles < to;
                    if has_ended {
                        member.next = received.photons.len();
                    }
                    has_ended.then_some((place, left))
                };
                let ended: Vec<_> = array.data().enumerate().filter_map(ended).collect();
                for (place, photons) in ended {
                    for photon in photons {
                        array.photon(place, photon.code);
                    }
                    array.leave_out(place);
                }
            }
            // Without a photon before this look, all laser cycles before the next photon end.
            let dark = |member: &mut Member| member.dark(slice, to);
            let has_photon = array.data().filter_map(dark).any(|dark| dark < to);
            let end = match has_photon {
                true => to,
                false => array.data().filter_map(dark).min().unwrap_or(to),
            };
            let mut left = end - from;
            while left > 0 {
                let next =
                    |_, member: &mut Member, codes: &mut [u16]| member.next(slice, to, codes);
                left = array.end_laser_cycles_on(&AllThreads, left, next);
                while let Some(event) = array.next_event() {
                    let member = array.data_of(&event);
                    let pixel = self.addresses[usize::from(event.pixel.raw())];
                    let event = DepthEvent { pixel, ..event };
                    if let Some(last) = member.and_then(|member| member.last.as_mut()) {
                        last.record_event(event);
                    }
                    events.push(event);
                }
            }
            from = end;
        }
        self.statistics = array.statistics();
        self.state = array.into_state();
        Ok(events)
    }

    /// The pixels and blocks, with the address of each.
    fn members(&mut self) -> impl Iterator<Item = (PixelAddress, &mut Member)> {
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
        let top = binning.levels;
        // Few blocks differ from the others: those at the edges.
        let mut configs = Vec::new();
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
            let known = configs.iter().position(|(of, _)| *of == layout);
            let at = known.unwrap_or(configs.len());
            if known.is_none() {
                configs.push((layout, settings.array_config(layout)?));
            }
            Part::new(&configs[at].1, addresses, source)
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
        array: Array,
        source: &[PixelAddress],
    ) -> Result<Self> {
        let addresses = (0..=u16::MAX).map(PixelAddress::new);
        let addresses = addresses.take(usize::try_from(array.pixels())?).collect();
        Ok(Self {
            parts: vec![Part::new(
                &settings.array_config(array)?,
                addresses,
                source,
            )?],
        })
    }
}

impl<const BINS: usize, W: CounterWidth> Engine for ArrayEngine<BINS, W> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let parts = of_parts(&mut self.parts, 1, |_, parts| -> Result<Vec<DepthEvent>> {
            let mut events = Vec::new();
            for part in parts {
                events.extend(part.run(slice)?);
            }
            Ok(events)
        });
        let mut events = Vec::new();
        for of_part in parts {
            events.extend(of_part?);
        }
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
        for (address, member) in self.parts.iter_mut().flat_map(Part::members) {
            member.last = LastDecision::allocate(is_kept(address));
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        let mut all = Vec::new();
        for part in &self.parts {
            let of_pixels = part.places.iter().map(|place| &place.data);
            let of_blocks = part.blocks.iter().map(|block| &block.data);
            let kept = of_pixels.chain(of_blocks);
            let kept = kept.filter_map(|member| member.last.as_ref());
            all.extend(kept.filter_map(|last| last.decision()));
        }
        decisions::sort(&mut all);
        all
    }
}

//! An array that is driven does what its parts do one by one, laser cycle by laser cycle.

use crate::tests::neighbours::end_laser_cycles_of_array;
use std::ops::AddAssign;
use std::sync::Mutex;

use dtof_core::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::{NeighbourConfig, Threads};
use dtof_core::rule::{DecisionInput, Tracking};
use dtof_core::{
    Array, ArrayConfig, ArrayError, ArrayLosses, AsyncPixel, BlockLevel, Count, Count10, Count24,
    CounterWidth, DepthEvent, EchoNumber, LaserCycle, Look, Neighbours, PixelAddress, PixelArray,
    PixelConfig, PixelData, PixelPlace, RangeGate, Statistics, WindowRule,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const BINS: usize = 32;
type Config = PixelConfig<BINS, WindowRule>;
type Place = PixelPlace<BINS>;

#[derive(Clone, Copy, Debug)]
enum Mode {
    Alone,
    Blocks(u8, u16),
    Neighbours(Neighbours),
}

#[derive(Clone, Copy, Debug)]
struct Settings {
    columns: u32,
    rows: u32,
    /// Pixels that the last row lacks.
    missing: u32,
    mode: Mode,
    once_per_bin: bool,
    left_out: u32,
    x: u16,
    echoes: u8,
    dead_time: u16,
    seed: u64,
}

impl Settings {
    const fn usual(columns: u32, rows: u32, mode: Mode) -> Self {
        Self {
            columns,
            rows,
            missing: 0,
            mode,
            once_per_bin: false,
            left_out: 0,
            x: 4,
            echoes: 1,
            dead_time: 0,
            seed: 0,
        }
    }

    fn layout(&self) -> Array {
        Array::new(self.columns, self.rows).unwrap()
    }

    fn number(&self) -> usize {
        (self.columns * self.rows - self.missing) as usize
    }

    fn is_left_out(&self, pixel: usize) -> bool {
        self.left_out >> pixel & 1 > 0
    }

    fn rule(&self) -> WindowRule {
        WindowRule::new(2, U4F12::lit("3.5"), Count::saturating(4)).unwrap()
    }

    fn config(&self, rule: WindowRule) -> Config {
        PixelConfig::with_rule(rule)
            .x(self.x)
            .l1(12)
            .l2(90)
            .gate(RangeGate::new(2, 29).unwrap())
            .echoes(EchoNumber::new(self.echoes).unwrap(), 2)
            .echo_wait(3)
            .dead_time(self.dead_time)
            .build()
            .unwrap()
    }

    fn neighbours(&self) -> Option<NeighbourConfig> {
        match self.mode {
            Mode::Neighbours(neighbours) => Some(NeighbourConfig::new(
                self.layout(),
                neighbours,
                &self.rule(),
            )),
            _ => None,
        }
    }

    fn pixels(&self) -> Config {
        let own = self.neighbours().map(|neighbours| *neighbours.rule().own());
        self.config(own.unwrap_or(self.rule()))
    }

    fn blocks(&self) -> Option<(BlockLevel, Config, u16)> {
        match self.mode {
            Mode::Blocks(levels, patience) => {
                let levels = BlockLevel::new(levels).unwrap();
                Some((levels, self.config(self.rule().of_blocks(levels)), patience))
            }
            _ => None,
        }
    }
}

impl Settings {
    fn array<T: PixelData>(&self) -> ArrayConfig<BINS, WindowRule, Count10, T> {
        let mut config = ArrayConfig::new(self.layout(), self.pixels());
        if let Some((levels, blocks, patience)) = self.blocks() {
            config = config.blocks(levels, blocks, patience).unwrap();
        }
        if let Some(neighbours) = self.neighbours() {
            config = config.neighbours(neighbours).unwrap();
        }
        if self.once_per_bin {
            config = config.once_per_bin();
        }
        config.first(self.number() as u32).unwrap()
    }
}

/// The parts, as a program had to drive them.
struct Parts {
    settings: Settings,
    pixels: Vec<Option<AsyncPixel<BINS>>>,
    links: Vec<BlockLink>,
    blocks: Vec<Block<BINS>>,
    seen: Vec<(usize, u16)>,
    cycle: u64,
    since_tick: u16,
    turn: usize,
    statistics: [Statistics; 2],
    left_out: u64,
}

impl Parts {
    fn new(settings: Settings) -> Self {
        let binning = settings
            .blocks()
            .map(|(levels, ..)| Binning::new(settings.layout(), levels).unwrap());
        let addresses = (0..settings.number()).map(|pixel| PixelAddress::new(pixel as u16));
        let pixel = |address: PixelAddress| {
            let is_left_out = settings.is_left_out(address.raw().into());
            (!is_left_out).then(|| AsyncPixel::new(address))
        };
        let link = |address| binning.map_or(BlockLink::NONE, |binning| binning.link_of(address));
        Self {
            settings,
            pixels: addresses.clone().map(pixel).collect(),
            links: addresses.map(link).collect(),
            blocks: binning
                .iter()
                .flat_map(Binning::blocks)
                .map(Block::new)
                .collect(),
            seen: Vec::new(),
            cycle: 0,
            since_tick: 0,
            turn: 0,
            statistics: [Statistics::new(); 2],
            left_out: 0,
        }
    }

    fn photon(&mut self, number: usize, code: u16) {
        let Some(pixel) = &mut self.pixels[number] else {
            self.left_out += 1;
            return;
        };
        if self.settings.once_per_bin && usize::from(code) < BINS {
            if self.seen.contains(&(number, code)) {
                self.statistics[0].repeated += 1;
                return;
            }
            self.seen.push((number, code));
        }
        pixel.count(&self.settings.pixels(), code);
        if let Some((_, config, _)) = self.settings.blocks() {
            count_in_blocks(&mut self.blocks, &self.links[number], &config, code);
        }
    }

    /// Returns whether the pixels have looked.
    fn end_laser_cycle(&mut self) -> bool {
        let (config, last) = (self.settings.pixels(), LaserCycle::new(self.cycle));
        let [of_pixels, of_blocks] = &mut self.statistics;
        self.seen.clear();
        self.cycle += 1;
        if let Some(neighbours) = self.settings.neighbours() {
            let mut places: Vec<PlaceOf> = self.pixels.drain(..).map(PlaceOf).collect();
            end_laser_cycles_of_array(&mut places, &config, &neighbours, of_pixels, last, 1);
            self.pixels.extend(places.into_iter().map(|place| place.0));
        } else {
            for (pixel, link) in self.pixels.iter_mut().zip(&mut self.links) {
                if let Some(pixel) = pixel {
                    let look = pixel.end_laser_cycle(&config, of_pixels, last);
                    if matches!(look, Look::Event | Look::Ended) {
                        link.reported();
                    }
                }
            }
        }
        let looks = self.cycle.is_multiple_of(self.settings.x.into());
        if let Some((_, config, patience)) = self.settings.blocks() {
            end_laser_cycles_of_blocks(&mut self.blocks, &config, of_blocks, last, 1);
            if looks {
                self.since_tick += self.settings.x;
            }
            if self.since_tick >= patience {
                self.since_tick = 0;
                for (pixel, link) in self.pixels.iter().zip(&mut self.links) {
                    link.tick(pixel.as_ref().is_some_and(AsyncPixel::has_reported));
                }
                self.blocks.iter_mut().for_each(Block::tick);
            }
        }
        looks
    }

    /// Takes up to `room` events. Who finds no room is the first later.
    fn events(&mut self, room: usize) -> Vec<DepthEvent> {
        let (mut events, pixels) = (Vec::new(), self.pixels.len());
        let slots = pixels + self.blocks.len();
        let turn = std::mem::take(&mut self.turn);
        for slot in (turn..slots).chain(0..turn) {
            let has_event = match slot.checked_sub(pixels) {
                None => self.pixels[slot]
                    .as_ref()
                    .is_some_and(AsyncPixel::has_event),
                Some(block) => self.blocks[block].has_event(),
            };
            if has_event && events.len() == room {
                self.turn = slot;
                break;
            }
            if has_event {
                events.extend(match slot.checked_sub(pixels) {
                    None => self.pixels[slot].as_mut().unwrap().take_event(),
                    Some(block) => self.blocks[block].take_event(),
                });
            }
        }
        events
    }
}

struct PlaceOf(Option<AsyncPixel<BINS>>);

impl dtof_core::neighbours::ArrayPixel<BINS, Count10> for PlaceOf {
    fn pixel(&self) -> Option<&AsyncPixel<BINS>> {
        self.0.as_ref()
    }

    fn pixel_mut(&mut self) -> Option<&mut AsyncPixel<BINS>> {
        self.0.as_mut()
    }
}

fn settings() -> impl Strategy<Value = Settings> {
    let mode = prop_oneof![
        Just(Mode::Alone),
        (1u8..=3, 8u16..60).prop_map(|(levels, patience)| Mode::Blocks(levels, patience)),
        prop::sample::select(vec![Neighbours::Four, Neighbours::Eight]).prop_map(Mode::Neighbours),
    ];
    let left_out = prop_oneof![Just(0), any::<u32>().prop_map(|bits| bits & bits >> 7)];
    let more = (
        1u16..=8,
        1u8..=2,
        prop_oneof![2 => Just(0u16), 1 => 1u16..40],
        any::<u64>(),
    );
    (
        (1u32..=6, 1u32..=5),
        0u32..3,
        mode,
        any::<bool>(),
        left_out,
        more,
    )
        .prop_map(
            |(
                (columns, rows),
                missing,
                mode,
                once_per_bin,
                left_out,
                (x, echoes, dead_time, seed),
            )| {
                let alone_weighs = !matches!(mode, Mode::Neighbours(_));
                Settings {
                    columns,
                    rows,
                    missing: missing.min(columns - 1),
                    mode,
                    once_per_bin,
                    left_out,
                    x,
                    echoes,
                    dead_time: if alone_weighs { dead_time } else { 0 },
                    seed,
                }
            },
        )
}

/// The photons of a laser cycle in the order of a shared queue: background, a surface, and bursts in one bin.
fn photons(rng: &mut Pcg32, settings: &Settings) -> Vec<(usize, u16)> {
    let mut photons = Vec::new();
    let below = |rng: &mut Pcg32, end: u32| rng.next_u32() % end;
    for pixel in 0..settings.number() {
        if below(rng, 3) == 0 {
            photons.push((pixel, below(rng, BINS as u32 + 2) as u16));
        }
        // Some pixels see more.
        if below(rng, 2 + 3 * (pixel as u32 % 5)) == 0 {
            photons.push((pixel, (12 + pixel / 4) as u16));
        }
        if below(rng, 40) == 0 {
            let burst = 1 + below(rng, 40) as usize;
            photons.extend([(pixel, 7)].repeat(burst));
        }
    }
    for place in (1..photons.len()).rev() {
        photons.swap(place, below(rng, place as u32 + 1) as usize);
    }
    // In the order of time, or pixel by pixel.
    if settings.seed.is_multiple_of(2) {
        photons.sort_by_key(|&(_, code)| code);
    } else {
        photons.sort_by_key(|&(pixel, _)| settings.number() - pixel);
    }
    photons
}

/// Small parts in another order.
struct Backwards;

impl Threads for Backwards {
    fn each<P: Send, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        work: impl Fn(usize, &mut [P]) -> S + Sync,
    ) -> S {
        let mut sum = S::default();
        for (number, items) in items.chunks_mut(3).enumerate().rev() {
            sum += work(3 * number, items);
        }
        sum
    }

    fn decide<P: Send + Sync, D: Send + Sync, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        decide: impl Fn(&[P], usize) -> Option<D> + Sync,
        work: impl Fn(&mut P, Option<&D>, &mut S) + Sync,
    ) -> S {
        let numbers = (0..items.len()).rev();
        let found: Vec<Option<D>> = numbers.map(|number| decide(items, number)).collect();
        let mut sum = S::default();
        for (item, found) in items.iter_mut().rev().zip(&found) {
            work(item, found.as_ref(), &mut sum);
        }
        sum
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_array_does_what_its_parts_do(settings in settings()) {
        let mut room: Vec<Place> = (0..31).map(|_| PixelPlace::new()).collect();
        let mut block_room: Vec<Block<BINS>> = (0..40).map(|_| Block::default()).collect();
        let mut array = PixelArray::new(&mut room, &mut block_room);
        let config = settings.array();
        // What was there before is gone.
        array.configure(&ArrayConfig::new(settings.layout(), settings.pixels())).unwrap();
        (0..400).for_each(|_| {
            array.photon(0, 9);
            array.end_laser_cycle();
        });
        // Before or after the configuration.
        if settings.left_out.is_multiple_of(2) {
            array.configure(&config).unwrap();
        }
        for pixel in (0..settings.number()).filter(|&pixel| settings.is_left_out(pixel)) {
            array.leave_out(pixel);
        }
        if !settings.left_out.is_multiple_of(2) {
            array.configure(&config).unwrap();
        }
        let mut parts = Parts::new(settings);
        let mut rng = Pcg32::seed_from_u64(settings.seed);
        let (mut found, mut unaddressed) = (0, 0);
        for _ in 0..300 {
            let codes = photons(&mut rng, &settings);
            codes.iter().for_each(|&(pixel, code)| parts.photon(pixel, code));
            let is_shared = rng.next_u32() % 2 == 0;
            if !is_shared {
                // Each alone, or those that come one after another at once.
                let at_once = rng.next_u32() % 2 == 0;
                for codes in codes.chunk_by(|one, next| at_once && one.0 == next.0) {
                    match codes {
                        [(pixel, code)] => array.photon(*pixel, *code),
                        [(pixel, _), ..] => {
                            let codes: Vec<u16> = codes.iter().map(|photon| photon.1).collect();
                            array.photons(*pixel, &codes);
                        }
                        [] => {}
                    }
                }
            }
            let coming = Mutex::new(if is_shared { codes } else { Vec::new() });
            let next = |pixel, _: &mut (), codes: &mut [u16]| {
                let mut coming = coming.lock().unwrap();
                let of_pixel = coming.extract_if(.., |photon| photon.0 == pixel).take(codes.len());
                codes.iter_mut().zip(of_pixel).map(|(code, photon)| *code = photon.1).count()
            };
            array.photon(settings.number(), 3);
            array.photon(31, 3);
            unaddressed += 2;
            // Dark ones follow now and then.
            let mut cycles = match rng.next_u32() % 32 {
                0 => 1 + rng.next_u32() as u16 % 200,
                1..8 => 1 + rng.next_u32() as u16 % 20,
                _ => 1,
            };
            while cycles > 0 {
                let left = match is_shared {
                    true => array.end_laser_cycles_on(&Backwards, cycles, next),
                    false => array.end_laser_cycles(cycles),
                };
                let mut looked = false;
                for _ in left..cycles {
                    looked = parts.end_laser_cycle();
                }
                prop_assert!(left == 0 || looked);
                cycles = left;
                // Most often all leave.
                let room = match rng.next_u32() % 4 {
                    0 => (rng.next_u32() % 3) as usize,
                    _ => usize::MAX,
                };
                let events = parts.events(room);
                for event in &events {
                    prop_assert_eq!(array.next_event(), Some(*event));
                }
                if room == usize::MAX {
                    prop_assert_eq!(array.next_event(), None);
                    prop_assert!(!array.has_event());
                }
                found += events.len();
            }
            prop_assert_eq!(array.cycles(), parts.cycle);
            prop_assert_eq!(array.to_look(), settings.x - (parts.cycle % u64::from(settings.x)) as u16);
            // Another room for what is beside the pixels.
            let state = array.into_state();
            array = PixelArray::resume(&mut room, &mut block_room, state).unwrap();
        }
        let waiting = parts.pixels.iter().flatten().filter(|pixel| pixel.has_event()).count();
        let blocks_waiting = parts.blocks.iter().filter(|block| block.has_event()).count();
        for (number, pixel) in parts.pixels.iter().enumerate() {
            let mine = array.pixel(number);
            prop_assert_eq!(mine.is_some(), pixel.is_some());
            if let (Some(mine), Some(pixel)) = (mine, pixel) {
                prop_assert_eq!(array.exposure(number), Some(pixel.exposure()));
                prop_assert_eq!(mine.histogram().counts(), pixel.histogram().counts());
                pixel.add_photons_to(&mut parts.statistics[0]);
            }
        }
        for block in &parts.blocks {
            block.pixel().add_photons_to(&mut parts.statistics[1]);
        }
        parts.statistics[0].events -= waiting as u64;
        parts.statistics[1].events -= blocks_waiting as u64;
        prop_assert_eq!(array.statistics(), parts.statistics);
        let losses = array.losses();
        prop_assert_eq!((losses.left_out, losses.unaddressed), (parts.left_out, unaddressed));
        prop_assert_eq!(losses.unordered, 0);
        let [pixels, blocks] = array.statistics();
        prop_assert_eq!(found as u64, pixels.events + blocks.events);
    }
}

#[test]
fn a_place_takes_few_bytes_more_than_a_pixel() {
    let more = size_of::<PixelPlace<128>>() - size_of::<AsyncPixel<128>>();
    assert_eq!(
        more,
        12_usize.next_multiple_of(align_of::<AsyncPixel<128>>())
    );
}

#[test]
fn what_cannot_be_driven_is_refused() {
    let settings = Settings::usual(4, 2, Mode::Alone);
    let config = ArrayConfig::new(settings.layout(), settings.pixels());
    let level = BlockLevel::new(1).unwrap();
    let neighbours = |array| NeighbourConfig::new(array, Neighbours::Eight, &settings.rule());
    let eight = neighbours(settings.layout());
    let with_blocks = config.blocks(level, settings.pixels(), 40).unwrap();
    let with_neighbours = config.neighbours(eight).unwrap();
    let of_x = |x| Settings { x, ..settings }.pixels();
    let weighing = Settings {
        dead_time: 5,
        ..settings
    }
    .pixels();
    let weighing = ArrayConfig::new(settings.layout(), weighing);
    let refusals = [
        (
            with_blocks.neighbours(eight),
            ArrayError::BlocksAndNeighbours,
        ),
        (
            with_neighbours.blocks(level, settings.pixels(), 40),
            ArrayError::BlocksAndNeighbours,
        ),
        (
            weighing.neighbours(eight),
            ArrayError::NeighboursAndDeadTime,
        ),
        (config.blocks(level, of_x(5), 40), ArrayError::OtherLooks),
        (
            config.blocks(BlockLevel::PIXEL, settings.pixels(), 40),
            ArrayError::NoLevel,
        ),
        (config.first(9), ArrayError::Layout),
        (
            config.neighbours(neighbours(Array::new(2, 4).unwrap())),
            ArrayError::Layout,
        ),
    ];
    for (refused, error) in refusals {
        assert_eq!(refused.err(), Some(error));
        assert!(!error.text().is_empty());
    }
    let mut places: Vec<PixelPlace<BINS>> = (0..8).map(|_| PixelPlace::new()).collect();
    let mut blocks: Vec<Block<BINS>> = vec![Block::default()];
    let mut array = PixelArray::new(&mut places, &mut blocks);
    array.configure(&config).unwrap();
    array.photon(3, 7);
    let larger = ArrayConfig::new(Array::new(3, 3).unwrap(), settings.pixels());
    for (config, error) in [
        (larger, ArrayError::Pixels),
        (with_blocks, ArrayError::Blocks),
    ] {
        assert_eq!(array.configure(&config), Err(error));
        // It goes on.
        assert_eq!(array.pixel(3).unwrap().histogram().total(), 1);
    }
    array.clear();
    assert!(array.pixel(3).is_none() && array.config().is_none());
    array.photon(3, 7);
    assert_eq!(
        (array.end_laser_cycles(5), array.losses().unaddressed),
        (0, 1)
    );
}

proptest! {
    /// In any other order no photon counts twice in a bin, and those that are left out for that are told.
    #[test]
    fn out_of_order_no_bin_counts_twice(
        cycles in prop::collection::vec(prop::collection::vec((0..3_usize, 0..6_u16), 0..12), 1..8),
    ) {
        let config = PixelConfig::<BINS>::paper().build().unwrap();
        let mut places: Vec<Place> = (0..3).map(|_| PixelPlace::new()).collect();
        let mut array = PixelArray::new(&mut places, &mut []);
        array.configure(&ArrayConfig::new(Array::new(3, 1).unwrap(), config).once_per_bin()).unwrap();
        let (mut first, mut all) = ([[0; 6]; 3], 0);
        for photons in &cycles {
            for (pixel, bins) in first.iter_mut().enumerate() {
                for (bin, count) in bins.iter_mut().enumerate() {
                    *count += u32::from(photons.contains(&(pixel, bin as u16)));
                }
            }
            photons.iter().for_each(|&(pixel, code)| array.photon(pixel, code));
            all += photons.len() as u64;
            array.end_laser_cycle();
        }
        let (mut missing, mut counted) = (0, 0);
        for (pixel, bins) in first.iter().enumerate() {
            for (bin, &expected) in bins.iter().enumerate() {
                let count = array.pixel(pixel).unwrap().histogram().count(bin).unwrap();
                prop_assert!(count <= expected);
                missing += u64::from(expected - count);
                counted += u64::from(count);
            }
        }
        prop_assert!(missing <= array.losses().unordered);
        prop_assert_eq!(array.statistics()[0].repeated, all - counted);
    }
}

#[test]
fn what_a_queue_has_lost_is_counted_and_numbered() {
    let config = PixelConfig::<BINS>::paper().build().unwrap();
    let mut places: Vec<PixelPlace<BINS>> = vec![PixelPlace::new()];
    let mut array = PixelArray::new(&mut places, &mut []);
    array
        .configure(&ArrayConfig::new(Array::new(1, 1).unwrap(), config))
        .unwrap();
    for _ in 0..43 {
        array.photon(0, 9);
        array.end_laser_cycle();
    }
    array.lost(17, 1000);
    array.photon(0, 9);
    array.end_laser_cycle();
    let event = array.next_event().unwrap();
    // They belong to no exposure.
    assert_eq!((event.exposure, event.cycle.raw()), (44, 1043));
    assert_eq!(
        (array.losses().photons, array.losses().laser_cycles),
        (17, 1000)
    );
}

#[test]
fn a_whole_histogram_is_decided_on_at_once() {
    let config = PixelConfig::<BINS>::paper().build().unwrap();
    let mut places: Vec<PixelPlace<BINS>> = (0..3).map(|_| PixelPlace::new()).collect();
    let mut array = PixelArray::new(&mut places, &mut []);
    array
        .configure(&ArrayConfig::new(Array::new(3, 1).unwrap(), config))
        .unwrap();
    array.leave_out(2);
    let mut counts = [3u16; BINS];
    counts[20] = 90;
    array.begin_frame(100_000);
    assert_eq!(array.frame_cycles(), 100_000);
    let mut events = Vec::new();
    for (pixel, room) in [(0, 1), (1, 0), (2, 1), (3, 1)] {
        array.histogram::<Count24, _>(PixelAddress::new(pixel), &counts, room, |event| {
            events.push(*event);
        });
    }
    let [event] = events[..] else {
        panic!("{events:?}");
    };
    assert_eq!((event.pixel.raw(), event.peak_bin.raw()), (0, 20));
    assert_eq!((event.cycle.raw(), event.exposure), (99_999, u16::MAX));
    let ([statistics, _], photons) = (array.statistics(), 31 * 3 + 90);
    assert_eq!((statistics.events, statistics.deferred), (1, 1));
    assert_eq!(statistics.counted, 2 * photons);
    assert_eq!(
        (array.losses().left_out, array.losses().unaddressed),
        (photons, photons)
    );
}

/// What an array has done is gone with its configuration, and with the array.
#[test]
fn used_room_is_as_new() {
    let settings = Settings::usual(2, 2, Mode::Blocks(1, 40));
    let (levels, blocks, patience) = settings.blocks().unwrap();
    let config = ArrayConfig::new(settings.layout(), settings.pixels());
    let config = config
        .blocks(levels, blocks, patience)
        .unwrap()
        .once_per_bin();
    let mut places: Vec<Place> = (0..5).map(|_| PixelPlace::new()).collect();
    let mut room: Vec<Block<BINS>> = vec![Block::default()];
    let mut array = PixelArray::new(&mut places, &mut room);
    assert_eq!(array.room(), 5);
    array.leave_out(3);
    // There is no pixel yet.
    array.photon(3, 9);
    assert_eq!(array.losses().unaddressed, 1);
    let run = |array: &mut PixelArray<'_, BINS, WindowRule>| {
        array.configure(&config).unwrap();
        assert_eq!(*array.losses(), ArrayLosses::default());
        let mut events = Vec::new();
        for cycle in 0..403 {
            // Pixel 2 comes twice and out of order now and then.
            for (pixel, code) in [(0, 12), (2, 20), (1, cycle % 32), (2, 19), (3, 12), (4, 12)] {
                array.photon(pixel, code);
            }
            array.end_laser_cycle();
            assert_eq!(array.has_looked(), cycle % 4 == 3);
            // The last events stay.
            if cycle < 380 {
                events.extend(core::iter::from_fn(|| array.next_event()));
            }
        }
        array.lost(3, 5);
        let mut counts = [1u8; BINS];
        counts[20] = 200;
        array.begin_frame(100);
        array.histogram::<Count24, _>(PixelAddress::new(0), &counts, 1, |event| {
            events.push(*event);
        });
        assert!(events.len() > 10 && array.has_event());
        assert_eq!(
            (array.losses().left_out, array.losses().unaddressed),
            (403, 403)
        );
        assert_eq!((array.losses().unordered, array.losses().photons), (403, 3));
        (events, array.statistics())
    };
    let first = run(&mut array);
    assert_eq!(run(&mut array), first);
    // Another array in the same room.
    let mut other = PixelArray::new(&mut places, &mut room);
    other.photon(0, 9);
    assert_eq!(other.losses().unaddressed, 1);
    assert!(other.pixel(0).is_none() && !other.has_event());
    assert_eq!(run(&mut other), first);
}

/// All places of three photons, which are the fewest of a detection or one more, before and after L1: no look finds anything
/// as long as the pixel says so.
#[test]
fn a_pixel_finds_nothing_as_long_as_it_is_dark() {
    const FEW: usize = 16;
    let (mut quiet, mut later) = (0, 0);
    for (minimum, z, dead_time, width) in combinations(
        &[2, 3, 4],
        &[1.0, 2.5, 3.0, 3.2, 3.4, 3.6],
        &[0, 1, 4, 9, u16::MAX],
        &[1, 3],
    ) {
        let rule = WindowRule::new(width, U4F12::from_num(z), Count::saturating(minimum)).unwrap();
        let config = PixelConfig::<FEW, WindowRule>::with_rule(rule)
            .x(1)
            .l1(4)
            .l2(200);
        let config = config.dead_time(dead_time).build().unwrap();
        for place in 0..(FEW as u16).pow(3) {
            let codes = [place % 16, place / 16 % 16, place / 256];
            if !codes.is_sorted() {
                continue;
            }
            let mut pixel = AsyncPixel::<FEW>::new(PixelAddress::new(0));
            pixel.count_batch(&config, &codes);
            let mut statistics = Statistics::new();
            let mut dark = pixel.dark_cycles(&config, false);
            for cycle in 0..210 {
                let blind_looks = statistics.blind_looks;
                let look = pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
                if dark > 0 {
                    assert!(matches!(look, Look::TooEarly | Look::NoPeak), "{look:?}");
                    assert_eq!(statistics.blind_looks, blind_looks);
                    quiet += 1;
                } else if look == Look::Event {
                    later += 1;
                }
                if look != Look::TooEarly && look != Look::NoPeak {
                    break;
                }
                let is_quiet = look == Look::TooEarly || statistics.blind_looks == blind_looks;
                dark = if is_quiet {
                    pixel.dark_cycles(&config, false)
                } else {
                    0
                };
            }
        }
    }
    assert!(quiet > 100_000 && later > 1_000, "{quiet} {later}");
}

/// All combinations.
fn combinations<A: Copy, B: Copy, C: Copy, D: Copy>(
    a: &[A],
    b: &[B],
    c: &[C],
    d: &[D],
) -> impl Iterator<Item = (A, B, C, D)> {
    a.iter().flat_map(move |&a| {
        b.iter().flat_map(move |&b| {
            c.iter()
                .flat_map(move |&c| d.iter().map(move |&d| (a, b, c, d)))
        })
    })
}

/// A pixel that tracks may be decided on by a rule with a lower minimum, and an event that waits is counted at each look.
#[test]
fn a_dark_pixel_minds_its_tracking_and_its_event() {
    let rule = |minimum| WindowRule::new(2, U4F12::lit("1"), Count::saturating(minimum)).unwrap();
    let tracking = Tracking::new(rule(2), rule(9), 1);
    let config = PixelConfig::with_rule(rule(9))
        .x(4)
        .l1(8)
        .l2(100)
        .dead_time(5);
    let config = config.tracking(Some(tracking)).build().unwrap();
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    let mut statistics = Statistics::new();
    pixel.count_batch(&config, &[3, 3, 20]);
    for cycle in 0..12 {
        let _ = pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
    }
    assert_eq!(pixel.dark_cycles(&config, false), 0);

    let config = PixelConfig::with_rule(rule(4))
        .x(4)
        .l1(8)
        .l2(100)
        .build()
        .unwrap();
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    assert_eq!(pixel.dark_cycles(&config, false), 99);
    pixel.count_batch(&config, &[3; 9]);
    assert_eq!(pixel.dark_cycles(&config, false), 8);
    let look = pixel.end_laser_cycles(&config, &mut statistics, LaserCycle::new(11), 12);
    assert_eq!(look, Look::Event);
    assert_eq!(pixel.dark_cycles(&config, false), 8);
    let _ = pixel.take_event();
    assert_eq!(pixel.dark_cycles(&config, false), 99);
}

#[test]
fn another_room_is_refused() {
    let settings = Settings::usual(2, 2, Mode::Blocks(1, 8));
    let mut places: Vec<Place> = (0..4).map(|_| PixelPlace::new()).collect();
    let mut room: Vec<Block<BINS>> = (0..1).map(|_| Block::default()).collect();
    let mut array = PixelArray::new(&mut places, &mut room);
    array.configure(&settings.array()).unwrap();
    array.photon(0, 9);
    let state = array.into_state();
    let fewer = PixelArray::resume(&mut places[..3], &mut room, state.clone());
    assert_eq!(fewer.map(|_| ()), Err(ArrayError::OtherRoom));
    let none = PixelArray::resume(&mut places, &mut [], state.clone());
    assert_eq!(none.map(|_| ()), Err(ArrayError::OtherRoom));
    let array = PixelArray::resume(&mut places, &mut room, state).unwrap();
    assert_eq!(array.statistics()[0].counted, 1);
}

/// An exposure of 92 laser cycles, the first look from L2 on, takes one call, or two with ticks in between.
#[test]
fn dark_laser_cycles_take_few_looks() {
    for (mode, calls_each) in [
        (Mode::Alone, 1),
        (Mode::Blocks(2, 60), 3),
        (Mode::Neighbours(Neighbours::Four), 1),
    ] {
        let settings = Settings::usual(4, 4, mode);
        let mut places: Vec<Place> = (0..16).map(|_| PixelPlace::new()).collect();
        let mut room: Vec<Block<BINS>> = (0..5).map(|_| Block::default()).collect();
        let mut array = PixelArray::new(&mut places, &mut room);
        array.configure(&settings.array()).unwrap();
        let (mut left, mut calls) = (92 * 100, 0);
        while left > 0 {
            left = array.end_laser_cycles(left);
            calls += 1;
        }
        assert!(calls <= 100 * calls_each + 1, "{mode:?}: {calls}");
        assert_eq!(array.statistics()[0].expired, 16 * 100);
    }
}

/// The pixel and level of its events, and of the last decision the photons and laser cycles.
#[derive(Clone, Copy, Default)]
struct Beside {
    address: u32,
    decision: Option<(u32, u32)>,
}

impl PixelData for Beside {
    fn decided_from<const BINS: usize, W: CounterWidth>(
        &mut self,
        input: &DecisionInput<'_, BINS, W>,
    ) {
        assert_eq!(self.decision, None);
        self.decision = Some((input.histogram.peak().count.raw(), input.cycles));
    }
}

#[test]
fn data_are_found_by_event() {
    for mode in [Mode::Blocks(2, 8), Mode::Neighbours(Neighbours::Eight)] {
        let of_levels = events_with_data(Settings::usual(3, 3, mode));
        let blocks = of_levels[1] + of_levels[2];
        let some = if matches!(mode, Mode::Blocks(..)) {
            blocks > 5
        } else {
            blocks == 0
        };
        assert!(of_levels[0] > 10 && some, "{of_levels:?}");
    }
}

/// Drives an array, and returns how many events of each level there were.
fn events_with_data(settings: Settings) -> [u32; 3] {
    let mut places: Vec<PixelPlace<BINS, Count10, Beside>> =
        (0..9).map(|_| PixelPlace::new()).collect();
    let mut room: Vec<Block<BINS, Beside>> = (0..5).map(|_| Block::default()).collect();
    let mut array = PixelArray::new(&mut places, &mut room);
    array.configure(&settings.array()).unwrap();
    let mut of_levels = [0_u32; 3];
    for cycle in 0..4000_usize {
        // Pixels 4 and 8 are bright, the others too dim for themselves.
        array.photon([4, 8][cycle % 2], 12);
        if cycle % 12 == 0 {
            array.photon([0, 1, 2, 3, 5, 6, 7][cycle / 12 % 7], 20);
        }
        array.end_laser_cycle();
        while let Some(event) = array.next_event() {
            let beside = array.data_of(&event).unwrap();
            // Each has one event after another.
            let expected = u32::from(event.pixel.raw()) << 8 | u32::from(event.level.raw());
            assert!(beside.address == 0 || beside.address == expected + 1);
            beside.address = expected + 1;
            let (highest, exposure) = beside.decision.take().unwrap();
            assert_eq!(exposure, u32::from(event.exposure));
            assert!(highest >= event.peak_count.raw());
            of_levels[usize::from(event.level.raw())] += 1;
        }
    }
    of_levels
}

//! Adaptive binning: where blocks lie and who feeds them, and a whole array against a model
//! written from the description of pixels, ticks and feeding.

#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    Array, AsyncPixel, Binning, Block, BlockLevel, Count, Count16, DepthEvent, EchoNumber, Feed,
    LaserCycle, PaperRule, PixelAddress, PixelConfig, Statistics, count_in_blocks,
    end_laser_cycles_of_blocks,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn level(raw: u8) -> BlockLevel {
    BlockLevel::new(raw).unwrap()
}

/// The number of the block that a feed is into. It is on from the first tick.
fn into(mut feed: Feed) -> Option<usize> {
    assert_eq!(feed.block(), None);
    feed.tick(false);
    feed.block()
}

/// Every pixel feeds the block of level 1 that it lies in, and every block that of the next.
fn check(columns: u32, rows: u32) {
    let array = Array::new(columns, rows).unwrap();
    let place = |pixel: PixelAddress| (u32::from(pixel.0) % columns, u32::from(pixel.0) / columns);
    for top in 1..=3 {
        let binning = Binning::new(array, level(top)).unwrap();
        let blocks: Vec<_> = binning.blocks().collect();
        assert_eq!(blocks.len() as u32, binning.number_of_blocks());
        let number_of = (1..=top).map(|level| {
            let side = 1 << level;
            columns.div_ceil(side) * rows.div_ceil(side)
        });
        assert_eq!(number_of.sum::<u32>(), binning.number_of_blocks());
        assert!(blocks.is_sorted_by_key(|block| (block.level, block.first)));
        let parent = |pixel: PixelAddress, of: u8| {
            let (column, row) = place(pixel);
            let (left, top) = (column >> of << of, row >> of << of);
            let first = PixelAddress((top * columns + left) as u16);
            let found = blocks
                .iter()
                .position(|block| (block.first, block.level.raw()) == (first, of));
            found.unwrap()
        };
        for pixel in (0..array.pixels()).map(|pixel| PixelAddress(pixel as u16)) {
            assert_eq!(into(binning.feed_of(pixel)), Some(parent(pixel, 1)));
        }
        for block in &blocks {
            let next = block.level.raw() + 1;
            let expected = (next <= top).then(|| parent(block.first, next));
            assert_eq!(into(block.feed), expected);
        }
        // No other pixel feeds a block.
        for beyond in [array.pixels(), array.pixels() + 1, 65_535] {
            if (array.pixels()..1 << 16).contains(&beyond) {
                assert_eq!(into(binning.feed_of(PixelAddress(beyond as u16))), None);
            }
        }
    }
    assert_eq!(Binning::new(array, BlockLevel::PIXEL), None);
}

#[test]
fn all_small_arrays() {
    for columns in 1..=18 {
        for rows in 1..=18 {
            check(columns, rows);
        }
    }
}

/// Every number of a block fits, however an array lies.
#[test]
fn the_most_blocks_are_those_of_one_row() {
    let blocks = |columns, rows| {
        let array = Array::new(columns, rows).unwrap();
        Binning::new(array, level(3)).unwrap().number_of_blocks()
    };
    let most = (1..=1 << 16)
        .map(|columns| blocks(columns, (1 << 16) / columns))
        .max();
    assert_eq!((most, blocks(1 << 16, 1)), (Some(57_344), 57_344));
    let binning = Binning::new(Array::new(1, 1 << 16).unwrap(), level(3)).unwrap();
    let last = binning.blocks().last().unwrap();
    assert_eq!((last.first, into(last.feed)), (PixelAddress(65_528), None));
    assert_eq!(into(binning.feed_of(PixelAddress(65_535))), Some(32_767));
}

#[test]
fn a_feed_is_on_from_a_tick_to_an_event_and_past_the_tick_after_it() {
    let binning = Binning::new(Array::new(4, 1).unwrap(), level(1)).unwrap();
    let mut feed = binning.feed_of(PixelAddress(2));
    // An event, a tick, or neither; what the feed is into then.
    for (step, expected) in [
        (' ', None),
        ('t', Some(1)),
        ('t', Some(1)),
        ('e', None),
        (' ', None),
        ('t', None), // an event since the last tick
        ('t', Some(1)),
        ('e', None),
        ('e', None),
        ('t', None),
        ('e', None),
        ('t', None),
        ('t', Some(1)),
        ('w', None), // an event that waits, or an exposure that goes on after one
        ('t', Some(1)),
    ] {
        match step {
            'e' => feed.reported(),
            't' => feed.tick(false),
            'w' => feed.tick(true),
            _ => {}
        }
        assert_eq!(feed.block(), expected);
    }
    let mut none = Feed::NONE;
    none.tick(false);
    assert_eq!(none.block(), None);
}

const BINS: usize = 16;

/// One that counts and decides: a pixel, or a block of its children.
struct Node {
    /// Columns and rows that it covers.
    columns: std::ops::Range<u32>,
    rows: std::ops::Range<u32>,
    level: u8,
    /// The laser cycle of its last event.
    reported: Option<u64>,
    /// From the last tick on, until an event.
    feeds: bool,
    counts: [u32; BINS],
    full: u32,
    exposure: u32,
}

/// The description: nodes by level, the pixels first.
struct Model {
    columns: u32,
    nodes: Vec<Node>,
    config: Settings,
    last_tick: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
struct Settings {
    x: u16,
    l1: u16,
    l2: u16,
    alpha: u16,
    patience: u64,
    levels: u8,
}

impl Model {
    fn new(columns: u32, rows: u32, config: Settings) -> Self {
        let mut nodes = Vec::new();
        for level in 0..=config.levels {
            let side = 1 << level;
            for row in (0..rows).step_by(side as usize) {
                for column in (0..columns).step_by(side as usize) {
                    nodes.push(Node {
                        columns: column..columns.min(column + side),
                        rows: row..rows.min(row + side),
                        level,
                        reported: None,
                        feeds: false,
                        counts: [0; BINS],
                        full: if level == 0 { 1023 } else { 65_535 },
                        exposure: 0,
                    });
                }
            }
        }
        Self {
            columns,
            nodes,
            config,
            last_tick: None,
        }
    }

    /// A photon counts in its pixel, and as far up as everyone feeds.
    fn photon(&mut self, column: u32, row: u32, code: usize) {
        let holds = |node: &&mut Node| node.columns.contains(&column) && node.rows.contains(&row);
        for node in self.nodes.iter_mut().filter(holds) {
            if let Some(count) = node.counts.get_mut(code) {
                *count = (*count + 1).min(node.full);
            }
            if !node.feeds {
                return;
            }
        }
    }

    /// First pixel, level, exposure, bin, count and background of the events.
    fn end_laser_cycle(&mut self, cycle: u64) -> Vec<(u32, u8, u32, usize, u32, u32)> {
        let mut events = Vec::new();
        for node in &mut self.nodes {
            node.exposure += 1;
            if node.exposure % u32::from(self.config.x) > 0
                || node.exposure <= u32::from(self.config.l1)
            {
                continue;
            }
            let expired = node.exposure >= u32::from(self.config.l2);
            if !expired {
                let peak = *node.counts.iter().max().unwrap();
                let bin = node.counts.iter().position(|&count| count == peak).unwrap();
                let other = if bin < BINS / 2 {
                    &node.counts[BINS / 2..]
                } else {
                    &node.counts[..BINS / 2]
                };
                let background = other
                    .chunks(BINS / 4)
                    .map(|quadrant| *quadrant.iter().max().unwrap())
                    .min()
                    .unwrap();
                let level = f64::from(background)
                    + f64::from(self.config.alpha) / 256.0 * f64::from(background).sqrt().floor();
                if f64::from(peak) <= level || peak < 5 {
                    continue;
                }
                let first = node.rows.start * self.columns + node.columns.start;
                events.push((first, node.level, node.exposure, bin, peak, background));
                node.reported = Some(cycle);
                node.feeds = false;
            }
            node.counts = [0; BINS];
            node.exposure = 0;
        }
        // Ticks come every `patience`, for all at once.
        if (cycle + 1).is_multiple_of(self.config.patience) {
            for node in &mut self.nodes {
                node.feeds = node.reported <= self.last_tick;
            }
            self.last_tick = Some(cycle);
        }
        events
    }
}

/// How many events there were of each level.
type Events = [u32; 4];

/// An array of the core beside the model.
fn compare(columns: u32, rows: u32, settings: Settings, cycles: u64, rng: &mut Pcg32) -> Events {
    let array = Array::new(columns, rows).unwrap();
    let binning = Binning::new(array, level(settings.levels)).unwrap();
    let rule = PaperRule::new(U8F8::from_bits(settings.alpha), Count::saturating(5));
    let config = PixelConfig::<BINS>::with_rule(rule)
        .x(settings.x)
        .l1(settings.l1);
    let config = config.l2(settings.l2).build().unwrap();
    let mut pixels: Vec<_> = (0..array.pixels())
        .map(|pixel| PixelAddress(pixel as u16))
        .map(|pixel| (AsyncPixel::<BINS>::new(pixel), binning.feed_of(pixel)))
        .collect();
    let mut blocks: Vec<Block<BINS>> = binning.blocks().map(Block::new).collect();
    let [mut of_pixels, mut of_blocks] = [Statistics::new(), Statistics::new()];
    let mut model = Model::new(columns, rows, settings);

    // What each pixel sees: a bin, and how many of 256 laser cycles have a photon there.
    let signals: Vec<(u32, u32)> = pixels
        .iter()
        .map(|_| {
            (
                rng.next_u32() % 3 + 6,
                rng.next_u32() >> (24 + rng.next_u32() % 6),
            )
        })
        .collect();
    let background = rng.next_u32() % 100;
    let (mut photons, mut events) = (0, Events::default());
    for cycle in 0..cycles {
        for (number, (pixel, feed)) in (0..).zip(&mut pixels) {
            let (bin, rate) = signals[number as usize];
            let mut codes = Vec::new();
            if rng.next_u32() % 256 < rate {
                codes.push(bin as u16);
            }
            if rng.next_u32() % 256 < background {
                codes.push((rng.next_u32() % (BINS as u32 + 1)) as u16);
            }
            for code in codes {
                pixel.count(&config, code);
                count_in_blocks(&mut blocks, feed, &config, code);
                model.photon(number % columns, number / columns, code.into());
                photons += 1;
            }
        }
        let now = LaserCycle(cycle);
        let mut found: Vec<DepthEvent> = Vec::new();
        for (pixel, feed) in &mut pixels {
            pixel.end_laser_cycle(&config, &mut of_pixels, now);
            if let Some(event) = pixel.acknowledge() {
                feed.reported();
                found.push(event);
            }
        }
        let fired = end_laser_cycles_of_blocks(&mut blocks, &config, &mut of_blocks, now, 1);
        let waiting = blocks.iter().filter(|block| block.request()).count();
        assert_eq!(fired, waiting > 0);
        found.extend(blocks.iter_mut().filter_map(Block::acknowledge));
        if (cycle + 1).is_multiple_of(settings.patience) {
            pixels
                .iter_mut()
                .for_each(|(pixel, feed)| feed.tick(pixel.has_reported()));
            blocks.iter_mut().for_each(Block::tick);
        }
        let expected = model.end_laser_cycle(cycle);
        for event in &found {
            assert_eq!((event.cycle, event.echo), (now, EchoNumber::FIRST));
            events[usize::from(event.level.raw())] += 1;
        }
        let plain = found.iter().map(|event| {
            let counts = (event.peak_count.raw(), event.background.raw());
            let (first, bin) = (event.pixel.0.into(), event.peak_bin.raw().into());
            (
                first,
                event.level.raw(),
                event.exposure.into(),
                bin,
                counts.0,
                counts.1,
            )
        });
        assert_eq!(plain.collect::<Vec<_>>(), expected, "laser cycle {cycle}");
    }
    // Every photon is in a pixel once; every node holds what the model holds.
    for (pixel, _) in &pixels {
        pixel.add_photons_to(&mut of_pixels);
    }
    assert_eq!(of_pixels.photons(), photons);
    for (node, block) in model.nodes[pixels.len()..].iter().zip(&blocks) {
        let pixel: &AsyncPixel<BINS, Count16> = block.pixel();
        assert_eq!(pixel.histogram().counts().map(u32::from), node.counts);
        assert_eq!(u32::from(pixel.exposure()), node.exposure);
        assert_eq!(pixel.level().raw(), node.level);
    }
    events
}

fn settings(x: u16, l1: u16, l2: u16, patience: u64, levels: u8) -> Settings {
    Settings {
        x,
        l1,
        l2,
        alpha: 3 * 256,
        patience,
        levels,
    }
}

/// Arrays of every shape up to 6 × 6 and the edges of blocks of 8 × 8.
#[test]
fn small_arrays_are_as_described() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = [Events::default(); 4];
    let shapes = (1..=6).flat_map(|columns| (1..=6).map(move |rows| (columns, rows)));
    for (columns, rows) in shapes.chain([(8, 8), (9, 8), (7, 9), (17, 1), (1, 17), (10, 13)]) {
        for levels in 1..=3 {
            for patience in [1, 16, 60, 250] {
                let settings = settings(4, 8, 120, patience, levels);
                let events = compare(columns, rows, settings, 600, &mut rng);
                for (seen, events) in seen[usize::from(levels)].iter_mut().zip(events) {
                    *seen += events;
                }
            }
        }
    }
    println!("{seen:?}");
    for levels in 1..=3 {
        let (with, without) = seen[levels].split_at(levels + 1);
        assert!(with.iter().all(|&events| events > 300), "{seen:?}");
        assert!(without.iter().all(|&events| events == 0), "{seen:?}");
    }
}

proptest! {
    #[test]
    fn any_array_is_as_described(
        (columns, rows) in (1u32..11, 1u32..11),
        (x, more, beyond) in (1u16..6, 0u16..20, 7u16..200),
        (patience, levels) in (1u64..300, 1u8..=3),
        seed in any::<u64>(),
    ) {
        let settings = settings(x, x + more, x + more + beyond, patience, levels);
        compare(columns, rows, settings, 400, &mut Pcg32::seed_from_u64(seed));
    }
}

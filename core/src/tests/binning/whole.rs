//! A whole array against a model written from the description of pixels, ticks and feeding.

use dtof_core::binning::{Binning, Block, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    Array, AsyncPixel, Count, Count16, DepthEvent, EchoNumber, LaserCycle, PaperRule, PixelAddress,
    PixelConfig, RangeGate, Statistics,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::level;

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
    links: bool,
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
                        links: false,
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
            if !node.links {
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
                node.links = false;
            }
            node.counts = [0; BINS];
            node.exposure = 0;
        }
        // Ticks come every `patience`, for all at once.
        if (cycle + 1).is_multiple_of(self.config.patience) {
            for node in &mut self.nodes {
                node.links = node.reported <= self.last_tick;
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
        .map(|pixel| PixelAddress::new(pixel as u16))
        .map(|pixel| (AsyncPixel::<BINS>::new(pixel), binning.link_of(pixel)))
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
        for (number, (pixel, link)) in (0..).zip(&mut pixels) {
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
                count_in_blocks(&mut blocks, link, &config, code);
                model.photon(number % columns, number / columns, code.into());
                photons += 1;
            }
        }
        let now = LaserCycle::new(cycle);
        let mut found: Vec<DepthEvent> = Vec::new();
        for (pixel, link) in &mut pixels {
            pixel.end_laser_cycle(&config, &mut of_pixels, now);
            if let Some(event) = pixel.take_event() {
                link.reported();
                found.push(event);
            }
        }
        end_laser_cycles_of_blocks(&mut blocks, &config, &mut of_blocks, now, 1);
        found.extend(blocks.iter_mut().filter_map(Block::take_event));
        if (cycle + 1).is_multiple_of(settings.patience) {
            pixels
                .iter_mut()
                .for_each(|(pixel, link)| link.tick(pixel.has_reported()));
            blocks.iter_mut().for_each(Block::tick);
        }
        let expected = model.end_laser_cycle(cycle);
        for event in &found {
            assert_eq!((event.cycle, event.echo), (now, EchoNumber::FIRST));
            events[usize::from(event.level.raw())] += 1;
        }
        let plain = found.iter().map(|event| {
            let counts = (event.peak_count.raw(), event.background.raw());
            let (first, bin) = (event.pixel.raw().into(), event.peak_bin.raw().into());
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

/// In the gate, outside it, or of no bin.
#[test]
fn a_photon_that_a_block_gets_is_counted_or_counted_as_lost() {
    let array = Array::new(2, 2).unwrap();
    let binning = Binning::new(array, level(1)).unwrap();
    let config = PixelConfig::<BINS>::paper().gate(RangeGate::new(4, 11).unwrap());
    let config = config.build().unwrap();
    let mut link = binning.link_of(PixelAddress::new(0));
    link.tick(false);
    let mut blocks: Vec<Block<BINS>> = binning.blocks().map(Block::new).collect();
    for code in 0..BINS as u16 + 3 {
        count_in_blocks(&mut blocks, &link, &config, code);
    }
    let mut statistics = Statistics::new();
    blocks[0].pixel().add_photons_to(&mut statistics);
    let found = [
        statistics.counted,
        statistics.gated_out,
        statistics.rejected,
    ];
    assert_eq!(found, [8, 8, 3]);
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

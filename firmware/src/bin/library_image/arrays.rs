//! Pixels of dtof-core that decide together.

use core::array;

use dtof_core::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::neighbours::{NeighbourConfig, end_laser_cycles_of_array};
use dtof_core::{
    AnyRule, Array, ArrayConfig, AsyncPixel, Count8, Count10, Count16, Count20, Count24,
    CounterWidth, Neighbours, PixelArray, PixelPlace, Statistics,
};

use crate::values::{
    address, any_rule, byte, cycle, gate, half, keep, level, more, or_text, settings, some,
    some_mut, values, window_rule, word,
};

pub fn all() {
    blocks::<8>();
    blocks::<128>();
    blocks::<1024>();
    driven::<8, Count10>();
    driven::<128, Count8>();
    driven::<128, Count10>();
    driven::<1024, Count20>();
    whole::<8, Count24>();
    whole::<128, Count24>();
    whole::<1024, Count20>();
    neighbours::<8, Count10>();
    neighbours::<128, Count8>();
    neighbours::<128, Count10>();
    neighbours::<128, Count16>();
    neighbours::<1024, Count20>();
}

/// Arrays of any shape, pixels and first pixels of blocks that may lie in none.
#[inline(never)]
fn blocks<const BINS: usize>() {
    let Some(array) = Array::new(word(), word()) else {
        return;
    };
    keep((array.columns(), array.rows(), array.pixels()));
    keep((array.blocks(level()), array.block_of(address(), level())));
    let first = array.first_of(word(), level());
    array.pixels_of(first, level()).for_each(keep);
    array.pixels_of(address(), level()).for_each(keep);
    let Some(binning) = Binning::new(array, level()) else {
        return;
    };
    keep((binning.number_of_blocks(), BlockLink::NONE));
    let mut link = binning.link_of(address());
    let rule = any_rule().of_blocks(level());
    let tracking = rule.tracking(&gate::<BINS>());
    let Some(config) = or_text(settings::<BINS, _>(rule).tracking(tracking).build()) else {
        return;
    };
    for place in binning.blocks() {
        let mut blocks: [Block<BINS>; 1] = [Block::new(place)];
        let mut statistics = Statistics::default();
        while more() {
            count_in_blocks(&mut blocks, &link, &config, half());
            let (cycle, cycles) = (cycle(), half());
            let look =
                end_laser_cycles_of_blocks(&mut blocks, &config, &mut statistics, cycle, cycles);
            keep(look);
            link.tick(more());
            link.reported();
            keep(link.block());
            let [block] = &mut blocks;
            block.tick();
            keep((block.has_event(), block.take_event()));
            keep((block.pixel().level(), block.pixel().address()));
        }
        keep(statistics);
    }
}

/// An array that is driven, of any shape, with blocks or neighbours or without.
#[inline(never)]
fn driven<const BINS: usize, W: CounterWidth>() {
    let (Some(array), Some(around)) = (Array::new(word(), word()), Neighbours::new(byte())) else {
        return;
    };
    let (Some(config), Some(rule)) = (
        or_text(settings::<BINS, _>(any_rule()).build()),
        window_rule(),
    ) else {
        return;
    };
    let mut config = ArrayConfig::new(array, config);
    if more() {
        let blocks = settings::<BINS, _>(any_rule().of_blocks(level()));
        let Some(blocks) = or_text(blocks.build()) else {
            return;
        };
        let Some(with) = or_text(config.blocks(level(), blocks, half())) else {
            return;
        };
        config = with;
    } else if more() {
        let with = config.neighbours(NeighbourConfig::new(array, around, &rule));
        let Some(with) = or_text(with) else {
            return;
        };
        config = with;
    }
    if more() {
        config = config.once_per_bin();
    }
    let Some(config) = or_text(config.first(word())) else {
        return;
    };
    keep((config.has_neighbours(), *config.pixels()));
    let mut places: [PixelPlace<BINS, W>; 3] = array::from_fn(|_| PixelPlace::new());
    let mut blocks: [Block<BINS>; 2] = array::from_fn(|_| Block::default());
    let mut driven = PixelArray::new(&mut places, &mut blocks);
    while more() {
        if more() {
            keep(or_text(driven.configure(&config)));
        }
        driven.leave_out(usize::from(half()));
        driven.photon(usize::from(half()), half());
        keep(driven.end_laser_cycles(half()));
        driven.lost(cycle().raw(), cycle().raw());
        keep((driven.has_event(), driven.has_looked(), driven.cycles()));
        if let Some(event) = driven.next_event() {
            keep(driven.data_of(&event).is_some());
            keep(event);
        }
        keep((
            driven.exposure(usize::from(half())),
            driven.room(),
            *driven.losses(),
        ));
        keep(driven.pixel(usize::from(half())).map(AsyncPixel::exposure));
        keep((driven.config().is_some(), driven.statistics()));
        if more() {
            driven.clear();
        }
    }
}

/// Whole histograms of one.
#[inline(never)]
fn whole<const BINS: usize, V: CounterWidth>() {
    let Some(config) = or_text(settings::<BINS, _>(any_rule()).build()) else {
        return;
    };
    let Some(layout) = Array::new(word(), word()) else {
        return;
    };
    let mut places: [PixelPlace<BINS>; 3] = array::from_fn(|_| PixelPlace::new());
    let mut driven = PixelArray::new(&mut places, &mut []);
    keep(or_text(driven.configure(&ArrayConfig::new(layout, config))));
    while more() {
        driven.begin_frame(word());
        let counts = values::<u32, BINS>(word);
        driven.histogram::<V, _>(address(), &counts, usize::from(half()), |event| {
            keep(*event);
        });
    }
    keep((driven.frame_cycles(), driven.statistics()));
}

/// Pixels with any addresses, of an array that may have more or fewer.
#[inline(never)]
fn neighbours<const BINS: usize, W: CounterWidth>() {
    let (Some(array), Some(around)) = (Array::new(word(), word()), Neighbours::new(byte())) else {
        return;
    };
    array.neighbours(address(), around).for_each(keep);
    let Some(rule) = window_rule() else {
        return;
    };
    let config = NeighbourConfig::new(array, around, &rule);
    keep((around.raw(), config.rule().z(word(), word())));
    let own = AnyRule::from(*config.rule().own());
    let Some(own) = or_text(settings::<BINS, _>(own).build()) else {
        return;
    };
    let mut statistics = Statistics::default();
    let mut pixels: [AsyncPixel<BINS, W>; 3] = array::from_fn(|_| AsyncPixel::new(address()));
    while more() {
        for pixel in &mut pixels {
            pixel.count_batch(&own, some(&values::<u16, 16>(half)));
            keep((pixel.take_event(), pixel.has_reported(), pixel.level()));
        }
        let (cycle, cycles) = (cycle(), half());
        let some = some_mut(&mut pixels);
        let fired = end_laser_cycles_of_array(some, &own, &config, &mut statistics, cycle, cycles);
        keep(fired);

        // The same steps by themselves.
        let [pixel, others @ ..] = &mut pixels;
        keep(pixel.begin_look(&own, &mut statistics, cycles));
        if let Some(detection) = pixel.decide(&own, config.rule(), others.iter()) {
            pixel.keep_detection(cycle, &detection);
        }
        keep(pixel.end_look(&own, &mut statistics, cycle, |input| keep(input.cycles)));
    }
    keep(statistics);
}

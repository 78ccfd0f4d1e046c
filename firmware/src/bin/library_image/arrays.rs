//! Pixels of dtof-core that decide together.

use core::array;

use dtof_core::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::neighbours::{NeighbourConfig, end_laser_cycles_of_array};
use dtof_core::{
    AnyRule, Array, AsyncPixel, Count8, Count10, Count16, Count20, CounterWidth, Neighbours,
    Statistics,
};

use crate::values::{
    address, any_rule, byte, cycle, gate, half, keep, level, more, or_text, settings, some,
    some_mut, values, window_rule, word,
};

pub fn all() {
    blocks::<8>();
    blocks::<128>();
    blocks::<1024>();
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
        let mut blocks = [Block::new(place)];
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

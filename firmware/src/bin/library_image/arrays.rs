//! Pixels of dtof-core that decide together.

use core::array;
use core::ops::AddAssign;

use dtof_core::binning::Block;
use dtof_core::neighbours::{NeighbourConfig, Threads};
use dtof_core::{
    AnyRule, Array, ArrayConfig, Count8, Count10, Count16, Count20, Count24, CounterWidth,
    Neighbours, PixelArray, PixelPlace,
};

use crate::values::{
    address, any_rule, byte, cycle, gate, half, keep, level, more, or_text, settings, values,
    window_rule, word,
};

pub fn all() {
    layout();
    driven::<8, Count10>();
    driven::<128, Count8>();
    driven::<128, Count10>();
    driven::<128, Count16>();
    driven::<1024, Count20>();
    whole::<8, Count24>();
    whole::<128, Count24>();
    whole::<1024, Count20>();
}

/// Arrays of any shape, pixels and first pixels of blocks that may lie in none.
#[inline(never)]
fn layout() {
    let Some(array) = Array::new(word(), word()) else {
        return;
    };
    keep((array.columns(), array.rows(), array.pixels()));
    if let Some(around) = Neighbours::new(byte()) {
        array.neighbours(address(), around).for_each(keep);
        keep(around.raw());
    }
    keep((array.blocks(level()), array.block_of(address(), level())));
    let first = array.first_of(word(), level());
    array.pixels_of(first, level()).for_each(keep);
    array.pixels_of(address(), level()).for_each(keep);
}

/// An array that is driven, of any shape, with blocks or neighbours or without.
#[inline(never)]
fn driven<const BINS: usize, W: CounterWidth>() {
    let (Some(array), Some(around)) = (Array::new(word(), word()), Neighbours::new(byte())) else {
        return;
    };
    let Some(rule) = window_rule() else {
        return;
    };
    let settings = |rule: AnyRule| {
        let tracking = rule.tracking(&gate::<BINS>());
        or_text(settings::<BINS, _>(rule).tracking(tracking).build())
    };
    let Some(config) = settings(any_rule()) else {
        return;
    };
    let mut config = ArrayConfig::new(array, config);
    if more() {
        let Some(blocks) = settings(any_rule().of_blocks(level())) else {
            return;
        };
        let Some(with) = or_text(config.blocks(level(), blocks, half())) else {
            return;
        };
        config = with;
    } else if more() {
        let around = NeighbourConfig::new(array, around, &rule);
        keep((*around.rule().own(), around.rule().z(word(), word())));
        let Some(with) = or_text(config.neighbours(around)) else {
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
    keep((config.has_neighbours(), *config.pixels(), config.room()));
    let mut places: [PixelPlace<BINS, W>; 3] = array::from_fn(|_| PixelPlace::new());
    let mut blocks: [Block<BINS>; 2] = array::from_fn(|_| Block::default());
    let mut driven = PixelArray::new(&mut places, &mut blocks);
    while more() {
        if more() {
            keep(or_text(driven.configure(&config)));
        }
        driven.leave_out(usize::from(half()));
        driven.photon(usize::from(half()), half());
        keep((driven.to_look(), driven.end_laser_cycles(half())));
        driven.photons(usize::from(half()), &values::<u16, 3>(half));
        keep(
            driven.end_laser_cycles_on(&InTurn, half(), |pixel, _, codes| {
                keep(pixel);
                codes.fill_with(half);
                usize::from(half())
            }),
        );
        keep(driven.data().count());
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
        keep(driven.pixel(usize::from(half())).map(|pixel| {
            let dark = pixel.dark_cycles(config.pixels(), more());
            (pixel.exposure(), pixel.has_reported(), pixel.level(), dark)
        }));
        keep((driven.config().is_some(), driven.statistics()));
        if more() {
            driven.clear();
        }
        let state = driven.into_state();
        let Some(resumed) = or_text(PixelArray::resume(&mut places, &mut blocks, state)) else {
            return;
        };
        driven = resumed;
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

/// One thread.
struct InTurn;

impl Threads for InTurn {
    fn each<P: Send, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        work: impl Fn(usize, &mut [P]) -> S + Sync,
    ) -> S {
        work(0, items)
    }

    fn decide<P: Send + Sync, D: Send + Sync, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        decide: impl Fn(&[P], usize) -> Option<D> + Sync,
        work: impl Fn(&mut P, Option<&D>, &mut S) + Sync,
    ) -> S {
        // There are three places.
        let found = [0, 1, 2].map(|number| decide(items, number));
        let mut sum = S::default();
        for (item, found) in items.iter_mut().zip(&found) {
            work(item, found.as_ref(), &mut sum);
        }
        sum
    }
}

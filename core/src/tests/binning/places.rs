//! Where blocks lie, and who feeds them.

use dtof_core::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::{
    Array, BlockLevel, EchoNumber, Flags, LaserCycle, PixelAddress, PixelConfig, Statistics,
};

use super::level;

/// The number of the block that a feed is into. It is on from the first tick.
fn into(mut link: BlockLink) -> Option<usize> {
    assert_eq!(link.block(), None);
    link.tick(false);
    link.block()
}

/// Every pixel feeds the block of level 1 that it lies in, and every block that of the next.
fn check(columns: u32, rows: u32) {
    let array = Array::new(columns, rows).unwrap();
    let place = |pixel: PixelAddress| {
        (
            u32::from(pixel.raw()) % columns,
            u32::from(pixel.raw()) / columns,
        )
    };
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
            let first = PixelAddress::new((top * columns + left) as u16);
            let found = blocks
                .iter()
                .position(|block| (block.first, block.level.raw()) == (first, of));
            found.unwrap()
        };
        for pixel in (0..array.pixels()).map(|pixel| PixelAddress::new(pixel as u16)) {
            assert_eq!(into(binning.link_of(pixel)), Some(parent(pixel, 1)));
        }
        for block in &blocks {
            let next = block.level.raw() + 1;
            let expected = (next <= top).then(|| parent(block.first, next));
            assert_eq!(into(block.link), expected);
        }
        // No other pixel feeds a block.
        for beyond in [array.pixels(), array.pixels() + 1, 65_535] {
            if (array.pixels()..1 << 16).contains(&beyond) {
                assert_eq!(
                    into(binning.link_of(PixelAddress::new(beyond as u16))),
                    None
                );
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
    assert_eq!(
        (last.first, into(last.link)),
        (PixelAddress::new(65_528), None)
    );
    assert_eq!(
        into(binning.link_of(PixelAddress::new(65_535))),
        Some(32_767)
    );
}

#[test]
fn a_feed_is_on_from_a_tick_to_an_event_and_past_the_tick_after_it() {
    let binning = Binning::new(Array::new(4, 1).unwrap(), level(1)).unwrap();
    let mut link = binning.link_of(PixelAddress::new(2));
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
            'e' => link.reported(),
            't' => link.tick(false),
            'w' => link.tick(true),
            _ => {}
        }
        assert_eq!(link.block(), expected);
    }
    let mut none = BlockLink::NONE;
    none.tick(false);
    assert_eq!(none.block(), None);
}

/// A TDC for each pixel, so that a photon a pixel in every second laser cycle is no pile-up of any.
#[test]
fn a_block_piles_up_when_its_pixels_do() {
    for (number, pixels) in [(1, 4), (2, 16), (3, 64)] {
        let side = 1 << number;
        let binning = Binning::new(Array::new(side, side).unwrap(), level(number)).unwrap();
        let mut config = PixelConfig::<32>::paper().l2(4000).build().unwrap();
        config = config.with_dead_time(u16::MAX);
        for (more, piles_up) in [(0, false), (1, true)] {
            let mut links: Vec<BlockLink> = (0..pixels)
                .map(|pixel| binning.link_of(PixelAddress::new(pixel)))
                .collect();
            let mut blocks: Vec<Block<32>> = binning.blocks().map(Block::new).collect();
            // Twice as often as there are levels: all the way up.
            for _ in 0..2 * number {
                links.iter_mut().for_each(|link| link.tick(false));
                blocks.iter_mut().for_each(Block::tick);
            }
            for photon in 0..22 * pixels + more {
                let link = &links[usize::from(photon % pixels)];
                count_in_blocks(&mut blocks, link, &config, 9);
            }
            let mut statistics = Statistics::default();
            let last = LaserCycle::new(43);
            end_laser_cycles_of_blocks(&mut blocks, &config, &mut statistics, last, 44);
            let block = blocks.last_mut().unwrap();
            let event = block.take_event().unwrap();
            assert_eq!(event.level, level(number));
            assert_eq!(
                event.flags.contains(Flags::PILE_UP),
                piles_up,
                "{number} {more}"
            );
        }
    }
}

/// A block that had an echo and has waited for another is not silent at the tick after that exposure.
#[test]
fn an_exposure_that_ends_after_its_wait_is_a_report() {
    let binning = Binning::new(Array::new(4, 4).unwrap(), level(2)).unwrap();
    let echoes = EchoNumber::new(2).unwrap();
    let config = PixelConfig::<32>::paper().l1(8).l2(60).echoes(echoes, 2);
    let config = config.build().unwrap();
    let mut link = binning.link_of(PixelAddress::new(0));
    link.tick(false);
    let mut blocks: Vec<Block<32>> = binning.blocks().map(Block::new).collect();
    let mut statistics = Statistics::default();
    let photons = |blocks: &[Block<32>]| blocks.last().unwrap().pixel().histogram().total();
    for cycle in 0..64 {
        count_in_blocks(&mut blocks, &link, &config, 9);
        let now = LaserCycle::new(cycle);
        end_laser_cycles_of_blocks(&mut blocks, &config, &mut statistics, now, 1);
        let event = blocks[0].take_event();
        assert_eq!(event.is_some(), cycle == 11);
        if cycle == 20 {
            // The tick during the exposure with the echo.
            blocks.iter_mut().for_each(Block::tick);
        }
    }
    assert_eq!(blocks[0].pixel().exposure(), 4);
    assert_eq!(photons(&blocks), 0);
    // The tick after it: still no photon goes on to the next level. After one without a report it does.
    for goes_on in [false, true] {
        blocks.iter_mut().for_each(Block::tick);
        count_in_blocks(&mut blocks, &link, &config, 9);
        assert_eq!(photons(&blocks) > 0, goes_on);
    }
}

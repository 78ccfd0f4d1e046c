//! An array does what that of `dtof-core` does.

use core::ptr;

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use dtof_core::binning::Block;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{AnyRule, Array, ArrayConfig, BlockLevel, Neighbours, PixelArray, PixelPlace};
use dtof_link::HistogramPart;
use proptest::prelude::*;

use crate::pixels::{CYCLES, config_with, numbers, photons, plain, read, rule_of, settings};
use crate::{OK, paper, statistics, zeroed};

/// Room for pixels and blocks.
pub const PIXELS: u16 = 20;
pub const BLOCKS: usize = 15;

/// An array and its room.
pub struct Driven {
    pub array: dtof_array_t,
    // A box must be alone in leading to what is in it.
    places: *mut [dtof_place_t; PIXELS as usize],
    blocks: *mut [dtof_block_t; BLOCKS],
}

impl Drop for Driven {
    fn drop(&mut self) {
        // SAFETY: both come from boxes, and the array is gone.
        unsafe { drop((Box::from_raw(self.places), Box::from_raw(self.blocks))) };
    }
}

impl Driven {
    pub fn new() -> Self {
        let places: *mut [dtof_place_t; PIXELS as usize] = Box::into_raw(Box::new(zeroed()));
        let blocks: *mut [dtof_block_t; BLOCKS] = Box::into_raw(Box::new(zeroed()));
        let (room, block_room) = (places.cast(), blocks.cast());
        let mut array = zeroed();
        let size = DTOF_PLACE_SIZE;
        // SAFETY: each pointer leads to room of its type.
        let made =
            unsafe { dtof_array_init(&mut array, size, room, PIXELS.into(), block_room, BLOCKS) };
        assert_eq!(made, OK);
        Self {
            array,
            places,
            blocks,
        }
    }

    pub fn configure(&mut self, settings: &dtof_config_t, layout: &dtof_layout_t) -> dtof_status_t {
        let array = &raw mut self.array;
        // SAFETY: each pointer leads to an object of its type.
        let status = unsafe { dtof_array_configure_layout(array, settings, layout) };
        if layout.block_levels + layout.neighbours + layout.once_per_bin == 0 {
            // SAFETY: the same.
            let alone = unsafe { dtof_array_configure(array, settings, layout.pixels) };
            assert_eq!(alone, status);
        }
        status
    }

    pub fn next_event(&mut self) -> Option<dtof_event_t> {
        let mut event = dtof_event_t::default();
        // SAFETY: each pointer leads to an object of its type.
        match unsafe { dtof_array_next_event(&mut self.array, &mut event) } {
            OK => Some(event),
            DTOF_ERROR_NO_EVENT => None,
            error => panic!("{error:?}"),
        }
    }
}

/// The layout and settings of an array in `dtof-core`.
fn of_core(settings: &dtof_config_t, layout: &dtof_layout_t) -> Option<ArrayConfig<128, AnyRule>> {
    let rule = rule_of(settings)?;
    let (pixels, columns) = (u32::from(layout.pixels), u32::from(layout.columns));
    let array = Array::new(columns, pixels.div_ceil(columns))?;
    let levels = BlockLevel::new(layout.block_levels)?;
    let config = match (Neighbours::new(layout.neighbours), rule) {
        (None, _) => ArrayConfig::new(array, config_with(settings, rule)?),
        (Some(neighbours), AnyRule::Window(rule)) => {
            let neighbours = NeighbourConfig::new(array, neighbours, &rule);
            let own = config_with(settings, (*neighbours.rule().own()).into())?;
            ArrayConfig::new(array, own).neighbours(neighbours).ok()?
        }
        _ => return None,
    };
    let mut config = config.first(pixels).ok()?;
    if levels > BlockLevel::PIXEL {
        let pixels = config.pixels();
        if pixels.weighs_dead_time() && !pixels.is_first_photon_only() {
            return None;
        }
        let blocks = config_with(settings, rule.of_blocks(levels))?;
        config = config.blocks(levels, blocks, layout.patience).ok()?;
    }
    Some(match layout.once_per_bin {
        0 => config,
        _ => config.once_per_bin(),
    })
}

fn layouts() -> impl Strategy<Value = dtof_layout_t> {
    let shape = (2u16..=PIXELS, 1u16..6, 4u16..40);
    let together = prop_oneof![
        Just((0, 0)),
        (1u8..3).prop_map(|levels| (levels, 0)),
        Just((0, 4)),
        Just((0, 8)),
        Just((1, 8))
    ];
    (shape, together, 0u8..2).prop_map(|((pixels, columns, patience), together, once_per_bin)| {
        dtof_layout_t {
            pixels,
            columns,
            patience,
            block_levels: together.0,
            neighbours: together.1,
            once_per_bin,
        }
    })
}

proptest! {
    #[test]
    fn an_array_reports_what_that_of_the_core_reports(
        settings in settings(),
        layout in layouts(),
        photons in photons(),
        left_out in 0..PIXELS,
        ways in prop::collection::vec((0u8..4, any::<bool>()), CYCLES),
    ) {
        let mut mine = Driven::new();
        let configured = mine.configure(&settings, &layout);
        let config = of_core(&settings, &layout);
        prop_assert_eq!(configured == OK, config.is_some(), "{:?}", configured);
        let Some(config) = config else {
            return Ok(());
        };
        let mut room: Vec<PixelPlace<128>> = (0..PIXELS).map(|_| PixelPlace::new()).collect();
        let mut blocks: Vec<Block<128>> = (0..BLOCKS).map(|_| Block::default()).collect();
        let mut other = PixelArray::new(&mut room, &mut blocks);
        prop_assert_eq!(other.configure(&config), Ok(()));
        let array = &raw mut mine.array;
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            prop_assert_eq!(dtof_array_leave_out(array, left_out), OK);
            other.leave_out(left_out.into());
            for (cycle, (codes, (way, takes))) in (0u16..).zip(photons.iter().zip(ways)) {
                // Most laser cycles are of one pixel and its neighbours; some are of a number without a pixel.
                let pixel = if way == 3 { cycle % 23 } else { cycle % 2 };
                if way == 0 {
                    codes.iter().for_each(|&code| other.photon(pixel.into(), code));
                } else {
                    other.photons(pixel.into(), codes);
                }
                if way == 1 {
                    for &code in codes {
                        prop_assert_eq!(dtof_array_photon(array, pixel, code), OK);
                    }
                } else {
                    let (first, number) = (codes.as_ptr(), codes.len());
                    prop_assert_eq!(dtof_array_photons(array, pixel, first, number), OK);
                }
                if way == 3 {
                    prop_assert_eq!(dtof_array_lost(array, 3, 1), OK);
                    other.lost(3, 1);
                }
                let mut cycles = if way == 2 { 9 } else { 1 };
                while cycles > 0 {
                    let mut left = 0;
                    prop_assert_eq!(dtof_array_end_laser_cycles(array, cycles, &mut left), OK);
                    cycles = other.end_laser_cycles(cycles);
                    prop_assert_eq!(left, cycles);
                    while takes && let Some(event) = other.next_event() {
                        prop_assert_eq!(mine.next_event(), Some(plain(&event)));
                    }
                    prop_assert!(!takes || mine.next_event().is_none());
                }
            }
            let (mut of_pixels, mut of_blocks, mut losses, mut cycles) = (zeroed(), zeroed(), zeroed(), 0);
            let status = dtof_array_statistics(array, &mut of_pixels, &mut of_blocks, &mut losses);
            prop_assert_eq!(status, OK);
            let expected = other.statistics().map(|of| numbers(&of));
            prop_assert_eq!([read(&of_pixels), read(&of_blocks)], expected);
            let lost = other.losses();
            prop_assert_eq!(losses, dtof_losses_t {
                unaddressed: lost.unaddressed,
                left_out: lost.left_out,
                unordered: lost.unordered,
                photons: lost.photons,
                laser_cycles: lost.laser_cycles,
            });
            prop_assert_eq!(dtof_array_cycles(array, &mut cycles), OK);
            prop_assert_eq!(cycles, other.cycles());
            for pixel in 0..PIXELS + 3 {
                let of_core = other.pixel(pixel.into());
                let (mut counts, mut head) = (Vec::new(), None);
                for number in 0.. {
                    let (mut body, mut length) = ([0; DTOF_BODY_BYTES], 9);
                    let room = body.as_mut_ptr();
                    let status = dtof_array_histogram_write(array, pixel, number, room, &mut length);
                    prop_assert_eq!(status, if of_core.is_some() { OK } else { DTOF_ERROR_PIXELS });
                    if status != OK || length == 0 {
                        break;
                    }
                    let part = HistogramPart::from_le_bytes(&body[..length]).unwrap().unwrap();
                    prop_assert_eq!(usize::from(part.first_bin()), counts.len());
                    counts.extend(part.counts());
                    head = Some(part.head());
                }
                prop_assert_eq!(head.is_some(), of_core.is_some());
                if let (Some(head), Some(of_core)) = (head, of_core) {
                    let exposure = other.exposure(pixel.into()).map(u32::from);
                    prop_assert_eq!((head.pixel.raw(), Some(head.exposure)), (pixel, exposure));
                    prop_assert_eq!((head.cycle.raw(), head.is_whole), (cycles, false));
                    prop_assert_eq!(counts, of_core.histogram().counts().map(u32::from));
                }
            }
        }
    }
}

#[test]
fn what_an_array_cannot_be_has_its_own_error() {
    let mut driven = Driven::new();
    let window = dtof_config_t {
        rule: DTOF_RULE_WINDOW,
        ..paper()
    };
    let dead_time = |dead_time| dtof_config_t {
        dead_time,
        ..window
    };
    let dead = dead_time(20);
    let alone = dtof_layout_t {
        pixels: 16,
        columns: 4,
        patience: 64,
        ..dtof_layout_t::default()
    };
    let blocks = |block_levels| dtof_layout_t {
        block_levels,
        ..alone
    };
    let neighbours = |neighbours| dtof_layout_t {
        neighbours,
        ..alone
    };
    let pixels = |pixels| dtof_layout_t { pixels, ..alone };
    for (settings, layout, expected) in [
        (paper(), alone, OK),
        (paper(), pixels(0), DTOF_ERROR_PIXELS),
        (paper(), pixels(20), OK),
        (paper(), pixels(21), DTOF_ERROR_PIXELS),
        (dead, blocks(0), OK),
        (dead, blocks(1), DTOF_ERROR_DEAD_TIME),
        (dead_time(127), blocks(1), DTOF_ERROR_DEAD_TIME),
        (dead_time(128), blocks(1), OK),
        (dead_time(u16::MAX), blocks(1), OK),
        (paper(), blocks(1), OK),
        (paper(), blocks(2), OK),
        // Four of 2 x 2, one of 4 x 4 and one of 8 x 8 pixels.
        (paper(), blocks(3), OK),
        (paper(), blocks(4), DTOF_ERROR_BLOCKS),
        (
            paper(),
            dtof_layout_t {
                columns: 1,
                ..blocks(1)
            },
            OK,
        ),
        (
            paper(),
            dtof_layout_t {
                pixels: 20,
                columns: 1,
                ..blocks(3)
            },
            DTOF_ERROR_BLOCKS,
        ),
        (
            paper(),
            dtof_layout_t {
                patience: 0,
                ..blocks(1)
            },
            DTOF_ERROR_PATIENCE,
        ),
        (window, neighbours(4), OK),
        (window, neighbours(8), OK),
        (window, neighbours(5), DTOF_ERROR_NEIGHBOURS),
        (paper(), neighbours(8), DTOF_ERROR_NEIGHBOURS),
        (dead, neighbours(8), DTOF_ERROR_NEIGHBOURS),
        (
            window,
            dtof_layout_t {
                block_levels: 1,
                ..neighbours(8)
            },
            DTOF_ERROR_NEIGHBOURS,
        ),
        (dtof_config_t { x: 0, ..paper() }, alone, DTOF_ERROR_ZERO_X),
        // Which pixels are beside each other is not known.
        (
            paper(),
            dtof_layout_t {
                columns: 0,
                ..blocks(1)
            },
            DTOF_ERROR_BLOCKS,
        ),
        (
            window,
            dtof_layout_t {
                columns: 0,
                ..neighbours(8)
            },
            DTOF_ERROR_NEIGHBOURS,
        ),
        // One row.
        (
            paper(),
            dtof_layout_t {
                columns: 0,
                ..alone
            },
            OK,
        ),
    ] {
        assert_eq!(driven.configure(&settings, &layout), expected, "{layout:?}");
    }
    // SAFETY: each pointer leads to an object of its type, or is null.
    unsafe {
        let array = &raw mut driven.array;
        assert_eq!(dtof_array_leave_out(array, PIXELS - 1), OK);
        assert_eq!(dtof_array_leave_out(array, PIXELS), DTOF_ERROR_PIXELS);
        // After the error of a null pointer no laser cycle has ended.
        let (mut done, mut cycles) = (statistics(), 9);
        assert_eq!(
            dtof_array_end_laser_cycles(array, 2, ptr::null_mut()),
            DTOF_ERROR_NULL
        );
        assert_eq!(dtof_array_end_laser_cycles(array, 1, ptr::null_mut()), OK);
        assert_eq!(dtof_array_cycles(array, &mut cycles), OK);
        assert_eq!(cycles, 1);
        let (none, no_losses) = (ptr::null_mut(), ptr::null_mut());
        assert_eq!(dtof_array_statistics(array, &mut done, none, no_losses), OK);
        assert_eq!(read(&done), [0; 12]);
        let (at, room, none) = (&mut zeroed(), ptr::null_mut(), ptr::null_mut());
        assert_eq!(dtof_array_init(at, 8, room, 0, none, 0), DTOF_ERROR_SIZE);
        assert_eq!(
            dtof_array_init(at, DTOF_PLACE_SIZE, room, usize::MAX, none, 0),
            DTOF_ERROR_LENGTH
        );
        assert_eq!(
            dtof_array_init(at, DTOF_PLACE_SIZE, room, 1, none, 0),
            DTOF_ERROR_NULL
        );
        assert_eq!(
            dtof_array_init(at, DTOF_PLACE_SIZE, room, 0, none, 1),
            DTOF_ERROR_NULL
        );
    }
}

/// What a refused call would have written: nothing.
#[test]
fn after_an_error_all_is_as_it_was() {
    let mut driven = Driven::new();
    let layout = dtof_layout_t {
        pixels: 2,
        ..dtof_layout_t::default()
    };
    assert_eq!(driven.configure(&paper(), &layout), OK);
    let room = driven.places.cast::<dtof_place_t>();
    let codes = [60; 20];
    // SAFETY: each pointer leads to an object of its type, is null or is misaligned.
    unsafe {
        let array = &raw mut driven.array;
        assert_eq!(dtof_array_photons(array, 1, codes.as_ptr(), 20), OK);
        // Room that an array has, and room that cannot be.
        let (other, null) = (&mut zeroed(), ptr::null_mut::<dtof_block_t>());
        let misaligned = driven.blocks.cast::<dtof_block_t>().wrapping_byte_add(1);
        for (blocks, number, error) in [
            (null, 1, DTOF_ERROR_NULL),
            (misaligned, 1, DTOF_ERROR_ALIGNMENT),
            (driven.blocks.cast(), usize::MAX, DTOF_ERROR_LENGTH),
        ] {
            let refused = dtof_array_init(other, DTOF_PLACE_SIZE, room, 2, blocks, number);
            assert_eq!(refused, error);
        }
        // Statistics, with others that cannot be written.
        let mut written = [statistics(), statistics()];
        let [of_pixels, of_blocks] = &mut written;
        let (blocks, losses) = (&raw mut *of_blocks, &mut dtof_losses_t::default());
        let (blocks_off, losses_off) = (
            blocks.wrapping_byte_add(1),
            (&raw mut *losses).wrapping_byte_add(1),
        );
        let refused = dtof_array_statistics(array, of_pixels, blocks_off, losses);
        assert_eq!(refused, DTOF_ERROR_ALIGNMENT);
        let refused = dtof_array_statistics(array, of_pixels, blocks, losses_off);
        assert_eq!(refused, DTOF_ERROR_ALIGNMENT);
        assert_eq!(written.map(|written| read(&written)), [[0; 12]; 2]);
        // A configuration for which there is no room.
        let layout = dtof_layout_t {
            pixels: PIXELS + 1,
            ..layout
        };
        assert_eq!(
            dtof_array_configure_layout(array, &paper(), &layout),
            DTOF_ERROR_PIXELS
        );
        for _ in 0..44 {
            assert_eq!(dtof_array_end_laser_cycles(array, 1, ptr::null_mut()), OK);
        }
        let event = driven.next_event().unwrap();
        assert_eq!((event.pixel, event.peak_bin, event.peak_count), (1, 60, 20));
    }
}

//! An array that is driven: photons in, events out.

use core::mem::MaybeUninit;

use dtof_core::binning::Block;
use dtof_core::{
    AnyRule, Array, ArrayConfig, BlockLevel, Neighbours, PixelArray, PixelPlace, Statistics,
};

use dtof_link::{AdaptiveBinning, Configuration};

use crate::config::{alone, dtof_config_t, requested};
use crate::event::dtof_event_t;
use crate::memory::{
    check, check_array, data_ref, data_slice, initialise, object, object_mut, object_ref, put,
    room, status,
};
use crate::statistics::{DTOF_STATISTICS_SIZE, dtof_statistics_t};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{
    DTOF_ERROR_BLOCKS, DTOF_ERROR_NEIGHBOURS, DTOF_ERROR_NO_EVENT, DTOF_ERROR_PIXELS,
    DTOF_ERROR_SIZE,
};
use crate::version::{DTOF_BINS, DTOF_COUNTER_BITS, PixelCounters};

/// Bytes of a dtof_place_t: other ones for each DTOF_BINS and DTOF_COUNTER_BITS.
#[allow(clippy::manual_div_ceil, reason = "an expression of C")]
pub const DTOF_PLACE_SIZE: usize =
    96 - 2 * DTOF_COUNTER_BITS + ((DTOF_COUNTER_BITS + 7) / 8) * DTOF_BINS;
/// The same in words.
pub const DTOF_PLACE_WORDS: usize = DTOF_PLACE_SIZE / 4;
/// Bytes of a dtof_block_t.
pub const DTOF_BLOCK_SIZE: usize = 68 + 2 * DTOF_BINS;
/// The same in words.
pub const DTOF_BLOCK_WORDS: usize = DTOF_BLOCK_SIZE / 4;
/// Bytes of a dtof_array_t.
pub const DTOF_ARRAY_SIZE: usize = 792;
/// The same in words of 64 bits.
pub const DTOF_ARRAY_WORDS: usize = DTOF_ARRAY_SIZE / 8;
/// Its alignment.
pub const DTOF_ARRAY_ALIGN: usize = 8;

/// Room for a pixel of an array, for dtof_array_init. Only that array uses it.
#[repr(C)]
pub struct dtof_place_t {
    words: [MaybeUninit<u32>; DTOF_PLACE_WORDS],
}

/// Room for a block of pixels of an array, for dtof_array_init. Only that array uses it.
#[repr(C)]
pub struct dtof_block_t {
    words: [MaybeUninit<u32>; DTOF_BLOCK_WORDS],
}

type Place = PixelPlace<DTOF_BINS, PixelCounters>;
type PlaceOfBlock = Block<DTOF_BINS>;

const _: () = assert!(
    size_of::<Place>() <= DTOF_PLACE_SIZE
        && DTOF_PLACE_SIZE <= size_of::<Place>() + 4
        && size_of::<PlaceOfBlock>() == DTOF_BLOCK_SIZE
        && align_of::<Place>() <= align_of::<dtof_place_t>()
        && align_of::<PlaceOfBlock>() <= align_of::<dtof_block_t>()
);

/// An array of pixels that is driven: photons in, events out. It orders what happens in a laser cycle, for
/// all pixels, for blocks of pixels that stay silent, and for neighbours that confirm. dtof_array_init makes
/// it, in room for its pixels and blocks that is yours.
///
/// One thread or interrupt at a time may use an array and its room. It must not be copied.
#[repr(C)]
pub struct dtof_array_t {
    opaque: [MaybeUninit<u64>; DTOF_ARRAY_WORDS],
}

object!(dtof_array_t, PixelArray<'static, DTOF_BINS, AnyRule, PixelCounters>, tag 0xdc,
    size DTOF_ARRAY_SIZE, align DTOF_ARRAY_ALIGN, unused_below 64);

/// How many pixels an array has, and how they work together, for dtof_array_configure_layout. All zero but `pixels`: they
/// work alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_layout_t {
    /// Pixels, numbered row by row: at least 1.
    pub pixels: u16,
    /// Columns of the array; the last row may have fewer. 0: one row. Blocks and neighbours need columns.
    pub columns: u16,
    /// Blocks: every so many laser cycles pixels without an event begin to feed theirs. At least 1.
    pub patience: u16,
    /// Levels of blocks, of 2, 4 and 8 pixels a side: 1 to 3; 0: no blocks.
    pub block_levels: u8,
    /// Neighbours of a pixel that may confirm its event: 4 or 8; 0: none. They need the window rule,
    /// without a dead time and without blocks.
    pub neighbours: u8,
    /// Not 0: photons of one laser cycle in one bin count once. Raindrops, which send many photons back in
    /// one laser cycle, are then hardly ever events. Targets with more than half a photon a laser cycle in a
    /// bin lose a fifth of their light or more.
    pub once_per_bin: u8,
}

/// Photons that counted in no pixel, since the configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_losses_t {
    /// Of numbers without a pixel.
    pub unaddressed: u64,
    /// Of pixels that are left out.
    pub left_out: u64,
    /// Where photons count once per bin: those that came out of order, so that their bin may have had one.
    /// They are among the repeated ones.
    pub unordered: u64,
    /// That never came, as dtof_array_lost was told.
    pub photons: u64,
    /// Laser cycles whose photons never came.
    pub laser_cycles: u64,
}

/// Makes an array of room for `number` pixels and `number_of_blocks` blocks. It has no pixels until
/// dtof_array_configure. Of 8 x 8 pixels there are 16 blocks of level 1, 4 of level 2 and 1 of level 3. Without
/// blocks `blocks` may be null. `size` is `sizeof *pixels`. The room belongs to the array from now on, and lasts
/// as long as it: do not read, write, copy or free it. Another dtof_array_init may have it again, or a part of it.
/// After that the earlier array must not be used, unless dtof_array_init makes it anew.
///
/// Errors: DTOF_ERROR_SIZE if the library was built for other DTOF_BINS or DTOF_COUNTER_BITS,
/// DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `array`, `pixels` or `blocks` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_init(
    array: *mut dtof_array_t,
    size: usize,
    pixels: *mut dtof_place_t,
    number: usize,
    blocks: *mut dtof_block_t,
    number_of_blocks: usize,
) -> dtof_status_t {
    status(|| {
        if size != DTOF_PLACE_SIZE {
            return Err(DTOF_ERROR_SIZE);
        }
        // Checked before the room is written, which another array may have.
        check(array)?;
        check_array(pixels, number)?;
        check_array(blocks, number_of_blocks)?;
        // SAFETY: the caller's promise, see the crate: the room is the array's alone from now on.
        let pixels = unsafe { room(pixels.cast(), number, Place::new)? };
        // SAFETY: the same promise.
        let blocks = unsafe { room(blocks.cast(), number_of_blocks, PlaceOfBlock::default)? };
        // SAFETY: the same promise.
        unsafe { initialise(array, DTOF_ARRAY_SIZE, PixelArray::new(pixels, blocks)) }
    })
}

/// The first `pixels` pixels begin, with all counts at 0. They decide alone. A program without
/// dtof_array_configure_layout does not link the looks of blocks and neighbours.
///
/// Errors: each of dtof_config_check, DTOF_ERROR_PIXELS for none and without room for so many,
/// DTOF_ERROR_NOT_INITIALISED. After an error the array is unchanged.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_configure(
    array: *mut dtof_array_t,
    settings: *const dtof_config_t,
    pixels: u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_mut(array)? };
        // SAFETY: the same promise.
        let settings = unsafe { data_ref(settings)? };
        let row = Array::new(pixels.into(), 1).ok_or(DTOF_ERROR_PIXELS)?;
        array.configure(&ArrayConfig::new(row, alone(settings)?))?;
        Ok(())
    })
}

/// The same for pixels that may decide together, by the rule of `settings`. With neighbours its false alarms are
/// those of all together. With blocks they are if the z of the window rule is for as many levels, as that of
/// `dtof tune --binning`: blocks get a higher one from it.
///
/// Errors: each of dtof_array_configure, DTOF_ERROR_BLOCKS for other levels, without columns or without room
/// for so many, DTOF_ERROR_PATIENCE, DTOF_ERROR_NEIGHBOURS. After an error the array is unchanged.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_configure_layout(
    array: *mut dtof_array_t,
    settings: *const dtof_config_t,
    layout: *const dtof_layout_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_mut(array)? };
        // SAFETY: the same promise.
        let (settings, layout) = unsafe { (data_ref(settings)?, data_ref(layout)?) };
        array.configure(&array_config(settings, layout)?)?;
        Ok(())
    })
}

/// The array has no pixels until dtof_array_configure, and all counts are 0: a session has begun or ended. Pixels that
/// are left out stay so.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_clear(array: *mut dtof_array_t) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        unsafe { object_mut(array)? }.clear();
        Ok(())
    })
}

/// The configuration of an array with a layout.
fn array_config(
    settings: &dtof_config_t,
    layout: &dtof_layout_t,
) -> Result<ArrayConfig<DTOF_BINS, AnyRule, PixelCounters>, dtof_status_t> {
    let neighbours = match layout.neighbours {
        0 => None,
        number => Some(Neighbours::new(number).ok_or(DTOF_ERROR_NEIGHBOURS)?),
    };
    let binning = match layout.block_levels {
        0 => None,
        levels => Some(AdaptiveBinning {
            levels: BlockLevel::new(levels).ok_or(DTOF_ERROR_BLOCKS)?,
            patience: layout.patience,
        }),
    };
    let requested = Configuration {
        pixels: layout.pixels,
        columns: layout.columns,
        binning,
        neighbours,
        once_per_bin: layout.once_per_bin != 0,
        ..requested(settings)?
    };
    Ok(requested.device_config(0)?)
}

/// The layout of the pixels in a configuration.
pub(crate) fn layout_of(requested: &Configuration) -> dtof_layout_t {
    let (levels, patience) = requested
        .binning
        .map_or((0, 0), |binning| (binning.levels.raw(), binning.patience));
    dtof_layout_t {
        pixels: requested.pixels,
        columns: requested.columns,
        patience,
        block_levels: levels,
        neighbours: requested.neighbours.map_or(0, Neighbours::raw),
        once_per_bin: requested.once_per_bin.into(),
    }
}

/// Leaves a pixel out from now on, whatever the configuration: its photons count as left out.
///
/// Errors: DTOF_ERROR_PIXELS without room for it, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_leave_out(
    array: *mut dtof_array_t,
    pixel: u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_mut(array)? };
        let pixel = usize::from(pixel);
        if pixel >= array.room() {
            return Err(DTOF_ERROR_PIXELS);
        }
        array.leave_out(pixel);
        Ok(())
    })
}

/// Counts a photon of pixel number `pixel` in the present laser cycle. `code` is its bin, as the TDC gives
/// it. dtof_array_statistics tells of a photon that does not count. The photons of a laser cycle may come in
/// any order; where they count once per bin, pixel by pixel or in the order of time.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_photon(
    array: *mut dtof_array_t,
    pixel: u16,
    code: u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        unsafe { object_mut(array)? }.photon(pixel.into(), code);
        Ok(())
    })
}

/// Counts `number` photons of one pixel as dtof_array_photon does, in a sixth of the time unless
/// photons count once per bin or the pixel feeds a block.
///
/// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED. `codes` may be null if `number` is 0.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_photons(
    array: *mut dtof_array_t,
    pixel: u16,
    codes: *const u16,
    number: usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (array, codes) = unsafe { (object_mut(array)?, data_slice(codes, number)?) };
        array.photons(pixel.into(), codes);
        Ok(())
    })
}

/// Ends `cycles` laser cycles: the present one, and after it those without a photon. It may stop after a
/// look. `left` gets how many are left: take the events, and call it again with these. It may be null if
/// `cycles` is 1.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_end_laser_cycles(
    array: *mut dtof_array_t,
    cycles: u16,
    left: *mut u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_mut(array)? };
        if left.is_null() && cycles <= 1 {
            let _ = array.end_laser_cycles(cycles);
            return Ok(());
        }
        // Checked before laser cycles end.
        check(left)?;
        // SAFETY: the same promise.
        unsafe { put(left, array.end_laser_cycles(cycles)) }
    })
}

/// Takes the next event. An event that waits defers the next decision of its pixel.
///
/// Errors: DTOF_ERROR_NO_EVENT if none waits, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_next_event(
    array: *mut dtof_array_t,
    event: *mut dtof_event_t,
) -> dtof_status_t {
    status(|| {
        // Checked before the event leaves its slot.
        check(event)?;
        // SAFETY: the caller's promise, see the crate.
        let next = unsafe { object_mut(array)? }.next_event();
        let next = next.ok_or(DTOF_ERROR_NO_EVENT)?;
        // SAFETY: the same promise.
        unsafe { put(event, (&next).into()) }
    })
}

/// The queue of a TDC has lost `photons`, and all photons of `laser_cycles`. These laser cycles are numbered,
/// but belong to no exposure. Call it between two laser cycles.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_lost(
    array: *mut dtof_array_t,
    photons: u64,
    laser_cycles: u64,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        unsafe { object_mut(array)? }.lost(photons, laser_cycles);
        Ok(())
    })
}

/// The laser cycles that have ended since the configuration.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_cycles(
    array: *const dtof_array_t,
    cycles: *mut u64,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_ref(array)? };
        // SAFETY: the same promise.
        unsafe { put(cycles, array.cycles()) }
    })
}

/// What pixels and blocks have done so far, with the photons of exposures that have not ended, and what counted
/// in no pixel. `blocks` and `losses` may be null. The statistics need not be initialised.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `array` or uses the others during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_statistics(
    array: *const dtof_array_t,
    pixels: *mut dtof_statistics_t,
    blocks: *mut dtof_statistics_t,
    losses: *mut dtof_losses_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_ref(array)? };
        // Checked before any is written.
        check(pixels)?;
        if !blocks.is_null() {
            check(blocks)?;
        }
        if !losses.is_null() {
            check(losses)?;
        }
        let [of_pixels, of_blocks] = array.statistics();
        let write = |statistics: *mut dtof_statistics_t, value: Statistics| {
            // SAFETY: the same promise.
            unsafe { initialise(statistics, DTOF_STATISTICS_SIZE, value) }
        };
        write(pixels, of_pixels)?;
        if !blocks.is_null() {
            write(blocks, of_blocks)?;
        }
        if losses.is_null() {
            return Ok(());
        }
        let lost = array.losses();
        let read = dtof_losses_t {
            unaddressed: lost.unaddressed,
            left_out: lost.left_out,
            unordered: lost.unordered,
            photons: lost.photons,
            laser_cycles: lost.laser_cycles,
        };
        // SAFETY: the same promise.
        unsafe { put(losses, read) }
    })
}

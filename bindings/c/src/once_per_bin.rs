//! Photons of one laser cycle in one bin count once.

use core::mem::MaybeUninit;

use dtof_core::OncePerBin;

use crate::config::dtof_checked_config_t;
use crate::memory::{data_slice, initialise, object, object_mut, object_ref, status};
use crate::pixel::dtof_pixel_t;
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::version::DTOF_BINS;

/// Bytes of a dtof_once_per_bin_t.
#[allow(clippy::manual_div_ceil, reason = "an expression of C")]
pub const DTOF_ONCE_PER_BIN_SIZE: usize = 4 + 4 * ((DTOF_BINS + 31) / 32);
/// The same in words of 32 bits.
pub const DTOF_ONCE_PER_BIN_WORDS: usize = DTOF_ONCE_PER_BIN_SIZE / 4;
/// Its alignment.
pub const DTOF_ONCE_PER_BIN_ALIGN: usize = 4;

/// The bins of one pixel that have had a photon in the present laser cycle:
/// dtof_once_per_bin_init makes it. Each pixel whose photons count once per bin needs its own.
///
/// One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_once_per_bin_t {
    opaque: [MaybeUninit<u32>; DTOF_ONCE_PER_BIN_WORDS],
}

type Bins = OncePerBin<{ OncePerBin::words(DTOF_BINS) }>;

object!(dtof_once_per_bin_t, Bins, tag 0xdc,
    size DTOF_ONCE_PER_BIN_SIZE, align DTOF_ONCE_PER_BIN_ALIGN, unused_below 1);

/// Initialises it at the beginning of a laser cycle. `size` is `sizeof *once_per_bin`.
///
/// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
/// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `once_per_bin` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_once_per_bin_init(
    once_per_bin: *mut dtof_once_per_bin_t,
    size: usize,
) -> dtof_status_t {
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { initialise(once_per_bin, size, Bins::new()) })
}

/// Ends a laser cycle, with photons or without. Call it for each pixel, beside
/// dtof_pixel_end_laser_cycles or dtof_pixels_end_laser_cycles.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `once_per_bin` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_once_per_bin_end_laser_cycle(
    once_per_bin: *mut dtof_once_per_bin_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        unsafe { object_mut(once_per_bin)? }.end_laser_cycle();
        Ok(())
    })
}

/// Counts `number` photons of the present laser cycle as dtof_pixel_count_batch does, except those
/// in a bin that has had one: `statistics` counts them as repeated. The photons of a laser cycle may
/// come in several calls. Raindrops, which send many photons back in one laser cycle, are then
/// hardly ever events. Targets with more than half a photon a laser cycle in a bin lose a fifth
/// of their light or more.
///
/// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED. `codes` may be null if `number` is 0.
/// Threads: no other thread uses `pixel`, `once_per_bin` or `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_count_once_per_bin(
    pixel: *mut dtof_pixel_t,
    config: *const dtof_checked_config_t,
    once_per_bin: *mut dtof_once_per_bin_t,
    statistics: *mut dtof_statistics_t,
    codes: *const u16,
    number: usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, config) = unsafe { (object_mut(pixel)?, object_ref(config)?) };
        // SAFETY: the same promise.
        let (bins, statistics) = unsafe { (object_mut(once_per_bin)?, object_mut(statistics)?) };
        // SAFETY: the same promise.
        let codes = unsafe { data_slice(codes, number)? };
        pixel.count_once_per_bin(config, statistics, bins, codes);
        Ok(())
    })
}

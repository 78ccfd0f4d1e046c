//! From bins to millimetres.

use core::mem::MaybeUninit;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{BinPosition, RangeScale};

use crate::memory::{initialise, object, object_ref, put, status};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_POSITION;

/// Bytes of a dtof_scale_t.
pub const DTOF_SCALE_SIZE: usize = 12;
/// The same in words of 32 bits.
pub const DTOF_SCALE_WORDS: usize = DTOF_SCALE_SIZE / 4;
/// Its alignment.
pub const DTOF_SCALE_ALIGN: usize = 4;

/// Bin width and range offset: dtof_scale_init makes it. Other functions only read it. It may be
/// copied.
#[repr(C)]
pub struct dtof_scale_t {
    opaque: [MaybeUninit<u32>; DTOF_SCALE_WORDS],
}

object!(dtof_scale_t, RangeScale, tag 0xda, size DTOF_SCALE_SIZE, align DTOF_SCALE_ALIGN, unused_below 1);

/// Initialises a scale. `bin_width_ps_q16` is the width of a bin, `offset_mm_q8` is added to every
/// range. The millimetres per bin are rounded to the nearest 1/65536 mm. If pixels have offsets of
/// their own, each takes a scale whose `offset_mm_q8` is the sum of both.
///
/// Errors: DTOF_ERROR_ZERO_BIN_WIDTH, DTOF_ERROR_RANGE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `scale` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_scale_init(
    scale: *mut dtof_scale_t,
    bin_width_ps_q16: u32,
    offset_mm_q8: i32,
) -> dtof_status_t {
    status(|| {
        let bin_width = U16F16::from_bits(bin_width_ps_q16);
        let made = RangeScale::new(bin_width, I24F8::from_bits(offset_mm_q8))?;
        // SAFETY: the caller's promise, see the crate.
        unsafe { initialise(scale, DTOF_SCALE_SIZE, made) }
    })
}

/// Converts an event's `position_q8` to a range, within 0.01 mm of the real-valued formula.
///
/// Errors: DTOF_ERROR_POSITION, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: any number may use one scale.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_range(
    scale: *const dtof_scale_t,
    position_q8: i32,
    range_mm_q8: *mut i32,
) -> dtof_status_t {
    status(|| {
        let position = BinPosition::new(position_q8).ok_or(DTOF_ERROR_POSITION)?;
        // SAFETY: the caller's promise, see the crate.
        let scale = unsafe { object_ref(scale)? };
        // SAFETY: the same promise.
        unsafe { put(range_mm_q8, scale.range(position).to_bits()) }
    })
}

//! From bins to millimetres.

use core::mem::MaybeUninit;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{BinPosition, RangeScale};

use crate::memory::{holds, initialise, put, shared, status};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_POSITION;

/// Bytes of a dtof_scale_t.
pub const DTOF_SCALE_SIZE: usize = 8;
/// The same in words of 32 bits.
pub const DTOF_SCALE_WORDS: usize = DTOF_SCALE_SIZE / 4;
/// Its alignment.
pub const DTOF_SCALE_ALIGN: usize = 4;

/// Bin width and range offset: dtof_scale_init makes it. It is read only from then on, and may
/// be copied.
#[repr(C)]
pub struct dtof_scale_t {
    opaque: [MaybeUninit<u32>; DTOF_SCALE_WORDS],
}

holds!(dtof_scale_t, RangeScale, size DTOF_SCALE_SIZE, align DTOF_SCALE_ALIGN, waste 1);

/// From the width of a bin in 1/65536 ps, and the millimetres that are added to every range in
/// 1/256 mm. The millimetres a bin are rounded to the nearest 1/65536 mm.
///
/// Errors: DTOF_ERROR_ZERO_BIN_WIDTH, DTOF_ERROR_RANGE, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: nobody else uses `scale` meanwhile.
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

/// The range of an event's `position_q8` (1/256 bin) in 1/256 mm, within 0.01 mm of the
/// real-valued formula.
///
/// Errors: DTOF_ERROR_POSITION, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: any number may use one scale.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_range(
    scale: *const dtof_scale_t,
    position_q8: i32,
    range_mm_q8: *mut i32,
) -> dtof_status_t {
    status(|| {
        let position = BinPosition::new(position_q8).ok_or(DTOF_ERROR_POSITION)?;
        // SAFETY: the caller's promise, see the crate; any bytes are a scale.
        let scale = unsafe { shared(scale)? };
        // SAFETY: the same promise.
        unsafe { put(range_mm_q8, scale.range(position).to_bits()) }
    })
}

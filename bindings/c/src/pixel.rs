//! Pixels: they count photons, look at the end of laser cycles, and report events.

use core::mem::MaybeUninit;

use dtof_core::{AsyncPixel, LaserCycle, Look, PixelAddress};

use crate::config::dtof_checked_config_t;
use crate::event::dtof_event_t;
use crate::memory::{check, data_slice, initialise, object, object_mut, object_ref, put, status};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{DTOF_ERROR_LENGTH, DTOF_ERROR_NO_EVENT};
use crate::version::{DTOF_BINS, DTOF_COUNTER_BITS, PixelCounters};

/// Bytes of a dtof_pixel_t. That of twice the bins of 8 bits is the same: no size tells them apart.
#[allow(clippy::manual_div_ceil, reason = "an expression of C")]
pub const DTOF_PIXEL_SIZE: usize = 68 + ((DTOF_COUNTER_BITS + 7) / 8) * DTOF_BINS;
/// The same in words.
pub const DTOF_PIXEL_WORDS: usize = DTOF_PIXEL_SIZE / 4;
/// Its alignment.
pub const DTOF_PIXEL_ALIGN: usize = 4;

/// A macropixel: a histogram of DTOF_BINS counters of DTOF_COUNTER_BITS bits, its exposure, and a slot for one
/// event. dtof_pixel_init makes it.
///
/// One thread or interrupt at a time may use a pixel. Different pixels are independent.
#[repr(C)]
pub struct dtof_pixel_t {
    opaque: [MaybeUninit<u32>; DTOF_PIXEL_WORDS],
}

pub(crate) type Pixel = AsyncPixel<DTOF_BINS, PixelCounters>;

object!(dtof_pixel_t, Pixel, tag 0xd8,
    size DTOF_PIXEL_SIZE, align DTOF_PIXEL_ALIGN, unused_below 1);

/// The outcome of dtof_pixel_end_laser_cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum dtof_look_t {
    /// Fewer than X laser cycles since the last look: none was taken.
    DTOF_LOOK_NOT_DUE = 0,
    /// The exposure has not exceeded L1.
    DTOF_LOOK_TOO_EARLY = 1,
    /// The peak does not exceed the threshold; the exposure goes on.
    DTOF_LOOK_NO_PEAK = 2,
    /// The slot still holds an event: the decision is deferred by X laser cycles.
    DTOF_LOOK_DEFERRED = 3,
    /// An event is in the slot.
    DTOF_LOOK_EVENT = 4,
    /// The exposure reached L2 without an event, or a counter is full, with a dead time or of 8 bits: a
    /// new one begins.
    DTOF_LOOK_EXPIRED = 5,
    /// The wait for another echo is over: a new exposure begins.
    DTOF_LOOK_ENDED = 6,
}

impl From<Look> for dtof_look_t {
    #[inline(always)]
    fn from(look: Look) -> Self {
        match look {
            Look::NotDue => Self::DTOF_LOOK_NOT_DUE,
            Look::TooEarly => Self::DTOF_LOOK_TOO_EARLY,
            Look::NoPeak => Self::DTOF_LOOK_NO_PEAK,
            Look::Deferred => Self::DTOF_LOOK_DEFERRED,
            Look::Event => Self::DTOF_LOOK_EVENT,
            Look::Expired => Self::DTOF_LOOK_EXPIRED,
            Look::Ended => Self::DTOF_LOOK_ENDED,
        }
    }
}

/// Initialises an empty pixel at the beginning of its first exposure. `size` is `sizeof *pixel`.
///
/// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
/// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_init(
    pixel: *mut dtof_pixel_t,
    size: usize,
    address: u16,
) -> dtof_status_t {
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { initialise(pixel, size, Pixel::new(PixelAddress::new(address))) })
}

/// Counts one photon of the present laser cycle. `code` is its bin, as the TDC gives it. A photon
/// with a code of DTOF_BINS or more counts as rejected, one outside the gate as gated out, and one
/// that meets a full counter as saturated.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_count(
    pixel: *mut dtof_pixel_t,
    config: *const dtof_checked_config_t,
    code: u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, config) = unsafe { (object_mut(pixel)?, object_ref(config)?) };
        pixel.count(config, code);
        Ok(())
    })
}

/// Counts `number` photons as dtof_pixel_count does, in a third of the time.
///
/// Errors: DTOF_ERROR_LENGTH, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED. `codes` may be null if `number` is 0.
/// Threads: no other thread uses `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_count_batch(
    pixel: *mut dtof_pixel_t,
    config: *const dtof_checked_config_t,
    codes: *const u16,
    number: usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, config) = unsafe { (object_mut(pixel)?, object_ref(config)?) };
        // SAFETY: the same promise.
        let codes = unsafe { data_slice(codes, number)? };
        pixel.count_batch(config, codes);
        Ok(())
    })
}

/// Counts a histogram of one or more laser cycles: `counts` has the photons of DTOF_BINS bins.
/// Then end the same number of laser cycles.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_count_frame(
    pixel: *mut dtof_pixel_t,
    config: *const dtof_checked_config_t,
    counts: *const u16,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, config) = unsafe { (object_mut(pixel)?, object_ref(config)?) };
        // SAFETY: the same promise.
        let counts = unsafe { data_slice(counts, DTOF_BINS)? };
        let counts = counts.as_array().ok_or(DTOF_ERROR_LENGTH)?;
        pixel.count_frame(config, counts);
        Ok(())
    })
}

/// Ends `cycles` laser cycles of a pixel; `last` is the number of the last one. The pixel looks at
/// its histogram if X or more laser cycles have passed since the last look. `look` gets the
/// outcome; it may be null.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `pixel` or `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_end_laser_cycles(
    pixel: *mut dtof_pixel_t,
    config: *const dtof_checked_config_t,
    last: u64,
    statistics: *mut dtof_statistics_t,
    cycles: u16,
    look: *mut dtof_look_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, config) = unsafe { (object_mut(pixel)?, object_ref(config)?) };
        // SAFETY: the same promise.
        let statistics = unsafe { object_mut(statistics)? };
        let outcome = pixel.end_laser_cycles(config, statistics, LaserCycle::new(last), cycles);
        if look.is_null() {
            return Ok(());
        }
        // SAFETY: the same promise.
        unsafe { put(look, outcome.into()) }
    })
}

/// Takes the event from the slot, so that the pixel can report the next one. Until then the pixel
/// counts on and defers its decisions.
///
/// Errors: DTOF_ERROR_NO_EVENT, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT,
/// DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_take_event(
    pixel: *mut dtof_pixel_t,
    event: *mut dtof_event_t,
) -> dtof_status_t {
    status(|| {
        // Checked before the event leaves its slot.
        check(event)?;
        // SAFETY: the caller's promise, see the crate.
        let pixel = unsafe { object_mut(pixel)? };
        let taken = pixel.take_event().ok_or(DTOF_ERROR_NO_EVENT)?;
        // SAFETY: the same promise.
        unsafe { put(event, (&taken).into()) }
    })
}

/// Adds the photons of the present exposure to `statistics`, which has only those of exposures that
/// have ended. Use a copy of the statistics, or call it once at the very end.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `pixel` or `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_add_photons(
    pixel: *const dtof_pixel_t,
    statistics: *mut dtof_statistics_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (pixel, statistics) = unsafe { (object_ref(pixel)?, object_mut(statistics)?) };
        pixel.add_photons_to(statistics);
        Ok(())
    })
}

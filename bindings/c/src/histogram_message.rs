//! Histograms as messages to the host.

use dtof_core::{LaserCycle, PixelAddress};
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::{HistogramHead, NoHistogram};
use heapless::Vec;

use crate::array::dtof_array_t;
use crate::memory::{array_mut, check, data_slice, object_ref, put, status};
use crate::pixel::{Pixel, dtof_pixel_t};
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::{DTOF_ERROR_LENGTH, DTOF_ERROR_PIXELS, DTOF_ERROR_REASON};
use crate::version::DTOF_BINS;

/// There is no histogram: no configuration is in force.
pub const DTOF_NO_HISTOGRAM_CONFIGURATION: u8 = 1;
/// There is no histogram: the device has no such pixel.
pub const DTOF_NO_HISTOGRAM_PIXEL: u8 = 2;
/// There is no histogram: another request came before the answer.
pub const DTOF_NO_HISTOGRAM_GIVEN_UP: u8 = 3;
/// There is no histogram: the sensor failed.
pub const DTOF_NO_HISTOGRAM_SENSOR: u8 = 4;
const _: () = assert!(
    DTOF_NO_HISTOGRAM_CONFIGURATION == NoHistogram::NoConfiguration as u8
        && DTOF_NO_HISTOGRAM_PIXEL == NoHistogram::NoPixel as u8
        && DTOF_NO_HISTOGRAM_GIVEN_UP == NoHistogram::GivenUp as u8
        && DTOF_NO_HISTOGRAM_SENSOR == NoHistogram::Sensor as u8
);

/// Writes a body of HISTOGRAM with the present exposure of a pixel. `cycles` is the number of laser
/// cycles that have ended, `part` counts from 0. `body` has room for DTOF_BODY_BYTES; `length` gets
/// the number of bytes, 0 after the last part. Count no photon between two parts.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `pixel` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_pixel_histogram_write(
    pixel: *const dtof_pixel_t,
    part: usize,
    cycles: u64,
    body: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let pixel = unsafe { object_ref(pixel)? };
        let exposure = pixel.exposure();
        // SAFETY: the same promise.
        unsafe { part_of_pixel(pixel, exposure, cycles, part, body, length) }
    })
}

/// Writes a body of HISTOGRAM with the present exposure of a pixel of an array, as dtof_pixel_histogram_write does.
///
/// Errors: DTOF_ERROR_PIXELS if there is no such pixel or it is left out, DTOF_ERROR_NULL,
/// DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `array` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_array_histogram_write(
    array: *const dtof_array_t,
    pixel: u16,
    part: usize,
    body: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let array = unsafe { object_ref(array)? };
        let number = usize::from(pixel);
        let of = array.pixel(number).zip(array.exposure(number));
        let (pixel, exposure) = of.ok_or(DTOF_ERROR_PIXELS)?;
        // SAFETY: the same promise.
        unsafe { part_of_pixel(pixel, exposure, array.cycles(), part, body, length) }
    })
}

/// Writes a body of HISTOGRAM with a histogram that the sensor counted over `exposure` laser
/// cycles: `counts` has the photons of DTOF_BINS bins. A greater count is written as 16,777,215.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_counts_write(
    counts: *const u32,
    part: usize,
    cycles: u64,
    exposure: u32,
    pixel: u16,
    body: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let counts = unsafe { data_slice(counts, DTOF_BINS)? };
        let counts: &[u32; DTOF_BINS] = counts.as_array().ok_or(DTOF_ERROR_LENGTH)?;
        let head = HistogramHead {
            pixel: PixelAddress::new(pixel),
            is_whole: true,
            cycle: LaserCycle::new(cycles),
            exposure,
        };
        // SAFETY: the same promise.
        unsafe { part_of(head, counts, part, body, length) }
    })
}

/// Writes a body of HISTOGRAM that tells why there is no histogram: `reason` is one of
/// DTOF_NO_HISTOGRAM_... `body` has room for DTOF_BODY_BYTES; `length` gets the number of bytes.
///
/// Errors: DTOF_ERROR_REASON, DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_no_histogram_write(
    pixel: u16,
    reason: u8,
    body: *mut u8,
    length: *mut usize,
) -> dtof_status_t {
    status(|| {
        let reason = NoHistogram::from_number(reason).ok_or(DTOF_ERROR_REASON)?;
        // SAFETY: the caller's promise, see the crate.
        unsafe { put_bytes(&reason.message(PixelAddress::new(pixel)), body, length) }
    })
}

/// The present exposure of a pixel.
///
/// # Safety
/// As for every function that C calls: see the crate.
unsafe fn part_of_pixel(
    pixel: &Pixel,
    exposure: u16,
    cycles: u64,
    part: usize,
    body: *mut u8,
    length: *mut usize,
) -> Result<(), dtof_status_t> {
    let head = HistogramHead {
        pixel: pixel.address(),
        is_whole: false,
        cycle: LaserCycle::new(cycles),
        exposure: exposure.into(),
    };
    let counts = pixel.histogram().counts().map(u32::from);
    // SAFETY: the same promise.
    unsafe { part_of(head, &counts, part, body, length) }
}

/// # Safety
/// As for every function that C calls: see the crate.
unsafe fn part_of(
    head: HistogramHead,
    counts: &[u32; DTOF_BINS],
    part: usize,
    body: *mut u8,
    length: *mut usize,
) -> Result<(), dtof_status_t> {
    let mut bytes = Vec::new();
    if let Some(message) = head.messages(counts).nth(part) {
        message.write(&mut bytes);
    }
    // SAFETY: the same promise.
    unsafe { put_bytes(&bytes, body, length) }
}

/// # Safety
/// As for every function that C calls: see the crate.
unsafe fn put_bytes(bytes: &[u8], body: *mut u8, length: *mut usize) -> Result<(), dtof_status_t> {
    check(length)?;
    // SAFETY: the same promise.
    let room: &mut [u8; BODY_BYTES] = unsafe { array_mut(body)? };
    for (place, byte) in room.iter_mut().zip(bytes) {
        *place = *byte;
    }
    // SAFETY: the same promise.
    unsafe { put(length, bytes.len()) }
}

//! Histograms counted by the sensor.

use core::mem::MaybeUninit;

use dtof_core::{Count24, DepthEvent, Histogram, LaserCycle, PixelAddress};

use crate::config::dtof_checked_config_t;
use crate::event::dtof_event_t;
use crate::memory::{
    array_mut, check, data_slice, initialise, object, object_mut, object_ref, put, status,
};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_LENGTH;
use crate::version::DTOF_BINS;

/// Bytes of a dtof_histogram_t.
pub const DTOF_HISTOGRAM_SIZE: usize = 20 + 4 * DTOF_BINS;
/// The same in words of 32 bits.
pub const DTOF_HISTOGRAM_WORDS: usize = DTOF_HISTOGRAM_SIZE / 4;
/// Its alignment.
pub const DTOF_HISTOGRAM_ALIGN: usize = 4;

/// The most echoes of one histogram or exposure.
pub const DTOF_ECHOES: usize = 4;

/// A histogram of DTOF_BINS counters of 24 bits. Each call of dtof_histogram_fill initialises it
/// anew. One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_histogram_t {
    opaque: [MaybeUninit<u32>; DTOF_HISTOGRAM_WORDS],
}

type Counted = Histogram<DTOF_BINS, Count24>;

object!(dtof_histogram_t, Counted, tag 0xd9,
    size DTOF_HISTOGRAM_SIZE, align DTOF_HISTOGRAM_ALIGN, unused_below 1);

/// Fills a histogram with `counts`, the photons of DTOF_BINS bins, and adds them to `statistics`:
/// photons outside the gate as gated out, those above 16,777,215 in a bin as saturated. `size` is
/// `sizeof *histogram`.
///
/// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
/// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `histogram` or `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_histogram_fill(
    histogram: *mut dtof_histogram_t,
    size: usize,
    config: *const dtof_checked_config_t,
    statistics: *mut dtof_statistics_t,
    counts: *const u32,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (config, statistics) = unsafe { (object_ref(config)?, object_mut(statistics)?) };
        // SAFETY: the same promise.
        let counts = unsafe { data_slice(counts, DTOF_BINS)? };
        let counts = counts.as_array().ok_or(DTOF_ERROR_LENGTH)?;
        // SAFETY: the same promise.
        unsafe { initialise(histogram, size, Counted::new())? };
        // SAFETY: the same promise.
        let histogram = unsafe { object_mut(histogram)? };
        let gated_out = config.add_frame(histogram, counts);
        statistics.add_photons_of(histogram, gated_out);
        Ok(())
    })
}

/// Looks for events in a filled histogram. X, L1 and L2 have no effect here. `events` has room
/// for DTOF_ECHOES events; `found` gets their number, at most the echoes of `config`. `pixel` and
/// `cycle` are copied into the events. `exposure` is the number of laser cycles in the histogram, by
/// which a dead time weighs bins; an event holds 65,535 at most. `config` must be that of
/// dtof_histogram_fill. With several echoes, the bins around all but the last are emptied, so fill
/// the histogram again before the next call. With a dead time and the window rule they are not:
/// their photons stay in their counters, and are left out.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `histogram` or `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_histogram_detect(
    histogram: *mut dtof_histogram_t,
    config: *const dtof_checked_config_t,
    cycle: u64,
    statistics: *mut dtof_statistics_t,
    pixel: u16,
    exposure: u32,
    events: *mut dtof_event_t,
    found: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (histogram, config) = unsafe { (object_mut(histogram)?, object_ref(config)?) };
        // SAFETY: the same promise.
        let (statistics, events) = unsafe {
            (
                object_mut(statistics)?,
                array_mut::<_, DTOF_ECHOES>(events)?,
            )
        };
        // Before the histogram changes.
        check(found)?;
        let mut places = events.iter_mut();
        let mut number = 0;
        let in_event = u16::try_from(exposure).unwrap_or(u16::MAX);
        let is_blind = config.detect_echoes(histogram, exposure, |echo, detection| {
            let event = detection.event(PixelAddress::new(pixel), LaserCycle::new(cycle), in_event);
            if let Some(place) = places.next() {
                *place = (&DepthEvent { echo, ..event }).into();
                number += 1;
            }
        });
        statistics.events += number as u64;
        statistics.expired += u64::from(number == 0);
        statistics.blind_looks += u64::from(is_blind);
        // SAFETY: the same promise.
        unsafe { put(found, number) }
    })
}

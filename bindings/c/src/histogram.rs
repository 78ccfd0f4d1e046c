//! Histograms that a sensor has counted by itself.

use core::mem::MaybeUninit;

use dtof_core::{Count24, DepthEvent, Histogram, LaserCycle, PixelAddress};

use crate::config::dtof_checked_config_t;
use crate::event::dtof_event_t;
use crate::memory::{
    all_plain, array_mut, check, exclusive, holds, initialise, put, status, tagged,
};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_LENGTH;
use crate::version::DTOF_BINS;

/// Bytes of a dtof_histogram_t.
pub const DTOF_HISTOGRAM_SIZE: usize = 16 + 4 * DTOF_BINS;
/// The same in words of 32 bits.
pub const DTOF_HISTOGRAM_WORDS: usize = DTOF_HISTOGRAM_SIZE / 4;
/// Its alignment.
pub const DTOF_HISTOGRAM_ALIGN: usize = 4;

/// Echoes of one histogram or exposure, at most.
pub const DTOF_ECHOES: usize = 4;

/// Room for one histogram of DTOF_BINS counters of 24 bits. dtof_histogram_fill makes it, again
/// and again. One thread or interrupt at a time may use it.
#[repr(C)]
pub struct dtof_histogram_t {
    opaque: [MaybeUninit<u32>; DTOF_HISTOGRAM_WORDS],
}

type Whole = Histogram<DTOF_BINS, Count24>;

// Any bytes are a histogram: all of its fields are integers.
holds!(dtof_histogram_t, Whole, size DTOF_HISTOGRAM_SIZE, align DTOF_HISTOGRAM_ALIGN, waste 1);

/// Takes `counts`, DTOF_BINS numbers of photons, as far as they are in the gate. Adds the
/// photons to `statistics`, those outside the gate as gated out, those above 16,777,215 a bin as
/// saturated. `size` is `sizeof *histogram`.
///
/// Errors: DTOF_ERROR_SIZE if the library was built for another number of bins,
/// DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
/// Threads: nobody else uses `histogram` or `statistics` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_histogram_fill(
    histogram: *mut dtof_histogram_t,
    size: usize,
    config: *const dtof_checked_config_t,
    statistics: *mut dtof_statistics_t,
    counts: *const u32,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate; any bytes are statistics.
        let (config, statistics) = unsafe { (tagged(config)?, exclusive(statistics)?) };
        // SAFETY: the same promise.
        unsafe { initialise(histogram, size, Whole::new())? };
        // SAFETY: the same promise.
        let (histogram, counts) = unsafe { (exclusive(histogram)?, all_plain(counts, DTOF_BINS)?) };
        let counts = counts.as_array().ok_or(DTOF_ERROR_LENGTH)?;
        let gated_out = histogram.add_frame(counts, config.gate());
        statistics.add_photons_of(histogram, gated_out);
        Ok(())
    })
}

/// Decides on a filled histogram, once, whatever X, L1 and L2 are. `events` has room for
/// DTOF_ECHOES of them; `found` gets how many there are, up to the echoes of `config`. `pixel`,
/// `cycle` and `exposure` (laser cycles) are those of the events. With several echoes the bins
/// around all but the last are emptied, so fill it again before the next decision.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED (of `config`).
/// Threads: nobody else uses `histogram` or `statistics` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_histogram_detect(
    histogram: *mut dtof_histogram_t,
    config: *const dtof_checked_config_t,
    cycle: u64,
    statistics: *mut dtof_statistics_t,
    pixel: u16,
    exposure: u16,
    events: *mut dtof_event_t,
    found: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (histogram, config) = unsafe { (exclusive(histogram)?, tagged(config)?) };
        // SAFETY: the same promise; any bytes are statistics, and events.
        let (statistics, events) =
            unsafe { (exclusive(statistics)?, array_mut::<_, DTOF_ECHOES>(events)?) };
        // Before an echo is taken out of the histogram.
        check(found)?;
        let mut places = events.iter_mut();
        let mut number = 0;
        config.detect_echoes(histogram, |echo, detection| {
            let event = detection.event(PixelAddress(pixel), LaserCycle(cycle), exposure);
            if let Some(place) = places.next() {
                *place = (&DepthEvent { echo, ..event }).into();
                number += 1;
            }
        });
        statistics.events += number as u64;
        statistics.expired += u64::from(number == 0);
        // SAFETY: the same promise.
        unsafe { put(found, number) }
    })
}

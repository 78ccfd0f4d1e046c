//! Histograms counted by the sensor.

use dtof_core::{DepthEvent, LaserCycle, PixelAddress, WholeHistogram};

use crate::config::dtof_checked_config_t;
use crate::event::dtof_event_t;
use crate::memory::{array_mut, check, data_slice, object_mut, object_ref, put, status};
use crate::statistics::dtof_statistics_t;
use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_LENGTH;
use crate::version::DTOF_BINS;

/// The most echoes of one histogram or exposure.
pub const DTOF_ECHOES: usize = 4;

/// Decides once on `counts`, the photons of DTOF_BINS bins in `exposure` laser cycles. X, L1 and L2 have no effect
/// here. `events` has room for DTOF_ECHOES events; `found` gets their number, at most the echoes of `config`. `pixel` and
/// `cycle` are copied into the events. A dead time weighs bins by `exposure`; an event holds 65,535 at most. Counts of
/// 16,777,215 and more in a bin are divided by a power of two, all of them and the laser cycles by the same. A peak at the
/// end of the range gate that is the slope of something outside is no event.
///
/// `statistics` get all photons, undivided, those outside the gate as gated out.
///
/// It takes 4 · DTOF_BINS bytes of stack more than other functions.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread uses `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_histogram_decide(
    config: *const dtof_checked_config_t,
    counts: *const u32,
    pixel: u16,
    cycle: u64,
    exposure: u32,
    statistics: *mut dtof_statistics_t,
    events: *mut dtof_event_t,
    found: *mut usize,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let (config, statistics) = unsafe { (object_ref(config)?, object_mut(statistics)?) };
        // SAFETY: the same promise.
        let counts = unsafe { data_slice(counts, DTOF_BINS)? };
        let counts = counts.as_array().ok_or(DTOF_ERROR_LENGTH)?;
        // SAFETY: the same promise.
        let events = unsafe { array_mut::<_, DTOF_ECHOES>(events)? };
        check(found)?;
        let mut places = events.iter_mut();
        let mut number = 0;
        let in_event = u16::try_from(exposure).unwrap_or(u16::MAX);
        let mut whole = WholeHistogram::<DTOF_BINS>::new();
        whole.decide(
            config,
            counts,
            exposure.into(),
            statistics,
            |echo, detection| {
                let event =
                    detection.event(PixelAddress::new(pixel), LaserCycle::new(cycle), in_event);
                if let Some(place) = places.next() {
                    *place = (&DepthEvent { echo, ..event }).into();
                    number += 1;
                }
            },
        );
        // SAFETY: the same promise.
        unsafe { put(found, number) }
    })
}

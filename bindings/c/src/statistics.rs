//! What pixels have done, and what was lost.

use core::mem::MaybeUninit;

use dtof_core::Statistics;

use crate::memory::{holds, put, shared, status};
use crate::status::dtof_status_t;

/// Bytes of a dtof_statistics_t.
pub const DTOF_STATISTICS_SIZE: usize = 72;
/// The same in words of 64 bits.
pub const DTOF_STATISTICS_WORDS: usize = DTOF_STATISTICS_SIZE / 8;
/// Its alignment.
pub const DTOF_STATISTICS_ALIGN: usize = 8;

/// What pixels have done. All zero it is of nothing done yet: `dtof_statistics_t done = {0};`.
/// One serves any number of pixels; pixels of two threads need one each.
#[repr(C)]
pub struct dtof_statistics_t {
    opaque: [MaybeUninit<u64>; DTOF_STATISTICS_WORDS],
}

holds!(dtof_statistics_t, Statistics,
    size DTOF_STATISTICS_SIZE, align DTOF_STATISTICS_ALIGN, waste 1);

/// The same as numbers. Photons offered are the first five together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_counts_t {
    /// Photons counted in a bin, of exposures that have ended.
    pub counted: u64,
    /// Photons in bins around an echo that was reported.
    pub held: u64,
    /// Photons that met a full counter.
    pub saturated: u64,
    /// Photons with a TDC code past the last bin.
    pub rejected: u64,
    /// Photons outside the range gate.
    pub gated_out: u64,
    /// Events.
    pub events: u64,
    /// Decisions put off because the slot was full.
    pub deferred: u64,
    /// Exposures that reached L2 without an event.
    pub expired: u64,
    /// Of these, exposures with a decision put off.
    pub expired_deferred: u64,
}

/// Reads statistics.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: not while another changes `statistics`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_statistics_read(
    statistics: *const dtof_statistics_t,
    counts: *mut dtof_counts_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate; any bytes are numbers.
        let of = unsafe { shared(statistics)? };
        let read = dtof_counts_t {
            counted: of.counted,
            held: of.held,
            saturated: of.saturated,
            rejected: of.rejected,
            gated_out: of.gated_out,
            events: of.events,
            deferred: of.deferred,
            expired: of.expired,
            expired_deferred: of.expired_deferred,
        };
        // SAFETY: the same promise.
        unsafe { put(counts, read) }
    })
}

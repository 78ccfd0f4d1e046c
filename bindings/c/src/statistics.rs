//! Counts of photons and events, losses included.

use core::mem::MaybeUninit;

use dtof_core::Statistics;

use crate::memory::{initialise, object, object_ref, put, status};
use crate::status::dtof_status_t;

/// Bytes of a dtof_statistics_t.
pub const DTOF_STATISTICS_SIZE: usize = 104;
/// The same in words of 64 bits.
pub const DTOF_STATISTICS_WORDS: usize = DTOF_STATISTICS_SIZE / 8;
/// Its alignment.
pub const DTOF_STATISTICS_ALIGN: usize = 8;

/// Counts of photons and events. dtof_statistics_init sets them to 0; dtof_statistics_read reads
/// them. Pixels of one thread may share one; pixels of two threads need one each. It may be copied.
#[repr(C)]
pub struct dtof_statistics_t {
    opaque: [MaybeUninit<u64>; DTOF_STATISTICS_WORDS],
}

object!(dtof_statistics_t, Statistics, tag 0xdb,
    size DTOF_STATISTICS_SIZE, align DTOF_STATISTICS_ALIGN, unused_below 1);

/// The counts of a dtof_statistics_t. The first six add up to all photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_counts_t {
    /// Photons counted in a bin, in exposures that have ended.
    pub counted: u64,
    /// Photons in bins around an echo that was reported.
    pub excluded: u64,
    /// Photons that met a full counter.
    pub saturated: u64,
    /// Photons with a TDC code past the last bin.
    pub rejected: u64,
    /// Photons outside the range gate.
    pub gated_out: u64,
    /// Photons in a bin that had one in the same laser cycle, where photons count once per bin.
    pub repeated: u64,
    /// Events.
    pub events: u64,
    /// Decisions deferred because the slot was full.
    pub deferred: u64,
    /// Exposures that reached L2 without an event.
    pub expired: u64,
    /// Of these, exposures with a deferred decision.
    pub expired_deferred: u64,
    /// Exposures that ended because a counter was full, so that a dead time could not be weighed, or as
    /// one of 8 bits had lost a photon.
    pub ended_full: u64,
    /// Decisions that left bins out, because the TDC was hardly ever live there, or all bins,
    /// because the counts contradict its dead time.
    pub blind_looks: u64,
}

/// Sets all counts to 0.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT.
/// Threads: no other thread uses `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_statistics_init(statistics: *mut dtof_statistics_t) -> dtof_status_t {
    // SAFETY: the caller's promise, see the crate.
    status(|| unsafe { initialise(statistics, DTOF_STATISTICS_SIZE, Statistics::new()) })
}

/// Reads statistics.
///
/// Errors: DTOF_ERROR_NULL, DTOF_ERROR_ALIGNMENT, DTOF_ERROR_NOT_INITIALISED.
/// Threads: no other thread changes `statistics` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dtof_statistics_read(
    statistics: *const dtof_statistics_t,
    counts: *mut dtof_counts_t,
) -> dtof_status_t {
    status(|| {
        // SAFETY: the caller's promise, see the crate.
        let of = unsafe { object_ref(statistics)? };
        let read = dtof_counts_t {
            counted: of.counted,
            excluded: of.excluded,
            saturated: of.saturated,
            rejected: of.rejected,
            gated_out: of.gated_out,
            repeated: of.repeated,
            events: of.events,
            deferred: of.deferred,
            expired: of.expired,
            expired_deferred: of.expired_deferred,
            ended_full: of.ended_full,
            blind_looks: of.blind_looks,
        };
        // SAFETY: the same promise.
        unsafe { put(counts, read) }
    })
}

//! Counts of what an array of pixels has done, and of losses.
//!
//! One [`Statistics`] serves all pixels. Each pixel adds its photons when an exposure
//! ends, so the photons of exposures that have not ended are still in the histograms:
//!
//! ```
//! use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, PixelConfig, Statistics, checked};
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let mut pixels = [0, 1].map(|address| AsyncPixel::<128>::new(PixelAddress::new(address)));
//! let mut statistics = Statistics::default();
//! for cycle in 0..50 {
//!     for pixel in &mut pixels {
//!         pixel.count(&CONFIG, 60);
//!         pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(cycle));
//!     }
//! }
//! assert_eq!((statistics.events, statistics.photons()), (2, 2 * 44));
//! for pixel in &pixels {
//!     pixel.add_photons_to(&mut statistics);
//! }
//! assert_eq!(statistics.photons(), 2 * 50);
//! ```
//!
//! Cost: 96 bytes an array, and none a pixel.

use core::ops::AddAssign;

use crate::histogram::Histogram;
use crate::histogram::counter::{CounterWidth, PhotonCount};
use crate::histogram::gate::RangeGate;

/// Counts of what pixels have done since they were made. Photons offered are
/// `counted + excluded + saturated + rejected + gated_out + repeated` (short of 2³² losses of
/// one kind within one exposure).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Statistics {
    /// Photons counted in a bin.
    pub counted: u64,
    /// Photons in excluded bins: those around a reported echo, to the end of the exposure.
    pub excluded: u64,
    /// Photons that met a full counter.
    pub saturated: u64,
    /// Photons with a TDC code past the last bin.
    pub rejected: u64,
    /// Photons outside the range gate.
    pub gated_out: u64,
    /// Photons in a bin that had one in the same laser cycle, where they [count once](crate::OncePerBin).
    pub repeated: u64,
    /// Events put into the slot.
    pub events: u64,
    /// Decisions deferred because the slot was full.
    pub deferred: u64,
    /// Exposures without an event: those that reached L2, and those that ended because a counter
    /// was full.
    pub expired: u64,
    /// Of these, exposures with a deferred decision: they might have had an event.
    pub expired_deferred: u64,
    /// Exposures that ended because a counter was full. Those without an event are in `expired`, too. With a
    /// dead time it was unknown how often the bins behind it were live. [`Count8`](crate::Count8) had
    /// lost a photon. Other counters never end one.
    pub ended_full: u64,
    /// Decisions in which a gated bin was blind or had a photon in nearly all laser cycles, as
    /// [`Flags::PILE_UP`](crate::Flags::PILE_UP) says; or in more laser cycles than there were, so
    /// that the counts contradict the dead time.
    pub blind_looks: u64,
}

impl Statistics {
    /// All zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            counted: 0,
            excluded: 0,
            saturated: 0,
            rejected: 0,
            gated_out: 0,
            repeated: 0,
            events: 0,
            deferred: 0,
            expired: 0,
            expired_deferred: 0,
            ended_full: 0,
            blind_looks: 0,
        }
    }

    /// Photons offered, counted or not: repeated ones, too.
    #[must_use]
    pub const fn photons(&self) -> u64 {
        self.counted
            + self.excluded
            + self.saturated
            + self.rejected
            + self.gated_out
            + self.repeated
    }

    /// Adds the photons of a whole histogram: those in the `gate` as counted, the others as gated out.
    #[inline(never)]
    pub fn add_counts<const BINS: usize, C: PhotonCount>(
        &mut self,
        counts: &[C; BINS],
        gate: &RangeGate<BINS>,
    ) {
        let bins = gate.bins();
        let outside = photons(counts.get(..bins.start)) + photons(counts.get(bins.end..));
        self.counted += photons(counts.get(bins));
        self.gated_out += outside;
    }

    /// Adds the photons of a histogram, and those outside the gate, as
    /// [`Histogram::add_frame`] returns them.
    #[inline(always)]
    pub fn add_photons_of<const BINS: usize, W: CounterWidth>(
        &mut self,
        histogram: &Histogram<BINS, W>,
        gated_out: u32,
    ) {
        self.counted += u64::from(histogram.total());
        // Most often none is lost.
        if histogram.saturated() | histogram.rejected() | gated_out != 0 {
            self.saturated += u64::from(histogram.saturated());
            self.rejected += u64::from(histogram.rejected());
            self.gated_out += u64::from(gated_out);
        }
    }
}

/// The photons of these bins.
#[inline(never)]
pub(crate) fn photons<C: PhotonCount>(counts: Option<&[C]>) -> u64 {
    let counts = counts.unwrap_or_default().iter();
    counts.map(|&photons| u64::from(photons.into())).sum()
}

/// Adds those of other pixels.
impl AddAssign for Statistics {
    fn add_assign(&mut self, other: Self) {
        self.counted += other.counted;
        self.excluded += other.excluded;
        self.saturated += other.saturated;
        self.rejected += other.rejected;
        self.gated_out += other.gated_out;
        self.repeated += other.repeated;
        self.events += other.events;
        self.deferred += other.deferred;
        self.expired += other.expired;
        self.expired_deferred += other.expired_deferred;
        self.ended_full += other.ended_full;
        self.blind_looks += other.blind_looks;
    }
}

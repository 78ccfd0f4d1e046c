//! The asynchronous pixel: it counts photons, looks at its histogram every X laser
//! cycles, and reports and starts over the moment the peak stands clear.
//!
//! After every X laser cycles the exposure N is checked. If `L1 < N < L2`
//! (strict, as printed) the detection rule decides. After an event, or once N
//! has reached L2, the histogram is cleared and N starts from 0.
//!
//! An event goes into the pixel's slot; the pixel clears and counts on at once.
//! While the link has not taken it the pixel does not fire again. It keeps
//! counting and looks again X laser cycles later. Each look put off is
//! counted as deferred. Back-pressure lengthens exposures; it loses no event
//! that was made. An exposure that reaches L2 meanwhile ends without one, and is
//! counted apart.
//!
//! ```
//! use dtof_core::*;
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let mut pixel = AsyncPixel::<128>::new(PixelAddress(7));
//! let mut statistics = Statistics::default();
//!
//! for cycle in 0..44 {
//!     pixel.count(&CONFIG, 60); // one photon a laser cycle, always bin 60
//!     let look = pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle(cycle));
//!     assert_eq!(look == Look::Event, cycle == 43); // the first N above L1
//! }
//! let event = pixel.acknowledge().unwrap();
//! assert_eq!((event.exposure, event.peak_bin.raw(), event.peak_count.raw()), (44, 60, 44));
//! ```
//!
//! Cost: 64 bytes beside the counters (a compile-time check). On a Cortex-M4 and 128
//! bins 10 instructions a photon in a batch, 130 a look, 110 to clear and re-arm.
//!
//! Source: the flow chart of the paper's section II-B. The slot is its REQ (section IV-A);
//! ACK is ours, as is what happens while the link is busy.

use crate::config::PixelConfig;
use crate::counter::{Count10, CounterWidth, PhotonCount};
use crate::detect::DetectionRule;
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::histogram::Histogram;
use crate::statistics::Statistics;
use crate::units::{BinIndex, Count, LaserCycle, PixelAddress, SubBinOffset};

/// What the end of a laser cycle brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Look {
    /// Fewer than X laser cycles since the last look: none was taken.
    NotDue,
    /// N has not exceeded L1.
    TooEarly,
    /// The peak does not stand clear of the background; the exposure goes on.
    NoPeak,
    /// The slot still holds an event, so the decision is put off by X laser
    /// cycles.
    Deferred,
    /// The peak stands clear: the event is in the slot, a new exposure begins.
    Event,
    /// N reached L2 without an event: a new exposure begins.
    Expired,
}

/// One macropixel: histogram, exposure and event slot.
#[derive(Clone, Debug)]
pub struct AsyncPixel<const BINS: usize, W: CounterWidth = Count10> {
    address: PixelAddress,
    exposure: u16,
    since_look: u16,
    /// Whether a decision of this exposure was put off.
    deferred: bool,
    /// Whether `event` waits for the link. Apart from it, where it takes no room.
    is_requesting: bool,
    event: DepthEvent,
    /// Photons of this exposure that the gate left out, fewer than 2³².
    gated_out: u32,
    histogram: Histogram<BINS, W>,
}

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// The bytes of a pixel beside its counters.
    const OVERHEAD: usize = size_of::<Self>() - size_of::<[W::Counter; BINS]>();

    /// An empty pixel at the beginning of its first exposure.
    #[must_use]
    pub const fn new(address: PixelAddress) -> Self {
        const { assert!(Self::OVERHEAD <= 64) };
        Self {
            address,
            exposure: 0,
            since_look: 0,
            deferred: false,
            is_requesting: false,
            event: DepthEvent {
                pixel: address,
                cycle: LaserCycle(0),
                exposure: 0,
                peak_bin: BinIndex::saturating(0),
                offset: SubBinOffset::CENTRE,
                peak_count: Count::saturating(0),
                background: Count::saturating(0),
                flags: Flags::NONE,
            },
            gated_out: 0,
            histogram: Histogram::new(),
        }
    }

    /// Counts one photon with the TDC code `code` in the present laser cycle.
    #[inline]
    pub fn count<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        let gated_out = self.histogram.add_gated(code, config.gate());
        self.leave_out(gated_out);
    }

    /// Counts one photon for each TDC code, as [`Self::count`] does.
    #[inline]
    pub fn count_batch<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, codes: &[u16]) {
        let gated_out = self.histogram.add_gated_batch(codes, config.gate());
        self.leave_out(gated_out);
    }

    /// Counts the photons of a whole mini-frame, a histogram over one or more
    /// laser cycles. Follow it by [`Self::end_laser_cycles`] with as many.
    #[inline]
    pub fn count_frame<R: DetectionRule, C: PhotonCount>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        frame: &[C; BINS],
    ) {
        let gated_out = self.histogram.add_frame(frame, config.gate());
        self.leave_out(gated_out);
    }

    /// Ends laser cycle `cycle`, and looks if X have passed since the last look.
    /// `statistics` are those of the array.
    #[inline]
    pub fn end_laser_cycle<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
    ) -> Look {
        self.end_laser_cycles(config, statistics, cycle, 1)
    }

    /// Ends `cycles` laser cycles at once, the last of which is `last`, and
    /// looks once if X or more have passed since the last look.
    ///
    /// The length of a mini-frame need not divide X. The look then falls on the first
    /// frame boundary after X laser cycles, which may leave no look between L1 and L2.
    #[inline]
    pub fn end_laser_cycles<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
        cycles: u16,
    ) -> Look {
        // An exposure stuck at the top is at least L2, and so expires.
        self.exposure = self.exposure.saturating_add(cycles);
        self.since_look = self.since_look.saturating_add(cycles);
        if self.since_look < config.x() {
            return Look::NotDue;
        }
        self.look(config, statistics, last)
    }

    /// Checks N and decides.
    #[inline]
    fn look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
    ) -> Look {
        self.since_look = 0;
        if self.exposure <= config.l1() {
            return Look::TooEarly;
        }
        if self.exposure >= config.l2() {
            statistics.expired += 1;
            statistics.expired_deferred += u64::from(self.deferred);
            self.restart(statistics);
            return Look::Expired;
        }
        if self.is_requesting {
            statistics.deferred += 1;
            self.deferred = true;
            return Look::Deferred;
        }
        let Some(detection) = config.detect(&self.histogram) else {
            return Look::NoPeak;
        };
        self.event = detection.event(self.address, cycle, self.exposure);
        self.is_requesting = true;
        if self.deferred {
            self.event.flags |= Flags::DEFERRED;
        }
        if config.is_one_hit() && 2 * self.photons() > u64::from(self.exposure) {
            self.event.flags |= Flags::PILE_UP;
        }
        statistics.events += 1;
        self.restart(statistics);
        Look::Event
    }

    /// REQ: whether an event waits for the link.
    #[inline]
    #[must_use]
    pub const fn request(&self) -> bool {
        self.is_requesting
    }

    /// ACK: takes the event that waits, so that the pixel may fire again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self) -> Option<DepthEvent> {
        if !self.is_requesting {
            return None;
        }
        self.is_requesting = false;
        Some(self.event)
    }

    /// Which macropixel this is.
    #[must_use]
    pub const fn address(&self) -> PixelAddress {
        self.address
    }

    /// N: laser cycles since the histogram was cleared.
    #[must_use]
    pub const fn exposure(&self) -> u16 {
        self.exposure
    }

    /// The histogram of the present exposure.
    #[must_use]
    pub const fn histogram(&self) -> &Histogram<BINS, W> {
        &self.histogram
    }

    /// Adds the photons of the present exposure to `statistics`. Those of exposures that
    /// have ended are there already.
    #[inline(always)]
    pub fn add_photons_to(&self, statistics: &mut Statistics) {
        statistics.add_photons_of(&self.histogram, self.gated_out);
    }

    /// Photons of the present exposure with a TDC code of a bin.
    fn photons(&self) -> u64 {
        let histogram = &self.histogram;
        let counted = u64::from(histogram.total()) + u64::from(histogram.saturated());
        counted + u64::from(self.gated_out)
    }

    /// Counts photons that the gate left out.
    #[inline(always)]
    fn leave_out(&mut self, photons: u32) {
        // Most often none.
        if photons > 0 {
            self.gated_out = self.gated_out.wrapping_add(photons);
        }
    }

    /// Begins a new exposure.
    fn restart(&mut self, statistics: &mut Statistics) {
        self.add_photons_to(statistics);
        // Not behind what `clear` ends with: together they would be a call of `memset`.
        self.gated_out = 0;
        self.histogram.clear();
        self.exposure = 0;
        self.deferred = false;
    }
}

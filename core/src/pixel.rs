//! The asynchronous pixel (section II-B): it counts photons, looks at its
//! histogram every X laser cycles, and reports and starts over the moment the
//! peak stands clear.
//!
//! After every X laser cycles the exposure N is checked. If `L1 < N < L2`
//! (strict, as printed) the detection rule decides. After an event, or once N
//! has reached L2, the histogram is cleared and N starts from 0.
//!
//! An event goes into the pixel's slot; the pixel clears and counts on at once.
//! While the link has not taken it the pixel does not fire again: it keeps
//! counting and looks again X laser cycles later, and each look put off is
//! counted as deferred. Back-pressure lengthens exposures; it loses no event
//! that was made. An exposure that reaches L2 meanwhile ends without one, and is
//! counted apart.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::*;
//!
//! let rule = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(5));
//! let config = PixelConfig::<128>::new(4, 40, 2000, RangeGate::full(), rule)?;
//! let mut pixel = AsyncPixel::<128>::new(PixelAddress(7));
//!
//! for cycle in 0..44 {
//!     pixel.count(&config, 60); // one photon a laser cycle, always bin 60
//!     let looked = pixel.end_laser_cycle(&config, LaserCycle(cycle));
//!     assert_eq!(looked == Look::Event, cycle == 43); // the first N above L1
//! }
//! let event = pixel.acknowledge().unwrap();
//! assert_eq!((event.exposure, event.peak_bin.raw(), event.peak_count.raw()), (44, 60, 44));
//! # Ok::<(), ConfigError>(())
//! ```

use core::fmt;
use core::ops::AddAssign;

use crate::detection::detect;
use crate::estimator::DepthEstimator;
use crate::event::{DepthEvent, EventSlot};
use crate::flags::Flags;
use crate::gate::RangeGate;
use crate::histogram::{Count10, CounterWidth, Histogram};
use crate::rule::{DetectionRule, PaperRule};
use crate::units::{LaserCycle, PixelAddress};

/// How pixels operate: one configuration for many. Valid by construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PixelConfig<const BINS: usize, R: DetectionRule = PaperRule> {
    x: u16,
    l1: u16,
    l2: u16,
    gate: RangeGate<BINS>,
    rule: R,
    estimator: DepthEstimator,
    is_one_hit: bool,
}

/// A configuration that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConfigError {
    /// X is 0.
    ZeroX,
    /// X is greater than L1.
    XAboveL1,
    /// L2 is not greater than L1.
    L2NotAboveL1,
    /// No multiple of X lies between L1 and L2, so that the pixel would never
    /// decide.
    NoLook,
    /// A processing element serves four macropixels in turn, which makes X 4.
    XNotFour,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ZeroX => "X must be at least 1",
            Self::XAboveL1 => "X must not be greater than L1",
            Self::L2NotAboveL1 => "L2 must be greater than L1",
            Self::NoLook => "no multiple of X lies strictly between L1 and L2",
            Self::XNotFour => "X must be 4 for a processing element",
        })
    }
}

impl core::error::Error for ConfigError {}

impl<const BINS: usize, R: DetectionRule> PixelConfig<BINS, R> {
    /// Looks every `x` laser cycles, decides while `l1 < N < l2`.
    ///
    /// # Errors
    /// [`ConfigError`] unless `0 < x <= l1 < l2` and a multiple of `x` lies
    /// strictly between `l1` and `l2`.
    pub const fn new(
        x: u16,
        l1: u16,
        l2: u16,
        gate: RangeGate<BINS>,
        rule: R,
    ) -> Result<Self, ConfigError> {
        if x == 0 {
            return Err(ConfigError::ZeroX);
        }
        if x > l1 {
            return Err(ConfigError::XAboveL1);
        }
        if l2 <= l1 {
            return Err(ConfigError::L2NotAboveL1);
        }
        // The last multiple of x below l2.
        let last_look = (l2 - 1) - (l2 - 1) % x;
        if last_look <= l1 {
            return Err(ConfigError::NoLook);
        }
        Ok(Self {
            x,
            l1,
            l2,
            gate,
            rule,
            estimator: DepthEstimator::CentreOfMass3,
            is_one_hit: false,
        })
    }

    /// The same with another depth estimator than the paper's
    /// [`DepthEstimator::CentreOfMass3`].
    #[must_use]
    pub const fn with_estimator(self, estimator: DepthEstimator) -> Self {
        Self { estimator, ..self }
    }

    /// The same for a TDC that takes the first photon of a laser cycle only: an
    /// event gets [`Flags::PILE_UP`] if the photons of its exposure, those that the
    /// gate left out included, are more than half its laser cycles.
    ///
    /// At that half, 0.7 photons arrive in a laser cycle, and a Gaussian pulse on its
    /// own is read 0.2 of its standard deviation too near; false events begin above four
    /// fifths (`docs/failures.md`). The 5 % that photon counting usually keeps to
    /// ask for a depth error of a hundredth of the pulse, far below that of an
    /// event's few photons.
    #[must_use]
    pub const fn with_one_hit_tdc(self) -> Self {
        Self {
            is_one_hit: true,
            ..self
        }
    }

    /// Laser cycles between looks.
    #[must_use]
    pub const fn x(&self) -> u16 {
        self.x
    }

    /// The exposure that a decision must exceed.
    #[must_use]
    pub const fn l1(&self) -> u16 {
        self.l1
    }

    /// The exposure at which the histogram is cleared without an event.
    #[must_use]
    pub const fn l2(&self) -> u16 {
        self.l2
    }

    /// The bins that may hold the peak.
    #[must_use]
    pub const fn gate(&self) -> &RangeGate<BINS> {
        &self.gate
    }

    /// The detection rule.
    #[must_use]
    pub const fn rule(&self) -> &R {
        &self.rule
    }

    /// How the depth of an event is found.
    #[must_use]
    pub const fn estimator(&self) -> &DepthEstimator {
        &self.estimator
    }

    /// Whether the TDC takes one hit a laser cycle.
    #[must_use]
    pub const fn is_one_hit(&self) -> bool {
        self.is_one_hit
    }
}

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

/// What a pixel has done since it was made. Photons offered are
/// `counted + saturated + rejected + gated_out` (short of 2³² losses of one
/// kind within one exposure).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Statistics {
    /// Photons counted in a bin.
    pub counted: u64,
    /// Photons that met a full counter.
    pub saturated: u64,
    /// Photons with a TDC code past the last bin.
    pub rejected: u64,
    /// Photons outside the range gate.
    pub gated_out: u64,
    /// Events put into the slot.
    pub events: u64,
    /// Decisions put off because the slot was full.
    pub deferred: u64,
    /// Exposures that reached L2 without an event.
    pub expired: u64,
    /// Of these, exposures with a decision put off: what they would have
    /// reported is not known.
    pub expired_deferred: u64,
}

impl Statistics {
    /// Photons offered, counted or not.
    #[must_use]
    pub const fn photons(&self) -> u64 {
        self.counted + self.saturated + self.rejected + self.gated_out
    }

    /// Adds those of an exposure.
    #[inline]
    fn add_photons_of<const BINS: usize, W: CounterWidth>(
        &mut self,
        histogram: &Histogram<BINS, W>,
    ) {
        self.counted += u64::from(histogram.total());
        self.saturated += u64::from(histogram.saturated());
        self.rejected += u64::from(histogram.rejected());
    }
}

impl AddAssign for Statistics {
    /// Those of one more pixel.
    fn add_assign(&mut self, other: Self) {
        self.counted += other.counted;
        self.saturated += other.saturated;
        self.rejected += other.rejected;
        self.gated_out += other.gated_out;
        self.events += other.events;
        self.deferred += other.deferred;
        self.expired += other.expired;
        self.expired_deferred += other.expired_deferred;
    }
}

/// One macropixel: histogram, exposure and event slot.
#[derive(Clone, Debug)]
pub struct AsyncPixel<const BINS: usize, W: CounterWidth = Count10> {
    address: PixelAddress,
    exposure: u16,
    since_look: u16,
    deferred: bool,
    histogram: Histogram<BINS, W>,
    slot: EventSlot,
    statistics: Statistics,
    /// [`Statistics::gated_out`] when the exposure began, its lower 32 bits.
    gated_out_before: u32,
}

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// An empty pixel at the beginning of its first exposure.
    #[must_use]
    pub const fn new(address: PixelAddress) -> Self {
        Self {
            address,
            exposure: 0,
            since_look: 0,
            deferred: false,
            histogram: Histogram::new(),
            slot: EventSlot::new(),
            statistics: Statistics {
                counted: 0,
                saturated: 0,
                rejected: 0,
                gated_out: 0,
                events: 0,
                deferred: 0,
                expired: 0,
                expired_deferred: 0,
            },
            gated_out_before: 0,
        }
    }

    /// Counts one photon with the TDC code `code` in the present laser cycle.
    #[inline]
    pub fn count<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, code: u16) {
        let gated_out = self.histogram.add_gated(code, &config.gate);
        if gated_out > 0 {
            self.statistics.gated_out += u64::from(gated_out);
        }
    }

    /// Counts one photon for each TDC code, as [`Self::count`] does.
    #[inline]
    pub fn count_batch<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>, codes: &[u16]) {
        let gated_out = self.histogram.add_gated_batch(codes, &config.gate);
        if gated_out > 0 {
            self.statistics.gated_out += u64::from(gated_out);
        }
    }

    /// Counts the photons of a whole mini-frame, a histogram over one or more
    /// laser cycles. Follow it by [`Self::end_laser_cycles`] with as many.
    #[inline]
    pub fn count_frame<R: DetectionRule, C: Copy + Into<u32>>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        frame: &[C; BINS],
    ) {
        let gated_out = self.histogram.add_frame(frame, &config.gate);
        self.statistics.gated_out += u64::from(gated_out);
    }

    /// Ends laser cycle `cycle`, and looks if X have passed since the last look.
    #[inline]
    pub fn end_laser_cycle<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        cycle: LaserCycle,
    ) -> Look {
        self.end_laser_cycles(config, cycle, 1)
    }

    /// Ends `cycles` laser cycles at once, the last of which is `last`, and
    /// looks once if X or more have passed since the last look. With
    /// mini-frames whose length does not divide X the look so falls on the first
    /// frame boundary after X laser cycles, which may leave no look between L1 and
    /// L2 where [`PixelConfig::new`] found one.
    #[inline]
    pub fn end_laser_cycles<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        last: LaserCycle,
        cycles: u16,
    ) -> Look {
        self.advance(cycles);
        if self.since_look < config.x {
            return Look::NotDue;
        }
        self.look(config, last)
    }

    /// Lets `cycles` laser cycles pass without a look.
    #[inline]
    pub(crate) fn advance(&mut self, cycles: u16) {
        // An exposure stuck at the top is at least L2, and so expires.
        self.exposure = self.exposure.saturating_add(cycles);
        self.since_look = self.since_look.saturating_add(cycles);
    }

    /// Checks N and decides.
    #[inline]
    pub(crate) fn look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        cycle: LaserCycle,
    ) -> Look {
        self.since_look = 0;
        if self.exposure <= config.l1 {
            return Look::TooEarly;
        }
        if self.exposure >= config.l2 {
            self.statistics.expired += 1;
            self.statistics.expired_deferred += u64::from(self.deferred);
            self.restart();
            return Look::Expired;
        }
        if self.slot.request() {
            self.statistics.deferred += 1;
            self.deferred = true;
            return Look::Deferred;
        }
        let Some(detection) = detect(
            &self.histogram,
            &config.gate,
            &config.rule,
            &config.estimator,
        ) else {
            return Look::NoPeak;
        };
        let mut flags = detection.depth.flags;
        if self.deferred {
            flags |= Flags::DEFERRED;
        }
        if config.is_one_hit && 2 * self.photons() > u64::from(self.exposure) {
            flags |= Flags::PILE_UP;
        }
        let event = DepthEvent {
            pixel: self.address,
            cycle,
            exposure: self.exposure,
            peak_bin: detection.peak.bin,
            offset: detection.depth.offset,
            peak_count: detection.peak.count,
            background: detection.background,
            flags,
        };
        if self.slot.offer(event).is_ok() {
            self.statistics.events += 1;
        }
        self.restart();
        Look::Event
    }

    /// REQ: whether an event waits for the link.
    #[inline]
    #[must_use]
    pub const fn request(&self) -> bool {
        self.slot.request()
    }

    /// ACK: takes the event that waits, so that the pixel may fire again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self) -> Option<DepthEvent> {
        self.slot.acknowledge()
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

    /// What the pixel has done so far, the present exposure included.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        let mut statistics = self.statistics;
        statistics.add_photons_of(&self.histogram);
        statistics
    }

    /// Photons of the present exposure with a TDC code of a bin, of which there are fewer
    /// than 2³² outside the gate.
    fn photons(&self) -> u64 {
        let gated_out = self.gated_out().wrapping_sub(self.gated_out_before);
        let counted = u64::from(self.histogram.total()) + u64::from(self.histogram.saturated());
        counted + u64::from(gated_out)
    }

    /// The lower 32 bits of what the gate has left out.
    #[allow(clippy::cast_possible_truncation, reason = "what is asked for")]
    const fn gated_out(&self) -> u32 {
        self.statistics.gated_out as u32
    }

    /// Begins a new exposure.
    fn restart(&mut self) {
        self.gated_out_before = self.gated_out();
        self.statistics.add_photons_of(&self.histogram);
        self.histogram.clear();
        self.exposure = 0;
        self.deferred = false;
    }
}

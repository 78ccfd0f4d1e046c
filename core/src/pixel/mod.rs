//! The asynchronous pixel: it counts photons, looks at its histogram every X laser
//! cycles, and reports and starts over the moment the peak stands clear.
//!
//! After every X laser cycles the exposure N is checked. If `L1 < N < L2`
//! (strict, as printed) the detection rule decides. After an event, or once N
//! has reached L2, the histogram is cleared and N starts from 0.
//!
//! An event goes into the pixel's slot; the pixel clears and counts on at once. While the
//! link has not taken it the pixel does not fire again. It keeps counting and looks again X
//! laser cycles later. Each look put off is counted as deferred. No event that was made is
//! lost. An exposure that reaches L2 meanwhile ends without one, and is counted apart.
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
//! With several [echoes](crate::PixelConfigBuilder::echoes) an event does not end the
//! exposure: the pixel leaves out the bins around its peak, and [waits](
//! crate::PixelConfigBuilder::echo_wait) for the next. With
//! [tracking](crate::PixelConfigBuilder::tracking) it expects an event where the last was.
//!
//! Cost: 72 bytes beside the counters (a compile-time check). On a Cortex-M4 and 128
//! bins 10 instructions a photon in a batch, 130 a look, 110 to clear and re-arm.
//!
//! Source: the flow chart of the paper's section II-B. The slot is its REQ (section IV-A);
//! ACK is ours, as is what happens while the link is busy.

mod count;
mod decided;
mod look;

pub use self::decided::Decided;
pub use self::look::Look;
use self::look::State;
use crate::config::PixelConfig;
use crate::detect::{Detection, DetectionRule};
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::histogram::Histogram;
use crate::histogram::counter::{Count10, CounterWidth};
use crate::histogram::peeled::PeeledBins;
use crate::statistics::Statistics;
use crate::units::{
    BinIndex, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress, SubBinOffset,
};

/// One macropixel: histogram, exposure and event slot.
#[derive(Clone, Debug)]
pub struct AsyncPixel<const BINS: usize, W: CounterWidth = Count10> {
    exposure: u16,
    since_look: u16,
    state: State,
    /// The bin of the last event, of exposures before this one.
    expected: BinIndex,
    /// The echoes of this exposure, but for its last.
    peeled: PeeledBins,
    /// The slot. Its pixel and level are there before the first event.
    event: DepthEvent,
    /// Photons of this exposure that the gate left out, fewer than 2³².
    gated_out: u32,
    /// Photons of this exposure that were in the bins around its echoes, fewer than 2³².
    held: u32,
    histogram: Histogram<BINS, W>,
}

impl<const BINS: usize, W: CounterWidth> AsyncPixel<BINS, W> {
    /// The bytes of a pixel beside its counters.
    const OVERHEAD: usize = size_of::<Self>() - size_of::<[W::Counter; BINS]>();

    /// An empty pixel at the beginning of its first exposure.
    #[must_use]
    pub const fn new(address: PixelAddress) -> Self {
        const { assert!(Self::OVERHEAD <= 72) };
        Self {
            exposure: 0,
            since_look: 0,
            state: State::NONE,
            expected: BinIndex::saturating(0),
            peeled: PeeledBins::NONE,
            event: DepthEvent {
                pixel: address,
                level: BlockLevel::PIXEL,
                echo: EchoNumber::FIRST,
                cycle: LaserCycle(0),
                exposure: 0,
                peak_bin: BinIndex::saturating(0),
                offset: SubBinOffset::CENTRE,
                peak_count: Count::saturating(0),
                background: Count::saturating(0),
                flags: Flags::NONE,
            },
            gated_out: 0,
            held: 0,
            histogram: Histogram::new(),
        }
    }

    /// One that counts for a block of `level` and the first pixel `first`.
    pub(crate) const fn of_block(first: PixelAddress, level: BlockLevel) -> Self {
        let mut pixel = Self::new(first);
        pixel.event.level = level;
        pixel
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
        self.end_laser_cycles_seen(config, statistics, last, cycles, |_| ())
    }

    /// The same, and shows what an event is decided from, if there is one: right after it the
    /// pixel starts over.
    #[inline]
    pub fn end_laser_cycles_seen<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
        cycles: u16,
        see: impl FnOnce(Decided<'_, BINS, W>),
    ) -> Look {
        // An exposure stuck at the top is at least L2, and so expires.
        self.exposure = self.exposure.saturating_add(cycles);
        self.since_look = self.since_look.saturating_add(cycles);
        if self.since_look < config.x() {
            return Look::NotDue;
        }
        self.look(config, statistics, last, see)
    }

    /// Checks N and decides.
    #[inline]
    fn look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        see: impl FnOnce(Decided<'_, BINS, W>),
    ) -> Look {
        self.since_look = 0;
        if self.exposure <= config.l1() {
            return Look::TooEarly;
        }
        if self.state != State::NONE {
            return self.look_further(config, statistics, cycle, see);
        }
        if self.exposure >= config.l2() {
            statistics.expired += 1;
            self.restart(statistics);
            return Look::Expired;
        }
        let Some(detection) = config.detect(&self.histogram) else {
            return Look::NoPeak;
        };
        see(Decided::plainly(&self.histogram));
        self.report(config, statistics, cycle, &detection)
    }

    /// A look at a pixel whose event waits, that has reported an echo or expects one, or
    /// whose decision was put off.
    #[inline(never)]
    fn look_further<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        see: impl FnOnce(Decided<'_, BINS, W>),
    ) -> Look {
        let mut longest = config.l2();
        if self.state.contains(State::PEELED) {
            // Photons that have come since the last look.
            self.peel(statistics);
            // The slot has the last echo, whether or not that was taken.
            longest = config.end_after_echo(self.event.exposure);
        }
        if self.exposure >= longest {
            return self.end(config, statistics);
        }
        if self.state.contains(State::REQUESTING) {
            statistics.deferred += 1;
            self.state.set(State::DEFERRED);
            return Look::Deferred;
        }
        let expected = self.state.contains(State::EXPECTING);
        let expected = expected.then_some(self.expected);
        let Some(detection) = config.detect_further(&self.histogram, expected, &self.peeled) else {
            return Look::NoPeak;
        };
        see(Decided {
            histogram: &self.histogram,
            expected,
            peeled: self.peeled,
        });
        self.report(config, statistics, cycle, &detection)
    }

    /// Puts the event of `detection` into the slot. The exposure ends, or goes on for the
    /// next echo.
    // Not behind a call, which would cost each look an instruction.
    #[inline(always)]
    fn report<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        detection: &Detection,
    ) -> Look {
        let DepthEvent { pixel, level, .. } = self.event;
        self.event = detection.event(pixel, cycle, self.exposure);
        self.event.level = level;
        if self.state.contains(State::DEFERRED) {
            self.event.flags |= Flags::DEFERRED;
        }
        if config.is_one_hit() && 2 * self.photons() > u64::from(self.exposure) * level.pixels() {
            self.event.flags |= Flags::PILE_UP;
        }
        statistics.events += 1;
        self.state.set(State::REQUESTING);
        if config.echoes() > EchoNumber::FIRST {
            if self.goes_on(config) {
                self.peel(statistics);
            } else {
                self.end(config, statistics);
            }
            return Look::Event;
        }
        self.restart(statistics);
        self.track(config);
        Look::Event
    }

    /// Numbers the echo in the slot, and says whether the exposure goes on after it.
    #[inline(never)]
    fn goes_on<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>) -> bool {
        if !self.state.contains(State::PEELED) {
            self.peeled = PeeledBins::new(config.peel_reach());
            self.state.set(State::PEELED);
        }
        let echo = EchoNumber::new(self.peeled.echoes() + 1).unwrap_or(EchoNumber::LAST);
        self.event.echo = echo;
        self.state.clear(State::DEFERRED);
        let next = config.echo_after(echo, &mut self.peeled, self.event.peak_bin);
        next.is_some()
    }

    /// Empties the bins around the echoes of this exposure.
    fn peel(&mut self, statistics: &mut Statistics) {
        let held = self.peeled.empty(&mut self.histogram);
        self.held = self.held.wrapping_add(held);
        statistics.held += u64::from(held);
    }

    /// Ends an exposure that may have had an event.
    fn end<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
    ) -> Look {
        let has_reported = self.state.contains(State::PEELED);
        if !has_reported {
            statistics.expired += 1;
            statistics.expired_deferred += u64::from(self.state.contains(State::DEFERRED));
        }
        self.peeled = PeeledBins::NONE;
        self.held = 0;
        self.restart(statistics);
        if !has_reported {
            return Look::Expired;
        }
        self.track(config);
        Look::Ended
    }

    /// A pixel that tracks expects its next event where the last was.
    #[inline(always)]
    fn track<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>) {
        if config.tracking().is_some() {
            self.expected = self.event.peak_bin;
            self.state.set(State::EXPECTING);
        }
    }

    /// REQ: whether an event waits for the link.
    #[inline]
    #[must_use]
    pub const fn request(&self) -> bool {
        self.state.contains(State::REQUESTING)
    }

    /// ACK: takes the event that waits, so that the pixel may fire again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self) -> Option<DepthEvent> {
        if !self.state.contains(State::REQUESTING) {
            return None;
        }
        self.state.clear(State::REQUESTING);
        Some(self.event)
    }

    /// Whether an event waits for the link, or one of this exposure was followed by no other
    /// exposure yet: not a pixel that sees nothing.
    #[inline]
    #[must_use]
    pub const fn has_reported(&self) -> bool {
        self.state.contains(State::REQUESTING) || self.state.contains(State::PEELED)
    }

    /// Which macropixel this is.
    #[must_use]
    pub const fn address(&self) -> PixelAddress {
        self.event.pixel
    }

    /// Whether it counts for one pixel, or for a block.
    #[must_use]
    pub const fn level(&self) -> BlockLevel {
        self.event.level
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
    /// have ended are there already, and those that are held.
    #[inline(always)]
    pub fn add_photons_to(&self, statistics: &mut Statistics) {
        statistics.add_photons_of(&self.histogram, self.gated_out);
    }

    /// Photons of the present exposure with a TDC code of a bin.
    fn photons(&self) -> u64 {
        let histogram = &self.histogram;
        let counted = u64::from(histogram.total()) + u64::from(histogram.saturated());
        counted + u64::from(self.gated_out) + u64::from(self.held)
    }

    /// Begins a new exposure.
    fn restart(&mut self, statistics: &mut Statistics) {
        self.add_photons_to(statistics);
        self.state.end_exposure();
        // Not behind what `clear` ends with: together they would be a call of `memset`.
        self.gated_out = 0;
        self.histogram.clear();
        self.exposure = 0;
    }
}

//! The asynchronous pixel: it counts photons, looks at its histogram every X laser
//! cycles, and reports and starts over the moment the peak stands clear.
//!
//! After every X laser cycles the exposure N is checked. If `L1 < N < L2`
//! (strict, as printed) the detection rule decides. After an event, or once N
//! has reached L2, the histogram is cleared and N starts from 0.
//!
//! An event goes into the pixel's slot; the pixel clears its histogram and counts on at once.
//! Until the link takes the event, the pixel does not report again. It keeps counting and
//! looks again X laser cycles later. Each such look is counted as deferred. No event is lost.
//! An exposure that reaches L2 meanwhile ends without an event, and is counted separately.
//!
//! ```
//! use dtof_core::{AsyncPixel, LaserCycle, Look, PixelAddress, PixelConfig, Statistics, checked};
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let mut pixel = AsyncPixel::<128>::new(PixelAddress::new(7));
//! let mut statistics = Statistics::default();
//!
//! for cycle in 0..44 {
//!     pixel.count(&CONFIG, 60); // one photon a laser cycle, always bin 60
//!     let look = pixel.end_laser_cycle(&CONFIG, &mut statistics, LaserCycle::new(cycle));
//!     assert_eq!(look == Look::Event, cycle == 43); // the first N above L1
//! }
//! let event = pixel.take_event().unwrap();
//! assert_eq!((event.exposure, event.peak_bin.raw(), event.peak_count.raw()), (44, 60, 44));
//! ```
//!
//! With several [echoes](crate::PixelConfigBuilder::echoes) an event does not end the
//! exposure: the pixel excludes the bins around its peak, and [waits](
//! crate::PixelConfigBuilder::echo_wait) for the next. With
//! [tracking](crate::PixelConfigBuilder::tracking) it expects an event where the last was.
//!
//! Cost: 64 bytes beside the counters (a compile-time check). On a Cortex-M4 and 128
//! bins 10 instructions a photon in a batch, 128 a look, 110 to clear.
//!
//! Source: the flow chart of the paper's section II-B. The slot is its REQ (section IV-A).
//! ACK and the behaviour while the link is busy are ours.

mod count;
mod input;
mod look;
mod once_per_bin;
mod steps;

pub(crate) use self::input::observer;
pub use self::input::{DecisionInput, PixelData};
pub use self::look::Look;
use self::look::State;
pub use self::once_per_bin::OncePerBin;
use crate::config::PixelConfig;
use crate::detect::{Detection, DetectionRule};
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::histogram::Histogram;
use crate::histogram::counter::{Count10, CounterWidth};
use crate::histogram::excluded::ExcludedBins;
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
    /// The bins around the echoes of this exposure, except its last.
    excluded: ExcludedBins,
    /// The slot. Its pixel and level are set from the start.
    event: DepthEvent,
    /// Photons of this exposure outside the gate, fewer than 2³².
    gated_out: u32,
    /// Photons of this exposure that were in the bins around its echoes, fewer than 2³².
    excluded_photons: u32,
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
            exposure: 0,
            since_look: 0,
            state: State::NONE,
            expected: BinIndex::saturating(0),
            excluded: ExcludedBins::NONE,
            event: DepthEvent {
                pixel: address,
                level: BlockLevel::PIXEL,
                echo: EchoNumber::FIRST,
                cycle: LaserCycle::new(0),
                exposure: 0,
                peak_bin: BinIndex::saturating(0),
                offset: SubBinOffset::CENTRE,
                peak_count: Count::saturating(0),
                background: Count::saturating(0),
                flags: Flags::NONE,
            },
            gated_out: 0,
            excluded_photons: 0,
            histogram: Histogram::new(),
        }
    }

    /// A pixel that counts for the block of `level` that begins at `first`.
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
        self.end_laser_cycles_with(config, statistics, last, cycles, unobserved)
    }

    /// The same with an observer. It is called right before an event is reported, with what the
    /// decision was made from; the pixel then clears its histogram.
    #[inline]
    pub fn end_laser_cycles_with<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
        cycles: u16,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        self.end_cycles::<R, true>(config, statistics, last, cycles, observe)
    }

    /// The same for a pixel, or for a block of pixels: its photons are of several TDCs, so that a dead
    /// time is not weighed.
    #[inline(always)]
    pub(crate) fn end_cycles<R: DetectionRule, const OF_PIXEL: bool>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
        cycles: u16,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        // A saturated exposure is at least L2, and so expires.
        self.exposure = self.exposure.saturating_add(cycles);
        self.since_look = self.since_look.saturating_add(cycles);
        if self.since_look < config.x() {
            return Look::NotDue;
        }
        self.look::<R, OF_PIXEL>(config, statistics, last, observe)
    }

    /// Checks N and decides.
    #[inline]
    fn look<R: DetectionRule, const OF_PIXEL: bool>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        self.since_look = 0;
        if self.exposure <= config.l1() {
            return Look::TooEarly;
        }
        if self.state != State::NONE || OF_PIXEL && config.weighs_dead_time() {
            return self.look_on::<R, OF_PIXEL>(config, statistics, cycle, observe);
        }
        if self.exposure >= config.l2() {
            statistics.expired += 1;
            self.restart(statistics);
            return Look::Expired;
        }
        if self.is_full() {
            statistics.ended_full += 1;
            return self.end(config, statistics);
        }
        let Some(detection) = config.detect(&self.histogram) else {
            return Look::NoPeak;
        };
        observe(&DecisionInput::plain(&self.histogram, self.exposure.into()));
        self.report(config, statistics, cycle, &detection)
    }

    /// A look with state or with a dead time.
    #[inline(never)]
    fn look_on<R: DetectionRule, const OF_PIXEL: bool>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        if OF_PIXEL && self.weighs_dead_time(config) {
            self.look_further::<R, true>(config, statistics, cycle, observe)
        } else {
            self.look_further::<R, false>(config, statistics, cycle, observe)
        }
    }

    /// A look with state: an event waits, an echo was reported, an event is expected, or a
    /// decision was deferred. With `LIVE` any look, weighed by a dead time.
    #[inline(always)]
    fn look_further<R: DetectionRule, const LIVE: bool>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        observe: impl FnOnce(&DecisionInput<'_, BINS, W>),
    ) -> Look {
        let mut longest = config.l2();
        if self.state.contains(State::HAS_ECHO) {
            // Photons that have come since the last look.
            self.leave_out_excluded::<R, LIVE>(config, statistics);
            longest = self.longest_after_echo(config);
        }
        if let Some(look) = self.undecided(config, statistics, longest) {
            return look;
        }
        let expected = self.expected();
        let (histogram, excluded) = (&self.histogram, &self.excluded);
        let detection = if LIVE {
            let Some(counts) = config.live_counts(histogram, self.exposure.into(), excluded) else {
                statistics.ended_full += 1;
                return self.end(config, statistics);
            };
            let (detection, is_blind) = config.detect_live(&counts, expected);
            statistics.blind_looks += u64::from(is_blind);
            detection
        } else {
            config.detect_further(histogram, expected, excluded)
        };
        let Some(detection) = detection else {
            return Look::NoPeak;
        };
        observe(&DecisionInput {
            histogram,
            expected,
            excluded: *excluded,
            cycles: self.exposure.into(),
        });
        self.report(config, statistics, cycle, &detection)
    }

    /// What a look is that makes no decision: the exposure has reached the `longest`, an event waits, or a counter
    /// is full.
    #[inline(always)]
    fn undecided<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        longest: u16,
    ) -> Option<Look> {
        if self.exposure >= longest {
            return Some(self.end(config, statistics));
        }
        if self.state.contains(State::REQUESTING) {
            statistics.deferred += 1;
            self.state.set(State::DEFERRED);
            return Some(Look::Deferred);
        }
        if self.is_full() {
            statistics.ended_full += 1;
            return Some(self.end(config, statistics));
        }
        None
    }

    /// Puts the event of `detection` into the slot. The exposure ends, or goes on for the
    /// next echo.
    // Inlined: a call would cost each look an instruction.
    #[inline(always)]
    fn report<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        cycle: LaserCycle,
        detection: &Detection,
    ) -> Look {
        self.put(cycle, detection);
        self.report_slot(config, statistics)
    }

    /// The length at which this exposure ends, which has had an echo.
    #[inline(always)]
    const fn longest_after_echo<R: DetectionRule>(&self, config: &PixelConfig<BINS, R>) -> u16 {
        // The slot has the last echo, even if that was taken.
        config.end_after_echo(self.event.exposure)
    }

    /// Where a pixel that tracks expects its event.
    #[inline(always)]
    fn expected(&self) -> Option<BinIndex> {
        let expects = self.state.contains(State::EXPECTING);
        expects.then_some(self.expected)
    }

    /// Puts the event of `detection` into the slot.
    #[inline(always)]
    fn put(&mut self, cycle: LaserCycle, detection: &Detection) {
        let DepthEvent { pixel, level, .. } = self.event;
        self.event = detection.event(pixel, cycle, self.exposure);
        self.event.level = level;
        if W::BITS < Count10::BITS {
            // It is full at most: no photon was lost.
            self.event.flags = self.event.flags.without(Flags::SATURATED);
        }
    }

    /// Whether a counter that is so narrow that it fills in a usual exposure has lost a photon: the counts
    /// are not those of the light, and no decision is made on them.
    #[inline(always)]
    const fn is_full(&self) -> bool {
        W::BITS < Count10::BITS && self.histogram.saturated() > 0
    }

    /// Reports the event in the slot. The exposure ends, or goes on for the next echo.
    #[inline(always)]
    fn report_slot<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
    ) -> Look {
        if self.state.contains(State::DEFERRED) {
            self.event.flags |= Flags::DEFERRED;
        }
        if config.is_first_photon_only()
            && !self.weighs_dead_time(config)
            && 2 * self.photons() > u64::from(self.exposure) * self.event.level.pixels()
        {
            self.event.flags |= Flags::PILE_UP;
        }
        statistics.events += 1;
        self.state.set(State::REQUESTING);
        if config.echoes() > EchoNumber::FIRST {
            if self.goes_on(config) {
                if self.weighs_dead_time(config) {
                    self.leave_out_excluded::<R, true>(config, statistics);
                } else {
                    self.leave_out_excluded::<R, false>(config, statistics);
                }
            } else {
                self.end(config, statistics);
            }
            return Look::Event;
        }
        self.restart(statistics);
        self.track(config);
        Look::Event
    }

    /// Numbers the echo in the slot. Returns whether the exposure goes on after it.
    #[inline(never)]
    fn goes_on<R: DetectionRule>(&mut self, config: &PixelConfig<BINS, R>) -> bool {
        if !self.state.contains(State::HAS_ECHO) {
            self.excluded = ExcludedBins::new(config.echo_guard_bins());
            self.state.set(State::HAS_ECHO);
        }
        let echo = EchoNumber::new(self.excluded.echoes() + 1).unwrap_or(EchoNumber::LAST);
        self.event.echo = echo;
        self.state.clear(State::DEFERRED);
        let next = config.echo_after(echo, &mut self.excluded, self.event.peak_bin);
        next.is_some()
    }

    /// Leaves the bins around the echoes of this exposure out: empties them, or with `LIVE`
    /// leaves their photons in their counters.
    fn leave_out_excluded<R: DetectionRule, const LIVE: bool>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
    ) {
        let photons = if LIVE {
            let photons = self.excluded.photons(&self.histogram, config.gate());
            let more = photons.wrapping_sub(self.excluded_photons);
            self.histogram.leave_out(more);
            more
        } else {
            self.excluded.empty(&mut self.histogram)
        };
        self.excluded_photons = self.excluded_photons.wrapping_add(photons);
        statistics.excluded += u64::from(photons);
    }

    /// Whether it weighs bins by their live laser cycles: not in a block, which has those of
    /// several pixels.
    #[inline(always)]
    fn weighs_dead_time<R: DetectionRule>(&self, config: &PixelConfig<BINS, R>) -> bool {
        config.weighs_dead_time() && matches!(self.event.level, BlockLevel::PIXEL)
    }

    /// Ends an exposure that may have had an event.
    fn end<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
    ) -> Look {
        let has_reported = self.state.contains(State::HAS_ECHO);
        if !has_reported {
            statistics.expired += 1;
            statistics.expired_deferred += u64::from(self.state.contains(State::DEFERRED));
        }
        self.excluded = ExcludedBins::NONE;
        self.excluded_photons = 0;
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
    pub const fn has_event(&self) -> bool {
        self.state.contains(State::REQUESTING)
    }

    /// ACK: takes the event that waits, so that the pixel can report again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn take_event(&mut self) -> Option<DepthEvent> {
        if !self.state.contains(State::REQUESTING) {
            return None;
        }
        self.state.clear(State::REQUESTING);
        Some(self.event)
    }

    /// Whether an event waits for the link, or this exposure has had an event. Adaptive
    /// binning treats such a pixel as not silent.
    #[inline]
    #[must_use]
    pub const fn has_reported(&self) -> bool {
        self.state.contains(State::REQUESTING) || self.state.contains(State::HAS_ECHO)
    }

    /// The address of the macropixel.
    #[must_use]
    pub const fn address(&self) -> PixelAddress {
        self.event.pixel
    }

    /// Level 0, or that of the block it counts for.
    #[must_use]
    pub const fn level(&self) -> BlockLevel {
        self.event.level
    }

    /// N: laser cycles since the histogram was cleared.
    #[must_use]
    pub const fn exposure(&self) -> u16 {
        self.exposure
    }

    /// The histogram of the current exposure.
    #[must_use]
    pub const fn histogram(&self) -> &Histogram<BINS, W> {
        &self.histogram
    }

    /// Adds the photons of the current exposure to `statistics`. Those of exposures that have
    /// ended, and those in excluded bins, are there already.
    #[inline(always)]
    pub fn add_photons_to(&self, statistics: &mut Statistics) {
        statistics.add_photons_of(&self.histogram, self.gated_out);
    }

    /// Photons of the current exposure with a TDC code of a bin.
    fn photons(&self) -> u64 {
        let histogram = &self.histogram;
        let counted = u64::from(histogram.total()) + u64::from(histogram.saturated());
        counted + u64::from(self.gated_out) + u64::from(self.excluded_photons)
    }

    /// Begins a new exposure.
    fn restart(&mut self, statistics: &mut Statistics) {
        self.add_photons_to(statistics);
        self.state.end_exposure();
        // Not after `clear`: the compiler would join them in a call of `memset`.
        self.gated_out = 0;
        self.histogram.clear();
        self.exposure = 0;
    }
}

/// No observer. One function for all, so that looks are compiled once.
pub(crate) const fn unobserved<const BINS: usize, W: CounterWidth>(_: &DecisionInput<'_, BINS, W>) {
}

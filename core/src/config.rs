//! How pixels operate: one configuration for many pixels.
//!
//! A configuration is built from settings, and checked once. [`checked!`](crate::checked)
//! does that at compile time:
//!
//! ```
//! use dtof_core::{PixelConfig, checked};
//!
//! const CONFIG: PixelConfig<128> =
//!     checked!(PixelConfig::paper().x(4).l1(40).l2(2000).build());
//! ```
//!
//! A program that gets its settings at run time gets an error instead. A rule other than
//! the paper's goes into [`PixelConfig::with_rule`]:
//!
//! ```
//! use dtof_core::fixed::types::{U4F12, U8F8};
//! use dtof_core::{
//!     Count, DepthEstimator, PixelConfig, PixelConfigError, WindowRule, WindowWidthError,
//! };
//!
//! let rule = WindowRule::new(3, const { U4F12::lit("4.504") }, Count::saturating(5))?;
//! let estimator = DepthEstimator::for_pulse(const { U8F8::lit("1") });
//! let config = PixelConfig::<128, _>::with_rule(rule).estimator(estimator);
//! assert!(config.l1(4).build().is_ok());
//! assert_eq!(config.l1(3).build(), Err(PixelConfigError::XAboveL1));
//! # Ok::<(), WindowWidthError>(())
//! ```
//!
//! Source: X, L1 and L2 are those of the flow chart in the paper's section II-B; X of 4
//! and L1 of 40 are those of its FPGA (section IV-A, Table I). α = 4, five photons and
//! L2 = 2000 are our defaults.

use fixed::types::U8F8;

use crate::check::impl_error;
use crate::depth::DepthEstimator;
use crate::detect::{
    Detection, DetectionRule, LiveCounts, PaperRule, Tracking, detect, detect_at, detection_in,
};
use crate::flags::Flags;
use crate::histogram::Histogram;
use crate::histogram::counter::{CounterWidth, PhotonCount};
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::units::{BinIndex, Count, EchoNumber};

/// How pixels operate. Valid by construction: made by [`Self::paper`] or [`Self::with_rule`],
/// some settings, and [`PixelConfigBuilder::build`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// In this order one load reaches each field that photons and looks need.
#[repr(C)]
pub struct PixelConfig<const BINS: usize, R: DetectionRule = PaperRule> {
    x: u16,
    l1: u16,
    l2: u16,
    gate: RangeGate<BINS>,
    dead_time: u16,
    echoes: EchoNumber,
    echo_guard_bins: u8,
    echo_wait: u8,
    rule: R,
    tracking: Option<Tracking<R>>,
    estimator: DepthEstimator,
}

/// Settings of pixels, not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use = "`build` makes a configuration of it"]
pub struct PixelConfigBuilder<const BINS: usize, R: DetectionRule = PaperRule>(
    PixelConfig<BINS, R>,
);

/// A configuration that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PixelConfigError {
    /// X is 0.
    ZeroX,
    /// X is greater than L1.
    XAboveL1,
    /// L2 is not greater than L1.
    L2NotAboveL1,
    /// No multiple of X lies between L1 and L2, so that the pixel would never
    /// decide.
    NoLook,
}

impl PixelConfigError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::ZeroX => "X must be at least 1",
            Self::XAboveL1 => "X must not be greater than L1",
            Self::L2NotAboveL1 => "L2 must be greater than L1",
            Self::NoLook => "no multiple of X lies strictly between L1 and L2",
        }
    }
}

impl_error!(PixelConfigError);

impl<const BINS: usize> PixelConfig<BINS> {
    /// The paper's rule and depth, with α = 4 and at least 5 photons in the peak. The other
    /// settings are those of [`Self::with_rule`].
    pub const fn paper() -> PixelConfigBuilder<BINS> {
        let alpha = const { U8F8::lit("4") };
        Self::with_rule(PaperRule::new(alpha, Count::saturating(5)))
    }
}

impl<const BINS: usize, R: DetectionRule> PixelConfig<BINS, R> {
    /// With another rule. The defaults: X is 4, L1 is 40, L2 is 2000, no gate, the paper's
    /// depth, and a TDC without a dead time.
    pub const fn with_rule(rule: R) -> PixelConfigBuilder<BINS, R> {
        PixelConfigBuilder(Self {
            x: 4,
            l1: 40,
            l2: 2000,
            gate: RangeGate::full(),
            rule,
            estimator: DepthEstimator::Centroid3,
            dead_time: 0,
            tracking: None,
            echoes: EchoNumber::FIRST,
            echo_guard_bins: 0,
            echo_wait: u8::MAX,
        })
    }

    /// The same configuration for a TDC with another dead time, for programs that read it from
    /// their sensor. See [`PixelConfigBuilder::dead_time`].
    #[must_use]
    pub const fn with_dead_time(self, dead_time: u16) -> Self {
        Self { dead_time, ..self }
    }

    /// The same configuration with another range gate, for histograms where something else fills the first bins.
    #[must_use]
    pub const fn with_gate(self, gate: RangeGate<BINS>) -> Self {
        Self { gate, ..self }
    }

    /// The detection in `histogram`, if its highest bin stands clear of the background.
    /// `histogram` must hold gated bins only. It is not weighed by a dead time:
    /// [`Self::detect_echoes`] does that.
    #[inline(always)]
    #[must_use]
    pub fn detect<W: CounterWidth>(&self, histogram: &Histogram<BINS, W>) -> Option<Detection> {
        detect(histogram, &self.gate, &self.rule, &self.estimator)
    }

    /// The decision of a pixel that has excluded some bins, or expects its next event.
    pub(crate) fn detect_further<W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        expected: Option<BinIndex>,
        excluded: &ExcludedBins,
    ) -> Option<Detection> {
        let (gate, estimator) = (&self.gate, &self.estimator);
        if let (Some(tracking), Some(expected)) = (&self.tracking, expected) {
            return tracking.detect(histogram, gate, estimator, expected, excluded);
        }
        detect_at(
            histogram,
            gate,
            histogram.peak(),
            &self.rule,
            estimator,
            excluded,
        )
    }

    /// The decision of a pixel on live counts, and whether bins were left out.
    #[inline(never)]
    pub(crate) fn detect_live<W: CounterWidth>(
        &self,
        counts: &LiveCounts<'_, BINS, W>,
        expected: Option<BinIndex>,
    ) -> (Option<Detection>, bool) {
        let decision = match (&self.tracking, expected) {
            (Some(tracking), Some(expected)) => tracking.detect_live(counts, expected),
            _ => self.rule.detect_live(counts, None),
        };
        let detection = decision.window.map(|window| {
            let mut detection = detection_in(counts, &window, &self.estimator);
            if decision.is_blind {
                detection.depth.flags |= Flags::PILE_UP;
            }
            detection
        });
        (detection, decision.is_blind)
    }

    /// Adds a histogram that was counted elsewhere, as [`Histogram::add_frame`] does with the gate
    /// of this configuration. With a dead time that the rule weighs, the photons before the gate
    /// stay in their counters.
    pub fn add_frame<C: PhotonCount, W: CounterWidth>(
        &self,
        histogram: &mut Histogram<BINS, W>,
        frame: &[C; BINS],
    ) -> u32 {
        let gated_out = histogram.add_frame(frame, &self.gate);
        if self.weighs_dead_time() {
            histogram.keep_frame_before(self.gate.first(), frame);
        }
        gated_out
    }

    /// Calls `echo` for each echo of a whole histogram of `cycles` laser cycles, at most
    /// [`Self::echoes`], the highest peak first. [`Self::add_frame`] has filled it. For counts of a sensor there is
    /// [`WholeHistogram`](crate::WholeHistogram).
    ///
    /// Without a dead time, the bins around all echoes but the last are empty after it, and
    /// `cycles` does not matter. With one that the rule weighs, returns whether a target may be hidden:
    /// a gated bin was blind or had a photon in nearly all laser cycles ([`Flags::PILE_UP`]), the
    /// counts contradict the dead time, or a counter is full. In the last two cases there is no
    /// detection, as the depth could be wrong.
    pub fn detect_echoes<W: CounterWidth>(
        &self,
        histogram: &mut Histogram<BINS, W>,
        cycles: u32,
        mut echo: impl FnMut(EchoNumber, &Detection),
    ) -> bool {
        let mut excluded = ExcludedBins::new(self.echo_guard_bins);
        let mut number = EchoNumber::FIRST;
        let mut is_blind = false;
        loop {
            let detection = if self.weighs_dead_time() {
                let Some(counts) = self.live_counts(histogram, cycles, &excluded) else {
                    return true;
                };
                let (detection, left_out) = self.detect_live(&counts, None);
                is_blind |= left_out;
                detection
            } else {
                excluded.empty(histogram);
                self.detect_further(histogram, None, &excluded)
            };
            let Some(detection) = detection else {
                return is_blind;
            };
            echo(number, &detection);
            let next = self.echo_after(number, &mut excluded, detection.peak.bin);
            let Some(next) = next else {
                return is_blind;
            };
            number = next;
        }
    }

    /// The counts of a histogram to weigh; `None` if they cannot be.
    #[inline(always)]
    pub(crate) fn live_counts<'a, W: CounterWidth>(
        &'a self,
        histogram: &'a Histogram<BINS, W>,
        cycles: u32,
        excluded: &'a ExcludedBins,
    ) -> Option<LiveCounts<'a, BINS, W>> {
        LiveCounts::new(histogram, &self.gate, excluded, cycles, self.dead_time)
    }

    /// Excludes the bins around echo `number`, which has its peak in `bin`. Returns the
    /// number of the next echo, or `None` if that was the last or fewer than
    /// [`RangeGate::MIN_BINS`] bins are left.
    pub(crate) fn echo_after(
        &self,
        number: EchoNumber,
        excluded: &mut ExcludedBins,
        bin: BinIndex,
    ) -> Option<EchoNumber> {
        if number >= self.echoes {
            return None;
        }
        excluded.push(bin);
        excluded.bins_left(&self.gate)?;
        EchoNumber::new(number.raw() + 1)
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

    /// The rules of pixels that track: see [`Tracking`].
    #[must_use]
    pub const fn tracking(&self) -> Option<&Tracking<R>> {
        self.tracking.as_ref()
    }

    /// The fewest photons of a detection by any of its rules.
    pub(crate) fn fewest_photons(&self) -> u32 {
        let fewest = self.rule.fewest_photons();
        self.tracking.as_ref().map_or(fewest, |tracking| {
            let tracking = [tracking.near(), tracking.far()];
            tracking
                .iter()
                .fold(fewest, |fewest, rule| fewest.min(rule.fewest_photons()))
        })
    }

    /// The last echo that a pixel reports in an exposure.
    #[must_use]
    pub const fn echoes(&self) -> EchoNumber {
        self.echoes
    }

    /// Bins to either side of an echo's peak that are excluded once it is reported.
    #[must_use]
    pub const fn echo_guard_bins(&self) -> u8 {
        self.echo_guard_bins
    }

    /// An exposure with an echo ends when it is this many times as long as it was at its
    /// last echo; with 255, at L2.
    #[must_use]
    pub const fn echo_wait(&self) -> u8 {
        self.echo_wait
    }

    /// The length at which an exposure ends whose last echo came after `exposure` laser cycles.
    pub(crate) const fn end_after_echo(&self, exposure: u16) -> u16 {
        let end = exposure.saturating_mul(self.echo_wait as u16);
        if end < self.l2 && self.echo_wait < u8::MAX {
            end
        } else {
            self.l2
        }
    }

    /// The bins for which the TDC is blind after a photon.
    #[must_use]
    pub const fn dead_time(&self) -> u16 {
        self.dead_time
    }

    /// Whether only the first photon of a laser cycle counts.
    #[must_use]
    pub const fn is_first_photon_only(&self) -> bool {
        self.dead_time as usize >= BINS
    }

    /// Whether the rule weighs bins by their live laser cycles: it can, and there is a dead time.
    #[inline(always)]
    #[must_use]
    pub fn weighs_dead_time(&self) -> bool {
        self.dead_time > 0 && self.rule.weighs_dead_time()
    }
}

impl<const BINS: usize, R: DetectionRule> PixelConfigBuilder<BINS, R> {
    /// Looks every `x` laser cycles.
    pub const fn x(mut self, x: u16) -> Self {
        self.0.x = x;
        self
    }

    /// Decides once the exposure exceeds `l1` laser cycles.
    pub const fn l1(mut self, l1: u16) -> Self {
        self.0.l1 = l1;
        self
    }

    /// Clears the histogram once the exposure reaches `l2` laser cycles.
    pub const fn l2(mut self, l2: u16) -> Self {
        self.0.l2 = l2;
        self
    }

    /// Takes photons of the gated bins only.
    pub const fn gate(mut self, gate: RangeGate<BINS>) -> Self {
        self.0.gate = gate;
        self
    }

    /// Finds the depth with `estimator`.
    pub const fn estimator(mut self, estimator: DepthEstimator) -> Self {
        self.0.estimator = estimator;
        self
    }

    /// Pixels expect their next event where the last was: see [`Tracking`].
    pub const fn tracking(mut self, tracking: Option<Tracking<R>>) -> Self {
        self.0.tracking = tracking;
        self
    }

    /// Pixels report up to echo number `last` in an exposure. The exposure goes on until
    /// then, or until [`Self::echo_wait`] or L2 ends it. Once an echo is reported, the bins up
    /// to `reach` from its peak are emptied and excluded for the rest of the exposure: see
    /// [`ExcludedBins`].
    pub const fn echoes(mut self, last: EchoNumber, reach: u8) -> Self {
        self.0.echoes = last;
        self.0.echo_guard_bins = reach;
        self
    }

    /// An exposure with an echo ends when it is `times` as long as it was at that echo, or at
    /// L2. With 255, the default, it always goes on until L2. That gives a weak echo behind a
    /// strong one time, but a pixel with one surface reports only once in L2 laser cycles. In
    /// the four scenes of the study `echo-wait` it reports 2 to 11 times as often with 4, and a
    /// second surface half as bright is found in 57 to 100 % of exposures. With 1 or less the
    /// exposure ends at the next look.
    pub const fn echo_wait(mut self, times: u8) -> Self {
        self.0.echo_wait = times;
        self
    }

    /// The TDC is blind for so many bins after each photon. With as many as the histogram has, or
    /// more, it takes the first photon of a laser cycle only. 0, the default, is a TDC that takes
    /// every photon.
    ///
    /// Round it down to whole bins: one bin too many makes a false target behind a bright bin, where
    /// the dead time ends, and one bin too few hardly matters. It must end before the next laser
    /// pulse, because bins are weighed as if the TDC were live at each pulse.
    ///
    /// The window rule weighs each bin by the laser cycles in which it was live: see [`LiveCounts`].
    /// Photons before the gate then stay in their counters, because they blind the TDC, and
    /// [`Detection`] says what peak and background are. An exposure with a full counter ends without
    /// a decision: [`Statistics::ended_full`](crate::Statistics::ended_full). Blocks of pixels are
    /// not weighed.
    ///
    /// Other rules, and blocks, take every bin as live. With them an event of a TDC of the first
    /// photon gets [`Flags::PILE_UP`] if its exposure has more photons than half its laser cycles;
    /// photons outside the gate count, too. At that half, 0.7 photons arrive in a laser cycle. A
    /// Gaussian pulse without background then reads too near by 0.2 of its standard deviation, and
    /// false alarms begin above four fifths (`docs/results/failures.md`). A shorter dead time has no
    /// effect on them: use the window rule.
    pub const fn dead_time(mut self, bins: u16) -> Self {
        self.0.dead_time = bins;
        self
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// Fails unless `0 < X <= L1 < L2` and a multiple of X lies strictly
    /// between L1 and L2.
    pub const fn build(self) -> Result<PixelConfig<BINS, R>, PixelConfigError> {
        let PixelConfig { x, l1, l2, .. } = self.0;
        if x == 0 {
            return Err(PixelConfigError::ZeroX);
        }
        if x > l1 {
            return Err(PixelConfigError::XAboveL1);
        }
        if l2 <= l1 {
            return Err(PixelConfigError::L2NotAboveL1);
        }
        // The last multiple of x below l2.
        let last_look = (l2 - 1) - (l2 - 1) % x;
        if last_look <= l1 {
            return Err(PixelConfigError::NoLook);
        }
        Ok(self.0)
    }
}

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
//! let rule = WindowRule::new(3, const { U4F12::lit("4.47") }, Count::saturating(5))?;
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
use crate::detect::{Detection, DetectionRule, PaperRule, Tracking, detect, detect_at};
use crate::histogram::Histogram;
use crate::histogram::counter::CounterWidth;
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
    is_one_hit: bool,
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
    /// depth, and a TDC that takes every photon.
    pub const fn with_rule(rule: R) -> PixelConfigBuilder<BINS, R> {
        PixelConfigBuilder(Self {
            x: 4,
            l1: 40,
            l2: 2000,
            gate: RangeGate::full(),
            rule,
            estimator: DepthEstimator::Centroid3,
            is_one_hit: false,
            tracking: None,
            echoes: EchoNumber::FIRST,
            echo_guard_bins: 0,
            echo_wait: u8::MAX,
        })
    }

    /// The same configuration for a TDC that takes one photon a laser cycle, for programs
    /// that read this from their sensor. See [`PixelConfigBuilder::one_hit_tdc`].
    #[must_use]
    pub const fn with_one_hit_tdc(self) -> Self {
        Self {
            is_one_hit: true,
            ..self
        }
    }

    /// The detection in `histogram`, if its highest bin stands clear of the background.
    /// `histogram` must hold gated bins only.
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

    /// Calls `echo` for each echo of a whole histogram, at most [`Self::echoes`], the highest
    /// peak first. Empties the bins around all but the last.
    pub fn detect_echoes<W: CounterWidth>(
        &self,
        histogram: &mut Histogram<BINS, W>,
        mut echo: impl FnMut(EchoNumber, &Detection),
    ) {
        let mut excluded = ExcludedBins::new(self.echo_guard_bins);
        let mut number = EchoNumber::FIRST;
        while let Some(detection) = self.detect_further(histogram, None, &excluded) {
            echo(number, &detection);
            let next = self.echo_after(number, &mut excluded, detection.peak.bin);
            let Some(next) = next else {
                return;
            };
            number = next;
            excluded.empty(histogram);
        }
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

    /// Whether the TDC takes one photon a laser cycle.
    #[must_use]
    pub const fn is_one_hit(&self) -> bool {
        self.is_one_hit
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

    /// Whether the TDC takes the first photon of a laser cycle only. An event then gets
    /// [`Flags::PILE_UP`](crate::Flags::PILE_UP) if its exposure has more photons than
    /// half its laser cycles. Photons outside the gate count, too.
    ///
    /// At that half, 0.7 photons arrive in a laser cycle. A Gaussian pulse without background
    /// then reads too near by 0.2 of its standard deviation. False alarms begin above four
    /// fifths (`docs/results/failures.md`). Photon counting usually keeps to 5 %. That limits
    /// the depth error to a hundredth of the pulse, far below that of an event's few photons.
    pub const fn one_hit_tdc(mut self, is_one_hit: bool) -> Self {
        self.0.is_one_hit = is_one_hit;
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

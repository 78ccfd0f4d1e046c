//! How pixels operate: one configuration for many pixels.
//!
//! A configuration is built from settings, and checked once. [`checked!`](crate::checked)
//! does that when it is compiled:
//!
//! ```
//! use dtof_core::{PixelConfig, checked};
//!
//! const CONFIG: PixelConfig<128> =
//!     checked!(PixelConfig::paper().x(4).l1(40).l2(2000).build());
//! ```
//!
//! A program that learns its settings when it runs gets an error instead. Another rule
//! than the paper's goes into [`PixelConfig::with_rule`]:
//!
//! ```
//! use dtof_core::fixed::types::{U4F12, U8F8};
//! use dtof_core::*;
//!
//! let rule = WindowRule::new(3, const { U4F12::lit("4.47") }, Count::saturating(5))?;
//! let estimator = DepthEstimator::for_pulse(const { U8F8::lit("1") });
//! let config = PixelConfig::<128, _>::with_rule(rule).estimator(estimator);
//! assert!(config.l1(4).build().is_ok());
//! assert_eq!(config.l1(3).build(), Err(ConfigError::XAboveL1));
//! # Ok::<(), WindowWidthError>(())
//! ```
//!
//! Source: X, L1 and L2 are those of the flow chart in the paper's section II-B; X of 4
//! and L1 of 40 those of its FPGA (section IV-A, Table I). α = 4, five photons and L2 = 2000
//! are our defaults.

use fixed::types::U8F8;

use crate::check::written_as_its_text;
use crate::depth::DepthEstimator;
use crate::detect::{Detection, DetectionRule, PaperRule, Tracking, detect, detect_at};
use crate::histogram::Histogram;
use crate::histogram::counter::CounterWidth;
use crate::histogram::gate::RangeGate;
use crate::histogram::peeled::PeeledBins;
use crate::units::{BinIndex, Count, EchoNumber};

/// How pixels operate. Valid by construction: made by [`Self::paper`] or [`Self::with_rule`],
/// some settings, and [`PixelConfigBuilder::build`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// In this order, so that what photons and looks need lies where one load reaches it.
#[repr(C)]
pub struct PixelConfig<const BINS: usize, R: DetectionRule = PaperRule> {
    x: u16,
    l1: u16,
    l2: u16,
    gate: RangeGate<BINS>,
    is_one_hit: bool,
    echoes: EchoNumber,
    peel_reach: u8,
    echo_wait: u8,
    rule: R,
    tracking: Option<Tracking<R>>,
    estimator: DepthEstimator,
}

/// Settings of pixels that are not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use = "`build` makes a configuration of it"]
pub struct PixelConfigBuilder<const BINS: usize, R: DetectionRule = PaperRule>(
    PixelConfig<BINS, R>,
);

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
}

impl ConfigError {
    /// What is wrong, in one line.
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

written_as_its_text!(ConfigError);

impl<const BINS: usize> PixelConfig<BINS> {
    /// The paper's rule and depth, with α = 4 and at least 5 photons in the peak.
    /// For the rest see [`Self::with_rule`].
    pub const fn paper() -> PixelConfigBuilder<BINS> {
        let alpha = const { U8F8::lit("4") };
        Self::with_rule(PaperRule::new(alpha, Count::saturating(5)))
    }
}

impl<const BINS: usize, R: DetectionRule> PixelConfig<BINS, R> {
    /// With another rule. Unless set otherwise X is 4, L1 is 40, L2 is 2000, there is no
    /// gate, the depth is the paper's, and the TDC takes every photon.
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
            peel_reach: 0,
            echo_wait: u8::MAX,
        })
    }

    /// The same for a TDC that takes one photon a laser cycle, for programs that learn
    /// that from their sensor. See [`PixelConfigBuilder::one_hit_tdc`].
    #[must_use]
    pub const fn with_one_hit_tdc(self) -> Self {
        Self {
            is_one_hit: true,
            ..self
        }
    }

    /// Whether the highest bin of `histogram` stands clear, and how deep its pulse lies.
    /// `histogram` must hold gated bins only.
    #[inline(always)]
    #[must_use]
    pub fn detect<W: CounterWidth>(&self, histogram: &Histogram<BINS, W>) -> Option<Detection> {
        detect(histogram, &self.gate, &self.rule, &self.estimator)
    }

    /// The decision of a pixel that has peeled some bins, or expects its next event.
    pub(crate) fn detect_further<W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        expected: Option<BinIndex>,
        peeled: &PeeledBins,
    ) -> Option<Detection> {
        let (gate, estimator) = (&self.gate, &self.estimator);
        if let (Some(tracking), Some(expected)) = (&self.tracking, expected) {
            return tracking.detect(histogram, gate, estimator, expected, peeled);
        }
        detect_at(
            histogram,
            gate,
            histogram.peak(),
            &self.rule,
            estimator,
            peeled,
        )
    }

    /// The echoes of a histogram that arrives whole, as many as the configuration has, in
    /// the order in which they stand clear. Empties the bins around all but the last.
    pub fn detect_echoes<W: CounterWidth>(
        &self,
        histogram: &mut Histogram<BINS, W>,
        mut echo: impl FnMut(EchoNumber, &Detection),
    ) {
        let mut peeled = PeeledBins::new(self.peel_reach);
        let mut number = EchoNumber::FIRST;
        while let Some(detection) = self.detect_further(histogram, None, &peeled) {
            echo(number, &detection);
            let next = self.echo_after(number, &mut peeled, detection.peak.bin);
            let Some(next) = next else {
                return;
            };
            number = next;
            peeled.empty(histogram);
        }
    }

    /// The number of the echo that is looked for after one with its peak in `bin`, whose
    /// bins are left out from now on; `None` if that was the last, or fewer than
    /// [`RangeGate::MIN_BINS`] bins would be left.
    pub(crate) fn echo_after(
        &self,
        number: EchoNumber,
        peeled: &mut PeeledBins,
        bin: BinIndex,
    ) -> Option<EchoNumber> {
        if number >= self.echoes {
            return None;
        }
        peeled.push(bin);
        peeled.bins_left(&self.gate)?;
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

    /// The rules of pixels that expect their next event where the last was.
    #[must_use]
    pub const fn tracking(&self) -> Option<&Tracking<R>> {
        self.tracking.as_ref()
    }

    /// The last echo that a pixel reports in an exposure.
    #[must_use]
    pub const fn echoes(&self) -> EchoNumber {
        self.echoes
    }

    /// Bins to either side of an echo's peak that are left out once it is reported.
    #[must_use]
    pub const fn peel_reach(&self) -> u8 {
        self.peel_reach
    }

    /// An exposure ends once it is so many times as long as it was at its last echo; with 255
    /// at L2.
    #[must_use]
    pub const fn echo_wait(&self) -> u8 {
        self.echo_wait
    }

    /// The exposure at which one ends that was `exposure` laser cycles long at its last echo.
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

    /// Pixels report up to the echo number `last` in an exposure, which goes on until then,
    /// or until [`Self::echo_wait`] or L2 ends it. Once an echo is reported the bins up to `reach` from its peak are empty
    /// and left out for the rest of the exposure: see [`PeeledBins`].
    pub const fn echoes(mut self, last: EchoNumber, reach: u8) -> Self {
        self.0.echoes = last;
        self.0.peel_reach = reach;
        self
    }

    /// An exposure with an echo ends once it is `times` as long as it was at that echo, or at
    /// L2. With 255, as it is unless set otherwise, it always goes on until L2: a weak echo
    /// behind a strong one has its time, but a pixel with one surface reports once in L2 laser
    /// cycles. In the four scenes of the study `echo-wait` it reports 2 to 11 times as often with
    /// 4, and a second surface half as bright is found in 57 to 100 % of exposures. With 1 or
    /// less the exposure ends at the next look.
    pub const fn echo_wait(mut self, times: u8) -> Self {
        self.0.echo_wait = times;
        self
    }

    /// Whether the TDC takes the first photon of a laser cycle only. An event then gets
    /// [`Flags::PILE_UP`](crate::Flags::PILE_UP) if its exposure has more photons than
    /// half its laser cycles. Photons that the gate left out count.
    ///
    /// At that half, 0.7 photons arrive in a laser cycle. A Gaussian pulse on its own is
    /// then read 0.2 of its standard deviation too near. False alarms begin above four
    /// fifths (`docs/results/failures.md`). Photon counting usually keeps to 5 %. That asks for
    /// a depth error of a hundredth of the pulse, far below that of an event's few
    /// photons.
    pub const fn one_hit_tdc(mut self, is_one_hit: bool) -> Self {
        self.0.is_one_hit = is_one_hit;
        self
    }

    /// The configuration.
    ///
    /// # Errors
    /// [`ConfigError`] unless `0 < X <= L1 < L2` and a multiple of X lies strictly
    /// between L1 and L2.
    pub const fn build(self) -> Result<PixelConfig<BINS, R>, ConfigError> {
        let PixelConfig { x, l1, l2, .. } = self.0;
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
        Ok(self.0)
    }
}

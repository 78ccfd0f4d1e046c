//! The choice of a depth estimator, by the width of the pulse.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::{DepthEstimator, PixelConfig, checked};
//!
//! // A pulse with a standard deviation of one bin.
//! const ESTIMATOR: DepthEstimator = DepthEstimator::for_pulse(U8F8::lit("1"));
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().estimator(ESTIMATOR).build());
//! ```
//!
//! Cost: that of the estimator, once an event.

use fixed::types::{U8F8, U24F8};

use super::centred_window::CentredWindow;
use super::centroid::centroid;
use super::estimate::DepthEstimate;
use super::rates::Rates;
use crate::histogram::counter::CounterWidth;
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak};
use crate::units::BinIndex;

/// How the place of the pulse within its bins is estimated.
///
/// Exhaustive, because the link and the C header number each estimator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DepthEstimator {
    /// The paper's: the [`centroid`] of three bins.
    #[default]
    Centroid3,
    /// The centroid of a window that suits the pulse and lies evenly about it.
    CentredWindow(CentredWindow),
}

impl DepthEstimator {
    /// The estimator for a pulse of the standard deviation `sigma` in bins: a
    /// [`CentredWindow::for_pulse`].
    #[must_use]
    pub const fn for_pulse(sigma: U8F8) -> Self {
        Self::CentredWindow(CentredWindow::for_pulse(sigma))
    }

    /// The depth of `peak`. `background` is the rule's, a bin. A [`CentredWindow`] uses its own
    /// if the gate leaves a bin for it.
    #[inline(always)]
    #[must_use]
    pub fn estimate<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
    ) -> DepthEstimate {
        self.estimate_without(histogram, gate, peak, background, &ExcludedBins::NONE)
    }

    /// The same with excluded bins, which are empty.
    #[inline(always)]
    pub(crate) fn estimate_without<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
        excluded: &ExcludedBins,
    ) -> DepthEstimate {
        match self {
            Self::Centroid3 => centroid(histogram, gate, peak, background),
            Self::CentredWindow(window) => {
                window.estimate_without(histogram, gate, peak, background, excluded)
            }
        }
    }

    /// The depth of the bin `peak` from the light of the bins about it.
    #[inline(never)]
    pub(crate) fn estimate_rates<const BINS: usize>(
        &self,
        rates: &Rates,
        gate: &RangeGate<BINS>,
        peak: BinIndex,
    ) -> DepthEstimate {
        match self {
            Self::Centroid3 => rates.centroid(gate, peak),
            Self::CentredWindow(window) => window.of_rates(rates, gate, peak),
        }
    }

    /// How many bins to either side of the peak bin it uses.
    #[must_use]
    pub const fn reach(&self) -> u16 {
        match self {
            Self::Centroid3 => 1,
            Self::CentredWindow(window) => {
                let [before, after] = [window.before().to_bits(), window.after().to_bits()];
                let widest = if before > after { before } else { after };
                widest.div_ceil(256)
            }
        }
    }
}

//! Which depth estimator: chosen when configured, to the width of the pulse.

use fixed::types::{U8F8, U24F8};

use crate::centred_window::CentredWindow;
use crate::depth::{Depth, centre_of_mass};
use crate::gate::RangeGate;
use crate::histogram::{CounterWidth, Histogram};
use crate::peak::Peak;

/// How the place of the pulse in its bins is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DepthEstimator {
    /// The paper's: [`centre_of_mass`] of three bins.
    #[default]
    CentreOfMass3,
    /// The centre of mass of a window that suits the pulse and lies evenly about it.
    CentredWindow(CentredWindow),
}

impl DepthEstimator {
    /// What suits a pulse of the standard deviation `sigma` in bins: a
    /// [`CentredWindow::for_pulse`].
    #[must_use]
    pub const fn for_pulse(sigma: U8F8) -> Self {
        Self::CentredWindow(CentredWindow::for_pulse(sigma))
    }

    /// The depth of `peak`, less the `background` a bin, which is that of the rule. A
    /// [`CentredWindow`] has its own, if the gate leaves a bin for it.
    #[inline(always)]
    #[must_use]
    pub fn estimate<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        peak: Peak,
        background: U24F8,
    ) -> Depth {
        match self {
            Self::CentreOfMass3 => centre_of_mass(histogram, gate, peak, background),
            Self::CentredWindow(window) => {
                let outside = window.background_outside(histogram, gate, peak);
                window.estimate(histogram, gate, peak, outside.unwrap_or(background))
            }
        }
    }
}

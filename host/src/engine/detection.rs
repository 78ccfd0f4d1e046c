//! Which rule decides and which estimator finds the depth, in the units the command
//! line uses.

use anyhow::{Context, Result};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, Count, DepthEstimator, PaperRule, WindowRule};
use serde::Serialize;

use crate::engine::settings::{U4F12Number, U8F8Number};
use crate::events::summary::Row;

/// What decides whether a peak stands clear of the background.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "rule", rename_all = "kebab-case")]
pub enum Rule {
    /// The paper's.
    Paper {
        /// Standard deviations of the background a peak must exceed it by.
        alpha: U8F8Number,
    },
    /// All photons in a window around the peak.
    Window {
        /// Bins in the window, 1 to 7.
        window: u8,
        /// Standard deviations of the background they must exceed it by.
        z: U4F12Number,
    },
}

impl Rule {
    /// The paper's with this α.
    #[must_use]
    pub const fn paper(alpha: U8F8) -> Self {
        Self::Paper {
            alpha: U8F8Number(alpha),
        }
    }

    /// A window of so many bins with this z.
    #[must_use]
    pub const fn window(window: u8, z: U4F12) -> Self {
        Self::Window {
            window,
            z: U4F12Number(z),
        }
    }

    /// As the core takes it.
    ///
    /// # Errors
    /// If the window is too narrow or too wide.
    pub fn with_minimum_count(&self, minimum_count: u16) -> Result<AnyRule> {
        let minimum_count = Count::saturating(minimum_count.into());
        Ok(match *self {
            Self::Paper { alpha } => PaperRule::new(alpha.0, minimum_count).into(),
            Self::Window { window, z } => WindowRule::new(window, z.0, minimum_count)
                .with_context(|| format!("--window {window}"))?
                .into(),
        })
    }

    /// For people.
    #[must_use]
    pub fn row(&self, minimum_count: u16) -> Row {
        let threshold = match self {
            Self::Paper { alpha } => format!(
                "background + {} × its square root (α), at least {minimum_count} photons",
                alpha.0
            ),
            Self::Window { window, z } => format!(
                "in a window of {window} bins: background + {} standard deviations (z), at least \
                 {minimum_count} photons",
                z.0
            ),
        };
        ("threshold".to_owned(), threshold)
    }
}

/// The widest pulse that a window for its depth suits, as a standard deviation in bins.
pub const WIDEST_PULSE: U8F8 = U8F8::lit("1.75");

/// What finds the depth of a peak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "estimator", rename_all = "kebab-case")]
pub enum Estimator {
    /// The paper's centre of mass of three bins.
    #[default]
    #[serde(rename = "centre-of-mass-3")]
    CentreOfMass3,
    /// A window that moves onto the pulse.
    CentredWindow {
        /// The standard deviation of the pulse it suits, in bins.
        sigma_bins: U8F8Number,
    },
}

impl Estimator {
    /// What suits a pulse of the standard deviation `sigma` in bins.
    #[must_use]
    pub const fn for_pulse(sigma: U8F8) -> Self {
        Self::CentredWindow {
            sigma_bins: U8F8Number(sigma),
        }
    }

    /// As the core takes it.
    #[must_use]
    pub const fn in_core(&self) -> DepthEstimator {
        match self {
            Self::CentreOfMass3 => DepthEstimator::Centroid3,
            Self::CentredWindow { sigma_bins } => DepthEstimator::for_pulse(sigma_bins.0),
        }
    }

    /// For people.
    #[must_use]
    pub fn row(&self) -> Row {
        let depth = match self.in_core() {
            DepthEstimator::Centroid3 => "centre of mass of 3 bins".to_owned(),
            DepthEstimator::CentredWindow(window) => {
                format!("centred window of ±{} bins", window.half_width())
            }
        };
        ("depth".to_owned(), depth)
    }
}

#[cfg(test)]
mod tests {
    use dtof_core::CentredWindow;

    use super::*;

    #[test]
    fn the_widest_pulse_has_the_widest_window() {
        let width = |sigma| CentredWindow::for_pulse(sigma).half_width();
        assert_eq!(width(WIDEST_PULSE), CentredWindow::MAX);
        assert!(width(WIDEST_PULSE - U8F8::DELTA) < CentredWindow::MAX);
    }
}

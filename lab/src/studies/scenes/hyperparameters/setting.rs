//! The claims at one background and pulse width.

use super::{SETTINGS, SNRS};
use crate::sweep::mean::Measured;
use crate::sweep::{Part, PointTally};

pub fn false_share(point: &PointTally) -> Measured {
    point.share("false", "events")
}

/// The root mean square error of all events in bins, with its 99 % interval.
pub fn error(point: &PointTally) -> Measured {
    let sum = |name| u128::from(point.count(name));
    let parts = Measured::root_of_squares(sum("events"), sum("squares"), sum("fourth"));
    parts.times(1.0 / 256.0)
}

/// One of [`SETTINGS`], with its background.
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    pub part: &'a Part,
    /// Whether the background is the average of all bins; otherwise that of two quadrants.
    pub is_average: bool,
    pub background: f64,
    pub sigma: f64,
}

impl<'a> Setting<'a> {
    /// All settings with the average of all bins.
    pub fn all(part: &'a Part) -> [Self; SETTINGS.len()] {
        SETTINGS.map(|(background, sigma)| Self {
            part,
            is_average: true,
            background,
            sigma,
        })
    }

    /// The settings with the paper's B, which have both background estimates.
    pub fn at_low_background(part: &'a Part, is_average: bool) -> [Self; 2] {
        let [first, second, ..] = Self::all(part);
        [first, second].map(|setting| Self {
            is_average,
            ..setting
        })
    }

    /// The points of an α and L1, by SNR. Points with fewer than 50 events are left out.
    pub fn by_snr(self, alpha: u16, l1: u16) -> Vec<&'a PointTally> {
        let points = self.part.at([
            ("average", f64::from(self.is_average)),
            ("background", self.background),
            ("sigma", self.sigma),
            ("alpha", alpha.into()),
            ("l1", l1.into()),
        ]);
        points.filter(|point| point.count("events") >= 50).collect()
    }

    pub fn shares(self, alpha: u16, l1: u16, of: fn(&PointTally) -> Measured) -> Vec<Measured> {
        self.by_snr(alpha, l1).into_iter().map(of).collect()
    }

    /// Whether, for L1 above 20, the error at the highest SNR is significantly below that at the
    /// lowest, and never rises by more than a twentieth. `None` with fewer than two points of an
    /// L1.
    pub fn error_falls_with_snr(self) -> Option<bool> {
        let mut falls = true;
        for l1 in [40, 80] {
            let errors = self.shares(4, l1, error);
            let [first, .., last] = errors[..] else {
                return None;
            };
            let no_rise = |pair: &[Measured]| pair[1].value <= 1.05 * pair[0].value;
            falls &= last.interval.1 < first.interval.0 && errors.windows(2).all(no_rise);
        }
        Some(falls)
    }

    /// The errors at several L1 with α = 4, averaged over the SNRs that have a point at each L1,
    /// and the number of these SNRs. `None` without such an SNR.
    pub fn mean_errors<const N: usize>(self, l1s: [u16; N]) -> Option<([f64; N], usize)> {
        let by_l1 = l1s.map(|l1| self.by_snr(4, l1));
        let at = |points: &[&PointTally], snr| {
            let mut points = points.iter();
            let found = points.find(|point| point.is_at([("snr", snr)]));
            found.map(|point| error(point).value)
        };
        let is_common = |&snr: &f64| by_l1.iter().all(|points| at(points, snr).is_some());
        let common: Vec<f64> = SNRS.into_iter().filter(is_common).collect();
        let mean = |points: Vec<&PointTally>| {
            let errors = common.iter().filter_map(|&snr| at(&points, snr));
            errors.sum::<f64>() / common.len() as f64
        };
        (!common.is_empty()).then(|| (by_l1.map(mean), common.len()))
    }

    /// Whether the error falls less from L1 = 40 to 80 than from 20 to 40: per laser cycle, as on
    /// any convex curve, or per doubling of L1.
    pub fn gain_diminishes(self, by_doubling: bool) -> Option<bool> {
        let ([at_20, at_40, at_80], _) = self.mean_errors([20, 40, 80])?;
        Some(if by_doubling {
            at_80 / at_40 > at_40 / at_20
        } else {
            (at_40 - at_80) / 40.0 < (at_20 - at_40) / 20.0
        })
    }

    /// The texts of `of` for every point of an α and L1, each with its SNR.
    pub fn list(self, alpha: u16, l1: u16, of: fn(&PointTally) -> String) -> String {
        let points = self.by_snr(alpha, l1).into_iter();
        let texts: Vec<String> = points
            .map(|point| format!("{} at A/B = {}", of(point), point.parameter("snr")))
            .collect();
        if texts.is_empty() {
            NOTHING.to_owned()
        } else {
            texts.join(", ")
        }
    }

    /// The text of `of`, after the setting.
    pub fn text(self, of: impl Fn(Self) -> String) -> String {
        format!("B {}, σ {}: {}", self.background, self.sigma, of(self))
    }
}

/// The text if no point has enough events.
pub const NOTHING: &str = "fewer than 50 events";

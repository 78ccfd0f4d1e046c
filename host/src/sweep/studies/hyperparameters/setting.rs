//! What one background and pulse width say of the claims.

use super::{ALPHAS, SETTINGS, SNRS};
use crate::sweep::mean::Measured;
use crate::sweep::results::Share;
use crate::sweep::{Part, PointTally};

pub fn false_share(point: &PointTally) -> Share {
    point.share("false", "events")
}

/// The root mean square error of all events in bins, with its 99 % interval.
pub fn error(point: &PointTally) -> Share {
    let sum = |name| u128::from(point.count(name));
    let parts = Measured::root_of_squares(sum("events"), sum("squares"), sum("fourth"));
    let Measured { value, interval } = parts.times(1.0 / 256.0);
    Share { value, interval }
}

/// One of [`SETTINGS`].
#[derive(Clone, Copy)]
pub struct Setting<'a> {
    pub part: &'a Part,
    pub background: f64,
    pub sigma: f64,
}

impl<'a> Setting<'a> {
    pub fn all(part: &'a Part) -> [Self; SETTINGS.len()] {
        SETTINGS.map(|(background, sigma)| Self {
            part,
            background,
            sigma,
        })
    }

    /// The points of an α and L1, by SNR. Those with fewer than 50 events say
    /// nothing.
    pub fn by_snr(self, alpha: u16, l1: u16) -> Vec<&'a PointTally> {
        let points = self.part.at([
            ("background", self.background),
            ("sigma", self.sigma),
            ("alpha", alpha.into()),
            ("l1", l1.into()),
        ]);
        points.filter(|point| point.count("events") >= 50).collect()
    }

    pub fn shares(self, alpha: u16, l1: u16, of: fn(&PointTally) -> Share) -> Vec<Share> {
        self.by_snr(alpha, l1).into_iter().map(of).collect()
    }

    /// Whether the false events are as many at every SNR, to a factor of 2 or the
    /// intervals.
    pub fn false_events_ignore_snr(self) -> bool {
        let shares = self.shares(4, 20, false_share);
        shares.iter().all(|a| {
            let alike = |b: &Share| a.value <= 2.0 * b.value || a.interval.0 <= b.interval.1;
            shares.iter().all(alike)
        })
    }

    /// Whether the error at the highest SNR lies below that at the lowest, intervals
    /// included, and it never rises by more than a twentieth, for L1 above 20.
    pub fn error_falls_with_snr(self) -> bool {
        [40, 80].into_iter().all(|l1| {
            let errors = self.shares(4, l1, error);
            let no_rise = |pair: &[Share]| pair[1].value <= 1.05 * pair[0].value;
            let ends = errors.first().zip(errors.last());
            ends.is_some_and(|(first, last)| last.interval.1 < first.interval.0)
                && errors.windows(2).all(no_rise)
        })
    }

    /// The greatest factor between the errors of two α, for L1 above 20 at one SNR.
    pub fn error_by_alpha(self) -> f64 {
        let mut factor = 1f64;
        for l1 in [40, 80] {
            for snr in SNRS {
                let at = ALPHAS.into_iter().flat_map(|alpha| self.by_snr(alpha, l1));
                let errors = at
                    .filter(|point| point.is_at([("snr", snr)]))
                    .map(|point| error(point).value);
                let (low, high) = ends(errors);
                if low > 0.0 && high > 0.0 {
                    factor = factor.max(high / low);
                }
            }
        }
        factor
    }

    /// The error and the false events at an L1, averaged over SNR, α = 4.
    #[allow(clippy::cast_precision_loss, reason = "five")]
    pub fn mean_at(self, l1: u16, of: fn(&PointTally) -> Share) -> f64 {
        let shares = self.shares(4, l1, of);
        shares.iter().map(|share| share.value).sum::<f64>() / shares.len() as f64
    }

    /// Whether from L1 = 40 to 80 the error falls by less than from 20 to 40 and by
    /// less than a tenth.
    pub fn little_gain_beyond_40(self) -> bool {
        let [at_20, at_40, at_80] = [20, 40, 80].map(|l1| self.mean_at(l1, error));
        at_40 - at_80 < (at_20 - at_40).max(0.1 * at_40) && at_80 > 0.9 * at_40
    }

    /// The share of false events over SNR, lowest and highest, at an α and L1.
    pub fn false_range(self, alpha: u16, l1: u16) -> (f64, f64) {
        ends(
            self.shares(alpha, l1, false_share)
                .iter()
                .map(|share| share.value),
        )
    }

    /// What `of` gives, after the setting.
    pub fn text(self, of: impl Fn(Self) -> String) -> String {
        format!("B {}, σ {}: {}", self.background, self.sigma, of(self))
    }
}

/// The lowest and the highest.
pub fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0), |(low, high), value| {
        (value.min(low), value.max(high))
    })
}

pub fn percent((low, high): (f64, f64)) -> String {
    format!("{:.3} to {:.3} %", low * 100.0, high * 100.0)
}

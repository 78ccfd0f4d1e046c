//! The paper's claims on the figure of section III-C, and its conclusions.

use super::setting::{NOTHING, Setting, error, false_share};
use super::{ALPHAS, GAUSSIAN_BACKGROUND, L1S, SNRS};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Verdict, ends, span};
use crate::sweep::{Part, PointTally};

/// The smallest ratio of SNRs over which a claim has to hold.
const RANGE: f64 = 5.0;

pub fn claims(part: &Part) -> Vec<Claim> {
    let all = Setting::all(part);
    let settings = |of: &dyn Fn(Setting) -> String| all.map(|setting| setting.text(of)).join("; ");
    // At the paper's B.
    let papers = |of: &dyn Fn(Setting) -> String| {
        let those = Setting::at_low_background(part, true);
        those.map(|setting| setting.text(of)).join("; ")
    };
    // Only settings with false alarms.
    let falls =
        |of: &dyn Fn(Setting) -> Option<Option<bool>>| in_all(all.into_iter().filter_map(of));
    let verdict = |holds: fn(Setting) -> Option<bool>| in_all(all.map(holds));
    vec![
        snr(part),
        Claim::new(
            "alpha-false",
            format!(
                "false events at α = 2, 4, 6, 8, A/B = 5: {}",
                papers(&|setting| setting.along(ALPHAS.map(|alpha| (alpha, 20))))
            ),
            falls(&|setting| setting.falls(ALPHAS.map(|alpha| (alpha, 20)))),
        )
        .with_details(format!(
            "share of events that are false at α = 2, 4, 6, 8, L1 = 20, A/B = 5: {}",
            settings(&|setting| setting.along(ALPHAS.map(|alpha| (alpha, 20))))
        )),
        Claim::new(
            "l1-false",
            format!(
                "false events at L1 = 5, 20, 80, A/B = 5: {}",
                papers(&|setting| setting.along([5, 20, 80].map(|l1| (4, l1))))
            ),
            falls(&|setting| setting.falls(L1S.map(|l1| (4, l1)))),
        )
        .with_details(format!(
            "share of events that are false at L1 = 5, 10, 20, 40, 80, α = 4, A/B = 5: {}",
            settings(&|setting| setting.along(L1S.map(|l1| (4, l1))))
        )),
        Claim::new(
            "error",
            format!(
                "RMSE in bins at L1 = 40 over A/B: {}",
                settings(&|setting| {
                    let errors = setting.shares(4, 40, error);
                    span(errors.iter().map(|error| error.value), 3)
                })
            ),
            verdict(|setting| setting.error_falls_with_snr()),
        )
        .with_details(format!(
            "RMSE in bins, α = 4, L1 = 40: {}",
            settings(&|setting| setting.list(4, 40, bins))
        )),
        alpha(part),
        Claim::new(
            "l1",
            format!(
                "mean RMSE in bins at L1 = 20, 40, 80: {}",
                settings(&|setting| mean_errors(setting, [20, 40, 80]).0)
            ),
            match [false, true]
                .map(|doubling| in_all(all.map(|setting| setting.gain_diminishes(doubling))))
            {
                [Verdict::Agrees, Verdict::Agrees] => Verdict::Agrees,
                [Verdict::Agrees, _] => Verdict::Differs,
                _ => Verdict::Refuted,
            },
        )
        .with_details(format!(
            "mean RMSE in bins at L1 = 10, 20, 40, 80 over the SNRs that have enough events at each, α = 4: {}",
            settings(&|setting| {
                let (errors, snrs) = mean_errors(setting, [10, 20, 40, 80]);
                format!("{errors} ({snrs} SNRs)")
            })
        )),
        Claim::new(
            "rate",
            format!(
                "events outside ±0.5 bin, %, over A/B: {}",
                settings(&|setting| {
                    let shares = setting.shares(4, 20, false_share);
                    span(shares.iter().map(|share| share.value * 100.0), 2)
                })
            ),
            // At every SNR of every setting, at none of any, or at some.
            in_all(all.into_iter().flat_map(|setting| {
                let shares = setting.shares(4, 20, false_share).into_iter();
                shares.map(below_a_thousandth)
            })),
        )
        .with_details(format!(
            "events outside ±0.5 bin: {}",
            settings(&|setting| setting.list(4, 20, percent))
        )),
        gaussian(),
    ]
}

/// The mean errors of a setting at several L1, and the number of SNRs.
fn mean_errors<const N: usize>(setting: Setting, l1s: [u16; N]) -> (String, usize) {
    match setting.mean_errors(l1s) {
        None => (NOTHING.to_owned(), 0),
        Some((errors, snrs)) => {
            let errors = errors.map(|error| format!("{error:.3}"));
            (errors.join(", "), snrs)
        }
    }
}

/// Whether false alarms are independent of the SNR within a factor of 2. Agrees over all SNRs in
/// every setting, differs over a range of [`RANGE`] with each pulse at the paper's B.
fn snr(part: &Part) -> Claim {
    let (mut here, mut details) = (Vec::new(), Vec::new());
    let (mut is_level, mut is_part) = (true, true);
    for setting in Setting::all(part) {
        let points = setting.by_snr(4, 20);
        let shares: Vec<(f64, f64)> = points
            .iter()
            .map(|point| (point.parameter("snr"), false_share(point).value))
            .collect();
        let (from, to, factor) = widest_level(&shares);
        is_level &= shares.first().map(|share| share.0) == Some(from)
            && shares.last().map(|share| share.0) == Some(to);
        is_part &= setting.background >= GAUSSIAN_BACKGROUND || to / from >= RANGE;
        here.push(setting.text(|_| format!("{from} to {to}")));
        details.push(format!(
            "B {}, σ {}: {}; within a factor of {factor:.1} from A/B = {from} to {to}",
            setting.background,
            setting.sigma,
            setting.list(4, 20, percent)
        ));
    }
    let quadrants = Setting::at_low_background(part, false).map(|setting| {
        let shares = setting.shares(4, 20, false_share);
        let (low, high) = ends(shares.iter().map(|share| share.value));
        format!(
            "{:.1} to {:.1} % (σ {})",
            low * 100.0,
            high * 100.0,
            setting.sigma
        )
    });
    Claim::new(
        "snr",
        format!("level to a factor of 2 over A/B of: {}", here.join("; ")),
        Verdict::graded(is_level, is_part),
    )
    .with_details(format!(
        "share of events that are false, α = 4, L1 = 20, average: {}; with two quadrants of two bins at B = 0.05 {}",
        details.join("; "),
        quadrants.join(", ")
    ))
}

/// The widest range of x in which no two values differ by more than a factor of 2, and the factor
/// in that range.
fn widest_level(values: &[(f64, f64)]) -> (f64, f64, f64) {
    let mut widest = (1.0, 1.0, 1.0);
    for first in 0..values.len() {
        for last in first..values.len() {
            let (low, high) = ends(values[first..=last].iter().map(|value| value.1));
            let (from, to) = (values[first].0, values[last].0);
            // Without false alarms there is nothing to compare.
            if low > 0.0 && high <= 2.0 * low && to / from > widest.1 / widest.0 {
                widest = (from, to, high / low);
            }
        }
    }
    widest
}

/// Whether α changes the error by less than a tenth for L1 above 20, at the background that the
/// paper's condition requires. Differs if so at more than half of the points.
fn alpha(part: &Part) -> Claim {
    let of = |background: f64| {
        let settings = Setting::all(part).into_iter();
        let those = settings.filter(|setting| setting.background == background);
        let factors: Vec<f64> = those.flat_map(Setting::errors_by_alpha).collect();
        let alike = factors.iter().filter(|&&factor| factor <= 1.1).count();
        (alike, factors.len(), ends(factors).1)
    };
    let (alike, all, most) = of(GAUSSIAN_BACKGROUND);
    let (few_alike, few_all, few_most) = of(0.05);
    Claim::new(
        "alpha",
        format!(
            "from α = 2 to 8 the RMSE changes by at most a tenth at {alike} of {all} places with B = {GAUSSIAN_BACKGROUND} (at most {most:.2} times), at {few_alike} of {few_all} with B = 0.05 ({few_most:.2} times)"
        ),
        Verdict::graded(alike == all, 2 * alike > all),
    )
    .with_details("places: one SNR, pulse and L1 (40 and 80)")
}

/// Whether an L1 of 20 or 40 gives 30 counts a bin, by arithmetic.
fn gaussian() -> Claim {
    let counts = [20.0, 40.0].map(|l1| l1 * 0.05);
    Claim::new(
        "gaussian",
        format!(
            "at the B = 0.05 of its figures L1 = 20 and 40 give λ_b = {} and {}; 30 take B = {} and {}",
            counts[0],
            counts[1],
            30.0 / 20.0,
            30.0 / 40.0
        ),
        // The B of the paper's setup is unknown.
        Verdict::graded(counts.iter().all(|&counts| counts >= 30.0), true),
    )
}

fn percent(point: &PointTally) -> String {
    format!("{:.2} %", false_share(point).value * 100.0)
}

fn bins(point: &PointTally) -> String {
    format!("{:.3}", error(point).value)
}

/// Whether a claim holds everywhere, nowhere, or in some places. Undecided places (`None`) leave it
/// open, unless decided places differ.
fn in_all(holds: impl IntoIterator<Item = Option<bool>>) -> Verdict {
    let [mut open, mut held, mut failed] = [false; 3];
    for holds in holds {
        match holds {
            None => open = true,
            Some(true) => held = true,
            Some(false) => failed = true,
        }
    }
    match (held, failed) {
        (true, true) => Verdict::Differs,
        (true, false) if !open => Verdict::Agrees,
        (false, true) if !open => Verdict::Refuted,
        _ => Verdict::NotDecided,
    }
}

/// Whether the whole interval lies below 0.1 %, or above; `None` if it contains 0.1 %.
fn below_a_thousandth(share: Measured) -> Option<bool> {
    (!share.contains(0.001)).then_some(share.value < 0.001)
}

impl Setting<'_> {
    /// The shares of false alarms at A/B = 5 for each α and L1.
    fn false_at_5<const N: usize>(self, at: [(u16, u16); N]) -> [Option<Measured>; N] {
        at.map(|(alpha, l1)| {
            let mut points = self.by_snr(alpha, l1).into_iter();
            let point = points.find(|point| point.is_at([("snr", 5.0)]));
            point.map(false_share)
        })
    }

    fn along<const N: usize>(self, at: [(u16, u16); N]) -> String {
        let text = |share: Option<Measured>| {
            share.map_or(NOTHING.to_owned(), |share| {
                format!("{:.2} %", share.value * 100.0)
            })
        };
        self.false_at_5(at).map(text).join(", ")
    }

    /// Whether the shares fall: the last is significantly below the first, and none is
    /// significantly above its predecessor. `Some(None)` if undecided, `None` without any false
    /// alarm.
    fn falls<const N: usize>(self, at: [(u16, u16); N]) -> Option<Option<bool>> {
        let shares: Vec<Measured> = self.false_at_5(at).into_iter().flatten().collect();
        let [first, .., last] = shares[..] else {
            return Some(None);
        };
        let rises = shares
            .windows(2)
            .any(|pair| pair[1].interval.0 > pair[0].interval.1);
        let falls = last.interval.1 < first.interval.0;
        let found = match (rises, falls) {
            (true, _) => Some(false),
            (false, true) => Some(true),
            (false, false) => None,
        };
        (first.value > 0.0).then_some(found)
    }

    /// The factors between the errors of α = 2 to 8, for L1 above 20 at each SNR.
    fn errors_by_alpha(self) -> Vec<f64> {
        let mut factors = Vec::new();
        for l1 in [40, 80] {
            for snr in SNRS {
                let at = ALPHAS.into_iter().flat_map(|alpha| self.by_snr(alpha, l1));
                let errors: Vec<f64> = at
                    .filter(|point| point.is_at([("snr", snr)]))
                    .map(|point| error(point).value)
                    .collect();
                if errors.len() > 1 {
                    let (low, high) = ends(errors);
                    // Two full counters of a pulse on their edge have no error: not counted.
                    if low > 0.0 {
                        factors.push(high / low);
                    }
                }
            }
        }
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_seen_is_no_pass() {
        assert_eq!(in_all([]), Verdict::NotDecided);
        assert_eq!(in_all([Some(true), None]), Verdict::NotDecided);
        assert_eq!(in_all([Some(true), Some(true)]), Verdict::Agrees);
        assert_eq!(in_all([Some(false), Some(false)]), Verdict::Refuted);
        assert_eq!(in_all([Some(true), None, Some(false)]), Verdict::Differs);
        assert_eq!(below_a_thousandth(Measured::share(0, 50)), None);
        assert_eq!(below_a_thousandth(Measured::share(0, 50_000)), Some(true));
    }

    #[test]
    fn the_widest_level_is_within_a_factor_of_two() {
        let values = [
            (1.0, 21.0),
            (2.0, 6.7),
            (5.0, 6.7),
            (10.0, 6.4),
            (20.0, 5.1),
        ];
        let (from, to, factor) = widest_level(&values);
        assert_eq!((from, to), (2.0, 20.0));
        assert!((factor - 6.7 / 5.1).abs() < 1e-12);
        assert_eq!(widest_level(&[(1.0, 9.0), (2.0, 1.0)]), (1.0, 1.0, 1.0));
        assert_eq!(widest_level(&[(1.0, 0.0), (9.0, 0.0)]), (1.0, 1.0, 1.0));
    }
}

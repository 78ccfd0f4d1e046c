//! False alarms and depth error of a board, by SNR, α and L1 (section III-C).
//!
//! The paper's board stands where the pulse lies on an edge between two bins of 8.75
//! ns, in a window of 8 bins; mini-frames of 5 laser cycles, so X = 5; L2 = 2000. It
//! gives neither the background nor the pulse's width. Taken here, each with each:
//! the background of its analysis (B = 0.05) and the one that its rule of thumb asks
//! for at L1 = 20 (L1·B = 30, so 1.5; 10-bit counters are full there well before L2);
//! pulses with σ = 1 bin, the lower end of what the paper names, and 0.33 bins, that
//! of a rectangle of 10 ns (1.2 % of 1/1.2 MHz).

mod setting;

use self::setting::{NOTHING, Setting, error, false_share};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, tally, whole};
use anyhow::Result;
use dtof::rows::grouped;
use dtof::simulate::MM_PER_PS;
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, Count, LaserCycle, Look, PaperRule, PixelAddress, PixelConfig, Statistics,
};
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{self, STEPS};
use dtof_theory::rates::bin_share;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

const BINS: usize = 8;
/// The board, in bins from the start of the window.
const POSITION: u8 = 4;
/// 114 MHz in metres of range.
const METRES_A_BIN: f64 = 8750.0 * MM_PER_PS / 1000.0;
/// Background photons a bin and laser cycle (B), and standard deviation of the pulse
/// in bins.
const SETTINGS: [(f64, f64); 4] = [(0.05, 1.0), (0.05, 0.33), (1.5, 1.0), (1.5, 0.33)];
/// Normalised SNR, A/B.
const SNRS: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
const ALPHAS: [u16; 4] = [2, 4, 6, 8];
const L1S: [u16; 5] = [5, 10, 20, 40, 80];
const L2: u16 = 2000;
/// Laser cycles of a mini-frame, and X.
const FRAME: u16 = 5;
/// Mini-frames of a trial: 10,000 laser cycles, as the paper's recording has.
const FRAMES: u16 = 2000;

/// With the pixel and the rule of the core.
pub const STUDY: Study = Study {
    name: "hyperparameters",
    about: "false alarms and depth error of a board by SNR, α and L1",
    revision: 1,
    few_seeds: 20,
    all_seeds: 400,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let of_setting = |(background, sigma)| {
        grid([
            ("background", &[background]),
            ("sigma", &[sigma]),
            ("l1", &L1S.map(f64::from)),
            ("alpha", &ALPHAS.map(f64::from)),
            ("snr", &SNRS),
        ])
    };
    SETTINGS.into_iter().flat_map(of_setting).collect()
}

/// A pixel in front of the board for 10,000 laser cycles.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of a mini-frame"
)]
fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let background = point["background"];
    let signal = point["snr"] * background;
    let mut laws = [Poisson::new(1.0)?; BINS];
    for (law, bin) in laws.iter_mut().zip(0..) {
        let share = bin_share(bin, POSITION.into(), point["sigma"]);
        *law = Poisson::new(f64::from(FRAME) * (background + signal * share))?;
    }
    // The paper has no minimum count; a peak holds a photon.
    let alpha = U8F8::from_num(point["alpha"]);
    let rule = PaperRule::new(alpha, Count::saturating(1));
    let config = PixelConfig::with_rule(rule)
        .x(FRAME)
        .l1(whole(point, "l1"))
        .l2(L2)
        .build()?;
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress(0));
    let mut statistics = Statistics::new();
    let [mut false_events, mut squares, mut fourth_powers] = [0; 3];
    for frame in 1..=u64::from(FRAMES) {
        let counts = laws.map(|law| law.sample(rng) as u32);
        pixel.count_frame(&config, &counts);
        let last = LaserCycle(frame * u64::from(FRAME) - 1);
        if pixel.end_laser_cycles(&config, &mut statistics, last, FRAME) != Look::Event {
            continue;
        }
        if let Some(event) = pixel.acknowledge() {
            // In 1/256 bin.
            let error =
                u64::from((event.position().raw() - i32::from(POSITION) * 256).unsigned_abs());
            false_events += u64::from(error > 128);
            squares += error.pow(2);
            fourth_powers += error.pow(4);
        }
    }
    Ok(tally([
        ("events", statistics.events),
        ("expired", statistics.expired),
        ("false", false_events),
        ("squares", squares),
        ("fourth", fourth_powers),
    ]))
}

fn results(part: &Part) -> Result<Results> {
    let main = Setting::all(part)[0];
    let settings = |of: fn(Setting) -> String| {
        let texts = Setting::all(part).map(|setting| setting.text(of));
        texts.join("; ")
    };
    let verdict = |holds: fn(Setting) -> Option<bool>| in_all(Setting::all(part).map(holds));
    let claims = vec![
        Claim::new(
            "snr",
            format!(
                "share of events that are false, α = 4, L1 = 20: {}",
                settings(|setting| setting.list(4, 20, percent))
            ),
            verdict(|setting| setting.false_events_ignore_snr()),
        ),
        Claim::new(
            "error",
            format!(
                "RMSE in bins, α = 4, L1 = 40: {}",
                settings(|setting| setting.list(4, 40, bins))
            ),
            verdict(|setting| setting.error_falls_with_snr()),
        ),
        Claim::new(
            "alpha",
            format!(
                "greatest factor between α = 2 and 8 at one SNR, L1 = 40 and 80: {}",
                settings(|setting| setting
                    .error_by_alpha()
                    .map_or(NOTHING.to_owned(), |factor| format!("{factor:.2}")))
            ),
            // To a tenth.
            verdict(|setting| setting.error_by_alpha().map(|factor| factor <= 1.1)),
        ),
        Claim::new(
            "l1",
            format!(
                "mean RMSE in bins at L1 = 10, 20, 40, 80 over the SNRs that have enough events at each, \
                 α = 4: {}",
                settings(|setting| match setting.mean_errors([10, 20, 40, 80]) {
                    None => NOTHING.to_owned(),
                    Some((errors, snrs)) => {
                        let errors = errors.map(|error| format!("{error:.3}"));
                        format!("{} ({snrs} SNRs)", errors.join(", "))
                    }
                })
            ),
            verdict(|setting| setting.little_gain_beyond_40()),
        ),
        Claim::new(
            "rate",
            format!(
                "events outside ±0.5 bin: {}",
                settings(|setting| setting.list(4, 20, percent))
            ),
            // At every SNR of every setting, at none of any, or at some.
            in_all(Setting::all(part).into_iter().flat_map(|setting| {
                let shares = setting.shares(4, 20, false_share).into_iter();
                shares.map(below_a_thousandth)
            })),
        ),
    ];
    Ok(Results {
        figures: figures(main)?,
        claims,
        values: [("pixels", grouped(part.seed_count()))].into(),
        ..Results::default()
    })
}

fn percent(point: &PointTally) -> String {
    format!("{:.3} %", false_share(point).value * 100.0)
}

fn bins(point: &PointTally) -> String {
    format!("{:.3}", error(point).value)
}

/// Whether a claim holds everywhere, nowhere, or in some places; what could not be told
/// (`None`) leaves it open, unless places that could be told differ.
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

/// Whether the whole interval lies below 0.1 %, or above; `None` if it holds it.
fn below_a_thousandth(share: Measured) -> Option<bool> {
    (!share.holds(0.001)).then_some(share.value < 0.001)
}

fn figures(setting: Setting) -> Result<Vec<Figure>> {
    let dots = |points: Vec<&PointTally>, of: fn(&PointTally) -> Measured| -> Vec<Dot> {
        let points = points.into_iter();
        points
            .map(|point| of(point).at(point.parameter("snr")))
            .collect()
    };
    let joined = |name, pen, points| Series::named(name, pen, Style::JoinedDots, points);
    let false_alarms = ALPHAS.map(|alpha| {
        let points = dots(setting.by_snr(alpha, 20), false_share);
        joined(format!("α = {alpha}"), palette::alpha(alpha.into()), points)
    });
    let in_metres = |point: &PointTally| error(point).times(METRES_A_BIN);
    let mut pens = STEPS.into_iter();
    let errors = L1S.map(|l1| {
        let points = dots(setting.by_snr(4, l1), in_metres);
        let pen = pens.next().unwrap_or(palette::NEUTRAL);
        joined(format!("L1 = {l1}"), pen, points)
    });
    let by_l1 = ALPHAS.map(|alpha| {
        let points = L1S.into_iter().flat_map(|l1| setting.by_snr(alpha, l1));
        let points = points.filter(|point| point.is_at([("snr", 5.0)]));
        let points = points.map(|point| in_metres(point).at(point.parameter("l1")));
        let pen = palette::alpha(alpha.into());
        joined(format!("α = {alpha}"), pen, points.collect())
    });
    let falls = |series: &[Series]| {
        series.iter().all(|series| {
            let [first, .., last] = series.points[..] else {
                return false;
            };
            let ends = (first.interval, last.interval);
            matches!(ends, (Some(first), Some(last)) if last.1 < first.0)
        })
    };
    let figure = |name, text: &str, x: &str, y, series: Vec<Series>| {
        let chart = Chart {
            finding: text.to_owned(),
            holds: falls(&series),
            note: "Bars hold 99 %. Dots with fewer than 50 events are left out.".to_owned(),
            x: Axis::logarithmic(x),
            y,
            key: Vec::new(),
            columns: 1,
            panels: vec![Panel::only(series)],
        };
        Figure::new(name, &chart)
    };
    let metres = |at: &str| {
        Axis::linear(format!(
            "root mean square error, false alarms included, metres ({at})"
        ))
    };
    let snr = "signal over background, A/B";
    Ok(vec![
        figure(
            "hyperparameters-false",
            "The stronger the signal, the fewer events are false alarms",
            snr,
            Axis::linear("events that are false alarms, % (L1 = 20)")
                .percent()
                .within(0.0, 1.0),
            false_alarms.into(),
        )?,
        figure(
            "hyperparameters-error",
            "A stronger signal lowers the depth error at every L1",
            snr,
            metres("α = 4"),
            errors.into(),
        )?,
        figure(
            "hyperparameters-alpha",
            "A larger L1 lowers the depth error at every α",
            "L1, laser cycles",
            metres("A/B = 5"),
            by_l1.into(),
        )?,
    ])
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
}

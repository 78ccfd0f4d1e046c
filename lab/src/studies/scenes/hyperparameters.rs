//! False alarms and depth error of a board, by SNR, α and L1 (section III-C).
//!
//! The pulse of the paper's board lies on the edge between two bins of 8.75 ns, in a window of 8
//! bins. Mini-frames have 5 laser cycles, L2 is 2000. The paper gives neither X, nor the
//! background, nor the pulse width. We use X = 5 and all pairs of two backgrounds and two pulses.
//! The backgrounds are that of its analysis (B = 0.05) and that of its rule of thumb at L1 = 20
//! (L1·B = 30, so 1.5, with which 10-bit counters are full well before L2). The pulses have σ =
//! 0.33 bins, that of a rectangle of 10 ns (1.2 % of 1/1.2 MHz), and 1 bin, the lower end of the
//! paper's range.
//!
//! The background estimate is the average of the 8 bins. At B = 0.05 it is compared with two
//! quadrants of two bins each, which section IV introduces for 128 bins.

mod claims;
mod setting;

use self::setting::{Setting, error, false_share};
use crate::sweep::charts::panel;
use crate::sweep::mean::Measured;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, tally, whole};
use anyhow::Result;
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AnyRule, AsyncPixel, AverageRule, Count, LaserCycle, Look, PaperRule, PixelAddress,
    PixelConfig, Statistics,
};
use dtof_data::options::rows::grouped;
use dtof_data::photons::MM_PER_PS;
use dtof_draw::chart::{Axis, Chart, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::{self, STEPS};
use dtof_light::rates::bin_share;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

const BINS: usize = 8;
/// The board, in bins from the start of the window.
const POSITION: u8 = 4;
/// Metres of range in a bin of 8.75 ns (114 MHz).
const METRES_A_BIN: f64 = 8750.0 * MM_PER_PS / 1000.0;
/// Background photons a bin and laser cycle (B), and standard deviation of the pulse
/// in bins.
const SETTINGS: [(f64, f64); 4] = [
    (0.05, 1.0),
    (0.05, 0.33),
    (GAUSSIAN_BACKGROUND, 1.0),
    (GAUSSIAN_BACKGROUND, 0.33),
];
/// The B that gives the paper's 30 background counts a bin at L1 = 20.
const GAUSSIAN_BACKGROUND: f64 = 1.5;
/// Normalised SNR, A/B.
const SNRS: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
const ALPHAS: [u16; 4] = [2, 4, 6, 8];
const L1S: [u16; 5] = [5, 10, 20, 40, 80];
const L2: u16 = 2000;
/// Laser cycles of a mini-frame, and X.
const FRAME: u16 = 5;
/// Mini-frames of a trial: 10,000 laser cycles, as in the paper's recording.
const FRAMES: u16 = 2000;

/// With the pixel and the rule of the core.
pub const STUDY: Study = Study {
    name: "hyperparameters",
    about: "false alarms and depth error of a board by SNR, α and L1",
    revision: 2,
    few_seeds: 20,
    all_seeds: 400,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let of_setting = |(background, sigma)| {
        let averages: &[f64] = if background < GAUSSIAN_BACKGROUND {
            &[1.0, 0.0]
        } else {
            &[1.0]
        };
        grid([
            ("average", averages),
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
    // The paper has no minimum count.
    let alpha = U8F8::from_num(point["alpha"]);
    let minimum = Count::saturating(1);
    let rule: AnyRule = if point["average"] > 0.0 {
        AverageRule::new(alpha, minimum).into()
    } else {
        PaperRule::new(alpha, minimum).into()
    };
    let config = PixelConfig::with_rule(rule)
        .x(FRAME)
        .l1(whole(point, "l1"))
        .l2(L2)
        .build()?;
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    let mut statistics = Statistics::new();
    let [mut false_events, mut squares, mut fourth_powers] = [0; 3];
    for frame in 1..=u64::from(FRAMES) {
        let counts = laws.map(|law| law.sample(rng) as u32);
        pixel.count_frame(&config, &counts);
        let last = LaserCycle::new(frame * u64::from(FRAME) - 1);
        if pixel.end_laser_cycles(&config, &mut statistics, last, FRAME) != Look::Event {
            continue;
        }
        if let Some(event) = pixel.take_event() {
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
    Ok(Results {
        figures: figures(part)?,
        claims: claims::claims(part),
        values: [
            ("pixels", grouped(part.seed_count())),
            ("table", table(part)),
        ]
        .into(),
        ..Results::default()
    })
}

/// The share of false events at α = 4 and L1 = 20, for both backgrounds and pulses.
fn table(part: &Part) -> String {
    let mut rows = String::new();
    for (is_average, background) in [(false, "two quadrants"), (true, "average of the 8 bins")] {
        for setting in Setting::at_low_background(part, is_average) {
            let shares = setting.by_snr(4, 20).into_iter().map(|point| {
                let share = false_share(point).times(100.0);
                share.with_half(1)
            });
            let cells: Vec<String> = shares.collect();
            rows += &format!(
                "| {background} | {} | {} |\n",
                setting.sigma,
                cells.join(" | ")
            );
        }
    }
    rows
}

fn figures(part: &Part) -> Result<Vec<Figure>> {
    let [_, setting] = Setting::at_low_background(part, true);
    let dots = |points: Vec<&PointTally>, of: fn(&PointTally) -> Measured| -> Vec<Dot> {
        let dot = |point: &PointTally| of(point).at(point.parameter("snr"));
        points.into_iter().map(dot).collect()
    };
    let joined = |name: String, pen, points| Series::named(name, pen, Style::JoinedDots, points);
    let backgrounds = [(false, "two quadrants"), (true, "average of all bins")];
    let panels = backgrounds.map(|(is_average, title)| {
        let settings = Setting::at_low_background(part, is_average);
        let series = settings
            .into_iter()
            .zip([STEPS[3], STEPS[0]])
            .map(|(setting, pen)| {
                let points = dots(setting.by_snr(4, 20), false_share);
                joined(format!("σ {} bins", setting.sigma), pen, points)
            });
        panel(title, series)
    });
    // Compared point by point, at equal pulse and SNR.
    let more = [0, 1].into_iter().all(|pulse| {
        let [quadrants, averages] = [false, true]
            .map(|is_average| Setting::at_low_background(part, is_average)[pulse].by_snr(4, 20));
        averages.iter().all(|average| {
            let snr = average.parameter("snr");
            let same = quadrants.iter().find(|point| point.is_at([("snr", snr)]));
            let [more, fewer] =
                [same, Some(average)].map(|point| point.map(|point| false_share(point)));
            // Only where there are any.
            fewer.is_some_and(|fewer| fewer.value < 1e-3)
                || more
                    .zip(fewer)
                    .is_some_and(|(more, fewer)| more.value > 2.0 * fewer.value)
        })
    });
    let background = Chart {
        finding: "Of 8 bins, two quadrants bring many more false alarms than the average"
            .to_owned(),
        holds: more,
        note: "Bars hold 99 %.".to_owned(),
        x: Axis::logarithmic("signal over background, A/B"),
        y: Axis::linear("events that are false alarms, %").percent(),
        key: Vec::new(),
        columns: 2,
        panels: panels.into(),
    };
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
    // Each series by its points.
    let y = |series: &Series, index: usize| series.points.get(index).map_or(f64::NAN, |dot| dot.y);
    let suppressed = false_alarms.windows(2).all(|pair| {
        let common = pair[1].points.iter();
        common.clone().count() > 1
            && common.clone().all(|dot| {
                let same = pair[0].points.iter().find(|other| other.x == dot.x);
                same.is_some_and(|other| dot.y <= other.y)
            })
    });
    let falls = |series: &Series| {
        let ends = (series.points.first(), series.points.last());
        let intervals = ends
            .0
            .zip(ends.1)
            .map(|(first, last)| (first.interval, last.interval));
        matches!(intervals, Some((Some(first), Some(last))) if last.1 < first.0)
    };
    let all_fall = errors.iter().all(falls);
    // α = 8 at the shortest exposure, α = 4 at the longest.
    let by_alpha = y(&by_l1[3], 0) < y(&by_l1[1], L1S.len() - 1);
    let figure = |name, text: &str, holds: bool, x: &str, y, series: Vec<Series>| {
        let chart = Chart {
            finding: text.to_owned(),
            holds,
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
        Figure::new("hyperparameters-background", &background)?,
        figure(
            "hyperparameters-false",
            "A larger α suppresses false alarms at every signal",
            suppressed,
            snr,
            Axis::linear("events that are false alarms, % (L1 = 20)").percent(),
            false_alarms.into(),
        )?,
        figure(
            "hyperparameters-error",
            "A stronger signal lowers the depth error at every L1",
            all_fall,
            snr,
            metres("α = 4"),
            errors.into(),
        )?,
        figure(
            "hyperparameters-alpha",
            "A larger α lowers the depth error more than a larger L1",
            by_alpha,
            "L1, laser cycles",
            metres("A/B = 5"),
            by_l1.into(),
        )?,
    ])
}

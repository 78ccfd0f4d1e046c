//! Several echoes of one exposure: two surfaces in one pixel, such as glass in front of a wall.

use super::light::Light;
use super::setting::{BINS, L1, L2, SIGMA, X, window_rule};
use crate::sweep::charts::{joined, joined_key, panel};
use crate::sweep::mean::{Measured, add_count};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::{Context, Result};
use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, BinPosition, DepthEstimator, EchoNumber, Histogram, LaserCycle, Look, PixelAddress,
    PixelConfig, Statistics, WindowRule,
};
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{Pen, STEPS};
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

/// Bins between two surfaces.
const DISTANCES: [f64; 8] = [4.0, 5.0, 6.0, 8.0, 12.0, 16.0, 24.0, 48.0];
/// Ratio of the brighter surface to the other.
const RATIOS: [f64; 4] = [1.0, 2.0, 4.0, 10.0];
const PENS: [Pen; 4] = [STEPS[0], STEPS[2], STEPS[4], STEPS[6]];
/// Signal photons of the dimmer echo in a whole histogram, and background photons a bin.
const WHOLE_HISTOGRAM: (f64, f64) = (60.0, 1.0);
/// For counting pixels: signal photons of the target a laser cycle, and background photons a bin;
/// 0 stands for the whole histogram.
const TARGET: f64 = 0.1;
const BACKGROUNDS: [f64; 3] = [0.0, 0.01, 0.05];
const REACH: u8 = 4;
/// Exposures of a trial.
const EXPOSURES: u64 = 50;

/// Both echoes by distance and ratio.
pub const STUDY: Study = Study {
    name: "echoes",
    about: "two surfaces of one pixel: both echoes over their distance and ratio",
    revision: 2,
    few_seeds: 2,
    all_seeds: 40,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([
        ("background", &BACKGROUNDS),
        ("ratio", &RATIOS),
        ("distance", &DISTANCES),
    ])
}

fn config() -> Result<PixelConfig<BINS, WindowRule>> {
    let two = EchoNumber::new(2).context("two")?;
    let estimator = DepthEstimator::for_pulse(U8F8::from_num(SIGMA));
    let config = PixelConfig::with_rule(window_rule(L1, L2)?)
        .x(X)
        .l1(L1)
        .l2(L2);
    Ok(config.estimator(estimator).echoes(two, REACH).build()?)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = config()?;
    let (background, ratio) = (point["background"], point["ratio"]);
    let mut tally = Tally::new();
    for _ in 0..EXPOSURES {
        let near = 20.0 + Uniform::new(0.0, 1.0)?.sample(rng);
        let far = near + point["distance"];
        let mut found = Vec::new();
        if background == 0.0 {
            let light = Light::new(
                WHOLE_HISTOGRAM.1,
                &[(WHOLE_HISTOGRAM.0 * ratio, near), (WHOLE_HISTOGRAM.0, far)],
            )?;
            let mut histogram = Histogram::<BINS>::new();
            histogram.add_batch(&light.draw(rng));
            config.detect_echoes(&mut histogram, 1, |_, detection| {
                found.push(detection.position());
            });
        } else {
            let cycles = f64::from(X);
            let surfaces = [(TARGET * ratio * cycles, near), (TARGET * cycles, far)];
            let light = Light::new(background * cycles, &surfaces)?;
            let (mut pixel, mut statistics) = (
                AsyncPixel::<BINS>::new(PixelAddress::new(0)),
                Statistics::new(),
            );
            for step in 1..=u64::from(L2 / X) {
                pixel.count_batch(&config, &light.draw(rng));
                let now = LaserCycle::new(step * u64::from(X));
                let look = pixel.end_laser_cycles(&config, &mut statistics, now, X);
                found.extend(pixel.take_event().map(|event| event.position()));
                if found.len() == 2 || matches!(look, Look::Ended | Look::Expired) {
                    break;
                }
            }
        }
        let is_at = |position: &BinPosition, place: f64| {
            (f64::from(position.raw()) / 256.0 - place).abs() <= 3.0
        };
        let is_found = |place| found.iter().any(|position| is_at(position, place));
        let both = is_found(near) && is_found(far) && found.len() == 2;
        let is_false = |position| !is_at(position, near) && !is_at(position, far);
        add_count(&mut tally, "exposures", 1);
        if both {
            add_count(&mut tally, "both", 1);
        }
        if found.iter().any(is_false) {
            add_count(&mut tally, "false", 1);
        }
    }
    Ok(tally)
}

fn both(point: &PointTally) -> Measured {
    point.share("both", "exposures")
}

fn results(part: &Part) -> Result<Results> {
    let mut csv = "background,ratio,distance,both,low,high,false,exposures\n".to_owned();
    for point in part.points() {
        let at = point.parameter_cells(["background", "ratio", "distance"]);
        let counts = point.count_cells(["false", "exposures"]);
        writeln!(csv, "{at},{},{counts}", both(point).cells(4))?;
    }
    let panels = BACKGROUNDS.map(|background| {
        let series = RATIOS.into_iter().zip(PENS).map(|(ratio, pen)| {
            let at = [("background", background), ("ratio", ratio)];
            joined(pen, part.dots(at, "distance", both))
        });
        let title = match background {
            0.0 => "whole histogram".to_owned(),
            _ => format!("counting, {background}"),
        };
        panel(title, series)
    });
    let least = |background, ratio, from: f64| -> f64 {
        let dots = part.dots(
            [("background", background), ("ratio", ratio)],
            "distance",
            both,
        );
        let far = dots.iter().filter(|dot| dot.x >= from);
        far.map(|dot| dot.y).fold(1.0, f64::min)
    };
    let equal = least(0.0, 1.0, 6.0);
    let glass = least(BACKGROUNDS[1], 10.0, 12.0).min(least(BACKGROUNDS[2], 10.0, 12.0));
    let percent = |share: f64| format!("{:.0}", (100.0 * share).floor());
    let chart = Chart {
        finding: format!(
            "Two equal echoes 6 bins or more apart are both found in {} % of histograms, a target \
             12 bins behind a glass ten times as bright in {} % of exposures",
            percent(equal),
            percent(glass)
        ),
        holds: equal >= 0.9 && glass >= 0.95,
        note: format!(
            "σ {SIGMA} bin, ±{REACH} bins left out. Whole histograms hold {} signal photons of the dimmer \
             echo; pixels count {TARGET} of it a laser cycle, up to {L2} cycles, with the background a bin that the panel names (whole: 1).",
            WHOLE_HISTOGRAM.0
        ),
        x: Axis::logarithmic("bins between the two"),
        y: Axis::linear("exposures with both, %")
            .percent()
            .within(0.0, 1.0),
        key: RATIOS
            .into_iter()
            .zip(PENS)
            .map(|(ratio, pen)| joined_key(pen, format!("{ratio} : 1")))
            .collect(),
        columns: 3,
        panels: panels.into(),
    };
    Ok(Results {
        figures: vec![Figure::new("echoes", &chart)?],
        values: [
            ("equal", percent(equal)),
            ("glass", percent(glass)),
            ("reach", REACH.to_string()),
        ]
        .into(),
        tables: vec![("results/data/echoes.csv", csv)],
        ..Results::default()
    })
}

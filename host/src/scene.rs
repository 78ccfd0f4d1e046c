//! The scene of the demo: a wall, before it a matt box, before that a bright
//! ball, on an array of any size.
//!
//! Each pixel sees one surface. Signal photons follow the reflectivity and the
//! inverse square of the distance; the background is the same everywhere.

use anyhow::Result;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};

use crate::maps::{Maps, PixelHistory};
use crate::settings::{I24F8Number, Settings, U8F8Number, U16F16Number};
use crate::simulation::{Rates, SimulatedArray};
use crate::source::Geometry;
use crate::summary::{Row, grouped};

/// Background photons a bin and laser cycle.
const BACKGROUND: f64 = 0.02;
/// Standard deviation of the pulse in bins.
const PULSE_SIGMA: f64 = 1.0;
/// Signal photons a laser cycle from a white surface at one metre.
const SIGNAL_AT_ONE_METRE: f64 = 4.0;
/// Millimetres of range a picosecond, half the speed of light.
const MM_PER_PS: f64 = 0.149_896_229;
/// An event is false if its range lies farther from the truth than this many
/// bins.
const FALSE_BEYOND_BINS: f64 = 3.0;

/// What a pixel looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// Behind everything, slightly turned: 3.4 m at the left to 3.8 m.
    Wall,
    /// 2.4 m away, a fifth as reflective as white.
    MattBox,
    /// 1.25 m away at its nearest, nearly white.
    BrightBall,
}

impl Surface {
    const ALL: [Self; 3] = [Self::Wall, Self::MattBox, Self::BrightBall];

    fn name(self) -> &'static str {
        match self {
            Self::Wall => "wall",
            Self::MattBox => "matt box",
            Self::BrightBall => "bright ball",
        }
    }

    fn reflectivity(self) -> f64 {
        match self {
            Self::Wall => 0.5,
            Self::MattBox => 0.2,
            Self::BrightBall => 0.9,
        }
    }
}

/// One pixel's view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// What it looks at.
    pub surface: Surface,
    /// How far away that is.
    pub range_mm: f64,
}

/// The whole scene on an array, row by row.
#[must_use]
pub fn views(geometry: Geometry) -> Vec<View> {
    // The scene is laid out on 64×32.
    let across = 64.0 / f64::from(geometry.columns);
    let down = 32.0 / f64::from(geometry.rows);
    let row = |row| {
        let columns = (0..geometry.columns).map(f64::from);
        columns.map(move |column| view(column * across, f64::from(row) * down))
    };
    (0..geometry.rows).flat_map(row).collect()
}

fn view(column: f64, row: f64) -> View {
    // A ball of 10 pixels radius, which are 300 mm at its distance.
    let from_centre = (column - 46.0).hypot(row - 17.0) / 10.0;
    if from_centre < 1.0 {
        let depth_mm = 300.0 * (1.0 - from_centre.powi(2)).sqrt();
        View {
            surface: Surface::BrightBall,
            range_mm: 1550.0 - depth_mm,
        }
    } else if (8.0..28.0).contains(&column) && (10.0..30.0).contains(&row) {
        View {
            surface: Surface::MattBox,
            range_mm: 2400.0,
        }
    } else {
        View {
            surface: Surface::Wall,
            range_mm: 3400.0 + 400.0 * column / 63.0,
        }
    }
}

/// The paper's settings for its static scene (section III-B), on 128 bins of
/// 250 ps.
#[must_use]
pub fn settings(seed: u64) -> Settings {
    Settings {
        bins: 128,
        bin_width_ps: U16F16Number(U16F16::lit("250")),
        offset_mm: I24F8Number(I24F8::ZERO),
        gate: None,
        alpha: U8F8Number(U8F8::lit("8")),
        min_count: 5,
        l1: 100,
        l2: 2000,
        x: 10,
        seed,
    }
}

/// The photons of the scene, `cycles` laser cycles of them.
///
/// # Errors
/// Never for the settings of the demo.
pub fn photons(geometry: Geometry, settings: &Settings, cycles: u64) -> Result<SimulatedArray> {
    let mm_per_bin = mm_per_bin(settings);
    let rates: Vec<Rates> = views(geometry)
        .iter()
        .map(|view| Rates {
            background: BACKGROUND,
            signal: SIGNAL_AT_ONE_METRE * view.surface.reflectivity()
                / (view.range_mm / 1000.0).powi(2),
            position: view.range_mm / mm_per_bin,
            sigma: PULSE_SIGMA,
        })
        .collect();
    SimulatedArray::new(
        geometry,
        &rates,
        u16::try_from(settings.bins)?,
        cycles,
        settings.seed,
    )
}

fn mm_per_bin(settings: &Settings) -> f64 {
    settings.bin_width_ps.0.to_num::<f64>() * MM_PER_PS
}

/// How the events compare with the scene, surface by surface.
#[must_use]
pub fn against_truth(maps: &Maps, settings: &Settings) -> Vec<Row> {
    let mm_per_bin = mm_per_bin(settings);
    let views = views(maps.geometry);
    let mut rows = Vec::new();
    for surface in Surface::ALL {
        let pixels: Vec<(&View, &PixelHistory)> = views
            .iter()
            .zip(&maps.pixels)
            .filter(|(view, _)| view.surface == surface)
            .collect();
        let events: u64 = pixels.iter().map(|(_, pixel)| pixel.events).sum();
        let first = pixels
            .iter()
            .filter_map(|(_, pixel)| pixel.first_cycle)
            .min();
        let errors = |range: fn(&PixelHistory) -> Option<f64>| {
            let error =
                |(view, pixel): &(&View, &PixelHistory)| Some(range(pixel)? - view.range_mm);
            pixels.iter().filter_map(error).collect::<Vec<f64>>()
        };
        let last = errors(PixelHistory::last_mm);
        let mean = errors(PixelHistory::mean_mm);
        let limit_mm = FALSE_BEYOND_BINS * mm_per_bin;
        let false_events = last.iter().filter(|error| error.abs() > limit_mm).count();
        rows.push((
            surface.name().to_owned(),
            format!(
                "{} events of {} pixels, the first in laser cycle {}",
                grouped(events),
                pixels.len(),
                first.map_or("-".to_owned(), grouped),
            ),
        ));
        if last.is_empty() {
            continue; // no event, no error
        }
        rows.push((
            format!("{}, rms error", surface.name()),
            format!(
                "{:.1} mm last event of each pixel ({false_events} beyond {FALSE_BEYOND_BINS} bins), \
                 {:.1} mm mean of ten",
                root_mean_square(&last),
                root_mean_square(&mean),
            ),
        ));
    }
    rows
}

#[allow(clippy::cast_precision_loss, reason = "some thousand pixels")]
fn root_mean_square(errors: &[f64]) -> f64 {
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    (squares / errors.len() as f64).sqrt()
}

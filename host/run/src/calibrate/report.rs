//! The report of a calibration: a page with the findings and their 95 % intervals.

use anyhow::Result;
use dtof_draw::chart::{Axis, Chart, Panel, Point, Series, Style, chart};
use dtof_draw::palette::{AVERAGE, EVENTS, PAPER, REFERENCE};
use dtof_draw::picture::{Map, heat_map};

use crate::report::{Figure, Section, still};
use dtof_calibrate::{Calibration, Layer, Length, Nearest, PixelOffsets, PulseSource, remarks};
use dtof_data::options::numbers::shortest;
use dtof_data::options::rows::{Row, grouped, percent, significant};
use dtof_engine::settings::SettingsFile;

/// Marks near the start of every settings file and of every report: such files may be replaced.
pub const MARKS: [&str; 2] = [dtof_engine::settings::MARK, crate::report::MARK];

/// The most columns and rows of an array whose offsets are listed.
const WIDEST: usize = 8;

/// The findings, one a row, with 95 % intervals.
#[must_use]
pub fn rows(found: &Calibration) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    let several = if found.captures == 1 { "" } else { "s" };
    row(
        "looked at",
        format!(
            "{} pixel{}, {} capture{several}, {} bins",
            grouped(found.array_pixels as u64),
            if found.array_pixels == 1 { "" } else { "s" },
            grouped(found.captures as u64),
            found.bins
        ),
    );
    let unit = if found.length == Length::Unknown {
        "photons a bin and laser cycle, if the brightest pixel has one a laser cycle"
    } else {
        "photons a bin and laser cycle"
    };
    let between = |(low, high): (f64, f64)| format!("({} to {})", short(low), short(high));
    let of = &found.pixels;
    row(
        "background",
        format!("{} {} {unit}", short(of.background), between(of.between)),
    );
    row(
        "background of pixels",
        format!("80 % have {} to {}", short(of.spread.0), short(of.spread.1)),
    );
    row("hot pixels", listed(&of.hot));
    row("dead pixels", listed(&of.dead));
    row("pulse", pulse(found));
    row(
        "cover glass",
        match &found.nearest {
            Nearest::NotCommon => "none: no peak is the same in all pixels".to_owned(),
            Nearest::Wall(bin) => format!("none: bin {bin} is a wall"),
            Nearest::Unclear(layer) => format!("bin {} is a wall or a cover glass", layer.bin),
            Nearest::Passing(layer) => format!("none: what is at bin {} has moved", layer.bin),
            Nearest::Glass(glass) => format!(
                "{} {} photons a laser cycle and pixel at bin {}",
                short(glass.photons),
                between(glass.photons_between),
                glass.top
            ),
        },
    );
    let between = found.glass().map(|glass| glass.end_between);
    row(
        "gate",
        match (found.written_gate(), between) {
            (None, _) => "none needed".to_owned(),
            (Some((first, last)), Some((low, high)))
                if low < high && (low..=high).contains(&usize::from(first)) =>
            {
                format!("{first}..{last} (begins at {low} to {high})")
            }
            (Some((first, last)), _) => format!("{first}..{last}"),
        },
    );
    row(
        "offset",
        match (found.offset, found.target_mm) {
            (Some(offset), target) => {
                let error = 1.96 * offset.error_mm;
                let target = match target {
                    None => String::new(),
                    Some(distance) if found.has_rays => {
                        format!(", from a flat target {distance} mm straight ahead")
                    }
                    Some(distance) => {
                        format!(", from a target that the median pixel sees at {distance} mm")
                    }
                };
                format!("{:.1} mm (± {error:.1}){target}", offset.mm)
            }
            (None, None) => {
                "not found: calibrate --target-mm D gives it, from a flat target at D mm; \
                             --offset-mm sets it"
                    .to_owned()
            }
            (None, Some(distance)) => {
                format!("not found: too few pixels see a target at {distance} mm")
            }
        },
    );
    if let Some(pixels) = &found.pixel_offsets {
        let lowest = pixels.mm.iter().copied().fold(0.0, f64::min);
        let highest = pixels.mm.iter().copied().fold(0.0, f64::max);
        let text = match (pixels.mm.is_empty(), pixels.needs_field_of_view) {
            (true, false) => "none: pixels differ by no more than their noise".to_owned(),
            (true, true) => {
                "not found: the field of view is not known; calibrate --fov HxV gives it".to_owned()
            }
            (false, _) => format!(
                "{lowest:.1} to {highest:.1} mm; without noise their standard deviation is {:.1} mm",
                pixels.spread_mm
            ),
        };
        row("offsets of pixels", text);
        if found.columns <= WIDEST && found.array_pixels / found.columns <= WIDEST {
            for (number, numbers) in pixels.mm.chunks(found.columns).enumerate() {
                let numbers = numbers.iter().map(|mm| format!("{mm:6.1}"));
                let numbers: Vec<String> = numbers.collect();
                row(&format!("row {number}, mm"), numbers.join(" "));
            }
        }
        if !pixels.without.is_empty() {
            row("without a target", listed(&pixels.without));
        }
    }
    if let Some(width) = found.offset.and_then(|offset| offset.bin_width_ps) {
        row("bin width", format!("{width:.2} ps, from the distances"));
    }
    let of = &found.detection;
    let z = of.z.map_or(String::new(), |z| format!(", z {z:.3}"));
    let counted = if of.exposures == 0 {
        String::new()
    } else {
        format!(", {} simulated exposures", grouped(of.exposures))
    };
    row(
        "rule",
        format!(
            "window of {}{z}, at least {} photons, L1 {}, L2 {}; {} % false alarms{counted}",
            of.window,
            of.min_count,
            of.l1,
            of.l2,
            percent(of.false_alarm)
        ),
    );
    if let Some(photon_budget) = &found.photon_budget {
        row(
            "events here",
            format!(
                "{:.1} photons each, half of them within {:.2} mm",
                photon_budget.photons, photon_budget.error_mm
            ),
        );
    }
    rows
}

/// The pulse that was measured, and that of the settings if it is another.
fn pulse(found: &Calibration) -> String {
    let used = shortest(found.detection.sigma_bins);
    let used = match found.detection.pulse_source {
        PulseSource::Measured => String::new(),
        PulseSource::Given => format!("; σ = {used} bins are used, as given"),
        PulseSource::Older => format!("; σ = {used} bins are kept, from the older settings"),
        PulseSource::Assumed => format!("; the window is that for σ = {used} bin"),
    };
    let measured = match &found.pulse {
        None => "no peak is bright enough".to_owned(),
        Some(pulse) if pulse.is_core => format!(
            "σ = {} bins, of its core, from {} peaks",
            short(pulse.sigma),
            pulse.peaks
        ),
        Some(pulse) => format!(
            "σ = {} ({} to {}) bins, from {} peak{}",
            short(pulse.sigma),
            short(pulse.between.0),
            short(pulse.between.1),
            pulse.peaks,
            if pulse.peaks == 1 { "" } else { "s" }
        ),
    };
    measured + &used
}

/// Changes since an older calibration, one a row.
#[must_use]
pub fn changes(now: &SettingsFile, before: &SettingsFile) -> Vec<Row> {
    let (now, before) = (&now.sensor, &before.sensor);
    let mut rows = Vec::new();
    let mut row = |name: &str, before: Option<f64>, now: Option<f64>| {
        if let (Some(before), Some(now)) = (before, now) {
            let times = now / before;
            let value = format!("{} was {}: {times:.2} times", short(now), short(before));
            rows.push((name.to_owned(), value));
        }
    };
    row("background", before.background, now.background);
    row("cover glass", before.glass, now.glass);
    let sigma = |sensor: &dtof_engine::settings::SensorSettings| {
        sensor.sigma_bins.map(|sigma| sigma.to_num())
    };
    row("pulse", sigma(before), sigma(now));
    let mut named = |name: &str, before: String, now: String| {
        if before != now {
            rows.push((name.to_owned(), format!("{now}, was {before}")));
        }
    };
    let gate = |gate: Option<(u16, u16)>| {
        gate.map_or("none".to_owned(), |(first, last)| {
            format!("{first}..{last}")
        })
    };
    named("gate", gate(before.gate), gate(now.gate));
    let mm = |mm: Option<dtof_core::fixed::types::I24F8>| {
        mm.map_or("not known".to_owned(), |mm| format!("{mm:.1} mm"))
    };
    named("offset", mm(before.offset_mm), mm(now.offset_mm));
    let most = |offsets: &Option<Vec<dtof_core::fixed::types::I24F8>>| {
        let most = offsets.iter().flatten().map(|mm| mm.abs()).max();
        most.map_or("none".to_owned(), |most| format!("up to {most:.1} mm"))
    };
    named(
        "offsets of pixels",
        most(&before.offsets_mm),
        most(&now.offsets_mm),
    );
    let masked = |masked: &Option<Vec<u16>>| {
        let of = masked.iter().flatten().map(|&pixel| pixel.into());
        listed(&of.collect::<Vec<usize>>())
    };
    named("masked pixels", masked(&before.masked), masked(&now.masked));
    rows
}

/// The page; `name` is that of the recording.
///
/// # Errors
/// Fails if the histogram cannot be drawn.
pub fn page(
    found: &Calibration,
    settings: &SettingsFile,
    changes: &[Row],
    name: &str,
) -> Result<String> {
    let svg = histogram(found)?;
    let rows = rows(found);
    let remarks = remarks(found, settings);
    let file: Vec<Row> = settings
        .to_toml()?
        .lines()
        .filter_map(|line| {
            line.split_once('#')
                .map_or(Some(line), |(key, _)| Some(key))
        })
        .filter_map(|line| line.split_once(" = "))
        .map(|(key, value)| (key.to_owned(), value.trim().to_owned()))
        .collect();
    let mut sections = vec![Section {
        heading: "Found",
        rows: &rows,
    }];
    if !remarks.is_empty() {
        sections.push(Section {
            heading: "What to know",
            rows: &remarks,
        });
    }
    if !changes.is_empty() {
        sections.push(Section {
            heading: "Since the older settings",
            rows: changes,
        });
    }
    sections.push(Section {
        heading: "Settings written",
        rows: &file,
    });
    let figure = Figure {
        svg: &svg,
        caption: "The mean histogram of all good pixels and captures, with the findings.",
    };
    let mut figures = vec![figure];
    let map = found
        .pixel_offsets
        .as_ref()
        .map(|pixels| offsets(found, pixels));
    let map = map.transpose()?.flatten();
    if let Some(svg) = &map {
        figures.push(Figure {
            svg,
            caption: "The offset of each pixel, which is added to the range offset. Without a target it is 0, or as it was.",
        });
    }
    let lead = format!("From the histograms of {name}. Intervals are 95 % intervals.");
    Ok(still("Calibration", &lead, &sections, &[], &figures))
}

/// The chart of the mean histogram, with the findings.
fn histogram(found: &Calibration) -> Result<String> {
    let level = found.pixels.background;
    let positive = found.mean.iter().copied().filter(|&rate| rate > 0.0);
    let lowest = positive.fold(f64::INFINITY, f64::min);
    let highest = found.mean.iter().copied().fold(0.0, f64::max).max(1e-9);
    // An empty bin has no place on a logarithmic axis.
    let floor = lowest
        .min(level.max(lowest / 2.0))
        .clamp(highest * 1e-7, highest)
        / 1.5;
    let top = highest * 2.0;
    let bins = 0..found.mean.len();
    let curve = |bins: std::ops::Range<usize>| -> Vec<Point> {
        bins.flat_map(|bin| {
            let rate = found.mean[bin].max(floor);
            [
                Point::exact(bin as f64, rate),
                Point::exact(bin as f64 + 1.0, rate),
            ]
        })
        .collect()
    };
    let mut series = Vec::new();
    let gate = usize::from(found.gate.0);
    if gate > 0 {
        series.push(Series::named(
            "crosstalk",
            PAPER,
            Style::Line,
            curve(0..gate),
        ));
        let line = vec![
            Point::exact(gate as f64, floor),
            Point::exact(gate as f64, top / 1.3),
        ];
        series.push(Series::named("gate", AVERAGE, Style::Dashed, line));
    }
    series.push(Series::named(
        "photons",
        EVENTS,
        Style::Line,
        curve(gate..bins.end),
    ));
    if level > floor {
        let line = vec![
            Point::exact(0.0, level),
            Point::exact(bins.end as f64, level),
        ];
        series.push(Series::named("background", REFERENCE, Style::Dashed, line));
    }
    chart(&Chart {
        finding: finding(found),
        holds: true,
        note:
            "The background is that of the median pixel. Peaks blur in the mean where pixels see \
               different distances."
                .to_owned(),
        x: Axis::linear("bin").within(0.0, bins.end as f64),
        y: Axis::logarithmic(if found.length == Length::Unknown {
            "photons a bin, relative"
        } else {
            "photons a bin and laser cycle"
        })
        .within(floor, top),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(series)],
    })
}

/// The map of the offsets, if there are any.
fn offsets(found: &Calibration, pixels: &PixelOffsets) -> Result<Option<String>> {
    let is_without = |pixel: &usize| pixels.without.contains(pixel);
    let all = pixels.mm.iter().enumerate();
    let values: Vec<Option<f64>> = all
        .map(|(pixel, mm)| (!is_without(&pixel)).then_some(*mm))
        .collect();
    if values.is_empty() {
        return Ok(None);
    }
    let map = Map {
        title: "Offsets of the pixels",
        unit: "mm",
        axis_names: ["column", "row"],
        missing: "target",
        columns: found.columns,
        rows: found.array_pixels / found.columns,
        values: &values,
    };
    heat_map(&map).map(Some)
}

/// The title of the chart.
fn finding(found: &Calibration) -> String {
    let signal = found.pulse.as_ref().map(|pulse| pulse.signal);
    match (&found.nearest, signal) {
        (Nearest::Glass(glass), Some(signal)) if glass.end > 0 => format!(
            "Crosstalk of the cover glass ends at bin {}, {} times as bright as targets",
            glass.end,
            short(glass.photons / signal.max(1e-12))
        ),
        (Nearest::Glass(_), _) => {
            "Crosstalk of the cover glass is so dim that no gate is needed".to_owned()
        }
        (Nearest::Unclear(Layer { bin, .. }) | Nearest::Passing(Layer { bin, .. }), _) => {
            format!("Most pixels see one surface at bin {bin}: a wall or a cover glass")
        }
        (_, Some(signal)) if found.pixels.background > 0.0 => format!(
            "No cover glass; targets have {} times the photons of a background bin",
            short(signal / found.pixels.background)
        ),
        _ => "No cover glass".to_owned(),
    }
}

fn listed(pixels: &[usize]) -> String {
    const SHOWN: usize = 20;
    if pixels.is_empty() {
        return "none".to_owned();
    }
    let all = grouped(pixels.len() as u64);
    let noun = if pixels.len() == 1 { "pixel" } else { "pixels" };
    let shown: Vec<String> = pixels.iter().take(SHOWN).map(ToString::to_string).collect();
    let more = pixels.len().saturating_sub(SHOWN);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("{all}: {noun} {}{more}", shown.join(", "))
}

/// To three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e5).contains(&value.abs()) {
        return format!("{value:.2e}");
    }
    significant(value, 3)
}

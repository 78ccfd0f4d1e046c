//! The chart, the tables and the page of a comparison.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use dtof_draw::chart::{Axis, Chart, Panel, Point, Series, Style, chart};
use dtof_draw::{palette, svg};

use super::Comparison;
use super::answer::Choice;
use super::measure::Outcome;
use super::method::Kind;
use crate::files::{Marked, may_replace, write_marked};
use crate::rows::{Row, grouped};
use crate::settings::{self, SettingsFile};
use crate::view::report::{self, Figure, Section, still};

/// The files of a comparison, and what stands near the start of each. The last makes a folder
/// complete.
pub const FILES: [(&str, &str); 5] = [
    ("dtof.toml", settings::MARK),
    ("compare.svg", svg::MARK),
    ("methods.csv", TABLE_HEAD),
    ("stress.csv", STRESS_HEAD),
    ("report.html", report::MARK),
];

/// A method holds in harder conditions if its error is at most so many times what it was, and
/// the share of wrong reports at most this.
const HOLDS_ERROR: f64 = 1.5;
const HOLDS_WRONG: f64 = 0.05;

/// A time that differs by less than this share is not told.
const AS_BEFORE: f64 = 0.2;

impl Comparison {
    /// Laser cycles in the unit of the chart.
    fn time(&self, cycles: f64) -> f64 {
        self.laser_hz.map_or(cycles, |hz| cycles * 1e6 / hz as f64)
    }

    /// That unit.
    const fn unit(&self) -> &'static str {
        match self.laser_hz {
            Some(_) => "µs",
            None => "laser cycles",
        }
    }

    /// A time with its unit.
    fn told(&self, cycles: f64) -> String {
        let time = self.time(cycles);
        match self.laser_hz {
            _ if !cycles.is_finite() => "never".to_owned(),
            None => format!("{} laser cycles", short(time)),
            Some(_) if time >= 1000.0 => format!("{} ms", short(time / 1000.0)),
            Some(_) => format!("{} µs", short(time)),
        }
    }

    /// The chart: time to a report against its error, a curve a method.
    ///
    /// # Errors
    /// If there is nothing to draw.
    pub fn chart(&self) -> Result<String> {
        let panel = |title: &str, single: bool| {
            let numbers = 0..self.methods.len();
            let mut series: Vec<Series> = numbers
                .filter(|&number| {
                    let method = &self.methods[number];
                    method.kind == Kind::Frames || method.is_single() == single
                })
                .filter_map(|number| self.series(number))
                .collect();
            series.extend(self.bound_series());
            Panel {
                title: title.to_owned(),
                series,
            }
        };
        let mut panels = vec![panel("each pixel and exposure by itself", true)];
        let has_more = self.methods.iter().any(|method| !method.is_single());
        if has_more {
            panels.push(panel("with blocks, and with tracking", false));
        }
        let (finding, holds) = self.finding();
        chart(&Chart {
            finding,
            holds,
            note: self.note(),
            x: Axis::logarithmic(format!("time to a report, {}", self.unit())),
            y: Axis::logarithmic("error of a report, mm"),
            key: Vec::new(),
            columns: 1,
            panels,
        })
    }

    /// What dots and names of the chart are.
    fn note(&self) -> String {
        format!(
            "A dot is a least count of photons, or a length of frames; all rules have at most \
             the same false alarms. Beside a name: instructions a laser cycle and pixel on a Cortex-M4F. \
             Times are of the middle half of the pixels; {}, 68 % of which are smaller.",
            self.truth.told()
        )
    }

    /// What the chart shows, and whether there is a method to take.
    fn finding(&self) -> (String, bool) {
        match &self.answer.taken {
            None => ("A method is as exact as wanted".to_owned(), false),
            Some(taken) => {
                let name = capital(&self.methods[taken.method].name);
                let time = self.told(taken.cycles);
                let times = self.as_a_frame(taken).map_or(String::new(), |times| {
                    format!(", {times:.1} times as fast as frames")
                });
                let error = short(taken.error_mm);
                (format!("{name}: {error} mm after {time}{times}"), true)
            }
        }
    }

    /// How many times the time of `taken` the shortest frame takes that is as exact.
    fn as_a_frame(&self, taken: &Choice) -> Option<f64> {
        let frames = self.of(self.methods.len() - 1);
        let exact = frames.filter(|outcome| outcome.figures.error_mm <= self.answer.within_mm);
        let times = exact.map(|outcome| outcome.figures.cycles / taken.cycles);
        times
            .min_by(f64::total_cmp)
            .filter(|times| times.is_finite())
    }

    /// The trials of a method.
    fn of(&self, number: usize) -> impl Iterator<Item = &Outcome> {
        let outcomes = self.outcomes.iter();
        outcomes.filter(move |outcome| outcome.trial.method == number)
    }

    fn series(&self, number: usize) -> Option<Series> {
        let method = &self.methods[number];
        let drawn = self
            .of(number)
            .filter(|outcome| outcome.figures.error_mm > 0.0);
        let points: Vec<Point> = drawn
            .map(|outcome| {
                Point::exact(self.time(outcome.figures.cycles), outcome.figures.error_mm)
            })
            .collect();
        let cost = self.of(number).next()?.instructions;
        let name = format!("{} ({cost:.0})", method.name);
        (!points.is_empty()).then(|| Series::named(name, method.pen, Style::JoinedDots, points))
    }

    fn bound_series(&self) -> Option<Series> {
        let bound = self.bound?;
        let longest = self.outcomes.iter().map(|outcome| outcome.figures.cycles);
        let longest = longest
            .filter(|cycles| cycles.is_finite())
            .fold(0.0, f64::max);
        let steps = 24;
        let each = (longest / bound.cycles)
            .max(1.0)
            .powf(1.0 / f64::from(steps));
        let cycles = (0..=steps).map(|step| bound.cycles * each.powi(step));
        let points = cycles.map(|cycles| Point::exact(self.time(cycles), bound.error_mm(cycles)));
        let name = "bound of a pixel";
        Some(Series::named(
            name,
            palette::REFERENCE,
            Style::Line,
            points.collect(),
        ))
    }

    /// The answer, in rows.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let row = |name: &str, value: String| (name.to_owned(), value);
        let mut rows = vec![
            row(
                "compared",
                format!(
                    "{} pixels, {} laser cycles",
                    grouped(self.pixels as u64),
                    grouped(self.cycles)
                ),
            ),
            row(
                "median pixel",
                format!(
                    "{} background photons a bin and laser cycle, {} signal photons a laser cycle",
                    short(self.light.background),
                    short(self.light.signal)
                ),
            ),
            row("truth", self.truth.told().to_owned()),
            row("wanted", self.wanted()),
        ];
        let Some(taken) = &self.answer.taken else {
            let all = self.outcomes.iter().filter(|outcome| {
                self.methods[outcome.trial.method].kind != Kind::Frames
                    && outcome.figures.cycles.is_finite()
            });
            let best =
                all.min_by(|one, other| one.figures.error_mm.total_cmp(&other.figures.error_mm));
            rows.push(row("take", "no method is so exact here".to_owned()));
            if let Some(best) = best {
                rows.push(row(
                    "most exact",
                    format!(
                        "{}: {} mm; --within takes another",
                        self.methods[best.trial.method].name,
                        short(best.figures.error_mm)
                    ),
                ));
                if best.figures.wrong > 0.5 {
                    let text = "most reports are wrong: a cover glass? `calibrate` finds the gate";
                    rows.push(row("hint", text.to_owned()));
                }
            }
            return rows;
        };
        rows.extend([
            row("take", self.methods[taken.method].name.clone()),
            row("photons of a peak", format!("at least {}", taken.effort)),
            row("time to a report", self.told(taken.cycles)),
            row("error", format!("{} mm", short(taken.error_mm))),
            row(
                "cost",
                format!(
                    "{:.0} instructions a laser cycle and pixel",
                    taken.instructions
                ),
            ),
        ]);
        if let Some(fastest) = self.answer.able.first().filter(|first| *first != taken) {
            rows.push(row(
                "fastest",
                format!(
                    "{}: {}, {:.0} instructions",
                    self.methods[fastest.method].name,
                    self.told(fastest.cycles),
                    fastest.instructions
                ),
            ));
        }
        let broken: Vec<&str> = self.broken(taken).collect();
        if !broken.is_empty() {
            rows.push(row("does not hold with", broken.join("; ")));
        }
        rows
    }

    /// How exact the answer has to be.
    fn wanted(&self) -> String {
        let within = self.answer.within_mm;
        let frame = self.frame_mm.filter(|frame| *frame < within);
        let frame = frame.map_or(String::new(), |frame| {
            format!("; frames of L2 have {} mm", short(frame))
        });
        format!("errors of at most {} mm{frame}", short(within))
    }

    /// Where each method that is exact enough gets there.
    #[must_use]
    pub fn able_rows(&self) -> Vec<Row> {
        let able = self.answer.able.iter().map(|choice| {
            let text = format!(
                "{}, at least {} photons, {:.0} instructions",
                self.told(choice.cycles),
                choice.effort,
                choice.instructions
            );
            (self.methods[choice.method].name.clone(), text)
        });
        able.collect()
    }

    /// How each method does in harder conditions: its time over that without, and where it fails.
    #[must_use]
    pub fn stress_rows(&self) -> Vec<Row> {
        let rows = self.methods.iter().enumerate().map(|(number, method)| {
            let of_method = |outcomes: &[Outcome]| {
                let mut of_method = outcomes.iter().filter(|one| one.trial.method == number);
                of_method.next().cloned()
            };
            let stressed = self.stressed.iter();
            let mut outcomes =
                stressed.filter_map(|(stress, all)| Some((stress.name, of_method(all)?)));
            let before = outcomes
                .next()
                .map_or(f64::NAN, |(_, outcome)| outcome.figures.cycles);
            let mut texts: Vec<String> = outcomes
                .filter_map(|(name, outcome)| {
                    let times = outcome.figures.cycles / before;
                    if !self.holds(&outcome) {
                        Some(format!("{name}: fails"))
                    } else if (times - 1.0).abs() < AS_BEFORE {
                        None
                    } else {
                        Some(format!("{name}: ×{times:.1}"))
                    }
                })
                .collect();
            texts.push("else as before".to_owned());
            (method.name.clone(), texts.join("; "))
        });
        rows.collect()
    }

    /// The conditions in which the method to take fails, as it is taken.
    fn broken(&self, taken: &Choice) -> impl Iterator<Item = &'static str> {
        let (method, effort) = (taken.method, taken.effort);
        let stressed = self.stressed.iter().skip(1).filter(move |(_, outcomes)| {
            let mut as_taken = outcomes
                .iter()
                .filter(|outcome| outcome.trial.method == method && outcome.trial.effort == effort);
            as_taken.any(|outcome| !self.holds(outcome))
        });
        stressed.map(|(stress, _)| stress.name)
    }

    /// Whether a method still works: it reports, as exact as without stress and seldom wrong.
    fn holds(&self, stressed: &Outcome) -> bool {
        let without = self.stressed.first().and_then(|(_, outcomes)| {
            let mut all = outcomes.iter();
            all.find(|outcome| {
                let (one, other) = (&outcome.trial, &stressed.trial);
                (one.method, one.effort) == (other.method, other.effort)
            })
        });
        let before = without.map_or(f64::INFINITY, |outcome| outcome.figures.error_mm);
        let figures = &stressed.figures;
        figures.cycles.is_finite()
            && figures.error_mm <= HOLDS_ERROR * before
            && figures.wrong <= HOLDS_WRONG
    }

    /// All trials as a table, `methods.csv`.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!("{TABLE_HEAD}\n");
        for outcome in &self.outcomes {
            self.line(&mut text, "", outcome);
        }
        text
    }

    /// The same under stress, `stress.csv`.
    #[must_use]
    pub fn stress_table(&self) -> String {
        let mut text = format!("{STRESS_HEAD},{TABLE_HEAD}\n");
        for (stress, outcomes) in &self.stressed {
            for outcome in outcomes {
                let holds = if self.holds(outcome) { "yes" } else { "no" };
                let before = format!("\"{}\",{holds},", stress.name);
                self.line(&mut text, &before, outcome);
            }
        }
        text
    }

    fn line(&self, text: &mut String, before: &str, outcome: &Outcome) {
        let figures = &outcome.figures;
        let threshold = self.thresholds[outcome.trial.method];
        let threshold = threshold.map_or(String::new(), |threshold| format!("{threshold:.4}"));
        let time = |cycles: f64| {
            if cycles.is_finite() {
                format!("{cycles:.2}")
            } else {
                String::new()
            }
        };
        let _ = writeln!(
            text,
            "{before}\"{}\",{threshold},{},{},{},{:.4},{:.6},{},{},{:.2}",
            self.methods[outcome.trial.method].name,
            outcome.trial.effort,
            time(figures.cycles),
            time(figures.slow_cycles),
            figures.error_mm,
            figures.wrong,
            figures.reports,
            figures.stray,
            outcome.instructions
        );
    }
}

/// The columns of the tables.
pub const TABLE_HEAD: &str = "method,threshold,least_photons_or_frame,cycles,cycles_slow_pixel,error_mm,\
     wrong_share,reports,reports_without_target,instructions";

/// The columns before these under stress.
const STRESS_HEAD: &str = "condition,holds";

/// Checks that the results may be written into `folder`.
///
/// # Errors
/// If a file is there that no comparison has written, or one of `inputs`.
pub fn may_write(folder: &Path, inputs: &[&Path]) -> Result<()> {
    ensure!(
        !folder.join("summary.json").exists(),
        "{}: holds the results of a run; take another folder",
        folder.display()
    );
    FILES
        .iter()
        .try_for_each(|(name, mark)| may_replace(&folder.join(name), mark, inputs))
}

/// Writes the results of photons called `name` into `folder`: charts, tables, the page, and the
/// settings that were `taken`, if there are any.
///
/// # Errors
/// If the folder cannot be written.
pub fn write(
    compared: &Comparison,
    folder: &Path,
    name: &Path,
    taken: Option<&SettingsFile>,
    inputs: &[&Path],
) -> Result<()> {
    fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be the output folder", folder.display()))?;
    may_write(folder, inputs)?;
    let svg = compared.chart()?;
    let section = |heading, rows| Section { heading, rows };
    let (answer, able, stress) = (
        compared.rows(),
        compared.able_rows(),
        compared.stress_rows(),
    );
    let sections = [
        section("Answer", &answer[..]),
        section("Methods as exact as wanted", &able),
        section("Harder conditions: times as long to a report", &stress),
    ];
    let lead = format!("All methods on the same photons of {}.", name.display());
    let (title, _) = compared.finding();
    let caption = "methods.csv has every dot, stress.csv the harder conditions.";
    let figure = Figure { svg: &svg, caption };
    let page = still(&title, &lead, &sections, &[figure]);
    let toml = taken.map(SettingsFile::to_toml).transpose()?;
    let texts = [
        toml,
        Some(svg.clone()),
        Some(compared.table()),
        Some(compared.stress_table()),
        Some(page),
    ];
    let places = FILES.map(|(name, _)| folder.join(name));
    let all = places.iter().zip(FILES).zip(&texts);
    let files: Vec<Marked> = all
        .filter_map(|((place, (_, mark)), text)| {
            let text = text.as_deref()?;
            Some(Marked { place, text, mark })
        })
        .collect();
    write_marked(&files, inputs)?;
    let [settings, ..] = &places;
    if taken.is_none() && settings.exists() {
        // Settings of an earlier comparison are not the answer of this one.
        fs::remove_file(settings).with_context(|| settings.display().to_string())?;
    }
    Ok(())
}

/// Three digits that count.
fn short(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        return value.to_string();
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few digits"
    )]
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}")
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

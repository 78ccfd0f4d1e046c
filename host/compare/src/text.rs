//! The answer of a comparison as text.

use super::Comparison;
use super::answer::{Answer, Choice};
use super::measure::Outcome;
use dtof_options::rows::{Row, grouped, significant};
use dtof_report::capitalised;

/// A method holds in harder conditions if its error grows at most by this factor, and the share of wrong
/// reports is at most `HOLDS_WRONG`.
const HOLDS_ERROR: f64 = 1.5;
const HOLDS_WRONG: f64 = 0.05;

/// A time that differs by less than this share counts as equal.
const SAME_TIME: f64 = 0.2;

impl Comparison {
    /// The finding of the chart, and whether there is a method to take.
    pub(super) fn finding(&self) -> (String, bool) {
        let Answer { best, fastest, .. } = &self.answer;
        let Some(first) = best.as_ref().or(fastest.as_ref()) else {
            return ("A method is exact enough".to_owned(), false);
        };
        let name = capitalised(&self.methods[first.method].name);
        let time = self.time_text(first.cycles);
        let times = self.speed_up(first).map_or(String::new(), |times| {
            format!(", {times:.1} times as fast as frames")
        });
        let error = short(first.error_mm);
        let second = fastest.as_ref().filter(|_| best.is_some());
        let second = second.map_or(String::new(), |second| {
            let name = &self.methods[second.method].name;
            format!("; {name} after {}", self.time_text(second.cycles))
        });
        (
            format!("{name}: {error} mm after {time}{times}{second}"),
            true,
        )
    }

    /// The time of the shortest frame that is exact enough, relative to that of `best`.
    fn speed_up(&self, best: &Choice) -> Option<f64> {
        let frames = self.of(self.methods.len() - 1);
        let exact = frames.filter(|outcome| outcome.figures.error_mm <= self.answer.within_mm);
        let times = exact.map(|outcome| outcome.figures.cycles / best.cycles);
        times
            .min_by(f64::total_cmp)
            .filter(|times| times.is_finite())
    }

    /// The trials of the method with this index.
    pub(super) fn of(&self, number: usize) -> impl Iterator<Item = &Outcome> {
        let outcomes = self.outcomes.iter();
        outcomes.filter(move |outcome| outcome.trial.method == number)
    }

    /// A time with its unit.
    fn time_text(&self, cycles: f64) -> String {
        let time = self.time(cycles);
        match self.laser_hz {
            _ if !cycles.is_finite() => "never".to_owned(),
            None => format!("{} laser cycles", short(time)),
            Some(_) if time >= 1000.0 => format!("{} ms", short(time / 1000.0)),
            Some(_) => format!("{} µs", short(time)),
        }
    }

    /// The answer in rows.
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
            row("truth", self.truth.description().to_owned()),
            row("wanted", self.allowed_error()),
        ];
        let Answer { best, fastest, .. } = &self.answer;
        match best {
            Some(best) => {
                rows.push(row("take", self.methods[best.method].name.clone()));
                rows.extend(self.choice_rows(best, ""));
            }
            None if fastest.is_some() => {
                let text = "no method that keeps every pixel is exact enough here";
                rows.push(row("take", text.to_owned()));
            }
            None => rows.extend(self.rows_without_answer()),
        }
        if let Some(fastest) = fastest {
            rows.push(row("fastest", self.methods[fastest.method].name.clone()));
            rows.extend(self.choice_rows(fastest, "its "));
        } else if best.is_some() {
            // See `NEARLY`.
            rows.push(row(
                "fastest",
                "the same, or at most 10 % faster".to_owned(),
            ));
        }
        rows
    }

    /// Why there is no method to take.
    fn rows_without_answer(&self) -> Vec<Row> {
        let row = |name: &str, value: String| (name.to_owned(), value);
        let mut rows = vec![row("take", "no method is exact enough here".to_owned())];
        let all = self.outcomes.iter().filter(|outcome| {
            !self.methods[outcome.trial.method].is_frames() && outcome.figures.cycles.is_finite()
        });
        let closest =
            all.min_by(|one, other| one.figures.error_mm.total_cmp(&other.figures.error_mm));
        if let Some(closest) = closest {
            rows.push(row(
                "most exact",
                format!(
                    "{}: {} mm; a larger --within allows it",
                    self.methods[closest.trial.method].name,
                    short(closest.figures.error_mm)
                ),
            ));
            if closest.figures.wrong > 0.5 {
                let text = "most reports are wrong: a cover glass? `calibrate` finds the gate";
                rows.push(row("hint", text.to_owned()));
            }
        }
        rows
    }

    /// What a method does; each row begins with `whose`.
    fn choice_rows(&self, choice: &Choice, whose: &str) -> Vec<Row> {
        let row = |name: &str, value: String| (format!("{whose}{name}"), value);
        let mut rows = vec![
            row("resolution", self.resolution(choice)),
            row("photons of a peak", format!("at least {}", choice.effort)),
            row("time to a report", self.time_text(choice.cycles)),
            row("slowest tenth", self.slowest_tenth(choice)),
            row("error", format!("{} mm", short(choice.error_mm))),
            row(
                "cost",
                format!(
                    "{:.0} instructions a laser cycle and pixel",
                    choice.instructions
                ),
            ),
        ];
        let broken: Vec<&str> = self.failing(choice).collect();
        if !broken.is_empty() {
            rows.push(row("weak points", broken.join("; ")));
        }
        rows
    }

    /// How many places the reports of a method have.
    fn resolution(&self, choice: &Choice) -> String {
        let method = &self.methods[choice.method];
        let [columns, rows] = self.sensor;
        let all = format!("{columns}×{rows}");
        let side = 1 << method.levels().raw();
        if side > 1 {
            return format!(
                "blocks of {side}×{side}: a sensor of {all} pixels keeps {}×{} places where only they \
                 report; {:.0} % of the reports are of blocks",
                columns.div_ceil(side),
                rows.div_ceil(side),
                100.0 * choice.of_blocks
            );
        }
        let shared = method.neighbours().map_or(String::new(), |neighbours| {
            format!(
                "; a depth may have photons of {} neighbours",
                neighbours.raw()
            )
        });
        format!("full: each of {all} pixels reports{shared}")
    }

    /// The time of the slowest tenth of the pixels.
    fn slowest_tenth(&self, best: &Choice) -> String {
        if best.slow_cycles.is_finite() {
            return format!(
                "of the pixels: {} or more",
                self.time_text(best.slow_cycles)
            );
        }
        "of the pixels: never report; a larger --within allows methods that report sooner"
            .to_owned()
    }

    /// The error that is allowed.
    fn allowed_error(&self) -> String {
        let within = self.answer.within_mm;
        let frame = self.frame_mm.filter(|frame| *frame < within);
        let frame = frame.map_or(String::new(), |frame| {
            format!("; frames of L2 have {} mm", short(frame))
        });
        format!("errors of at most {} mm{frame}", short(within))
    }

    /// Time and cost of each method that is exact enough.
    #[must_use]
    pub fn candidate_rows(&self) -> Vec<Row> {
        let rows = self.answer.candidates.iter().map(|choice| {
            let text = format!(
                "{}, at least {} photons, {:.0} instructions",
                self.time_text(choice.cycles),
                choice.effort,
                choice.instructions
            );
            (self.methods[choice.method].name.clone(), text)
        });
        rows.collect()
    }

    /// The time of each method in harder conditions relative to that without, and where it fails.
    #[must_use]
    pub fn stress_rows(&self) -> Vec<Row> {
        let rows = self.methods.iter().enumerate().map(|(number, method)| {
            let stressed = self.stressed.iter();
            let mut outcomes = stressed.filter_map(|(stress, all)| {
                let outcome = all.iter().find(|one| one.trial.method == number)?;
                Some((stress.name, outcome))
            });
            let before = outcomes
                .next()
                .map_or(f64::NAN, |(_, outcome)| outcome.figures.cycles);
            let mut texts: Vec<String> = outcomes
                .filter_map(|(name, outcome)| {
                    let times = outcome.figures.cycles / before;
                    if !self.holds(outcome) {
                        Some(format!("{name}: fails"))
                    } else if (times - 1.0).abs() < SAME_TIME {
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

    /// The conditions in which the method to take fails, with its minimum count.
    fn failing(&self, best: &Choice) -> impl Iterator<Item = &'static str> {
        let (method, effort) = (best.method, best.effort);
        let stressed = self.stressed.iter().skip(1).filter(move |(_, outcomes)| {
            let mut same = outcomes
                .iter()
                .filter(|outcome| outcome.trial.method == method && outcome.trial.effort == effort);
            same.any(|outcome| !self.holds(outcome))
        });
        stressed.map(|(stress, _)| stress.name)
    }

    /// Whether a method holds under stress: it reports, about as exact as without, and is rarely wrong.
    pub(super) fn holds(&self, stressed: &Outcome) -> bool {
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
}

/// To three significant digits.
fn short(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        return value.to_string();
    }
    significant(value, 3)
}

//! The answer of a comparison as text.

use super::Comparison;
use super::answer::{Answer, Choice};
use super::measure::TrialOutcome;
use super::method::Method;
use crate::report::capitalised;
use dtof_data::options::rows::{Row, grouped, significant};

/// A method holds in harder conditions if its error grows at most by this factor, and the share of wrong
/// reports is at most `HOLDS_WRONG`.
const HOLDS_ERROR: f64 = 1.5;
const HOLDS_WRONG: f64 = 0.05;

const FAILS: &str = "fails";

/// The heading of the harder conditions, and what their table has.
pub(super) const HARDER: &str = "harder conditions";
pub(super) const STRESS_NOTE: &str = "×: time to a report over that without. fails: the error grows by half, or 5 % are wrong. –: it fails without, too, or reports nothing";

/// A warning says that this share of the pixels or more does not report.
const MANY_SILENT: f64 = 0.1;

impl Comparison {
    /// The finding of the chart, and whether the data show it.
    pub(super) fn finding(&self) -> (String, bool) {
        let Answer { best, fastest, .. } = &self.answer;
        let Some(first) = best.as_ref().or(fastest.as_ref()) else {
            return (capitalised(&self.none_is_exact(&|_| true)), true);
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
        let exact =
            frames.filter(|outcome| outcome.figures.error_mm <= self.answer.limits.within_mm);
        let times = exact.map(|outcome| outcome.figures.cycles / best.cycles);
        times
            .min_by(f64::total_cmp)
            .filter(|times| times.is_finite())
    }

    /// The trials of the method with this index.
    pub(super) fn of(&self, number: usize) -> impl Iterator<Item = &TrialOutcome> {
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
            row(
                "first report",
                format!(
                    "after more than {} laser cycles (L1), {}",
                    self.l1.0, self.l1.1
                ),
            ),
        ];
        let Answer { best, fastest, .. } = &self.answer;
        match best {
            Some(best) => {
                rows.push(row("take", self.methods[best.method].name.clone()));
                rows.extend(self.choice_rows(best, ""));
            }
            None if fastest.is_some() => {
                let text = self.none_is_exact(&Method::has_full_resolution);
                rows.push(row("take", text));
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
        let mut rows = vec![row("take", self.none_is_exact(&|_| true))];
        if let Some(closest) = self.most_exact(&|_| true) {
            if closest.figures.wrong > 0.5 {
                let text = "most reports are wrong: `calibrate` says what it finds, as a cover glass or a background that \
                            is not flat";
                rows.push(row("hint", text.to_owned()));
            } else {
                rows.push(row("hint", "a larger --within has an answer".to_owned()));
            }
        }
        rows
    }

    /// The trials with events, of the methods that are `among` those to choose from.
    fn events(&self, among: &dyn Fn(&Method) -> bool) -> impl Iterator<Item = &TrialOutcome> {
        self.outcomes.iter().filter(move |outcome| {
            let method = &self.methods[outcome.trial.method];
            !method.is_frames() && among(method) && outcome.figures.cycles.is_finite()
        })
    }

    /// The one of them with the smallest error.
    fn most_exact(&self, among: &dyn Fn(&Method) -> bool) -> Option<&TrialOutcome> {
        let all = self.events(among);
        all.min_by(|one, other| one.figures.error_mm.total_cmp(&other.figures.error_mm))
    }

    /// That no method is exact enough, and how exact one is.
    fn none_is_exact(&self, among: &dyn Fn(&Method) -> bool) -> String {
        let limits = &self.answer.limits;
        let within = limits.within_mm;
        let whose = if self.answer.fastest.is_some() {
            "no method that keeps every pixel"
        } else {
            "no method"
        };
        let none = format!("{whose} reaches an error of {} mm", short(within));
        let Some(closest) = self.most_exact(among) else {
            return format!("{none}: none has enough reports");
        };
        let of = |outcome: &TrialOutcome| {
            let name = &self.methods[outcome.trial.method].name;
            let error = short(outcome.figures.error_mm);
            format!("{name} has {error} mm, but")
        };
        let figures = &closest.figures;
        if figures.error_mm > within {
            let name = &self.methods[closest.trial.method].name;
            let error = short(figures.error_mm);
            return format!("{none}; the smallest is {error} mm, by {name}");
        }
        let exact = self.events(among).filter(|outcome| {
            outcome.figures.error_mm <= within && outcome.figures.wrong <= limits.wrong
        });
        let silent = |outcome: &&TrialOutcome| outcome.figures.silent;
        let speaking = exact.min_by(|one, other| silent(one).total_cmp(&silent(other)));
        match speaking {
            Some(speaking) if silent(&speaking) > limits.silent => format!(
                "{none} in enough pixels: {} it leaves {:.0} % of the pixels without a right report",
                of(speaking),
                100.0 * silent(&speaking)
            ),
            Some(few) => format!(
                "{none} reliably: {} from only {} reports",
                of(few),
                grouped(few.figures.reports)
            ),
            None => format!(
                "{none} reliably: {} {:.0} % of its {} reports are wrong",
                of(closest),
                100.0 * figures.wrong,
                grouped(figures.reports)
            ),
        }
    }

    /// Warnings about the methods to take: pixels that do not report.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let Answer { best, fastest, .. } = &self.answer;
        let answers = [
            (best, "the method to take"),
            (fastest, "the fastest method"),
        ];
        let warnings = answers.into_iter().filter_map(|(choice, whose)| {
            let choice = choice.as_ref()?;
            let silent = self.without_stress(choice.method, choice.effort)?.figures.silent;
            (silent >= MANY_SILENT).then(|| {
                format!(
                    "{whose} leaves {:.0} % of the pixels without a right report; a larger --within takes \
                     one that reports sooner",
                    100.0 * silent
                )
            })
        });
        warnings.collect()
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
        let within = self.answer.limits.within_mm;
        let frame = self.frame_mm.filter(|frame| *frame < within);
        let frame = frame.map_or(String::new(), |frame| {
            format!("; the longest frames have {} mm", short(frame))
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

    /// The names of the harder conditions, in two lines.
    pub(super) fn stress_head(&self) -> Vec<[&'static str; 2]> {
        let stressed = self.stressed.iter().skip(1);
        stressed.map(|(stress, _)| stress.short).collect()
    }

    /// A row for the methods to take, with their minimum count, and for each method, with the lowest: in each
    /// harder condition its time over that without, or that it fails there, or without it, too.
    pub(super) fn stress_rows(&self) -> Vec<(String, Vec<String>)> {
        let Answer { best, fastest, .. } = &self.answer;
        let answers = [(best, "take"), (fastest, "fastest")];
        let answers = answers.into_iter().filter_map(|(choice, name)| {
            let choice = choice.as_ref()?;
            Some((name.to_owned(), choice.method, Some(choice.effort)))
        });
        let methods = self.methods.iter().enumerate();
        let methods = methods.map(|(number, method)| (method.name.clone(), number, None));
        let rows = answers.chain(methods).map(|(name, method, effort)| {
            let is_same = |outcome: &&TrialOutcome| {
                let trial = &outcome.trial;
                trial.method == method && effort.is_none_or(|effort| trial.effort == effort)
            };
            let mut outcomes = self
                .stressed
                .iter()
                .map(|(_, all)| all.iter().find(is_same));
            let before = outcomes.next().flatten();
            let before = before.filter(|outcome| self.holds(outcome));
            let cells = outcomes.map(|outcome| match (before, outcome) {
                (None, _) => "–".to_owned(),
                (Some(before), Some(outcome)) if self.holds(outcome) => {
                    format!("×{:.1}", outcome.figures.cycles / before.figures.cycles)
                }
                _ => FAILS.to_owned(),
            });
            (name, cells.collect())
        });
        rows.collect()
    }

    /// The harder conditions as text.
    #[must_use]
    pub fn stress_text(&self) -> String {
        /// Of a column.
        const WIDTH: usize = 7;
        let (head, rows) = (self.stress_head(), self.stress_rows());
        let names = rows.iter().map(|(name, _)| name.chars().count());
        let left = 2 + names.fold(HARDER.len(), usize::max);
        let mut lines = vec![format!("{:left$}", format!("  {HARDER}")), " ".repeat(left)];
        for (column, [group, name]) in head.iter().enumerate() {
            let end = left + WIDTH * (column + 1);
            let is_last = head.get(column + 1).is_none_or(|next| next[0] != *group);
            let group = if is_last { group } else { "" };
            for (line, text) in lines.iter_mut().zip([group, name]) {
                let width = end - line.chars().count();
                *line += &format!("{text:>width$}");
            }
        }
        for (name, cells) in rows {
            let cells: String = cells.iter().map(|cell| format!("{cell:>WIDTH$}")).collect();
            lines.push(format!("  {name:width$}{cells}", width = left - 2));
        }
        lines.push(format!("  {STRESS_NOTE}"));
        lines
            .iter()
            .map(|line| format!("{}\n", line.trim_end()))
            .collect()
    }

    /// A method without stress, on the photons that are then changed.
    fn without_stress(&self, method: usize, effort: u16) -> Option<&TrialOutcome> {
        let mut all = self.stressed.first()?.1.iter();
        all.find(|outcome| (outcome.trial.method, outcome.trial.effort) == (method, effort))
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
    pub(super) fn holds(&self, stressed: &TrialOutcome) -> bool {
        let without = self.without_stress(stressed.trial.method, stressed.trial.effort);
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

#[cfg(test)]
mod tests {
    use super::super::answer::answer;
    use super::super::measure::Trial;
    use super::super::stress::{Light, Stress};
    use super::super::truth::Truth;
    use super::super::{Figures, Settings};
    use super::*;
    use dtof_core::fixed::types::U8F8;

    /// A comparison of trials of a window of 3 with these errors in millimetres, numbers of reports, and shares of wrong
    /// reports and of silent pixels.
    fn comparison(trials: &[(f64, u64, f64, f64)]) -> Comparison {
        let settings = Settings::static_scene(1);
        let methods = Method::all(U8F8::ONE, 0, false, &settings);
        let outcome = |(effort, &(error_mm, reports, wrong, silent))| TrialOutcome {
            trial: Trial {
                method: 4,
                effort,
                settings: settings.clone(),
            },
            figures: Figures {
                cycles: 100.0,
                slow_cycles: 100.0,
                error_mm,
                reports,
                wrong,
                silent,
                ..Figures::default()
            },
            instructions: 50.0,
        };
        let outcomes: Vec<TrialOutcome> = (5..).zip(trials).map(outcome).collect();
        Comparison {
            thresholds: vec![None; methods.len()],
            answer: answer(&methods, &outcomes, 10.0),
            outcomes,
            methods,
            bound: None,
            stressed: Vec::new(),
            frame_mm: None,
            settings: None,
            fastest: None,
            l1: (4, String::new()),
            light: Light {
                background: 0.01,
                signal: 0.1,
                sigma: 1.0,
            },
            truth: Truth::Ranges(Vec::new()),
            sensor: [8, 8],
            pixels: 64,
            cycles: 10_000,
            laser_hz: None,
        }
    }

    /// What there is to take within 10 mm.
    fn take(trials: &[(f64, u64, f64, f64)]) -> String {
        let mut rows = comparison(trials).rows().into_iter();
        rows.find(|(name, _)| name == "take").unwrap().1
    }

    #[test]
    fn a_method_fails_where_it_held_without() {
        let many = 1_000_000_000;
        let cell = |before: (f64, u64, f64, f64), in_drift: (f64, u64, f64, f64)| {
            let mut compared = comparison(&[]);
            let outcomes = |trial| (Stress::NONE, comparison(&[trial]).outcomes);
            compared.stressed = vec![outcomes(before), outcomes(in_drift)];
            let mut rows = compared.stress_rows().into_iter();
            let (_, cells) = rows.find(|(name, _)| name == "window of 3").unwrap();
            cells.concat()
        };
        let good = (8.0, many, 0.01, 0.0);
        assert_eq!(cell(good, (12.0, many, 0.05, 0.0)), "×1.0");
        assert_eq!(cell(good, (12.1, many, 0.05, 0.0)), "fails");
        assert_eq!(cell(good, (8.0, many, 0.051, 0.0)), "fails");
        let wrong = (8.0, many, 0.06, 0.0);
        assert_eq!(cell(wrong, wrong), "–");
        assert_eq!(cell(wrong, good), "–");
    }

    #[test]
    fn without_a_method_to_take_the_reason_is_said() {
        let many = 1_000_000_000;
        for (trials, text) in [
            (&[(9.0, many, 0.01, 0.0)][..], "window of 3"),
            (
                &[],
                "no method reaches an error of 10.0 mm: none has enough reports",
            ),
            (
                &[(12.0, many, 0.0, 0.0)],
                "no method reaches an error of 10.0 mm; the smallest is 12.0 mm, by window of 3",
            ),
            (
                &[(14.0, many, 0.0, 0.02), (9.0, many, 0.0, 0.5)],
                "no method reaches an error of 10.0 mm in enough pixels: window of 3 has 9.00 mm, but it leaves 50 % of the \
                 pixels without a right report",
            ),
            (
                &[(9.0, 1000, 0.2, 0.0)],
                "no method reaches an error of 10.0 mm reliably: window of 3 has 9.00 mm, but 20 % of its 1,000 reports are \
                 wrong",
            ),
            (
                &[(9.9, 100, 0.0, 0.0)],
                "no method reaches an error of 10.0 mm reliably: window of 3 has 9.90 mm, but from only 100 reports",
            ),
        ] {
            assert_eq!(take(trials), text);
        }
    }
}

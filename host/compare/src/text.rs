//! The answer of a comparison, in words.

use super::Comparison;
use super::answer::Choice;
use super::measure::Outcome;
use super::method::Kind;
use dtof_options::rows::{Row, grouped, significant};

/// A method holds in harder conditions if its error is at most so many times what it was, and
/// the share of wrong reports at most this.
const HOLDS_ERROR: f64 = 1.5;
const HOLDS_WRONG: f64 = 0.05;

/// A time that differs by less than this share is not told.
const AS_BEFORE: f64 = 0.2;

impl Comparison {
    /// What the chart shows, and whether there is a method to take.
    pub(super) fn finding(&self) -> (String, bool) {
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
    pub(super) fn of(&self, number: usize) -> impl Iterator<Item = &Outcome> {
        let outcomes = self.outcomes.iter();
        outcomes.filter(move |outcome| outcome.trial.method == number)
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
            row("slowest tenth", self.slowest(taken)),
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

    /// How long the pixels take that nine of ten are faster than.
    fn slowest(&self, taken: &Choice) -> String {
        if taken.slow_cycles.is_finite() {
            return format!("of the pixels: {} or more", self.told(taken.slow_cycles));
        }
        "of the pixels: never report; a larger --within takes what reports sooner".to_owned()
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

/// Three digits that count.
fn short(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        return value.to_string();
    }
    significant(value, 3)
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

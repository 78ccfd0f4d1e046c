//! Where methods fail: the table, the data of each case, and the picture.

use std::fmt::Write as _;

use anyhow::{Result, ensure};

use crate::studies::failures::rows::{self, Row, SECTIONS};
use crate::studies::failures::{Case, FailureOutcome, Method, Rule, Verdict, Warning, outcomes};
use crate::sweep::Part;
use crate::sweep::values::Values;
use dtof_draw::palette::Mark;
use dtof_draw::svg::{Anchor, BOLD, EDGE, Svg, TEXT, TITLE, text_width, wrapped};

/// The rows of the table: those in which a method fails or degrades.
///
/// # Errors
/// As [`outcomes`].
pub fn table(part: &Part) -> Result<Values> {
    let all = outcomes(part)?;
    let mut table = String::new();
    for row in SECTIONS.into_iter().flat_map(|(_, rows)| rows) {
        let of_row = of_row(&all, *row);
        let fails = failures(&of_row);
        if !fails.is_empty() {
            let fails = fails.replace("silently", "**silently**");
            let (holds, advice) = (survivors(&of_row), row.advice);
            writeln!(table, "| {} | {fails} | {holds} | {advice} |", row.name)?;
        }
    }
    Ok([("table", table), ("cases", all.len().to_string())].into())
}

/// Every case with its row, as CSV.
///
/// # Errors
/// As [`outcomes`].
pub fn cases(part: &Part) -> Result<String> {
    let mut csv = "case,row,fails,holds,advice,why_no_flag\n".to_owned();
    for (case, outcomes) in &outcomes(part)? {
        let all: Vec<&FailureOutcome> = outcomes.iter().collect();
        let (fails, holds) = (failures(&all), survivors(&all));
        let Row {
            name,
            advice,
            silence,
        } = case.row;
        let advice = if fails.is_empty() { "" } else { advice };
        let is_silent = all.iter().any(|of| of.warning == Warning::Silent);
        let why = match (is_silent, silence) {
            (false, _) => "",
            (true, "") => "not known",
            (true, silence) => silence,
        };
        let cells = [&case.name, name, &fails, &holds, advice, why];
        writeln!(csv, "{}", cells.map(|cell| format!("\"{cell}\"")).join(","))?;
    }
    Ok(csv)
}

/// The outcomes in all cases of `row`.
fn of_row(outcomes: &[(Case, Vec<FailureOutcome>)], row: Row) -> Vec<&FailureOutcome> {
    let cases = outcomes.iter().filter(|(case, _)| case.row == row);
    cases.flat_map(|(_, outcomes)| outcomes).collect()
}

/// The worst outcome of `method`.
fn worst<'a>(outcomes: &[&'a FailureOutcome], method: Method) -> Option<&'a FailureOutcome> {
    let of_method = outcomes.iter().filter(|of| of.method == method);
    let worst = of_method.max_by(|a, b| {
        let by_size = number(a).0.total_cmp(&number(b).0);
        kind(a).cmp(&kind(b)).then(by_size)
    });
    worst.copied()
}

const fn kind(outcome: &FailureOutcome) -> (Verdict, Warning) {
    (outcome.verdict, outcome.warning)
}

/// What fails and how, with the worst number of each kind. Empty if nothing does.
fn failures(outcomes: &[&FailureOutcome]) -> String {
    let mut worst: Vec<&FailureOutcome> = Method::all()
        .filter_map(|method| worst(outcomes, method))
        .filter(|of| kind(of) != (Verdict::Survives, Warning::NotNeeded))
        .collect();
    worst.sort_by_key(|of| std::cmp::Reverse(kind(of)));
    let kinds = worst.chunk_by(|a, b| kind(a) == kind(b)).map(|alike| {
        let methods: Vec<Method> = alike.iter().map(|of| of.method).collect();
        let verb = match alike[0].verdict {
            Verdict::Survives => "holds",
            Verdict::Degrades => "degrades",
            Verdict::Fails => "fails",
        };
        let warning = match alike[0].warning {
            Warning::NotNeeded => "",
            Warning::Flagged => ", flagged",
            Warning::Silent => " silently",
        };
        let numbers = alike.iter().map(|of| number(of));
        let (_, number) = numbers
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or_default();
        format!("{verb}{warning}: {} ({number})", names(&methods))
    });
    kinds.collect::<Vec<_>>().join("; ")
}

/// The number that tells why a method does not hold, and its text.
fn number(outcome: &FailureOutcome) -> (f64, String) {
    let percent = |share: f64, what| {
        let digits = usize::from(share < 0.1);
        (share, format!("{:.digits$} % {what}", share * 100.0))
    };
    let off = (outcome.error, format!("{:.1} bins off", outcome.error));
    match outcome.false_share {
        Some(share) if !outcome.has_target => percent(share.value, "false"),
        Some(share) if share.value >= 0.1 && outcome.without.value < 0.9 => {
            percent(share.value, "false")
        }
        _ if outcome.is_far_off && outcome.without.value < 0.5 => off,
        Some(share) if outcome.without.value < 0.5 && share.interval.1 >= 0.02 => {
            percent(share.value, "false")
        }
        _ if outcome.without.value < 0.5 => off,
        _ => percent(outcome.without.value, "no event"),
    }
}

/// The methods that survive every outcome.
fn survivors(outcomes: &[&FailureOutcome]) -> String {
    let survives = |of: &FailureOutcome| of.verdict == Verdict::Survives;
    let methods = Method::all().filter(|method| worst(outcomes, *method).is_some_and(survives));
    names(&methods.collect::<Vec<_>>())
}

/// The names of methods; only that of the rule if it is there with both estimators.
fn names(methods: &[Method]) -> String {
    let of = |is_centred| methods.iter().filter(move |of| of.is_centred == is_centred);
    let rules = [false, true].map(|is_centred| of(is_centred).count());
    let all = Rule::ALL.len();
    let estimator = methods.first().map_or("", |method| estimator(*method));
    match rules {
        [0, 0] => return "none".to_owned(),
        [some, other] if some == all && other == all => return "all".to_owned(),
        [some, 0] | [0, some] if some == all => return format!("all with the {estimator}"),
        _ => {}
    }
    let named = Rule::ALL.into_iter().filter_map(|rule| {
        let mut of_rule = methods.iter().filter(|method| method.rule == rule);
        match (of_rule.next(), of_rule.next()) {
            (Some(_), Some(_)) => Some(short(rule).to_owned()),
            (Some(method), None) => Some(format!(
                "{} with the {}",
                short(rule),
                self::estimator(*method)
            )),
            _ => None,
        }
    });
    named.collect::<Vec<_>>().join(", ")
}

/// The name of a rule without the α of the average.
fn short(rule: Rule) -> &'static str {
    let name = rule.name();
    name.split_once(", ").map_or(name, |(short, _)| short)
}

const fn estimator(method: Method) -> &'static str {
    if method.is_centred {
        "centred window"
    } else {
        "centroid"
    }
}

const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
/// Heights of a row of the matrix and of a line of text.
const ROW: f64 = 21.0;
const LINE: f64 = 19.0;
/// The width of the names of rows, and of the columns of the rules.
const NAMES: f64 = 284.0;
const COLUMNS: [f64; 4] = [54.0, 54.0, 74.0, 66.0];
/// Half the distance of two marks in a cell.
const ASIDE: f64 = 11.0;
const RADIUS: f64 = 6.0;
const FINDING: &str = "The window rule holds most often; no rule holds against stray pulses";
const NOTE: &str = "Fails: a tenth of the events or more are false alarms, or half of the exposures have no event. Silently: \
                    wrong events without a flag. A cell shows the worst case of its row. It has two marks where the depth matters: the \
                    centroid's on the left, the centred window's on the right.";

/// The matrix of rules and rows.
///
/// # Errors
/// As [`outcomes`], and fails if the data no longer support the title.
pub fn picture(part: &Part) -> Result<String> {
    let outcomes = outcomes(part)?;
    ensure!(holds(&outcomes), "the data no longer support: {FINDING}");
    Ok(draw(&outcomes))
}

/// Whether the title holds.
fn holds(outcomes: &[(Case, Vec<FailureOutcome>)]) -> bool {
    let survived = |rule| {
        let all = outcomes.iter().flat_map(|(_, outcomes)| outcomes);
        let of_rule = all.filter(|of| of.method.rule == rule);
        of_rule.filter(|of| of.verdict == Verdict::Survives).count()
    };
    let [others @ .., window] = Rule::ALL.map(survived);
    let stray = [rows::GLASS, rows::RAIN, rows::VEIL, rows::LIDAR];
    others.iter().all(|other| *other < window)
        && stray.into_iter().all(|row| {
            let of_row = of_row(outcomes, row);
            let mut worst = Method::all().filter_map(|method| worst(&of_row, method));
            worst.all(|of| kind(of) == (Verdict::Fails, Warning::Silent))
        })
}

fn draw(outcomes: &[(Case, Vec<FailureOutcome>)]) -> String {
    let mut svg = Svg::default();
    let lines = wrapped(FINDING, BOLD * TITLE.0, INNER);
    let mut y = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines) + 8.0;
    let columns = columns();
    for (rule, (middle, width)) in Rule::ALL.into_iter().zip(columns) {
        let lines = wrapped(&rule.name().replace(", ", " "), BOLD * TEXT, width);
        let class = rule.pen().colour.class();
        let (class, place) = (format!("{class} panel"), (middle, y));
        svg.lines(&class, place, (TEXT, LINE), Anchor::Middle, &lines);
    }
    y += LINE;
    for (index, (section, rows)) in SECTIONS.into_iter().enumerate() {
        if index > 0 {
            y += 8.0;
        }
        let place = (EDGE, y + LINE / 2.0);
        svg.text("ink panel", place, TEXT, Anchor::Start, section);
        y += LINE + 3.0;
        for row in rows {
            svg.line("grid", (EDGE, y), (EDGE + INNER, y));
            let place = (EDGE, y + ROW / 2.0);
            svg.text("ink", place, TEXT, Anchor::Start, row.name);
            let of_row = of_row(outcomes, *row);
            for (rule, (middle, _)) in Rule::ALL.into_iter().zip(columns) {
                let class = rule.pen().colour.class();
                svg.raw(&format!("<g class=\"{class}\">"));
                cell(&mut svg, &of_row, rule, (middle, y + ROW / 2.0));
                svg.raw("</g>");
            }
            y += ROW;
        }
    }
    y = key(&mut svg, y + 12.0);
    // Wide fonts need as much room as bold letters.
    let lines = wrapped(NOTE, BOLD * TEXT, INNER);
    y = svg.lines("soft", (EDGE, y + 4.0), (TEXT, LINE), Anchor::Start, &lines);
    svg.document((WIDTH, y + EDGE - 4.0), FINDING)
}

/// The middle and the width of each column.
fn columns() -> [(f64, f64); 4] {
    let mut left = EDGE + NAMES;
    COLUMNS.map(|width| {
        left += width;
        (left - width / 2.0, width)
    })
}

/// One mark, or two where the estimators differ.
fn cell(svg: &mut Svg, outcomes: &[&FailureOutcome], rule: Rule, (x, y): (f64, f64)) {
    let kinds = [false, true].map(|is_centred| {
        let worst = worst(outcomes, Method { rule, is_centred });
        worst.map_or((Verdict::Survives, Warning::NotNeeded), kind)
    });
    let is_same = kinds[0] == kinds[1];
    let places: &[f64] = if is_same { &[0.0] } else { &[-ASIDE, ASIDE] };
    for ((verdict, warning), aside) in kinds.into_iter().zip(places) {
        mark(svg, verdict, warning == Warning::Silent, (x + aside, y));
    }
}

fn mark(svg: &mut Svg, verdict: Verdict, is_silent: bool, place: (f64, f64)) {
    match verdict {
        Verdict::Survives => svg.dot(Mark::Circle, place, 1.6, true),
        Verdict::Degrades => svg.dot(Mark::Up, place, RADIUS, is_silent),
        Verdict::Fails => svg.dot(Mark::Square, place, RADIUS, is_silent),
    }
}

/// What the marks mean. Returns the y below.
fn key(svg: &mut Svg, top: f64) -> f64 {
    let entries = [
        (Verdict::Survives, false, "holds"),
        (Verdict::Degrades, false, "degrades"),
        (Verdict::Degrades, true, "degrades silently"),
        (Verdict::Fails, false, "fails"),
        (Verdict::Fails, true, "fails silently"),
    ];
    let mut x = EDGE;
    svg.raw("<g class=\"ink\">");
    for (verdict, is_silent, text) in entries {
        mark(svg, verdict, is_silent, (x + 7.0, top + LINE / 2.0));
        let place = (x + 20.0, top + LINE / 2.0);
        svg.text("ink", place, TEXT, Anchor::Start, text);
        x += 20.0 + text_width(text, TEXT) + 16.0;
    }
    svg.raw("</g>");
    top + LINE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_fits_beside_the_marks() {
        for row in SECTIONS.into_iter().flat_map(|(_, rows)| rows) {
            let width = text_width(row.name, TEXT);
            assert!(width < NAMES, "{}: {width}", row.name);
        }
        assert!(NAMES + COLUMNS.iter().sum::<f64>() <= INNER);
        // Two marks and the gap to those of the next column.
        assert!(
            COLUMNS
                .iter()
                .all(|width| *width > 2.0 * (ASIDE + 1.2 * RADIUS))
        );
    }
}

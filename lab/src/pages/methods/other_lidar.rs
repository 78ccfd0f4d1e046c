//! Another LiDAR, and the dither against it.

use std::fmt::Write as _;

use anyhow::{Result, ensure};

use crate::studies::beyond::dither::{
    Counted, DEFAULT, DitherOutcome, MOST_FALSE, MOST_WRONG, RANGES, STRENGTHS, Scene, least_range,
    outcome, undisturbed,
};
use crate::sweep::Part;
use crate::sweep::values::Values;

/// The section on the study of the dither.
pub(super) fn section(values: &mut Values, part: &Part) -> Result<()> {
    values.set("lidar.table", table(part)?);
    values.set(
        "lidar.without",
        cell(|scene| undisturbed(part, scene, Counted::All))?,
    );
    values.set("lidar.default", DEFAULT);
    values.set("lidar.most wrong", 100.0 * MOST_WRONG);
    values.set("lidar.most false", 100.0 * MOST_FALSE);
    let at = |scene, counted, strength| outcome(part, scene, counted, strength, DEFAULT);
    for (name, scene, counted, strength) in [
        ("equal", Scene::Empty, Counted::All, 1.0),
        ("twice", Scene::Empty, Counted::All, 2.0),
        ("twice once", Scene::Empty, Counted::OncePerBin, 2.0),
        ("dark", Scene::Dark, Counted::All, 2.0),
        ("very dark", Scene::VeryDark, Counted::All, 2.0),
        ("dark once", Scene::Dark, Counted::OncePerBin, 2.0),
        ("clock equal", Scene::EqualClock, Counted::All, 1.0),
        ("clock twice", Scene::EqualClock, Counted::All, 2.0),
    ] {
        let outcome = at(scene, counted, strength)?;
        values.set(format!("lidar.{name}"), percent(outcome, 1));
    }
    let alone = undisturbed(part, Scene::Target, Counted::All)?.cycles.value;
    let ratio = at(Scene::Target, Counted::All, 2.0)?.cycles.value / alone;
    values.set("lidar.time", format!("{ratio:.2}"));
    values.set(
        "lidar.first without",
        first_cell(|scene| undisturbed(part, scene, Counted::First))?,
    );
    values.set("lidar.first table", first_table(part)?);
    let without = undisturbed(part, Scene::Empty, Counted::All)?;
    values.set("lidar.alone", percent(without, 1));
    let without = without.wrong;
    let [equal, twice] = [1.0, 2.0].map(|strength| at(Scene::Empty, Counted::All, strength));
    let (equal, twice) = (equal?.wrong, twice?.wrong);
    ensure!(
        equal.contains(without.value)
            && twice.interval.0 > without.interval.1
            && least_range(part, Scene::Empty, Counted::All, 1.0)? == Some(DEFAULT),
        "the data no longer show which LiDAR the default suits"
    );
    Ok(())
}

fn percent(outcome: DitherOutcome, digits: usize) -> String {
    format!("{:.digits$}", 100.0 * outcome.wrong.value)
}

/// With a target, without one, and without one in the dark.
fn cell(of: impl Fn(Scene) -> Result<DitherOutcome>) -> Result<String> {
    let [target, empty, dark] = [Scene::Target, Scene::Empty, Scene::Dark].map(of);
    Ok(format!(
        "{} · {} · {}",
        percent(target?, 2),
        percent(empty?, 1),
        percent(dark?, 1)
    ))
}

/// Of a TDC of the first photon: laser cycles to an event, wrong events and, without a target, false alarms.
fn first_cell(of: impl Fn(Scene) -> Result<DitherOutcome>) -> Result<String> {
    let target = of(Scene::FirstPhoton)?;
    Ok(format!(
        "{:.0} · {} · {}",
        target.cycles.value,
        percent(target, 2),
        percent(of(Scene::FirstPhotonEmpty)?, 1)
    ))
}

/// A row without dither and one with the default.
fn first_table(part: &Part) -> Result<String> {
    let mut table = heading();
    for range in [0.0, DEFAULT] {
        write!(table, "| {range} |")?;
        for strength in STRENGTHS {
            let cell = first_cell(|scene| outcome(part, scene, Counted::First, strength, range))?;
            write!(table, " {cell} |")?;
        }
        writeln!(table)?;
    }
    Ok(table)
}

/// The names of the strengths.
fn heading() -> String {
    let strengths = STRENGTHS.map(|strength| format!(" {strength} × |"));
    let below = "---|".repeat(STRENGTHS.len());
    format!("| S |{}\n|---|{below}\n", strengths.concat())
}

/// A row for each range, and the smallest that suffices.
fn table(part: &Part) -> Result<String> {
    let mut table = heading();
    let all = RANGES.map(|range| (range.to_string(), Counted::All, range));
    let once = (
        format!("{DEFAULT}, once per bin"),
        Counted::OncePerBin,
        DEFAULT,
    );
    for (name, counted, range) in all.into_iter().chain([once]) {
        write!(table, "| {name} |")?;
        for strength in STRENGTHS {
            let cell = cell(|scene| outcome(part, scene, counted, strength, range))?;
            write!(table, " {cell} |")?;
        }
        writeln!(table)?;
    }
    for (name, empty, counted) in [
        ("least S", Scene::Empty, Counted::All),
        ("least S in the dark", Scene::Dark, Counted::All),
        (
            "least S in the dark, once per bin",
            Scene::Dark,
            Counted::OncePerBin,
        ),
    ] {
        write!(table, "| {name} |")?;
        for strength in STRENGTHS {
            match least_range(part, empty, counted, strength)? {
                Some(range) => write!(table, " {range} |")?,
                None => write!(table, " none |")?,
            }
        }
        writeln!(table)?;
    }
    Ok(table)
}

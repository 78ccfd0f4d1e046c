//! Another LiDAR, and the dither against it.

use anyhow::{Result, ensure};

use crate::studies::beyond::dither::{
    Counted, DEFAULT, DitherOutcome, MOST_FALSE, MOST_WRONG, RANGES, STRENGTHS, Scene, least_range,
    outcome, undisturbed,
};
use crate::sweep::Part;
use crate::sweep::values::Values;

/// The section on the study of the dither.
pub(super) fn section(values: &mut Values, part: &Part) -> Result<()> {
    values.set("lidar.table", table(part));
    let without = |scene| undisturbed(part, scene, Counted::All);
    values.set("lidar.without", cell(without));
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
        let outcome = at(scene, counted, strength);
        values.set(format!("lidar.{name}"), percent(outcome, 1));
    }
    let alone = without(Scene::Target).cycles.value;
    let ratio = at(Scene::Target, Counted::All, 2.0).cycles.value / alone;
    values.set("lidar.time", format!("{ratio:.2}"));
    let first_without = first_cell(|scene| undisturbed(part, scene, Counted::First));
    values.set("lidar.first without", first_without);
    values.set("lidar.first table", first_table(part));
    let without = without(Scene::Empty);
    values.set("lidar.alone", percent(without, 1));
    let without = without.wrong;
    let [equal, twice] = [1.0, 2.0].map(|strength| at(Scene::Empty, Counted::All, strength).wrong);
    ensure!(
        equal.contains(without.value)
            && twice.interval.0 > without.interval.1
            && least_range(part, Scene::Empty, Counted::All, 1.0) == Some(DEFAULT),
        "the data no longer show which LiDAR the default suits"
    );
    Ok(())
}

fn percent(outcome: DitherOutcome, digits: usize) -> String {
    format!("{:.digits$}", 100.0 * outcome.wrong.value)
}

/// With a target, without one, and without one in the dark.
fn cell(of: impl Fn(Scene) -> DitherOutcome) -> String {
    format!(
        "{} · {} · {}",
        percent(of(Scene::Target), 2),
        percent(of(Scene::Empty), 1),
        percent(of(Scene::Dark), 1)
    )
}

/// Of a TDC of the first photon: laser cycles to an event, wrong events and, without a target, false alarms.
fn first_cell(of: impl Fn(Scene) -> DitherOutcome) -> String {
    let target = of(Scene::FirstPhoton);
    format!(
        "{:.0} · {} · {}",
        target.cycles.value,
        percent(target, 2),
        percent(of(Scene::FirstPhotonEmpty), 1)
    )
}

/// A row of a table: `cell` of each strength.
fn row(name: &str, cell: impl Fn(f64) -> String) -> String {
    format!("| {name} | {} |\n", STRENGTHS.map(cell).join(" | "))
}

/// A row without dither and one with the default.
fn first_table(part: &Part) -> String {
    let rows = [0.0, DEFAULT].map(|range| {
        row(&range.to_string(), |strength| {
            first_cell(|scene| outcome(part, scene, Counted::First, strength, range))
        })
    });
    heading() + &rows.concat()
}

/// The names of the strengths.
fn heading() -> String {
    let strengths = STRENGTHS.map(|strength| format!(" {strength} × |"));
    let below = "---|".repeat(STRENGTHS.len());
    format!("| S |{}\n|---|{below}\n", strengths.concat())
}

/// A row for each range, and the smallest that suffices.
fn table(part: &Part) -> String {
    let mut table = heading();
    let all = RANGES.map(|range| (range.to_string(), Counted::All, range));
    let once = (
        format!("{DEFAULT}, once per bin"),
        Counted::OncePerBin,
        DEFAULT,
    );
    for (name, counted, range) in all.into_iter().chain([once]) {
        table += &row(&name, |strength| {
            cell(|scene| outcome(part, scene, counted, strength, range))
        });
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
        table += &row(name, |strength| {
            let least = least_range(part, empty, counted, strength);
            least.map_or("none".to_owned(), |range| range.to_string())
        });
    }
    table
}

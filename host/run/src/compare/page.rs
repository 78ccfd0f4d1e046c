//! The tables and the page of a comparison.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use dtof_draw::svg;

use super::Comparison;
use super::measure::TrialOutcome;
use super::text::{HARDER, STRESS_NOTE};
use crate::report::{Figure, Section, Table, capitalised, still};
use dtof_data::options::files::{MarkedFile, may_replace, temporary_file, write_marked};
use dtof_engine::settings::{self, SettingsFile};

/// The page, which makes a folder complete.
const PAGE: &str = "report.html";

/// The files of a comparison, and the mark near the start of each. The last one makes a folder complete.
pub const FILES: [(&str, &str); 6] = [
    ("dtof.toml", settings::MARK),
    ("dtof-fastest.toml", settings::MARK),
    ("compare.svg", svg::MARK),
    ("methods.csv", TABLE_HEAD),
    ("stress.csv", STRESS_HEAD),
    (PAGE, crate::report::MARK),
];

impl Comparison {
    /// All trials as a table, `methods.csv`.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!("{TABLE_HEAD}\n");
        for outcome in &self.outcomes {
            self.line(&mut text, "", outcome);
        }
        text
    }

    /// All trials under stress as a table, `stress.csv`.
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

    fn line(&self, text: &mut String, before: &str, outcome: &TrialOutcome) {
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

/// The columns that come first in the table under stress.
const STRESS_HEAD: &str = "condition,holds";

/// Creates `folder` if it does not exist, and checks that the results can be written there.
///
/// # Errors
/// Fails if the folder cannot be written, if it holds a run, one of `inputs`, or a file of these names that no
/// comparison has written.
pub fn prepare(folder: &Path, inputs: &[&Path]) -> Result<()> {
    ensure!(
        !folder.join("summary.json").exists(),
        "{}: holds the results of a run; take another folder",
        folder.display()
    );
    fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be the output folder", folder.display()))?;
    FILES
        .iter()
        .try_for_each(|(name, mark)| may_replace(&folder.join(name), mark, inputs))?;
    // It is deleted at once.
    temporary_file(folder, ".dtof-").map(drop)
}

/// Writes the results for the input `name` into `folder`: chart, tables, page, and `settings`: those of the
/// method to take at full resolution, and of the fastest if that is another.
///
/// # Errors
/// Fails if the folder cannot be written.
pub fn write(
    comparison: &Comparison,
    folder: &Path,
    name: &Path,
    settings: [Option<&SettingsFile>; 2],
    inputs: &[&Path],
) -> Result<()> {
    prepare(folder, inputs)?;
    let svg = comparison.chart()?;
    let section = |heading, rows| Section { heading, rows };
    let (answer, candidates) = (comparison.rows(), comparison.candidate_rows());
    let head = comparison.stress_head();
    let head: Vec<String> = head
        .iter()
        .map(|[group, name]| format!("{group} {name}"))
        .collect();
    let stress = Table {
        heading: &capitalised(HARDER),
        head: &head,
        rows: &comparison.stress_rows(),
        note: STRESS_NOTE,
    };
    let sections = [
        section("Answer", &answer[..]),
        section("Methods that are exact enough", &candidates),
    ];
    let lead = format!("All methods on the same photons of {}.", name.display());
    let (title, _) = comparison.finding();
    let caption = "methods.csv has every dot, stress.csv the harder conditions.";
    let figure = Figure { svg: &svg, caption };
    let page = still(&title, &lead, &sections, &[stress], &[figure]);
    let [best, fastest] = settings.map(|one| one.map(SettingsFile::to_toml).transpose());
    let texts = [
        best?,
        fastest?,
        Some(svg.clone()),
        Some(comparison.table()),
        Some(comparison.stress_table()),
        Some(page),
    ];
    let places = FILES.map(|(name, _)| folder.join(name));
    let all = places.iter().zip(FILES).zip(&texts);
    let files: Vec<MarkedFile> = all
        .filter_map(|((place, (_, mark)), text)| {
            let text = text.as_deref()?;
            Some(MarkedFile {
                place,
                text,
                mark,
                is_edited: false,
            })
        })
        .collect();
    // Without its page the folder does not look complete. Settings of an earlier comparison would look like the
    // answer of this one.
    let old = places.iter().zip(FILES).zip(&texts);
    let old = old.filter(|((_, (name, _)), text)| text.is_none() || *name == PAGE);
    let removed: Vec<&Path> = old.map(|((place, _), _)| place.as_path()).collect();
    write_marked(&files, &removed, inputs)?;
    Ok(())
}

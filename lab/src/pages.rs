//! The documents that studies make: figures, their captions, and the verdicts on
//! the paper's claims.
//!
//! Of every study the seeds of a quick look and the rest are kept apart in
//! `docs/results/data`. So a quick look that is taken again must give the kept numbers
//! bit for bit, and together with the kept rest every document.

pub mod failures;
pub mod methods;
mod movie;

use crate::studies::failures::STUDY as FAILURES;
use crate::studies::methods::{depth_error, event_depth, time_to_detect};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, SeedRange, Study};
use crate::{studies, sweep};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What is done anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anew {
    /// The seeds of a quick look: minutes.
    Few,
    /// All seeds.
    All,
    /// None: documents are drawn again from what is kept.
    None,
}

/// Works out the seeds and gives every document below `docs` with its content.
/// `progress` is told which study comes next.
///
/// # Errors
/// If a trial fails or what is kept cannot be read.
pub fn documents(
    docs: &Path,
    anew: Anew,
    mut progress: impl FnMut(&Study),
) -> Result<Vec<(PathBuf, String)>> {
    let data = |study: &Study, which| format!("results/data/{}.{which}.json", study.name);
    let mut documents = Vec::new();
    let mut all = Vec::new();
    let mut parts = BTreeMap::new();
    for study in studies::ALL {
        progress(study);
        let [few, rest] = [
            ("few", (0, study.few_seeds), anew != Anew::None),
            (
                "rest",
                (study.few_seeds, study.all_seeds),
                anew == Anew::All,
            ),
        ]
        .map(|(which, (first, end), is_anew)| {
            let kept = data(study, which);
            let part = if is_anew {
                work_out(study, first, end)?
            } else {
                Part::load(&docs.join(&kept))?
            };
            documents.push((kept.into(), part.to_json()?));
            anyhow::Ok(part)
        });
        let (few, rest) = (few?, rest?);
        let mut part = few;
        part.add(&rest)
            .with_context(|| format!("{}: the kept rest", study.name))?;
        let all_seeds = SeedRange {
            first: 0,
            end: study.all_seeds,
        };
        ensure!(
            part.seeds() == [all_seeds],
            "{}: the kept rest is not of the seeds {}..{}",
            study.name,
            study.few_seeds,
            study.all_seeds
        );
        let results = (study.results)(&part).with_context(|| study.name.to_owned())?;
        all.push((study, results));
        parts.insert(study.name, part);
    }
    let figures = all.iter().flat_map(|(_, results)| &results.figures);
    let wrong = figures.filter(|figure| !figure.holds);
    let wrong: Vec<&str> = wrong.map(|figure| figure.name).collect();
    ensure!(
        wrong.is_empty(),
        "the data no longer show what these titles say: {}",
        wrong.join(", ")
    );
    for (_, results) in &all {
        for figure in &results.figures {
            let path = format!("figures/{}.svg", figure.name);
            documents.push((path.into(), figure.svg.clone()));
        }
        for table in &results.tables {
            documents.push((table.path.into(), table.csv.clone()));
        }
    }
    let part = |study: Study| parts.get(study.name).context(study.name);
    let used = [
        time_to_detect::STUDY,
        depth_error::STUDY,
        event_depth::STUDY,
    ];
    let [time, depth, events] = used.map(part);
    let read = |path| {
        let path = docs.join(path);
        fs::read_to_string(&path).with_context(|| path.display().to_string())
    };
    let (counts, recorded) = (read(methods::INSTRUCTIONS)?, read(methods::RECORDED)?);
    let methods = methods::documents(&counts, &recorded, time?, depth?, events?)?;
    documents.extend(methods);
    let failures = failures::document(part(FAILURES)?)?;
    documents.push(("results/failures.md".into(), failures));
    documents.push(("figures/demo.svg".into(), movie::demo()?));
    documents.push(("results/figures.md".into(), captions(&all)?));
    documents.push(("results/paper-claims.md".into(), claims(&all)?));
    Ok(documents)
}

fn work_out(study: &Study, first: u64, end: u64) -> Result<Part> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("part");
    let hour = Duration::from_secs(3600);
    sweep::run(study, SeedRange { first, end }, &path, hour, |_| ())
}

/// Writes documents below `docs` and gives those that changed.
///
/// # Errors
/// If one cannot be written.
pub fn write(docs: &Path, documents: &[(PathBuf, String)]) -> Result<Vec<PathBuf>> {
    let mut changed = Vec::new();
    for path in different(docs, documents) {
        let name = || path.display().to_string();
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(name)?;
        }
        let content = documents.iter().find(|(of, _)| docs.join(of) == path);
        if let Some((_, content)) = content {
            fs::write(&path, content).with_context(name)?;
        }
        changed.push(path);
    }
    Ok(changed)
}

/// Documents that are not below `docs` as they should be.
#[must_use]
pub fn different(docs: &Path, documents: &[(PathBuf, String)]) -> Vec<PathBuf> {
    let differs = |(path, content): &&(PathBuf, String)| {
        fs::read(docs.join(path)).ok().as_deref() != Some(content.as_bytes())
    };
    let different = documents.iter().filter(differs);
    different.map(|(path, _)| docs.join(path)).collect()
}

/// Figures by study. A caption that several have in common stands below the last of them.
fn captions(all: &[(&Study, Results)]) -> Result<String> {
    let mut text = "# Figures\n\n\
        Made by `cargo lab figures`; do not edit. `--all` works out every seed again.\n"
        .to_owned();
    for (study, results) in all {
        let (name, about) = (study.name, study.about);
        if !results.figures.is_empty() {
            let seeds = study.all_seeds;
            write!(text, "\n## {name}\n\nStudy of {about}; {seeds} seeds.\n")?;
        }
        for same in results.figures.chunk_by(|a, b| a.caption == b.caption) {
            for Figure { name, .. } in same {
                write!(text, "\n![{name}](../figures/{name}.svg)\n")?;
            }
            if let [Figure { caption, .. }, ..] = same {
                write!(text, "\n{caption}\n")?;
            }
        }
    }
    Ok(text)
}

fn claims(all: &[(&Study, Results)]) -> Result<String> {
    let mut text = "# The paper's claims\n\n\
        Made by `cargo lab figures`; do not edit. Each claim of the paper, its number, ours, and a verdict. The \
        [figures](figures.md) show more; [the paper, line by line](../paper.md) has the rest of the paper.\n\n\
        | verdict | meaning |\n|---|---|\n\
        | agrees | the same here, in all that was tried |\n\
        | differs | in part, or with another number |\n\
        | refuted | not so in anything that was tried, or not as stated |\n\
        | not decided | the sample is too small to tell |\n\n\
        The criterion stands with the claim, or in its study in `lab/src/studies`.\n\n\
        | claim | the paper | here | verdict | why | study |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for (study, results) in all {
        for claim in &results.claims {
            writeln!(
                text,
                "| {} | {} | {} | **{}** | {} | `{}` |",
                claim.claim, claim.paper, claim.here, claim.verdict, claim.why, study.name
            )?;
        }
    }
    Ok(text)
}

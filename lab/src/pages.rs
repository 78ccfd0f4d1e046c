//! The documents made from the studies: figures, captions, and the verdicts on the paper's claims.
//!
//! `docs/results/data` has the data of every study in two files: the seeds of a quick look, and the
//! rest. So a new quick look must reproduce its file bit for bit, and with the rest it yields every
//! document.

mod bus;
pub mod failures;
pub mod methods;
mod movie;
mod pixel;
mod timing;

use crate::studies::beyond::dither;
use crate::studies::failures::STUDY as FAILURES;
use crate::studies::methods::{depth_error, event_depth, time_to_detect};
use crate::sweep::results::{Claim, Figure, Verdict};
use crate::sweep::values::Values;
use crate::sweep::{Part, Study};
use crate::{studies, sweep};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const FIGURES: &str = include_str!("pages/figures.md");
const CLAIMS: &str = include_str!("pages/paper-claims.md");
const CLAIM_DETAILS: &str = include_str!("pages/paper_claims.csv");

/// Which trials run again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rerun {
    /// The seeds of a quick look, which takes minutes.
    Quick,
    /// All seeds.
    All,
    /// None: documents are drawn from the stored data.
    None,
}

/// Runs the trials and returns every document below `docs` with its content. Calls `progress`
/// before each study.
///
/// # Errors
/// Fails if a trial fails or the stored data cannot be read.
pub fn documents(
    docs: &Path,
    rerun: Rerun,
    mut progress: impl FnMut(&Study),
) -> Result<Vec<(PathBuf, String)>> {
    let mut documents = Vec::new();
    let mut all = Vec::new();
    let mut parts = BTreeMap::new();
    for study in studies::ALL {
        progress(study);
        let Study {
            name,
            few_seeds,
            all_seeds,
            ..
        } = *study;
        let mut taken = |which, seeds, is_anew| {
            let kept = format!("results/data/{name}.{which}.json");
            let part = if is_anew {
                sweep::run_seeds(study, seeds)?
            } else {
                Part::load(&docs.join(&kept))?
            };
            documents.push((kept.into(), part.to_json()?));
            anyhow::Ok(part)
        };
        let few = taken("few", 0..few_seeds, rerun != Rerun::None)?;
        let rest = taken("rest", few_seeds..all_seeds, rerun == Rerun::All)?;
        // Only parts with the points of the study can be added.
        let mut part = Part::empty(study);
        part.add(&few)
            .with_context(|| format!("{name}: the stored few"))?;
        part.add(&rest)
            .with_context(|| format!("{name}: the stored rest"))?;
        ensure!(
            part.seeds() == [(0, all_seeds)],
            "{name}: the stored rest does not have the seeds {few_seeds}..{all_seeds}"
        );
        let results = (study.results)(&part).context(name)?;
        all.push((study, results));
        parts.insert(name, part);
    }
    let figures = all.iter().flat_map(|(_, results)| &results.figures);
    let wrong = figures.filter(|figure| !figure.holds);
    let wrong: Vec<&str> = wrong.map(|figure| figure.name).collect();
    ensure!(
        wrong.is_empty(),
        "the data no longer support these titles: {}",
        wrong.join(", ")
    );
    for (_, results) in &all {
        for figure in &results.figures {
            let path = format!("figures/{}.svg", figure.name);
            documents.push((path.into(), figure.svg.clone()));
        }
        for (path, csv) in &results.tables {
            documents.push((path.into(), csv.clone()));
        }
    }
    let part = |study: Study| parts.get(study.name).context(study.name);
    let time = part(time_to_detect::STUDY)?;
    let (depth, events) = (part(depth_error::STUDY)?, part(event_depth::STUDY)?);
    let read = |path| {
        let path = docs.join(path);
        fs::read_to_string(&path).with_context(|| path.display().to_string())
    };
    let (counts, recorded) = (read(methods::INSTRUCTIONS)?, read(methods::RECORDED)?);
    let methods = methods::documents(
        &counts,
        &recorded,
        time,
        depth,
        events,
        part(dither::STUDY)?,
    )?;
    documents.extend(methods);
    let mut values = Values::default();
    for (study, results) in &all {
        values.add(study.name, &results.values);
        values.set(format!("{}.about", study.name), study.about);
        values.set(format!("{}.seeds", study.name), study.all_seeds);
        for Claim {
            name,
            here,
            details,
            verdict,
        } in &results.claims
        {
            values.set(format!("{}.{name}", study.name), verdict);
            values.set(format!("{}.{name}.answer", study.name), verdict.answer());
            values.set(format!("{}.{name}.here", study.name), here);
            values.set(format!("{}.{name}.details", study.name), details);
            for page in [CLAIMS, CLAIM_DETAILS] {
                ensure!(
                    page.contains(&format!("{{{}.{name}.here}}", study.name)),
                    "{}: a page has no claim {name}",
                    study.name
                );
            }
        }
        for Figure { name, .. } in &results.figures {
            ensure!(
                FIGURES.contains(&format!("(../figures/{name}.svg)")),
                "the page has no figure {name}"
            );
        }
    }
    // Our own questions have answers instead of verdicts.
    let is_of_paper = |study: &Study, claim: &Claim| {
        CLAIMS.contains(&format!("**{{{}.{}}}**", study.name, claim.name))
    };
    let verdicts: Vec<Verdict> = all
        .iter()
        .flat_map(|(study, results)| results.claims.iter().map(move |claim| (study, claim)))
        .filter(|(study, claim)| is_of_paper(study, claim))
        .map(|(_, claim)| claim.verdict)
        .collect();
    values.set("claims.all", verdicts.len());
    for (name, verdict) in [
        ("agree", Verdict::Agrees),
        ("differ", Verdict::Differs),
        ("refuted", Verdict::Refuted),
        ("open", Verdict::NotDecided),
    ] {
        let count = verdicts.iter().filter(|&&of| of == verdict).count();
        values.set(format!("claims.{name}"), count);
    }
    values.set("bus.rates", bus::rates());
    values.set("bus.waits", bus::waits());
    values.add(FAILURES.name, &failures::table(part(FAILURES)?)?);
    for (page, template) in [
        ("results/failures.md", include_str!("pages/failures.md")),
        ("results/figures.md", FIGURES),
        ("results/paper-claims.md", CLAIMS),
        ("results/data/paper_claims.csv", CLAIM_DETAILS),
    ] {
        documents.push((page.into(), values.fill(template)?));
    }
    let failures = [
        ("figures/failures.svg", failures::picture(part(FAILURES)?)?),
        (
            "results/data/failure_cases.csv",
            failures::cases(part(FAILURES)?)?,
        ),
    ];
    documents.extend(failures.map(|(path, content)| (path.into(), content)));
    documents.push(("figures/demo.svg".into(), movie::demo()?));
    documents.push(("figures/pixel.svg".into(), pixel::pixel()?));
    documents.push(("figures/processing.svg".into(), timing::timing()));
    Ok(documents)
}

/// Writes documents below `docs` and returns those that changed.
///
/// # Errors
/// Fails if one cannot be written.
pub fn write(docs: &Path, documents: &[(PathBuf, String)]) -> Result<Vec<PathBuf>> {
    let changed = outdated(docs, documents);
    for (path, content) in documents {
        let path = docs.join(path);
        let name = || path.display().to_string();
        if !changed.contains(&path) {
            continue;
        }
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(name)?;
        }
        fs::write(&path, content).with_context(name)?;
    }
    Ok(changed)
}

/// Documents below `docs` that are missing or differ.
#[must_use]
pub fn outdated(docs: &Path, documents: &[(PathBuf, String)]) -> Vec<PathBuf> {
    let differs = |(path, content): &&(PathBuf, String)| {
        fs::read(docs.join(path)).ok().as_deref() != Some(content.as_bytes())
    };
    let different = documents.iter().filter(differs);
    different.map(|(path, _)| docs.join(path)).collect()
}

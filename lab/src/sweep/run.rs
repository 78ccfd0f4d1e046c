//! Running the seeds of a part.

use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;

use super::{Part, Study, Tally};

/// Runs `seeds` and returns their part.
///
/// # Errors
/// Fails if a trial fails or the temporary file cannot be written.
pub fn run_seeds(study: &Study, seeds: Range<u64>) -> Result<Part> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("part");
    run(study, seeds, &path, Duration::MAX, |_| ())
}

/// Runs `seeds` into the file at `path`. If the file has a part of them from an interrupted run,
/// the rest is added. Saves every `save_every` and at the end; calls `progress` with the number of
/// finished seeds.
///
/// # Errors
/// Fails if the file is not such a part or cannot be written, or if a trial fails.
pub fn run(
    study: &Study,
    seeds: Range<u64>,
    path: &Path,
    save_every: Duration,
    mut progress: impl FnMut(u64),
) -> Result<Part> {
    let mut part = Part::empty(study);
    if path.exists() {
        let before = Part::load(path)?;
        let inside = |&(first, end): &(u64, u64)| seeds.start <= first && end <= seeds.end;
        ensure!(
            before.seeds().iter().all(inside),
            "{}: has seeds outside the requested range",
            path.display()
        );
        part.add(&before)
            .with_context(|| path.display().to_string())?;
    }
    let done = part.seeds().to_vec();
    let is_left = |seed: &u64| !done.iter().any(|range| (range.0..range.1).contains(seed));
    let points = (study.points)();
    // Enough trials at once to keep every thread busy.
    let at_once = (8 * rayon::current_num_threads()).div_ceil(points.len().max(1));
    let mut saved = Instant::now();
    let mut left = seeds.filter(is_left);
    loop {
        let chunk: Vec<u64> = left.by_ref().take(at_once).collect();
        if chunk.is_empty() {
            break;
        }
        let trials: Vec<(u64, usize)> = chunk
            .iter()
            .flat_map(|&seed| (0..points.len()).map(move |point| (seed, point)))
            .collect();
        let tallies: Vec<Tally> = trials
            .into_par_iter()
            .map(|(seed, point)| {
                (study.trial)(&points[point], &mut study.rng(point, seed))
                    .with_context(|| format!("{}, seed {seed}", study.name))
            })
            .collect::<Result<_>>()?;
        for (&seed, tallies) in chunk.iter().zip(tallies.chunks(points.len())) {
            part.add_seed(seed, tallies.to_vec())?;
        }
        progress(part.seed_count());
        if saved.elapsed() >= save_every {
            part.save(path)?;
            saved = Instant::now();
        }
    }
    part.save(path)?;
    Ok(part)
}

//! `cargo softcore mutations`: whether the scenes find faults in the Verilog.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

use anyhow::{Context, Result, ensure};
use lexopt::ValueExt;
use lexopt::prelude::{Long, Short};

use super::mutants::{MUTANTS, Mutant};
use super::scene::Scene;
use super::{proof, simulation::simulate};
use crate::rtl::verilate_in;
use crate::target_folder;

/// Photons of a run, by which every fault has shown.
const PHOTONS: u64 = 1_000_000;

/// Builds as fast as can be: what is built runs for a second. A fault may leave a signal
/// without use.
const FAST_BUILD: [&str; 7] = [
    "-Wno-fatal",
    "-MAKEFLAGS",
    "OPT_FAST=-O0",
    "-MAKEFLAGS",
    "OPT_SLOW=-O0",
    "-MAKEFLAGS",
    "OPT_GLOBAL=-O0",
];

const HELP: &str = "\
cargo softcore mutations [--sample N] [--only TEXT]

Plants faults in copies of the pixel processor's Verilog, one at a time, and runs the scenes of
`cargo softcore pixels`, which have to fail.

  --sample N   so many of them, others with each commit
  --only TEXT  those with TEXT in the name of their file, or in what they change";

/// Runs the command.
pub fn run(mut parser: lexopt::Parser) -> Result<()> {
    let (mut sample, mut only) = (None, None);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("sample") => sample = Some(parser.value()?.parse()?),
            Long("only") => only = Some(parser.value()?.string()?),
            Short('h') | Long("help") => {
                println!("{HELP}");
                return Ok(());
            }
            other => return Err(other.unexpected().into()),
        }
    }
    prove(&crate::root().canonicalize()?, sample, only.as_deref())
}

/// Puts each fault into a copy of the Verilog, all of them or a sample, and fails if the
/// scenes do not find one.
fn prove(root: &Path, sample: Option<usize>, only: Option<&str>) -> Result<()> {
    let mut chosen =
        sample.map_or_else(|| (0..MUTANTS.len()).collect(), |many| sampled(root, many));
    let is_meant = |Mutant { file, from, to }: &Mutant| {
        only.is_none_or(|text| [file, from, to].iter().any(|of| of.contains(text)))
    };
    chosen.retain(|&number| is_meant(&MUTANTS[number]));
    ensure!(!chosen.is_empty(), "no faults to plant");
    let scenes = proof::scenes(root, PHOTONS)?;
    let folder = target_folder(root).join("softcore/mutants");
    let (next, chosen) = (&AtomicUsize::new(0), &chosen);
    let (scenes, of) = (&scenes, &folder);
    let mut survivors = 0;
    thread::scope(|scope| -> Result<()> {
        let (sender, results) = mpsc::channel();
        for worker in 0..thread::available_parallelism().map_or(1, Into::into) {
            let sender = sender.clone();
            scope.spawn(move || {
                let folder = of.join(worker.to_string());
                while let Some(&number) = chosen.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mutant = &MUTANTS[number];
                    if sender
                        .send((mutant, judge(root, &folder, mutant, scenes)))
                        .is_err()
                    {
                        break;
                    }
                }
            });
        }
        drop(sender);
        for (mutant, found) in results {
            let Mutant { file, from, to } = mutant;
            let what = format!("{file}: `{from}` as `{to}`");
            if let Some(by) = found.with_context(|| what.clone())? {
                println!("{what}: {by}");
            } else {
                println!("{what}: NOT FOUND");
                survivors += 1;
            }
        }
        Ok(())
    })?;
    let all = chosen.len();
    ensure!(survivors == 0, "{survivors} of {all} faults are not found");
    println!("pixel processor: {all} faults, all found");
    Ok(())
}

/// So many, others with each commit.
fn sampled(root: &Path, many: usize) -> Vec<usize> {
    let head = Command::new("git")
        .current_dir(root)
        .args(["rev-parse", "HEAD"])
        .output();
    // Without a history, the first ones.
    let head = head.map(|head| head.stdout).unwrap_or_default();
    let text = String::from_utf8_lossy(&head);
    let key = usize::from_str_radix(text.get(..8).unwrap_or_default(), 16).unwrap_or_default();
    let all = MUTANTS.len();
    (0..many.min(all))
        .map(|place| (key + place) % all)
        .collect()
}

/// What finds a fault, if anything does.
fn judge(root: &Path, folder: &Path, mutant: &Mutant, scenes: &[Scene]) -> Result<Option<String>> {
    let softcore = copy(root, folder)?;
    let file = softcore
        .join("rtl/pixels")
        .join(mutant.file)
        .with_extension("v");
    let text = fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    fs::write(&file, mutant.apply(&text)?)?;
    let mut sizes: Vec<u32> = scenes.iter().map(|scene| scene.pixels_log2).collect();
    // Most scenes have four macropixels.
    sizes.sort_by_key(|&size| (size != 2, size));
    sizes.dedup();
    for size in sizes {
        let build = folder.join(format!("pixels-{size}"));
        let parameter = format!("-GPIXELS_LOG2={size}");
        let mut arguments = vec![&*parameter];
        arguments.extend(FAST_BUILD);
        let simulator = verilate_in(&softcore, "pixels", &build, Path::new(""), &arguments)?;
        for scene in scenes.iter().filter(|scene| scene.pixels_log2 == size) {
            if let Err(error) = simulate(&mut Command::new(&simulator), scene) {
                return Ok(Some(format!("{error:#}")));
            }
        }
    }
    Ok(None)
}

/// A copy of what the simulation is built from.
fn copy(root: &Path, folder: &Path) -> Result<PathBuf> {
    let softcore = folder.join("softcore");
    for part in ["rtl/pixels", "sim"] {
        let (from, to) = (root.join("softcore").join(part), softcore.join(part));
        fs::create_dir_all(&to).with_context(|| to.display().to_string())?;
        for file in fs::read_dir(&from).with_context(|| from.display().to_string())? {
            let file = file?;
            fs::copy(file.path(), to.join(file.file_name()))?;
        }
    }
    Ok(softcore)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_has_its_place() {
        let folder = crate::root().join("softcore/rtl/pixels");
        for (number, mutant) in MUTANTS.iter().enumerate() {
            let text = fs::read_to_string(folder.join(mutant.file).with_extension("v")).unwrap();
            assert_ne!(mutant.apply(&text).unwrap(), text, "{mutant:?}");
            let others = &MUTANTS[..number];
            assert!(!others.contains(mutant), "twice: {mutant:?}");
        }
        let page = crate::root().join("docs/softcore.md");
        let told = format!("plants {} faults", MUTANTS.len());
        assert!(fs::read_to_string(page).unwrap().contains(&told), "{told}");
        assert!(MUTANTS[0].apply("").is_err());
        let twice = MUTANTS[0].from.repeat(2);
        assert!(MUTANTS[0].apply(&twice).is_err());
    }

    #[test]
    fn a_sample_has_no_fault_twice() {
        let root = crate::root();
        let mut sample = sampled(&root, 9);
        assert_eq!(sample.len(), 9);
        sample.sort_unstable();
        sample.dedup();
        assert_eq!(sample.len(), 9);
        assert_eq!(sampled(&root, 1000).len(), MUTANTS.len());
    }
}

//! `cargo softcore pixels`: the pixel processor in simulation against `dtof-core`.

mod command;
mod model;
pub mod mutants;
pub mod mutations;
mod page;
mod proof;
mod reads;
mod row;
mod scene;
mod simulation;
mod system;

use std::collections::btree_map::{BTreeMap, Entry};
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use lexopt::ValueExt;
use lexopt::prelude::{Long, Short};

use crate::files;
use crate::line::Line;
use crate::rtl;

use row::Proof;
use simulation::simulate;

const HELP: &str = "\
cargo softcore pixels [--photons N] [--check]

Runs the pixel processor in simulation against dtof-core, bit for bit, alone and in the whole
system, and writes docs/results/bench/pixels.csv and pixels.md.

  --photons N  about so many photons in all, 10 million unless told; others write nothing
  --check      compare with the files instead of writing them";

/// Photons of a run unless others are asked for.
const PHOTONS: u64 = 10_000_000;

/// The options of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Options {
    photons: u64,
    check: bool,
}

impl Options {
    /// `None` if help is asked for.
    fn parse(mut parser: lexopt::Parser) -> Result<Option<Self>> {
        let mut options = Self {
            photons: PHOTONS,
            check: false,
        };
        while let Some(argument) = parser.next()? {
            match argument {
                Long("photons") => options.photons = parser.value()?.parse()?,
                Long("check") => options.check = true,
                Short('h') | Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        Ok(Some(options))
    }
}

/// Runs the command.
pub fn run(parser: lexopt::Parser) -> Result<()> {
    let Some(options) = Options::parse(parser)? else {
        println!("{HELP}");
        return Ok(());
    };
    let root = &crate::root().canonicalize()?;
    let proofs = prove(root, options.photons)?;
    let latencies = system::measure(root)?;
    rtl::check(root, "photon_crossing")?;
    rtl::check_two_clocks(root)?;
    let page = page::text(&proofs, &latencies);
    println!("\n{page}");
    if options.check {
        let mut expected: Vec<Proof> = files::lines(root)?;
        // Without the recording its scenes are missing, as was said.
        let is_recorded = |proof: &Proof| proof.scene == proof::RECORDED;
        if !proofs.iter().any(is_recorded) {
            expected.retain(|proof| !is_recorded(proof));
        }
        check(&expected, &proofs)?;
        return check(&files::lines(root)?, &latencies);
    }
    if options.photons == PHOTONS {
        for (file, text) in [
            files::text(&proofs),
            files::text(&latencies),
            (page::DOCUMENT, page),
        ] {
            fs::write(root.join(file), text).context(file)?;
            println!("{file}: written");
        }
    }
    Ok(())
}

/// Runs every scene, with so many photons in all.
fn prove(root: &Path, photons: u64) -> Result<Vec<Proof>> {
    let scenes = proof::scenes(root, photons)?;
    let mut simulators = BTreeMap::new();
    let mut proofs = Vec::new();
    for scene in &scenes {
        let log2 = scene.pixels_log2;
        let simulator = match simulators.entry(log2) {
            Entry::Occupied(built) => built.into_mut(),
            Entry::Vacant(place) => {
                let name = format!("pixels-{log2}");
                let size = format!("-GPIXELS_LOG2={log2}");
                place.insert(rtl::verilate(
                    root,
                    "pixels",
                    &name,
                    Path::new(""),
                    &[&size],
                )?)
            }
        };
        let outcome = simulate(&mut Command::new(&*simulator), scene)?;
        let statistics = outcome.statistics;
        let proof = Proof {
            scene: scene.name.clone(),
            macropixels: 1 << log2,
            photons: outcome.photons,
            cycles: outcome.cycles,
            looks: outcome.looks,
            late: outcome.late,
            events: statistics.events,
            deferred: statistics.deferred,
            expired: statistics.expired,
            full: statistics.saturated,
        };
        println!(
            "{}, {} macropixels: {} photons and {} events as dtof-core",
            proof.scene, proof.macropixels, proof.photons, proof.events
        );
        if scene.reads.is_some() {
            println!(
                "of histograms, {} times eight bins: as dtof-core",
                outcome.bins_read
            );
        }
        proofs.push(proof);
    }
    let photons: u64 = proofs.iter().map(|proof| proof.photons).sum();
    println!("pixel processor: {photons} photons as dtof-core has them");
    Ok(proofs)
}

/// Compares what was measured with a file.
fn check<L: Line>(expected: &[L], measured: &[L]) -> Result<()> {
    let ((_, expected), (file, measured)) = (files::text(expected), files::text(measured));
    let differences = files::differences(&expected, &measured, L::COLUMNS);
    for difference in &differences {
        println!("{difference}");
    }
    ensure!(
        differences.is_empty(),
        "not what {file} says, see above; `cargo softcore pixels` writes it"
    );
    println!("{file}: as measured");
    Ok(())
}

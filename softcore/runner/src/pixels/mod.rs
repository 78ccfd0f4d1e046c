//! `cargo softcore pixels`: the pixel processor in simulation against `dtof-core`.

mod command;
mod figures;
mod model;
pub mod mutants;
pub mod mutations;
mod reads;
mod scene;
mod scenes;
mod system;

use std::collections::btree_map::{BTreeMap, Entry};
use std::path::Path;
use std::process::Command;

use anyhow::Result;
use lexopt::ValueExt;
use lexopt::prelude::Long;

use crate::files::{self, Line};
use crate::rtl;

use figures::Simulated;
use model::simulate;

pub const HELP: &str = "\
cargo softcore pixels [--photons N] [--check]

Runs the pixel processor in simulation against dtof-core, bit for bit, alone and in the whole
system, and writes docs/results/bench/pixels.csv and pixels.md.

  --photons N  about so many photons in all, 10 million unless told; others write nothing
  --check      compare with the files instead of writing them";

/// Photons of a run unless others are asked for.
const PHOTONS: u64 = 10_000_000;

/// Runs the command.
pub fn run(mut parser: lexopt::Parser) -> Result<()> {
    let (mut photons, mut checks) = (PHOTONS, false);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("photons") => photons = parser.value()?.parse()?,
            Long("check") => checks = true,
            other => return Err(other.unexpected().into()),
        }
    }
    let results = run_all(photons)?;
    let latencies = system::measure()?;
    rtl::check("photon_crossing")?;
    rtl::check_two_clocks()?;
    let page = figures::page(&results, &latencies);
    println!("\n{page}");
    if checks {
        // Without the recording its scenes are missing, as was said.
        let has_recorded = results.iter().any(|of| of.scene == scenes::RECORDED);
        let recorded = format!("{},", scenes::RECORDED);
        check(&results, |line| {
            has_recorded || !line.starts_with(&recorded)
        })?;
        check(&latencies, |_| true)?;
    } else if photons == PHOTONS {
        files::write([
            files::text(&results),
            files::text(&latencies),
            (figures::DOCUMENT, page),
        ])?;
    }
    Ok(())
}

/// Runs every scene, with so many photons in all.
fn run_all(photons: u64) -> Result<Vec<Simulated>> {
    let mut simulators = BTreeMap::new();
    let mut results = Vec::new();
    for scene in scenes::all(photons)? {
        let log2 = scene.pixels_log2;
        let simulator = match simulators.entry(log2) {
            Entry::Occupied(built) => built.into_mut(),
            Entry::Vacant(place) => {
                let name = format!("pixels-{log2}");
                let size = format!("-GPIXELS_LOG2={log2}");
                place.insert(rtl::verilate("pixels", &name, Path::new(""), &[&size])?)
            }
        };
        let outcome = simulate(&mut Command::new(&*simulator), &scene)?;
        let (photons, events) = (outcome.photons, outcome.statistics.events);
        let (name, macropixels) = (scene.name, 1 << log2);
        println!(
            "{name}, {macropixels} macropixels: {photons} photons and {events} events as dtof-core"
        );
        if scene.reads.is_some() {
            println!(
                "of histograms, {} times eight bins: as dtof-core",
                outcome.bins_read
            );
        }
        results.push(Simulated {
            scene: name,
            macropixels,
            outcome,
        });
    }
    let photons: u64 = results.iter().map(|of| of.outcome.photons).sum();
    println!("pixel processor: {photons} photons as dtof-core has them");
    Ok(results)
}

/// Compares what was measured with its file.
fn check<L: Line>(measured: &[L], keeps: impl Fn(&str) -> bool) -> Result<()> {
    files::check(measured, keeps, "cargo softcore pixels")?;
    println!("{}: as measured", L::FILE);
    Ok(())
}

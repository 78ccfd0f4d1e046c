//! `cargo softcore pixels`: the pixel processor in simulation against `dtof-core`.

mod command;
mod model;
mod proof;
mod scene;
mod system;

use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;

use anyhow::{Context, Result, ensure};
use dtof_core::Statistics;
use lexopt::ValueExt;
use lexopt::prelude::{Long, Short};

use crate::rtl::verilate;

use command::Happened;
use model::{Model, Outcome, Told};
use scene::{Commands, Scene};

const HELP: &str = "\
cargo softcore pixels [--photons N] [--check]

Runs the pixel processor in simulation against dtof-core, bit for bit, alone and in the whole
system, and writes docs/results/bench/pixels.csv and pixels.md.

  --photons N  photons of the scenes in all, 10 million unless told; others write nothing
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
    prove(root, options.photons)
}

/// Runs every scene, with so many photons in all.
fn prove(root: &Path, photons: u64) -> Result<()> {
    let scenes = proof::scenes(photons)?;
    let mut simulators = BTreeMap::new();
    let (mut all, mut events) = (0, 0);
    for scene in &scenes {
        let log2 = scene.pixels_log2;
        if !simulators.contains_key(&log2) {
            let name = format!("pixels-{log2}");
            let size = format!("-GPIXELS_LOG2={log2}");
            simulators.insert(log2, verilate(root, "pixels", &name, Path::new(""), &[&size])?);
        }
        let simulator = simulators.get(&log2).context("no simulator")?;
        let outcome = simulate(&mut Command::new(simulator), scene)?;
        let Statistics {
            events: found,
            deferred,
            expired,
            saturated,
            ..
        } = outcome.statistics;
        println!(
            "{}: {} photons, {} looks ({} late), {found} events, {deferred} decisions put off, \
             {expired} exposures without an event, {saturated} photons in full counters: as dtof-core",
            scene.name, outcome.photons, outcome.looks, outcome.late
        );
        all += outcome.photons;
        events += found;
    }
    system::measure(root, photons / 40)?;
    println!("pixel processor: {all} photons and {events} events as dtof-core has them");
    Ok(())
}

/// Runs a scene in the simulation, and the same in `dtof-core`.
fn simulate(simulator: &mut Command, scene: &Scene) -> Result<Outcome> {
    let mut child = simulator
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("the simulation does not start")?;
    let mut input = BufWriter::with_capacity(1 << 16, child.stdin.take().context("no input")?);
    let mut output = BufReader::with_capacity(1 << 16, child.stdout.take().context("no output")?);
    let commands = Commands::new(scene)?;
    let writer = thread::spawn(move || -> std::io::Result<()> {
        for command in commands {
            command.write(&mut input)?;
        }
        input.flush()
    });
    let mut told = Told::new(|| Happened::read(&mut output));
    let mut model = Model::new(scene);
    let outcome = Commands::new(scene)?
        .try_for_each(|command| model.clock(&command, &mut told))
        .and_then(|()| model.end(&mut told));
    if outcome.is_err() {
        // It may wait to be read.
        let _ = child.kill();
    }
    let written = writer.join();
    let status = child.wait()?;
    let outcome = outcome.with_context(|| scene.name.clone())?;
    ensure!(status.success(), "{}: the simulation fails", scene.name);
    ensure!(
        matches!(written, Ok(Ok(()))),
        "{}: commands are not read",
        scene.name
    );
    Ok(outcome)
}

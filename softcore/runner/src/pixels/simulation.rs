//! A scene in the simulation and in `dtof-core` at the same time.

use std::io::{BufReader, BufWriter, Write};
use std::process::{Command, Stdio};
use std::thread;

use anyhow::{Context, Result, ensure};

use super::model::{Model, ModelOutcome};
use super::scene::{Commands, Scene};

/// Runs a scene in the simulation, and the same in `dtof-core`.
pub fn simulate(simulator: &mut Command, scene: &Scene) -> Result<ModelOutcome> {
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
    let mut model = Model::new(scene, &mut output)?;
    let outcome = Commands::new(scene)?
        .try_for_each(|command| model.clock(&command))
        .and_then(|()| model.end());
    if outcome.is_err() {
        // It may wait to be read.
        let _ = child.kill();
    }
    let written = writer.join();
    let status = child.wait()?;
    let outcome = outcome.with_context(|| scene.name.clone())?;
    ensure!(
        scene.reads.is_none() || outcome.bins_read > 0,
        "{}: no bins were compared",
        scene.name
    );
    ensure!(status.success(), "{}: the simulation fails", scene.name);
    ensure!(
        matches!(written, Ok(Ok(()))),
        "{}: commands are not read",
        scene.name
    );
    Ok(outcome)
}

//! The command line.

#![deny(
    clippy::print_stderr,
    reason = "a closed standard error is no reason to stop"
)]

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Asynchronous depth events from single photons.
///
/// Without a command: the demo.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate the demo scene and report its events.
    Demo(command::demo::Demo),
    /// Simulate a scene from a file.
    Simulate(Box<command::simulate::Simulate>),
    /// Turn recorded photons into events.
    ///
    /// Without --settings it first finds in the recording what `calibrate` does: the window rule, the pulse, a gate, hot
    /// pixels. Options override that. Defaults hold for what is not found, or with --settings.
    Replay(Box<command::replay::Replay>),
    /// Find the settings of a sensor from a recording or a device.
    Calibrate(Box<command::calibrate::Calibrate>),
    /// Run all methods on a recording or a scene, and recommend one.
    Compare(Box<command::compare::Compare>),
    /// Print the events of an AER file as CSV.
    Decode(command::decode::Decode),
    /// Write the events of an AER file as points or as event-camera data.
    Export(Box<command::export::Export>),
    /// Print the events of a device with a sensor as CSV, as they come.
    Monitor(Box<command::monitor::Monitor>),
    /// Find the threshold and L1 for a given rate of false alarms.
    Tune(Box<command::tune::Tune>),
    /// Show a device or a recording live in a browser on this computer.
    View(Box<command::view::View>),
}

fn main() -> ExitCode {
    dtof::run::<Cli>(|cli| match cli.command {
        None => command::demo::Demo::parse_from(["demo"]).run(),
        Some(Command::Demo(demo)) => demo.run(),
        Some(Command::Simulate(simulate)) => simulate.run(),
        Some(Command::Replay(replay)) => replay.run(),
        Some(Command::Calibrate(calibrate)) => calibrate.run(),
        Some(Command::Compare(compare)) => compare.run(),
        Some(Command::Decode(decode)) => decode.run(),
        Some(Command::Export(export)) => export.run(),
        Some(Command::Monitor(monitor)) => monitor.run(),
        Some(Command::Tune(tune)) => tune.run(),
        Some(Command::View(view)) => view.run(),
    })
}

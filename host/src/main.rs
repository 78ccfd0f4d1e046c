//! The command line.

mod command;

use std::io::{self, Write};
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
    /// Simulate a static scene and show its events.
    Demo(command::demo::Demo),
    /// Simulate a scene that a file describes.
    Simulate(Box<command::simulate::Simulate>),
    /// Turn recorded photons into events.
    Replay(Box<command::replay::Replay>),
    /// Print the events of an AER file as CSV.
    Decode(command::decode::Decode),
    /// Write the events of an AER file as points, or as an event camera's.
    Export(Box<command::export::Export>),
    /// Print the events of a device with a sensor as CSV, as they come.
    Monitor(Box<command::monitor::Monitor>),
    /// Find α and L1 for a wanted rate of false events, and say what to expect.
    Tune(Box<command::tune::Tune>),
    /// Run Monte-Carlo trials of a study into a part, or list the studies.
    Sweep(command::sweep::Sweep),
    /// Add up parts of a sweep.
    Merge(command::sweep::Merge),
    /// Make the figures of the documentation and the verdicts on the paper's claims.
    Figures(command::figures::Figures),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let done = match cli.command {
        None => command::demo::Demo::default().run(),
        Some(Command::Demo(demo)) => demo.run(),
        Some(Command::Simulate(simulate)) => simulate.run(),
        Some(Command::Replay(replay)) => replay.run(),
        Some(Command::Decode(decode)) => decode.run(),
        Some(Command::Export(export)) => export.run(),
        Some(Command::Monitor(monitor)) => monitor.run(),
        Some(Command::Tune(tune)) => tune.run(),
        Some(Command::Sweep(sweep)) => sweep.run(),
        Some(Command::Merge(merge)) => merge.run(),
        Some(Command::Figures(figures)) => figures.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads the output has seen enough.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&format!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

/// Help is printed whole; an error with its hints as one line.
fn refuse(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        return error
            .print()
            .map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS);
    }
    let text = error.to_string();
    let lines = text.lines().map(str::trim);
    let reason: Vec<&str> = lines
        .filter(|line| !line.is_empty() && !line.starts_with("Usage:"))
        .collect();
    complain(&reason.join(" "));
    ExitCode::from(2)
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// One line on standard error; if that cannot be written, nobody reads it.
fn complain(message: &str) {
    let line: Vec<&str> = message.lines().collect();
    let _ = writeln!(io::stderr(), "{}", line.join(" "));
}

//! The command line.

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
    /// Simulate a static scene and show its events.
    Demo(command::demo::Demo),
    /// Turn recorded photons into events.
    Replay(Box<command::replay::Replay>),
    /// Print the events of an AER file as CSV.
    Decode(command::decode::Decode),
    /// Print the events of a device with a sensor as CSV, as they come.
    Monitor(Box<command::monitor::Monitor>),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let done = match cli.command {
        None => command::demo::Demo::default().run(),
        Some(Command::Demo(demo)) => demo.run(),
        Some(Command::Replay(replay)) => replay.run(),
        Some(Command::Decode(decode)) => decode.run(),
        Some(Command::Monitor(monitor)) => monitor.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
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
    eprintln!("{}", reason.join(" "));
    ExitCode::from(2)
}

//! Command lines, alike in every program of this project: help is printed whole, an
//! error is one line and a failure.

pub mod arguments;
pub mod interrupt;

use std::io::{self, Write};
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use crate::rows::printable;

/// Parses the command line and runs it.
#[must_use]
pub fn run<C: Parser>(run: impl FnOnce(C) -> Result<()>) -> ExitCode {
    let done = match C::try_parse() {
        Ok(cli) => run(cli),
        Err(error) => return refuse(&error),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of the output has seen enough.
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
    complain(&format!("error: {}", reason(error)));
    ExitCode::from(2)
}

/// Why options are refused, with hints, as one line.
#[must_use]
pub fn reason(error: &clap::Error) -> String {
    let text = error.to_string();
    let lines = text.lines().map(str::trim);
    let reason: Vec<&str> = lines
        .filter(|line| !line.is_empty() && !line.starts_with("Usage:"))
        .collect();
    let reason = reason.join(" ");
    reason.strip_prefix("error: ").unwrap_or(&reason).to_owned()
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// One line on standard error; if that cannot be written, nobody reads it.
pub fn complain(message: &str) {
    let line: Vec<&str> = message.lines().collect();
    let _ = writeln!(io::stderr(), "{}", printable(&line.join(" ")));
}

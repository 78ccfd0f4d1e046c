#![doc = include_str!("../README.md")]
//! ## Command lines
//!
//! Command lines behave alike in all programs of this project: an error is one line and a failure.

pub mod interrupt;
pub mod progress;

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};

use dtof_data::options::rows::printable;
use dtof_data::options::{Refused, flag, plain};

/// Parses the command line and runs it.
#[must_use]
pub fn run<C: Parser>(run: impl FnOnce(C) -> Result<()>) -> ExitCode {
    let done = match C::try_parse() {
        Ok(cli) => run(cli),
        Err(error) => return refuse(&error, &C::command()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        // The reader has closed the output.
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            if let Some(error) = error.downcast_ref() {
                return refuse(error, &C::command());
            }
            complain(&format!(
                "error: {}",
                dtof_data::options::line(&error, &flag)
            ));
            ExitCode::FAILURE
        }
    }
}

/// The command line lacks the argument `name`.
#[must_use]
pub fn missing(name: &str, reason: &str) -> anyhow::Error {
    let refused = Refused::new(name, reason);
    clap::Error::raw(ErrorKind::MissingRequiredArgument, refused.line(&flag)).into()
}

/// Prints help, or an error with its hints in one line.
fn refuse(error: &clap::Error, command: &clap::Command) -> ExitCode {
    if !error.use_stderr() {
        return error
            .print()
            .map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS);
    }
    complain(&format!("error: {}", reason(error, command)));
    ExitCode::from(2)
}

/// What is wrong with an argument that the command, which the command line begins with, does not take.
fn unknown(argument: &str, command: &clap::Command) -> Refused {
    let name = std::env::args_os().nth(1).unwrap_or_default();
    let command = command.find_subcommand(name).unwrap_or(command);
    let flags = command.get_arguments().filter(|arg| !arg.is_hide_set());
    let names = flags.filter_map(clap::Arg::get_long);
    let names: Vec<String> = names.map(|name| name.replace('-', "_")).collect();
    if argument.starts_with('-') {
        return Refused::unknown(argument, None, names.iter().map(String::as_str));
    }
    // The value of a switch is no argument of its own.
    let given: Vec<_> = std::env::args_os().collect();
    let switch = given.windows(2).find_map(|pair| match pair {
        [flag, value] if value == "true" || value == "false" => {
            let flag = flag.to_str().filter(|flag| flag.starts_with("--"))?;
            Some(format!(": write {flag}={}", value.display()))
        }
        _ => None,
    });
    let hint = match &switch {
        Some(hint) => hint,
        None if command.get_positionals().next().is_some() => ": one file at a time",
        None if names.iter().any(|name| name == "scene") => ": a scene is given by `scene`",
        None => "",
    };
    Refused::input(format!("{} is not expected here{hint}", plain(argument)))
}

/// The reason of an error in one line.
fn reason(error: &clap::Error, command: &clap::Command) -> String {
    if let Some(refused) = refused(error, command) {
        return refused.line(&flag);
    }
    let text = error.to_string();
    let lines = text.lines().map(str::trim);
    let is_hint =
        |line: &str| line.starts_with("Usage:") || line.starts_with("For more information");
    let reason: Vec<&str> = lines
        .filter(|line| !line.is_empty() && !is_hint(line))
        .collect();
    let reason = reason.join(" ");
    reason.strip_prefix("error: ").unwrap_or(&reason).to_owned()
}

/// The error in the form that settings files and Python keywords use.
fn refused(error: &clap::Error, command: &clap::Command) -> Option<Refused> {
    let all = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => vec![key(text)],
        Some(ContextValue::Strings(texts)) => texts.iter().map(|text| key(text)).collect(),
        _ => Vec::new(),
    };
    let value = match error.get(ContextKind::InvalidValue) {
        Some(ContextValue::String(value)) => Some(value),
        _ => None,
    };
    let names = all(ContextKind::InvalidArg);
    let (first, rest) = names.split_first()?;
    let quoted = |names: &[String]| {
        let quoted = |name: &String| match name.starts_with(char::is_alphabetic) {
            true => format!("`{name}`"),
            false => name.clone(),
        };
        names.iter().map(quoted).collect::<Vec<_>>().join(", ")
    };
    Some(match error.kind() {
        ErrorKind::ValueValidation => {
            Refused::value(first, value?, std::error::Error::source(error)?.to_string())
        }
        ErrorKind::InvalidValue if value?.is_empty() => Refused::new(first, "needs a value"),
        ErrorKind::InvalidValue => {
            let reason = format!("must be one of {}", all(ContextKind::ValidValue).join(", "));
            Refused::value(first, value?, reason)
        }
        ErrorKind::UnknownArgument => {
            let Some(ContextValue::String(name)) = error.get(ContextKind::InvalidArg) else {
                return None;
            };
            unknown(name, command)
        }
        ErrorKind::ArgumentConflict => {
            let others = all(ContextKind::PriorArg);
            let reason = match others.iter().all(|other| other == first) {
                true => "is given twice".to_owned(),
                false => format!("cannot be used with {}", quoted(&others)),
            };
            Refused::new(first, reason)
        }
        ErrorKind::MissingRequiredArgument if rest.is_empty() => Refused::new(first, "is needed"),
        ErrorKind::MissingRequiredArgument => {
            Refused::input(format!("{} are needed", quoted(&names)))
        }
        _ => return None,
    })
}

/// The key of an argument as clap writes it: `--l1 <N>`, `<FILE>`.
fn key(arg: &str) -> String {
    let name = arg.split([' ', '=']).next().unwrap_or_default();
    match name.strip_prefix("--") {
        Some(name) => name.replace('-', "_"),
        None if name.starts_with(char::is_alphabetic) => format!("'{name}'"),
        None => name.to_owned(),
    }
}

/// Reads the name of a file or a folder. Refuses `-`, which often means standard input or output.
#[must_use]
pub fn path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|name| dtof_data::options::path(&name))
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// Prints one line on standard error. Errors of that are ignored.
pub fn complain(message: &str) {
    let line: Vec<&str> = message.lines().collect();
    let _ = writeln!(io::stderr(), "{}", printable(&line.join(" ")));
}

//! Options, as the command line reads them.

use std::ffi::OsString;

use anyhow::{Result, anyhow};
use clap::Args;
use dtof::cli::reason;

/// Parses `--name=value`, one an argument.
///
/// # Errors
/// What is wrong, in the line of the command line.
pub fn parse<O: Args>(arguments: Vec<OsString>) -> Result<O> {
    let command = clap::Command::new("dtof")
        .no_binary_name(true)
        .disable_help_flag(true);
    let matches = O::augment_args(command).try_get_matches_from(arguments);
    matches
        .and_then(|matches| O::from_arg_matches(&matches))
        .map_err(|error| anyhow!("{}", reason(&error)))
}

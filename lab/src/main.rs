//! The command line of the studies.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Monte-Carlo studies, and the figures and result pages made from them.
#[derive(Parser)]
#[command(version, name = "cargo lab", bin_name = "cargo lab")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run Monte-Carlo trials of a study into a part, or list the studies.
    Sweep(command::sweep::Sweep),
    /// Merge parts of a sweep.
    Merge(command::sweep::Merge),
    /// Make the figures and result pages of the documentation.
    Figures(command::figures::Figures),
}

fn main() -> ExitCode {
    dtof::run::<Cli>(|cli| match cli.command {
        Command::Sweep(sweep) => sweep.run(),
        Command::Merge(merge) => merge.run(),
        Command::Figures(figures) => figures.run(),
    })
}

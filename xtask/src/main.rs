//! `cargo xtask`: what set-up and checks need beyond cargo itself.

mod image;
mod panics;
mod source;
mod symbols;
mod toolchain;

use std::env;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};

const HELP: &str = "\
cargo xtask <command>

  setup         install what rust-toolchain.toml names and is not there yet
  check-image   link dtof-core for every target; no panic, float or allocation
  check-source  no floating-point type and no unsafe in core/src";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["setup"] => toolchain::set_up(root()?),
        ["check-image"] => image::check(root()?),
        ["check-source"] => source::check(root()?),
        ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            Ok(())
        }
        _ => bail!("which command?\n\n{HELP}"),
    }
}

/// The folder of the workspace.
fn root() -> Result<&'static Path> {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .context("xtask lies in no workspace")
}

//! `cargo xtask setup`: the pinned toolchain with its targets and components.
//!
//! rustup installs a missing toolchain by itself, unless `RUSTUP_AUTO_INSTALL=0`. It does not add
//! a target to an installed toolchain.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, anyhow, bail, ensure};
use toml::{Table, Value};

/// The toolchain of `rust-toolchain.toml`.
pub struct Toolchain {
    pub channel: String,
    pub components: Vec<String>,
    pub targets: Vec<String>,
}

impl Toolchain {
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join("rust-toolchain.toml");
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        Self::parse(&text).with_context(|| path.display().to_string())
    }

    fn parse(text: &str) -> Result<Self> {
        let file: Table = text.parse()?;
        let toolchain = file.get("toolchain").context("no [toolchain]")?;
        let list = |key: &str| {
            let names = toolchain.get(key).and_then(Value::as_array);
            let names = names.with_context(|| format!("no `{key}`"))?.iter();
            let names = names.map(|name| name.as_str().map(str::to_owned));
            let names: Option<Vec<_>> = names.collect();
            names.with_context(|| format!("`{key}` is not a list of names"))
        };
        let channel = toolchain.get("channel").and_then(Value::as_str);
        Ok(Self {
            channel: channel.context("no `channel`")?.to_owned(),
            components: list("components")?,
            targets: list("targets")?,
        })
    }

    /// The `required` names that are not in `installed`, a list from rustup. It lists most components
    /// as their name and the name of the host.
    fn missing<'a>(required: &'a [String], installed: &str) -> Vec<&'a str> {
        let is_installed = |name: &str| {
            installed.lines().any(|line| {
                let rest = line.trim().strip_prefix(name);
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
            })
        };
        let required = required.iter().map(String::as_str);
        required.filter(|name| !is_installed(name)).collect()
    }
}

/// Installs missing components and targets. Needs no network if none is missing.
pub fn set_up(root: &Path) -> Result<()> {
    let toolchain = Toolchain::read(root)?;
    let channel = &toolchain.channel;

    // Both lists fail if the toolchain is not installed: then everything is missing.
    let list = |what: &str| rustup(&[what, "list", "--installed", "--toolchain", channel]);
    let components = list("component")?.unwrap_or_default();
    let targets = list("target")?.unwrap_or_default();
    let mut missing = Toolchain::missing(&toolchain.components, &components);
    missing.extend(Toolchain::missing(&toolchain.targets, &targets));
    if missing.is_empty() {
        println!("{channel}: every component and target is installed");
        return Ok(());
    }

    println!("{channel}: installing {}", missing.join(", "));
    let mut install = vec!["toolchain", "install", channel, "--no-self-update"];
    install.extend(["--profile", "minimal"]);
    for component in &toolchain.components {
        install.extend(["--component", component]);
    }
    for target in &toolchain.targets {
        install.extend(["--target", target]);
    }
    match rustup(&install)? {
        Some(_) => Ok(()),
        None => bail!("rustup could not install {}", missing.join(", ")),
    }
}

/// The output of rustup, or `None` if it fails. Its input is empty, so it cannot ask.
fn rustup(arguments: &[&str]) -> Result<Option<String>> {
    let output = Command::new("rustup")
        .args(arguments)
        // The cargo that runs this program sets it; rust-toolchain.toml must decide.
        .env_remove("RUSTUP_TOOLCHAIN")
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| match error.kind() {
            ErrorKind::NotFound => anyhow!("rustup is missing: install it from https://rustup.rs"),
            _ => anyhow!("rustup does not start: {error}"),
        })?;
    Ok(output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned()))
}

/// Whether the running toolchain can build for `target`.
pub fn ensure_target(target: &str) -> Result<()> {
    let output = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", target])
        .output()
        .context("rustc does not start")?;
    let folder = String::from_utf8_lossy(&output.stdout);
    ensure!(
        output.status.success() && Path::new(folder.trim()).is_dir(),
        "target {target} is not installed: run `cargo xtask setup`"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::root;

    #[test]
    fn reads_the_file_of_this_workspace() {
        let toolchain = Toolchain::read(root().unwrap()).unwrap();
        assert!(toolchain.channel.starts_with("1."));
        assert!(toolchain.components.contains(&"clippy".into()));
        assert!(toolchain.targets.contains(&"thumbv6m-none-eabi".into()));
        for wrong in ["", "[toolchain]", "[toolchain]\nchannel = \"1.2.3\""] {
            assert!(Toolchain::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn finds_what_is_missing() {
        let installed = "clippy-x86_64-unknown-linux-gnu\nrust-src\nriscv32imc-unknown-none-elf\n";
        let required = ["clippy", "rustfmt", "rust-src", "riscv32i-unknown-none-elf"];
        assert_eq!(
            Toolchain::missing(&required.map(Into::into), installed),
            ["rustfmt", "riscv32i-unknown-none-elf"]
        );
    }
}

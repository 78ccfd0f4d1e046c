//! `cargo xtask hil` with the emulated Pico as the board and a script in place of probe-rs.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow hil -- --nocapture
//! ```

use std::env;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use anyhow::{Result, ensure};

use crate::emulator::free_ports;
use crate::rp2040::{NODE, NPM, install};
use crate::{enabled, root};

/// Runs the image in the last argument in the emulator. A sidecar has its serial port at `$PORT`.
const STAND_IN: &str = r#"#!/bin/sh
for image; do :; done
emulator="node $RUNNER $image"
if [ "$1" = --version ]; then echo 'probe-rs, a stand-in'; exit; fi
if [ "$BROKEN" ]; then exit 1; fi
case $1 in
run) case $image in *bench*) exec $emulator --count ;; *) exec $emulator ;; esac ;;
download) $emulator --port "$PORT" </dev/null >/dev/null 2>&1 & echo $! >"$PID" ;;
reset) sleep 1 ;;
esac
"#;

#[test]
fn a_board_is_tested_and_its_results_are_one_file() -> Result<()> {
    let Some(_alone) = enabled("cargo xtask hil", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let folder = tempfile::tempdir()?;
    let program = folder.path().join("probe-rs");
    fs::write(&program, STAND_IN)?;
    fs::set_permissions(&program, Permissions::from_mode(0o755))?;
    let [port, _] = free_ports()?;
    let pid = folder.path().join("pid");
    let paths = env::var_os("PATH").unwrap_or_default();
    let paths = [folder.path().to_owned()]
        .into_iter()
        .chain(env::split_paths(&paths));
    let mut xtask = Command::new(env!("CARGO"));
    xtask
        .args(["--locked", "xtask", "hil", "pico", "--device"])
        .arg(format!("tcp:127.0.0.1:{port}"))
        .arg("--out")
        .arg(folder.path())
        .env("PATH", env::join_paths(paths)?)
        .env("RUNNER", root().join("firmware/rp2040js/run.js"))
        .env("PORT", port.to_string())
        .env("PID", &pid)
        .current_dir(root())
        .stdin(Stdio::null());
    let tried = xtask.status()?;
    let emulator = fs::read_to_string(pid)?;
    Command::new("kill").arg(emulator.trim()).status()?;
    ensure!(tried.success(), "{tried}");
    let found = fs::read_to_string(folder.path().join("pico.md"))?;
    for text in [
        "probe-rs, a stand-in",
        "lines as in `firmware/self-test.out`",
        "| photon: AsyncPixel::count |",
        "events, all as on this computer",
        "- Stack overflow: not tried. Do: ",
        "- Watchdog: not tried. Do: ",
        "- Brown-out: not tried. Do: ",
    ] {
        ensure!(found.contains(text), "no `{text}`: {found}");
    }

    // A probe without a board.
    ensure!(!xtask.env("BROKEN", "1").status()?.success());
    let found = fs::read_to_string(folder.path().join("pico.md"))?;
    ensure!(found.matches("**failed**").count() == 3, "{found}");
    Ok(())
}

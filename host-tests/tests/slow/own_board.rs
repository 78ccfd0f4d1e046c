//! Firmware of one's own around the sidecar, `firmware/examples/own-board`: its laser goes off when its port fails, whether
//! it polls on or never again, first thing in a panic, a hard fault, a stack overflow and a reset, and by the watchdog in a
//! hang. Needs QEMU, and Node.js and npm, which installs rp2040js.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow own_board -- --nocapture
//! ```

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::emulator::{Board, Emulator, Planted, QEMU};
use crate::laser::{HOST_TIMEOUT_MS, ROUND_MS, light_over};
use crate::rp2040::{NODE, NPM, Rp2040, install};
use crate::{cargo, enabled, target_folder};

/// How long the laser is on before the fault.
const LIT_MS: f64 = 20.0;
/// How long the image goes on after it: the watchdog's second is over then. If the emulator is ended, it is the five
/// seconds for which its client waits, in which the image has at least this many milliseconds.
const DARK_MS: u32 = 1_500;
const SURELY_DARK_MS: f64 = 200.0;
/// The most milliseconds from a fault to its handler's first write.
const HANDLER_MS: f64 = 0.002;
/// From a reset of the processor to the first line of the image: its statics are set up before.
const START_MS: f64 = 0.1;
const WATCHDOG_MS: f64 = 1_001.0;
/// The most instructions from a fault to there.
const HANDLER_INSTRUCTIONS: u32 = 40;

/// Builds the image, as its README says.
fn image(features: &str, target: &str) -> Result<PathBuf> {
    let folder = target_folder().join("own-board");
    let manifest = "firmware/examples/own-board/Cargo.toml";
    let folder_name = folder.to_str().context("a path that is text")?;
    cargo(&[
        "build",
        "--quiet",
        "--release",
        "--manifest-path",
        manifest,
        "--features",
        features,
        "--target",
        target,
        "--target-dir",
        folder_name,
    ])?;
    // The next one has the same name.
    let image = folder.join(target).join("release/dtof-own-board");
    let kept = folder.join(features);
    std::fs::copy(image, &kept)?;
    Ok(kept)
}

/// How an image of the Pico went on after its fault.
fn after(image: &Path, fault: &str, polls_again: bool) -> Result<(f64, Vec<String>)> {
    let mut board = Rp2040::start_with_usb_fault(image, fault, LIT_MS, DARK_MS)?;
    let (mut client, _) = light_over(board.connect()?)?;
    // Until the device is silent.
    while client.report().is_ok() {}
    drop(client);
    // It does not read what the host has sent, so for the emulator its host is never gone.
    let done = if polls_again {
        board.stop()?
    } else {
        board.wait()?
    };
    let planted = done.planted_ms.context("no fault was planted")?;
    let last = done.laser.last_high_ms.context("the laser was never on")?;
    let (lit, dark) = (last - planted, done.end_ms - last);
    let boots = done.boots.iter().map(|boot| boot.reason.clone()).collect();
    println!(
        "own board, RP2040, {fault}: the laser is on for {lit:.4} ms, off for {dark:.0} ms; {boots:?}"
    );
    ensure!(!done.laser.is_high && dark >= SURELY_DARK_MS, "{done:?}");
    ensure!(lit > -1.0, "the laser was off before: {done:?}");
    Ok((lit, boots))
}

#[test]
fn a_port_that_fails_leaves_the_laser_of_ones_own_board_off() -> Result<()> {
    let Some(_alone) = enabled("the port of one's own board", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    // The host is not silent for long enough, nor has the watchdog run out.
    ensure!(ROUND_MS < f64::from(HOST_TIMEOUT_MS));
    for (features, boots) in [
        ("rp2040", &["power", "watchdog"][..]),
        ("rp2040,poll-again", &["power"]),
    ] {
        let image = image(features, "thumbv6m-none-eabi")?;
        let (lit, found) = after(&image, "bus-reset", boots.len() == 1)?;
        ensure!(lit <= ROUND_MS, "{features}: {lit} ms of light");
        ensure!(found == boots, "{features}: {found:?}");
    }
    Ok(())
}

#[test]
fn a_loss_of_control_switches_the_laser_of_ones_own_board_off() -> Result<()> {
    let Some(_alone) = enabled("faults of one's own board", &[QEMU, NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let pico = image("rp2040", "thumbv6m-none-eabi")?;
    for (fault, most_ms, reset) in [
        ("panic", HANDLER_MS, "forced"),
        ("fault", HANDLER_MS, "forced"),
        ("overflow-entered", HANDLER_MS, "forced"),
        ("core-reset", START_MS, "core"),
        ("hang", WATCHDOG_MS, "watchdog"),
        ("lockup", WATCHDOG_MS, "watchdog"),
        ("halt", WATCHDOG_MS, "watchdog"),
    ] {
        let (lit, boots) = after(&pico, fault, false)?;
        ensure!(lit <= most_ms, "{fault}: {lit} ms of light");
        ensure!(boots == ["power", reset], "{fault}: {boots:?}");
    }
    let image = image("an386", "thumbv7em-none-eabihf")?;
    for what in [Planted::Panic, Planted::Fault, Planted::Overflow] {
        let mut emulator = Emulator::start(Board::Mps2An386, &image, &[])?;
        let _client = light_over(emulator.connect()?)?;
        let instructions = emulator.instructions_until_dark(what, HANDLER_INSTRUCTIONS)?;
        println!("own board, AN386, {what:?}: the laser is off after {instructions} instructions");
    }
    Ok(())
}

//! The laser of the Pico's photon timer goes dark and stays dark, whatever happens to the image.
//! Needs Node.js and npm, which installs rp2040js.
//!
//! The runner records the laser's pin as it leaves the chip, over all resets.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow laser:: -- --nocapture
//! DTOF_SLOW=1 DTOF_LONG=1 cargo test … # a minute of darkness each instead of a second
//! ```

use std::env;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use dtof::device::{Client, configuration};
use dtof_link::Source;

use crate::pico::senses;
use crate::rp2040::{Done, NODE, NPM, Rp2040, image, install};
use crate::{root, skipped, stack, succeed, wanted};

/// How long a pulse is set to be: 100 ns in whole clocks.
const PULSE_NS: u64 = 104;
/// The laser's period.
const PERIOD_MS: f64 = 0.01;
/// How long the laser fires before the fault is planted. The faults that end the light at once
/// are planted as a pulse begins, and at other times of the period, the last just before a pulse.
const LIT_MS: f64 = 20.0;
const PHASES_MS: [f64; 4] = [0.0, 0.0025, 0.005, 0.0097];
/// Where the memory begins.
const RAM: u64 = 0x2000_0000;

/// A fault, and what follows from it.
struct Fault {
    kind: &'static str,
    /// Milliseconds from the fault to the end of the last pulse, at most.
    lit_ms: f64,
    /// The reason of the boot that follows.
    reset: &'static str,
}

/// The watchdog's second, and a period of the laser.
const WATCHDOG_MS: f64 = 1000.0 + PERIOD_MS;
/// The handler is entered and turns the laser off: much less than what the report and the reset
/// take, in which there would be a pulse.
const HANDLER_MS: f64 = 0.002;

const FAULTS: [Fault; 7] = [
    Fault {
        kind: "panic",
        lit_ms: HANDLER_MS,
        reset: "forced",
    },
    Fault {
        kind: "fault",
        lit_ms: HANDLER_MS,
        reset: "forced",
    },
    Fault {
        kind: "hang",
        lit_ms: WATCHDOG_MS,
        reset: "watchdog",
    },
    Fault {
        kind: "lockup",
        lit_ms: WATCHDOG_MS,
        reset: "watchdog",
    },
    // Until the image's start resets the PIO; before it paints the stack. On the chip the boot
    // ROM comes first.
    Fault {
        kind: "core-reset",
        lit_ms: 4.0,
        reset: "core",
    },
    // The registers of the hard fault find no room either: the core locks up.
    Fault {
        kind: "overflow",
        lit_ms: WATCHDOG_MS,
        reset: "watchdog",
    },
    Fault {
        kind: "overflow-entered",
        lit_ms: WATCHDOG_MS,
        reset: "",
    },
];

/// How long it has to stay dark.
fn dark_ms() -> f64 {
    if env::var_os("DTOF_LONG").is_some() {
        60_000.0
    } else {
        1000.0
    }
}

/// Lets the laser fire, and drops the connection.
fn light(mut board: Rp2040) -> Result<Done> {
    let mut client = Client::new(board.connect()?)?;
    client.configure(&configuration(&senses(), 1, 1, Source::Sensor, None)?)?;
    drop(client);
    board.wait()
}

#[test]
fn laser_record_and_resets_of_the_runner_are_right() -> Result<()> {
    let Some(_alone) = wanted("the runner of the Pico's images", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    succeed(
        Command::new(NODE)
            .arg("--test")
            .current_dir(root().join("tools/rp2040")),
    )
}

#[test]
fn laser_goes_dark_and_stays_dark_after_every_fault() -> Result<()> {
    let Some(_alone) = wanted("the laser of the Pico in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    let is_lowest = stack::Image::read(&image)?.stack.start == RAM;
    println!("fault at ms: ms until the last pulse, at most; dark for ms; longest pulse; boots");
    for fault in &FAULTS {
        if fault.kind.starts_with("overflow") && !is_lowest {
            skipped(
                fault.kind,
                "an overflow does not leave the memory: the stack is not lowest in it",
            );
            continue;
        }
        let phases = if fault.lit_ms < PERIOD_MS {
            &PHASES_MS[..]
        } else {
            &PHASES_MS[..1]
        };
        for phase in phases {
            goes_dark(&image, fault, LIT_MS + phase).with_context(|| fault.kind)?;
        }
    }
    Ok(())
}

fn goes_dark(image: &Path, fault: &Fault, fault_ms: f64) -> Result<()> {
    let &Fault {
        kind,
        lit_ms,
        reset,
    } = fault;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let for_ms = (lit_ms + dark_ms()).ceil() as u32;
    let done = light(Rp2040::start_with_fault(image, kind, fault_ms, for_ms)?)?;
    ensure!(done.success, "{done:?}");
    let laser = &done.laser;
    let planted = done.planted_ms.context("no fault is planted")?;
    let last = laser.last_high_ms.context("the laser has never fired")?;
    let (lit, dark) = (last - planted, done.end_ms - last);
    let boots: Vec<_> = done.boots.iter().map(|boot| &*boot.reason).collect();
    println!(
        "{kind} at {fault_ms}: {lit:.4}, {lit_ms}; {dark:.0}; {} ns; {boots:?}",
        laser.longest_ns
    );
    // It has fired until the fault.
    ensure!(laser.pulses >= 2000, "{done:?}");
    ensure!(lit > -2.0 * PERIOD_MS, "it was dark before: {done:?}");
    ensure!(lit <= lit_ms, "{lit} ms of light: {done:?}");
    ensure!(!laser.is_high && dark >= dark_ms(), "{done:?}");
    ensure!(laser.longest_ns <= PULSE_NS, "a long pulse: {done:?}");
    ensure!(boots.len() == 2, "{done:?}");
    ensure!(reset.is_empty() || boots[1] == reset, "{done:?}");
    ensure!(done.panicked == (kind == "panic"), "{done:?}");
    let faults = kind == "fault" || kind.starts_with("overflow");
    ensure!((done.hard_faults > 0) == faults, "{done:?}");
    Ok(())
}

#[test]
fn laser_of_an_emulated_usb_port_knows_when_its_client_goes() -> Result<()> {
    let Some(_alone) = wanted("DTR of the Pico in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    let done = light(Rp2040::start_with_usb_for(&image, 20)?)?;
    println!("{done:?}");
    let low = done.dtr_low_ms.context("DTR has not gone low")?;
    let input = done.last_input_ms.context("no byte has come")?;
    ensure!(done.success && low >= input, "{done:?}");
    ensure!(done.boots.len() == 1 && done.laser.longest_ns <= PULSE_NS);
    Ok(())
}

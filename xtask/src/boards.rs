//! `cargo xtask check-boards`: the images do in QEMU what they should.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use dtof::device::{Client, DeviceEngine};
use dtof::engine::{Engine, host_engine};
use dtof::scene;
use dtof::settings::{Settings, U8F8Number};
use dtof::source::{Geometry, PhotonSource};
use dtof_core::fixed::types::U8F8;

use crate::firmware::Board;
use crate::log;
use crate::qemu::{self, Emulator};
use crate::tools::DEFMT_PRINT;

/// Runs all of it.
pub fn check(root: &Path) -> Result<()> {
    let cannot = qemu::cannot_run(Board::Stm32F405)?;
    let image = Board::Mps2An386.sidecar(root, &[])?;
    ends(&image)?;
    // A million photons of 64 macropixels.
    let array = Geometry {
        columns: 8,
        rows: 8,
    };
    for reads_every in [0, 150] {
        let reads_every = Duration::from_millis(reads_every);
        agrees(Board::Mps2An386, &image, array, 5300, reads_every)?;
    }
    match cannot {
        Some(reason) => println!("{reason}"),
        None => {
            let image = Board::Stm32F405.sidecar(root, &["pll-off"])?;
            let array = Geometry {
                columns: 4,
                rows: 2,
            };
            agrees(Board::Stm32F405, &image, array, 200, Duration::ZERO)?;
        }
    }
    Ok(())
}

/// However the image ends, QEMU ends with it, and the reason is to be seen.
fn ends(image: &Path) -> Result<()> {
    for (word, success, message) in [
        ("exit", true, "mps2-an386 started"),
        ("panic", false, "as asked for on the command line"),
        ("fault", false, "hard fault at 0x"),
    ] {
        let (status, output) = Emulator::start(Board::Mps2An386, image, &[word])?.wait()?;
        ensure!(
            status.success() == success,
            "mps2-an386: `{word}` ends QEMU with {status}"
        );
        if !DEFMT_PRINT.is_there() {
            println!(
                "SKIPPED: the message of `{word}`: {}",
                DEFMT_PRINT.missing()
            );
            continue;
        }
        let text = log::decode(image, output)?;
        ensure!(
            text.contains(message),
            "mps2-an386: `{word}` does not log `{message}` but\n{text}"
        );
        println!("mps2-an386: `{word}` ends QEMU with {status} and is logged");
    }
    Ok(())
}

/// What decides the events: a setting at which there are many.
fn settings() -> Settings {
    Settings {
        alpha: U8F8Number(U8F8::lit("4")),
        l1: 20,
        x: 4,
        ..scene::settings(1)
    }
}

/// The demo's scene on a board and on this computer gives the same events and
/// the same counts, however seldom the host reads.
fn agrees(
    board: Board,
    image: &Path,
    geometry: Geometry,
    cycles: u16,
    reads_every: Duration,
) -> Result<()> {
    let name = board.name();
    let mut emulator = Emulator::start(board, image, &[])?;
    let start = Instant::now();
    let mut client = Client::new(emulator.connect()?).context(name)?;
    client.reads_every = reads_every;
    let settings = settings();
    let mut photons = scene::photons(geometry, &settings, cycles.into())?;
    let addresses = photons.addresses();
    let slice = photons.next_slice(cycles)?;
    let mut on_host = host_engine(&settings, &addresses)?;
    let expected = on_host.run(&slice)?;
    let mut on_board = DeviceEngine::new(client, &settings, &addresses)?;
    let events = on_board.run(&slice).context(name)?;
    ensure!(
        events == expected,
        "{name}: not the events of this computer"
    );
    let statistics = on_board.statistics();
    ensure!(
        statistics == on_host.statistics(),
        "{name}: not the counts of this computer"
    );
    let photons = statistics.photons();
    println!(
        "{name}: {photons} photons of {} macropixels, {} events, each as on this computer; \
         read every {} ms; {:.0} s, {:?}",
        addresses.len(),
        events.len(),
        reads_every.as_millis(),
        start.elapsed().as_secs_f64(),
        on_board.report().link,
    );
    emulator.stop()?;
    Ok(())
}

//! `cargo xtask check-boards`: the images do in QEMU what they should.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use dtof::device::monitor;
use dtof::device::{Client, DeviceEngine, configuration};
use dtof::engine::settings::Settings;
use dtof::engine::{Engine, host::host_engine};
use dtof::input::source::{Geometry, PhotonSource};
use dtof::simulate::scene;
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{Count, PaperRule, WindowRule};
use dtof_link::{FaultRecord, Source};

use crate::firmware::{Board, Sensor};
use crate::log;
use crate::qemu::{self, Emulator, End};
use crate::tools::DEFMT_PRINT;
use crate::{stack, stack_bound};

/// Runs all of it.
pub fn check(root: &Path) -> Result<()> {
    let cannot = qemu::cannot_run(Board::Stm32F405)?;
    let board = Board::Mps2An386;
    let image = board.sidecar(root, &[])?;
    let mut used = ends(board, &image)?;
    // A million photons of 64 macropixels.
    let array = Geometry {
        columns: 8,
        rows: 8,
    };
    for (settings, reads_every) in [(settings(), 0), (with_windows(), 150)] {
        let reads_every = Duration::from_millis(reads_every);
        used.push(agrees(board, &image, &settings, array, 5300, reads_every)?);
    }
    used.push(senses(board, &image)?);
    stack::check(board, &image, &used)?;
    match cannot {
        Some(reason) => println!("{reason}"),
        None => {
            let board = Board::Stm32F405;
            let image = board.sidecar(root, &["pll-off"])?;
            let array = Geometry {
                columns: 4,
                rows: 2,
            };
            let used = [
                agrees(board, &image, &settings(), array, 200, Duration::ZERO)?,
                agrees(board, &image, &with_windows(), array, 200, Duration::ZERO)?,
                senses(board, &image)?,
            ];
            stack::check(board, &image, &used)?;
            for sensor in Sensor::ALL {
                let image = board.sidecar(root, &["pll-off", sensor.feature()])?;
                let used = says_unplugged(board, &image, sensor, array)?;
                stack::check(board, &image, &[used])?;
            }
        }
    }
    Ok(())
}

/// However the image ends, QEMU ends with it, and the reason is to be seen. Gives
/// the bytes of stack each time used.
fn ends(board: Board, image: &Path) -> Result<Vec<u64>> {
    let name = board.name();
    let needed = stack_bound::of_image(image)?;
    let mut used = Vec::new();
    for (word, success, message) in [
        ("exit", true, "mps2-an386 started"),
        ("panic", false, "as asked for on the command line"),
        ("fault", false, "hard fault at 0x"),
    ] {
        let End {
            status,
            output,
            stack,
        } = Emulator::start(board, image, &[word])?.wait()?;
        // It may happen where most of the stack is in use.
        ensure!(
            needed + stack <= stack::RESERVE,
            "{name}: no room to report the end by `{word}`"
        );
        used.push(stack);
        ensure!(
            status.success() == success,
            "{name}: `{word}` ends QEMU with {status}"
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
            "{name}: `{word}` does not log `{message}` but\n{text}"
        );
        println!(
            "{name}: `{word}` ends QEMU with {status} and is logged; \
             {stack} bytes of stack"
        );
    }
    Ok(used)
}

/// What decides the events: a setting at which there are many.
fn settings() -> Settings {
    Settings {
        rule: PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into(),
        l1: 20,
        x: 4,
        ..scene::settings(1)
    }
}

/// The other rule and the other estimator.
fn with_windows() -> Settings {
    Settings {
        rule: WindowRule::new(2, U4F12::lit("4.5"), Count::saturating(5))
            .unwrap()
            .into(),
        sigma_bins: Some(U8F8::lit("0.55")),
        ..settings()
    }
}

/// The demo's scene on a board and on this computer gives the same events and
/// the same counts, whatever the rule and however seldom the host reads. Gives the bytes of stack used.
fn agrees(
    board: Board,
    image: &Path,
    settings: &Settings,
    geometry: Geometry,
    cycles: u16,
    reads_every: Duration,
) -> Result<u64> {
    let name = board.name();
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?).context(name)?;
    client.reads_every = reads_every;
    let decided = decides_alike(client, settings, geometry, cycles).context(name)?;
    let stack = emulator.stop()?;
    println!(
        "{name}: {decided}; read every {} ms; {stack} bytes of stack",
        reads_every.as_millis()
    );
    Ok(stack)
}

/// What the device makes of the demo's photons is what this computer does. Says
/// how much that was.
fn decides_alike(
    client: Client,
    settings: &Settings,
    geometry: Geometry,
    cycles: u16,
) -> Result<String> {
    let start = Instant::now();
    let mut photons = scene::photons(geometry, settings, cycles.into())?;
    let addresses = photons.addresses();
    let slice = photons.next_slice(cycles)?;
    let mut on_host = host_engine(settings, &addresses)?;
    let expected = on_host.run(&slice)?;
    let mut on_board = DeviceEngine::new(client, settings, &addresses)?;
    let events = on_board.run(&slice)?;
    ensure!(events == expected, "not the events of this computer");
    let statistics = on_board.statistics();
    ensure!(
        statistics == on_host.statistics(),
        "not the counts of this computer"
    );
    Ok(format!(
        "{} photons of {} macropixels, {} events, each as on this computer; {:.0} s, {:?}",
        statistics.photons(),
        addresses.len(),
        events.len(),
        start.elapsed().as_secs_f64(),
        on_board.report().link,
    ))
}

/// The device decides on photons of its own. Gives the bytes of stack used.
fn senses(board: Board, image: &Path) -> Result<u64> {
    let name = board.name();
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?).context(name)?;
    let (mut events, mut statistics) = (Vec::new(), Vec::new());
    monitor::monitor(
        &mut client,
        &monitor::Task {
            settings: &settings(),
            pixels: 16,
            dynamic_depth: None,
        },
        |elapsed| elapsed >= Duration::from_secs(3),
        &mut monitor::Outputs {
            events: &mut events,
            statistics: &mut statistics,
            map: None,
            recording: None,
        },
    )
    .context(name)?;
    // Less their header.
    let events = events.split(|&byte| byte == b'\n').count() - 2;
    ensure!(events > 0, "{name}: no event of the simulated sensor");
    let stack = emulator.stop()?;
    println!("{name}: {events} events of the simulated sensor; {stack} bytes of stack");
    Ok(stack)
}

/// What a sensor that is not there is taken for. The emulator has no pins, so that
/// all of them read as zeros: a TDC7200 that does not answer, and an I²C bus that
/// nothing pulls up. On a real board its resistors pull it up, and both are "no
/// answer".
fn unplugged(sensor: Sensor) -> FaultRecord {
    match sensor {
        Sensor::Tdc7200 => FaultRecord::NoAnswer,
        Sensor::Tmf882x => FaultRecord::Bus,
    }
}

/// The image of a sensor with nothing connected says so, and decides on photons of
/// the link afterwards. Gives the bytes of stack used.
fn says_unplugged(board: Board, image: &Path, sensor: Sensor, array: Geometry) -> Result<u64> {
    let name = format!("{} with {}", board.name(), sensor.name());
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?).with_context(|| name.clone())?;
    let pixels = u16::try_from(array.addresses())?;
    let about = client
        .sensor()?
        .with_context(|| format!("{name}: no sensor"))?;
    let mut wanted = settings();
    if let Some(bin_width) = about.bin_width {
        wanted.bin_width_ps = bin_width;
    }
    client.configure(&configuration(&wanted, pixels, Source::Sensor, None)?)?;
    let since = Instant::now();
    let report = loop {
        let report = client.report().with_context(|| name.clone())?;
        if report.sensor_errors >= 10 {
            break report;
        }
        ensure!(
            since.elapsed() < Duration::from_secs(10),
            "{name}: a missing sensor is not noticed"
        );
    };
    let fault = FaultRecord::from_number(report.last_sensor_error);
    let fault = fault.with_context(|| format!("{name}: no reason for {report:?}"))?;
    let expected = unplugged(sensor);
    ensure!(fault == expected, "{name}: \"{fault}\", not \"{expected}\"");
    ensure!(
        report.statistics.photons() == 0,
        "{name}: photons without a sensor"
    );
    let decided = decides_alike(client, &settings(), array, 100).with_context(|| name.clone())?;
    let stack = emulator.stop()?;
    println!("{name} unplugged: \"{fault}\"; then {decided}; {stack} bytes of stack");
    Ok(stack)
}

//! Runs the images in QEMU and measures their stack. Needs
//! `qemu-system-arm`, of version 7.2 for `stm32f405`, and `defmt-print`.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow boards -- --nocapture
//! ```

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{fs, thread};

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    Array, BlockLevel, Count, EchoNumber, Neighbours, PaperRule, PixelAddress, WindowRule,
};
use dtof_data::photons::source::PhotonSource;
use dtof_device::{Client, DeviceEngine, HostTimeout, Task, monitor};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_light::demo;
use dtof_light::effects::tdc::Tdc;
use dtof_link::{AdaptiveBinning, FaultRecord, Source};

use crate::emulator::{Board, Emulator, End, Laser, Overflow, QEMU};
use crate::{dtof, enabled, histograms, root, skipped, stack, succeed, target_folder, version};

/// Decodes the log of an image.
const DEFMT_PRINT: &str = "defmt-print";

/// The QEMU that runs `stm32f405`. QEMU 10, for instance, ends at a reset of the clocks.
const KNOWN: &str = "version 7.2.";

/// Bytes of the stack of each board.
const SIZE: u64 = 19 * 1024;

/// The most words of statics that a report may change: the log and the clock. A stack overflow into
/// the statics changes thousands.
const CHANGED: usize = 100;

#[test]
fn mps2_an386_decides_as_this_computer_and_keeps_to_its_stack() -> Result<()> {
    let Some(_alone) = enabled("mps2-an386 in QEMU", &[QEMU, DEFMT_PRINT]) else {
        return Ok(());
    };
    let board = Board::Mps2An386;
    let image = board.image(&[])?;
    let mut used = ends(board, &image)?;
    // A million photons of 64 macropixels.
    let array = Array::new(8, 8).unwrap();
    for (settings, cycles, reads_every) in [
        (settings(), 5300, 0),
        (with_windows(), 5300, 150),
        (with_all(), 2000, 0),
        (with_all(), 500, 150),
        (with_dead_time(), 2000, 0),
        (once_per_bin(), 1000, 0),
    ] {
        let reads_every = Duration::from_millis(reads_every);
        used.push(agrees(
            board,
            &image,
            &settings,
            array,
            cycles,
            reads_every,
        )?);
    }
    // No side of the array is a multiple of a block's side.
    let array = Array::new(5, 3).unwrap();
    used.push(agrees(
        board,
        &image,
        &with_all(),
        array,
        2000,
        Duration::ZERO,
    )?);
    used.push(senses(board, &image)?);
    stack::check(&image, &used)?;
    tests_itself(board)
}

/// 800 macropixels in 192 KiB.
#[test]
fn mps2_an386_with_counters_of_8_bits_decides_as_this_computer() -> Result<()> {
    let Some(_alone) = enabled("counters of 8 bits on mps2-an386", &[QEMU]) else {
        return Ok(());
    };
    let board = Board::Mps2An386;
    let image = board.image(&["--count8"])?;
    let settings = Settings {
        counter_bits: 8,
        ..settings()
    };
    let with_neighbours = Settings {
        counter_bits: 8,
        ..with_windows().configured(|array| array.neighbours = Neighbours::new(8))
    };
    let array = Array::new(40, 20).unwrap();
    for settings in [settings, with_neighbours] {
        let used = agrees(board, &image, &settings, array, 200, Duration::ZERO)?;
        // Of 16 KiB; a panic's report takes up to 7.
        ensure!(used <= 9 * 1024, "{used} bytes of stack");
    }
    // This computer refuses what the image does not have.
    let mut emulator = Emulator::start(board, &image, &[])?;
    let client = Client::new(emulator.connect()?)?;
    let wide = Settings {
        counter_bits: 10,
        ..with_windows()
    };
    let addresses = [PixelAddress::new(0)];
    let engine = DeviceEngine::new(client, &wide, Array::new(1, 1).unwrap(), &addresses);
    let refused = engine.err().context("10 bits are not refused")?;
    let expected = "counter_bits 10: the pixels of this device have counters of 8 bits";
    ensure!(refused.to_string() == expected, "{refused}");
    Ok(())
}

#[test]
#[ignore = "takes minutes: `.ci/long boards` runs it"]
fn stm32f405_decides_as_this_computer_and_keeps_to_its_stack() -> Result<()> {
    let test = "stm32f405 in QEMU";
    let Some(_alone) = enabled(test, &[QEMU, DEFMT_PRINT]) else {
        return Ok(());
    };
    if !is_known(test) {
        return Ok(());
    }
    let board = Board::Stm32F405;
    let image = board.image(&[])?;
    let array = Array::new(4, 2).unwrap();
    let used = [
        agrees(board, &image, &settings(), array, 200, Duration::ZERO)?,
        agrees(board, &image, &with_windows(), array, 200, Duration::ZERO)?,
        agrees(board, &image, &with_all(), array, 400, Duration::ZERO)?,
        agrees(board, &image, &with_dead_time(), array, 400, Duration::ZERO)?,
        agrees(board, &image, &once_per_bin(), array, 1200, Duration::ZERO)?,
        senses(board, &image)?,
    ];
    stack::check(&image, &used)?;
    overflows(board, &image)?;
    // The emulated pins all read as zero: a TDC7200 that does not answer, an I²C bus without
    // pull-up resistors, and a TMF8829 on SPI that never gets ready. On a real board the first two give
    // "no answer", and the third reads as ones: "wrong chip or program".
    for (sensor, fault) in [
        ("tdc7200", FaultRecord::NoAnswer),
        ("tmf8829", FaultRecord::Bus),
        ("tmf8829-spi", FaultRecord::Rejected),
        ("tmf882x", FaultRecord::Bus),
    ] {
        let image = board.image(&[sensor])?;
        let used = reports_unplugged(board, &image, fault, array).context(sensor)?;
        stack::check(&image, &[used])?;
    }
    tests_itself(board)
}

#[test]
fn the_demo_on_an_emulated_device_gives_the_same_files() -> Result<()> {
    let Some(_alone) = enabled("the demo on mps2-an386", &[QEMU]) else {
        return Ok(());
    };
    let image = Board::Mps2An386.image(&[])?;
    let dtof = dtof()?;
    let folder = target_folder().join("demo");
    let demo = |name: &str| {
        let mut demo = Command::new(&dtof);
        demo.args(["demo", "--array", "8x8", "--cycles", "500", "--quiet"]);
        demo.arg("--out").arg(folder.join(name));
        demo
    };
    succeed(&mut demo("host"))?;
    succeed(
        demo("device")
            .args(["--device", "qemu", "--image"])
            .arg(image),
    )?;
    for file in ["events.csv", "events.aer"] {
        let [of_host, of_device] =
            ["host", "device"].map(|name| fs::read(folder.join(name).join(file)));
        let of_host = of_host?;
        ensure!(
            !of_host.is_empty() && of_host == of_device?,
            "{file} differs"
        );
    }
    Ok(())
}

/// Whether this QEMU runs `stm32f405`. Prints the reason if it does not.
pub fn is_known(test: &str) -> bool {
    let version = version(QEMU).unwrap_or_default();
    let is_known = version.contains(KNOWN);
    if !is_known {
        let first = version.lines().next().unwrap_or_default();
        skipped(
            test,
            &format!("known to run in QEMU {KNOWN}x, this is {first}"),
        );
    }
    is_known
}

/// The self-test calls through function pointers, so its stack has no bound and is only measured.
fn tests_itself(board: Board) -> Result<()> {
    let image = board.image(&["self-test"])?;
    let End {
        status,
        output,
        stack,
        ..
    } = Emulator::start(board, &image, &[])?.wait()?;
    ensure!(status.success(), "the self-test ends QEMU with {status}");
    let expected = fs::read(root().join("firmware/self-test.out"))?;
    ensure!(output == expected, "differs from firmware/self-test.out");
    ensure!(stack <= stack::MOST, "{stack} bytes of stack");
    println!("{board:?}: the self-test uses {stack} bytes of stack");
    Ok(())
}

/// For each way that the image ends: QEMU ends, the log has the reason, and the laser is off. Returns
/// the bytes of stack used, except for the overflow.
fn ends(board: Board, image: &Path) -> Result<Vec<u64>> {
    let mut used = Vec::new();
    for (word, success, message) in [
        ("exit", true, "mps2-an386 started"),
        ("panic", false, "requested on the command line"),
        ("fault", false, "hard fault at 0x"),
        ("overflow", false, "stack overflow"),
    ] {
        let End {
            status,
            output,
            stack,
            laser,
        } = Emulator::start(board, image, &[word])?.wait()?;
        if word == "overflow" {
            ensure!(stack == SIZE, "`{word}`: {stack} bytes of stack");
        } else {
            ensure!(stack <= stack::MOST, "`{word}`: {stack} bytes of stack");
            used.push(stack);
        }
        ensure!(
            status.success() == success,
            "`{word}` ends QEMU with {status}"
        );
        let text = log(image, output)?;
        ensure!(
            text.contains(message),
            "`{word}` does not log `{message}` but\n{text}"
        );
        match laser {
            None => ensure!(word == "exit", "`{word}`: the laser was never on"),
            Some(Laser { is_on, changed }) => {
                ensure!(!is_on, "`{word}` leaves the laser on");
                ensure!(changed <= CHANGED, "`{word}` changes {changed} words");
            }
        }
        println!(
            "`{word}` ends QEMU with {status} and is logged; \
             {stack} bytes of stack; {laser:?}"
        );
    }
    Ok(used)
}

/// An image whose stack overflows logs it, does not damage its statics, resets the board, and logs
/// the reason of the restart. `enable` has the pin of the sensor.
fn overflows(board: Board, image: &Path) -> Result<()> {
    let Overflow { logs, changed } = Emulator::start(board, image, &[])?.overflow()?;
    let [before, after] = logs.map(|bytes| log(image, bytes));
    let (before, after) = (before?, after?);
    ensure!(before.contains("stack overflow"), "it logs\n{before}");
    ensure!(
        after.contains("started: Fault"),
        "after the reset it logs\n{after}"
    );
    ensure!(changed <= CHANGED, "{changed} words change");
    println!(
        "{board:?}: a stack overflow is logged and resets it; {changed} words of statics changed"
    );
    Ok(())
}

/// Decodes the log of an image.
fn log(image: &Path, bytes: Vec<u8>) -> Result<String> {
    let mut decoder = Command::new(DEFMT_PRINT);
    let decoder = decoder.arg("-e").arg(image);
    let decoder = decoder.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut decoder = decoder.spawn().context("defmt-print does not start")?;
    let mut stdin = decoder.stdin.take().context("no input of defmt-print")?;
    // Its exit status shows if it ended early.
    let writer = thread::spawn(move || stdin.write_all(&bytes));
    let output = decoder.wait_with_output()?;
    let _ = writer.join();
    ensure!(output.status.success(), "defmt-print: {}", output.status);
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Settings with many events.
pub fn settings() -> Settings {
    Settings::static_scene(1).configured(|array| {
        array.rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into();
        array.l1 = 20;
        array.x = 4;
    })
}

/// The other rule and the other estimator.
fn with_windows() -> Settings {
    settings().for_pulse(U8F8::lit("0.55")).configured(|array| {
        array.rule = WindowRule::new(2, U4F12::lit("4.5"), Count::saturating(5))
            .unwrap()
            .into();
    })
}

/// Blocks of three levels, tracking and two echoes as well.
pub fn with_all() -> Settings {
    with_windows()
        .for_pulse(U8F8::lit("1"))
        .configured(|array| {
            array.binning = Some(AdaptiveBinning {
                levels: BlockLevel::MAX,
                patience: 20,
            });
            array.tracking = true;
            array.echoes = EchoNumber::new(2).unwrap();
            array.echo_wait = 4;
            array.l2 = 300;
        })
}

/// A TDC that is dead for 20 bins after each photon, with tracking and two echoes.
pub fn with_dead_time() -> Settings {
    with_all().configured(|array| {
        array.binning = None;
        array.dead_time = Some(20);
    })
}

/// Blocks, and photons that count once per bin.
pub fn once_per_bin() -> Settings {
    with_all().configured(|array| array.once_per_bin = true)
}

/// A board and this computer find the same events and counts in the demo's scene, for every rule and
/// for slow hosts. Returns the bytes of
/// stack used.
fn agrees(
    board: Board,
    image: &Path,
    settings: &Settings,
    array: Array,
    cycles: u16,
    reads_every: Duration,
) -> Result<u64> {
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?)?;
    client.reads_every = reads_every;
    let decided = decides_alike(client, settings, array, cycles)?;
    let stack = emulator.stop()?;
    println!(
        "{board:?}: {decided}; read every {} ms; {stack} bytes of stack",
        reads_every.as_millis()
    );
    Ok(stack)
}

/// The device and this computer find the same events in the demo's photons. Returns a summary.
pub fn decides_alike(
    client: Client,
    settings: &Settings,
    array: Array,
    cycles: u16,
) -> Result<String> {
    let start = Instant::now();
    let mut scene = demo::scene()?;
    scene.size = [array.columns(), array.rows()];
    // The photons of such a TDC.
    let dead_time_bins = (settings.dead_time() > 0).then_some(settings.dead_time());
    scene.effects.tdc = dead_time_bins.map(|bins| Tdc {
        dead_time_bins: Some(bins),
        ..Tdc::default()
    });
    let mut photons = scene.photons(settings.seed, cycles.into())?;
    let addresses = photons.addresses();
    let slice = photons.next_slice(cycles)?;
    let mut on_host = host_engine(settings, array, &addresses)?;
    let expected = on_host.run(&slice)?;
    let mut on_board = DeviceEngine::new(client, settings, array, &addresses)?;
    let events = on_board.run(&slice)?;
    ensure!(events == expected, "the events differ from this computer's");
    let statistics = on_board.statistics();
    ensure!(
        statistics == on_host.statistics(),
        "the counts differ from this computer's"
    );
    let [pixels, blocks] = statistics;
    ensure!(!events.is_empty(), "no events");
    ensure!(
        settings.configuration.once_per_bin == (pixels.repeated > 0),
        "{} photons in a bin that had one",
        pixels.repeated
    );
    ensure!(
        settings.configuration.binning.is_some() == (blocks.events > 0),
        "{} events of blocks",
        blocks.events
    );
    Ok(format!(
        "{} photons of {} macropixels, {} events, {} of them of blocks, each as on this computer; \
         {:.0} s, {:?}",
        pixels.photons(),
        addresses.len(),
        events.len(),
        blocks.events,
        start.elapsed().as_secs_f64(),
        on_board.report().link,
    ))
}

/// The device finds events in simulated photons of its own. Returns the bytes of stack used.
fn senses(board: Board, image: &Path) -> Result<u64> {
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?)?;
    let (mut events, mut statistics) = (Vec::new(), Vec::new());
    monitor::monitor(
        &mut client,
        &Task {
            settings: &settings(),
            pixels: 16,
            columns: 4,
            dynamic_depth: None,
            host_timeout: HostTimeout::default(),
        },
        |elapsed| elapsed >= Duration::from_secs(3),
        &mut monitor::Outputs {
            events: &mut events,
            statistics: &mut statistics,
            recording: None,
            masked: 0,
        },
    )?;
    // Without the header.
    let events = events.split(|&byte| byte == b'\n').count() - 2;
    ensure!(events > 0, "no event of the simulated sensor");
    histograms::are_those_of_the_scene(&mut client, &settings())?;
    let stack = emulator.stop()?;
    println!("{board:?}: {events} events of the simulated sensor; {stack} bytes of stack");
    Ok(stack)
}

/// Without a connected sensor, the image reports the fault, and afterwards processes photons from the
/// link. Returns the bytes of stack used.
fn reports_unplugged(
    board: Board,
    image: &Path,
    expected: FaultRecord,
    array: Array,
) -> Result<u64> {
    let mut emulator = Emulator::start(board, image, &[])?;
    let mut client = Client::new(emulator.connect()?)?;
    let pixels = u16::try_from(array.pixels())?;
    let sensor = client.sensor()?.context("no sensor")?;
    let mut settings_of_sensor = settings();
    if let Some(bin_width) = sensor.bin_width {
        settings_of_sensor.configuration.bin_width_ps = bin_width;
    }
    let task = Task {
        settings: &settings_of_sensor,
        pixels,
        columns: pixels.into(),
        dynamic_depth: None,
        host_timeout: HostTimeout::default(),
    };
    client.configure(&task.configuration(Source::Sensor)?)?;
    let since = Instant::now();
    let report = loop {
        let report = client.report()?;
        if report.sensor_errors >= 10 {
            break report;
        }
        ensure!(
            since.elapsed() < Duration::from_secs(10),
            "the missing sensor was not reported"
        );
    };
    let fault = FaultRecord::from_number(report.last_sensor_error);
    let fault = fault.with_context(|| format!("no reason for {report:?}"))?;
    ensure!(fault == expected, "\"{fault}\", not \"{expected}\"");
    ensure!(report.statistics.photons() == 0, "photons without a sensor");
    let decided = decides_alike(client, &settings(), array, 100)?;
    let stack = emulator.stop()?;
    println!("unplugged: \"{fault}\"; then {decided}; {stack} bytes of stack");
    Ok(stack)
}

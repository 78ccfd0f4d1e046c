//! The laser of the Pico's photon timer goes off and stays off after every fault, and no image has pulses beyond the
//! limits. Needs Node.js and npm, which installs rp2040js.
//!
//! The runner records the laser's pin as it leaves the chip, over all resets.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow laser:: -- --nocapture
//! DTOF_SLOW=1 DTOF_LONG=1 cargo test … # off for a minute each instead of a second
//! ```

use std::env;
use std::io::{self, BufRead, BufReader, ErrorKind};
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use dtof_device::{Client, HostTimeout, Port, Stopped, Task};
use dtof_link::{Report, Source, StopReason};

use crate::pico::senses;
use crate::rp2040::{Done, NODE, NPM, Rp2040, image, install, refusal};
use crate::{dtof, enabled, root, stack, succeed};

/// The pulse length of the image as it comes.
const PULSE_NS: u64 = 16;
/// The laser's period.
const PERIOD_MS: f64 = 0.01;
/// How long the laser fires before the fault. Faults that switch the laser off at once are planted
/// at the start of a pulse and at other times of the period, the last just before a pulse.
const LIT_MS: f64 = 20.0;
const PHASES_MS: [f64; 4] = [0.0, 0.0025, 0.005, 0.0097];
/// The start of the RAM.
const RAM: u64 = 0x2000_0000;

/// The host timeout here; the default would take a minute of emulation.
pub const HOST_TIMEOUT_MS: u16 = 300;
/// The round of the main loop that stops the sensor, and the round of the keep-alive before it.
pub const ROUND_MS: f64 = 2.0;

/// A fault and its consequences.
struct Fault {
    kind: &'static str,
    /// The most milliseconds from the fault to the end of the last pulse.
    lit_ms: f64,
    /// The reason of the next boot.
    reset: &'static str,
    /// The reason that the device then reports to its host.
    reported: StopReason,
}

/// The watchdog's second, and a period of the laser.
const WATCHDOG_MS: f64 = 1000.0 + PERIOD_MS;
/// The handler turns the laser off at once. The report and the reset take much longer and would
/// contain a pulse. The start of the image resets the PIO just as fast.
const HANDLER_MS: f64 = 0.002;

const fn fault(
    kind: &'static str,
    lit_ms: f64,
    reset: &'static str,
    reported: StopReason,
) -> Fault {
    Fault {
        kind,
        lit_ms,
        reset,
        reported,
    }
}

const FAULTS: [Fault; 9] = [
    fault("panic", HANDLER_MS, "forced", StopReason::Panic),
    fault("fault", HANDLER_MS, "forced", StopReason::Fault),
    fault("hang", WATCHDOG_MS, "watchdog", StopReason::Watchdog),
    fault("lockup", WATCHDOG_MS, "watchdog", StopReason::Watchdog),
    // By a debugger.
    fault("halt", WATCHDOG_MS, "watchdog", StopReason::Watchdog),
    // The current millisecond still feeds the watchdog in the next round.
    fault(
        "clock",
        WATCHDOG_MS + ROUND_MS,
        "watchdog",
        StopReason::Watchdog,
    ),
    // On the chip, the boot ROM runs before the image.
    fault("core-reset", HANDLER_MS, "core", StopReason::Reset),
    // The stack has no room for the registers of the hard fault: the core locks up, or enters the
    // handler without them.
    fault("overflow", WATCHDOG_MS, "watchdog", StopReason::Watchdog),
    fault("overflow-entered", HANDLER_MS, "forced", StopReason::Fault),
];

/// How long the laser must stay off, in milliseconds.
fn dark_ms() -> f64 {
    if env::var_os("DTOF_LONG").is_some() {
        60_000.0
    } else {
        1000.0
    }
}

/// A line that can be cut, as if the program at its end were killed.
struct Cut {
    port: Box<dyn Port>,
    is_cut: Arc<AtomicBool>,
}

impl Cut {
    fn checked(&mut self) -> io::Result<&mut dyn Port> {
        if self.is_cut.load(Ordering::Relaxed) {
            return Err(ErrorKind::BrokenPipe.into());
        }
        Ok(&mut *self.port)
    }
}

impl Port for Cut {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.checked()?.send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.checked()?.receive(bytes)
    }
}

/// A host that has started the laser, and the switch that cuts its line.
fn light(board: &mut Rp2040) -> Result<(Client, Arc<AtomicBool>)> {
    let port = board.connect()?;
    light_over(port)
}

/// The same over a port.
pub fn light_over(port: Box<dyn Port>) -> Result<(Client, Arc<AtomicBool>)> {
    let is_cut = Arc::new(AtomicBool::new(false));
    let mut client = Client::new(Box::new(Cut {
        port,
        is_cut: is_cut.clone(),
    }))?;
    let timeout = HostTimeout::from_milliseconds(HOST_TIMEOUT_MS).context("no timeout")?;
    let task = Task {
        settings: &senses(),
        pixels: 1,
        columns: 1,
        dynamic_depth: None,
        host_timeout: timeout,
    };
    client.configure(&task.configuration(Source::Sensor)?)?;
    Ok((client, is_cut))
}

/// The milliseconds for which the laser has fired after `from`, and for which it has been off since.
/// Fails if a pulse had the wrong length.
fn dark_since(from: f64, done: &Done) -> Result<(f64, f64)> {
    let laser = &done.laser;
    let last = laser.last_high_ms.context("the laser never fired")?;
    let (lit, dark) = (last - from, done.end_ms - last);
    ensure!(done.success, "{done:?}");
    ensure!(laser.pulses >= 1000, "{done:?}");
    ensure!(!laser.is_high && dark >= dark_ms(), "{done:?}");
    ensure!(laser.longest_ns <= PULSE_NS, "a long pulse: {done:?}");
    Ok((lit, dark))
}

#[test]
fn laser_record_and_resets_of_the_runner_are_right() -> Result<()> {
    let Some(_alone) = enabled("the runner of the Pico's images", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    succeed(
        Command::new(NODE)
            .arg("--test")
            .current_dir(root().join("firmware/rp2040js")),
    )
}

/// 1 µs and 2 %, and 8 ns more.
#[test]
fn laser_pulses_beyond_the_limits_are_not_compiled() -> Result<()> {
    let Some(_alone) = enabled("images with pulses beyond the limits", &[]) else {
        return Ok(());
    };
    for (within, beyond, reason) in [
        ((20_000, 1000), (20_000, 1008), "longer than 1000 ns"),
        ((100_000, 200), (100_000, 208), "more than 2 % of the time"),
    ] {
        let refused = refusal(within)?;
        ensure!(refused.is_none(), "{within:?}: {refused:?}");
        let refused = refusal(beyond)?.with_context(|| format!("an image of {beyond:?}"))?;
        ensure!(refused.contains(reason), "{beyond:?}: {refused}");
    }
    Ok(())
}

#[test]
fn laser_goes_dark_and_stays_dark_after_every_fault() -> Result<()> {
    let Some(_alone) = enabled("the laser of the Pico in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    ensure!(stack::Image::read(&image)?.stack.start == RAM);
    println!("fault at ms: ms until the last pulse, at most; off for ms; longest pulse; boots");
    for fault in &FAULTS {
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
        reported,
    } = fault;
    let for_ms = whole(lit_ms + dark_ms());
    let mut board = Rp2040::start_with_fault(image, kind, fault_ms, for_ms)?;
    let (mut client, is_cut) = light(&mut board)?;
    // Waits until the device has restarted. A second of the watchdog may take the emulator longer than
    // a client waits for an answer.
    let start = Instant::now();
    let lost = loop {
        match client.exchange() {
            Err(lost) if lost.is::<Stopped>() => break format!("{lost:#}"),
            _ => ensure!(start.elapsed() < Duration::from_secs(120), "no reset"),
        }
    };
    let expected =
        format!("the device has been restarted ({reported}) and has forgotten this session");
    ensure!(lost == expected, "{lost}");
    is_cut.store(true, Ordering::Relaxed);
    drop(client);
    let done = board.wait()?;
    let planted = done.planted_ms.context("no fault is planted")?;
    let (lit, dark) = dark_since(planted, &done)?;
    let boots: Vec<_> = done.boots.iter().map(|boot| &*boot.reason).collect();
    println!(
        "{kind} at {fault_ms}: {lit:.4}, {lit_ms}; {dark:.0}; {} ns; {boots:?}",
        done.laser.longest_ns
    );
    ensure!(lit > -2.0 * PERIOD_MS, "the laser was off before: {done:?}");
    ensure!(lit <= lit_ms, "{lit} ms of light: {done:?}");
    ensure!(boots == ["power", reset], "{done:?}");
    ensure!(done.panicked == (kind == "panic"), "{done:?}");
    let faults = kind == "fault" || kind.starts_with("overflow");
    ensure!((done.hard_faults > 0) == faults, "{done:?}");
    Ok(())
}

/// Waits until an image has ended, without a reset. Its laser must have fired for the `expected`
/// milliseconds after `from`, or after the host's last byte.
fn fired_for(
    what: &str,
    expected: RangeInclusive<f64>,
    from: impl Fn(&Done) -> Option<f64>,
    board: Rp2040,
) -> Result<()> {
    let done = board.wait()?;
    let from = from(&done).with_context(|| format!("{what}: {done:?}"))?;
    check_fired(what, expected, from, &done)
}

/// Checks that a laser has fired for the `expected` milliseconds after `from`, without a reset.
pub fn check_fired(
    what: &str,
    expected: RangeInclusive<f64>,
    from: f64,
    done: &Done,
) -> Result<()> {
    let (lit, dark) = dark_since(from, done)?;
    println!("{what}: {lit:.3} ms of {expected:?}; off for {dark:.0} ms");
    ensure!(
        expected.contains(&lit),
        "{what}: {lit} ms of light: {done:?}"
    );
    ensure!(done.boots.len() == 1, "{what}: {done:?}");
    Ok(())
}

/// Milliseconds, rounded up.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn whole(ms: f64) -> u32 {
    ms.ceil() as u32
}

fn start(image: &Path, over_usb: bool) -> Result<Rp2040> {
    let for_ms = f64::from(HOST_TIMEOUT_MS) + dark_ms() + ROUND_MS;
    Rp2040::start_for(image, over_usb, whole(for_ms))
}

/// From the last byte of the host, which ends a frame.
pub const SILENCE_MS: RangeInclusive<f64> =
    HOST_TIMEOUT_MS as f64 - ROUND_MS..=HOST_TIMEOUT_MS as f64 + ROUND_MS;
pub const AT_ONCE_MS: RangeInclusive<f64> = -ROUND_MS..=ROUND_MS;

#[test]
fn laser_goes_dark_when_its_host_ends_its_session_or_is_cut_off() -> Result<()> {
    let Some(_alone) = enabled("the laser without a host", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    for over_usb in [false, true] {
        let port = if over_usb { "USB" } else { "UART" };
        let mut board = start(&image, over_usb)?;
        let (mut client, _) = light(&mut board)?;
        fires(&mut client)?;
        drop(client);
        let what = format!("{port}, end of the session");
        fired_for(&what, AT_ONCE_MS, |done| done.last_input_ms, board)?;

        let mut board = start(&image, over_usb)?;
        let (mut client, is_cut) = light(&mut board)?;
        fires(&mut client)?;
        is_cut.store(true, Ordering::Relaxed);
        drop(client);
        let what = format!("{port}, cut off");
        if over_usb {
            fired_for(&what, AT_ONCE_MS, |done| done.dtr_low_ms, board)?;
        } else {
            fired_for(&what, SILENCE_MS, |done| done.last_input_ms, board)?;
        }
    }
    Ok(())
}

/// The end of a reset of the bus takes 20 ms, and the chip needs help to find it.
#[test]
fn laser_goes_dark_when_the_usb_is_reset() -> Result<()> {
    let Some(_alone) = enabled("the laser in a reset of the USB", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    let mut board = Rp2040::start_with_usb_fault(&image, "bus-reset", LIT_MS, whole(dark_ms()))?;
    let (mut client, is_cut) = light(&mut board)?;
    // Until the device is silent.
    while client.report().is_ok() {}
    is_cut.store(true, Ordering::Relaxed);
    drop(client);
    fired_for(
        "reset of the USB",
        AT_ONCE_MS,
        |done| done.planted_ms,
        board,
    )
}

/// Waits until the laser has fired often enough.
pub fn fires(client: &mut Client) -> Result<()> {
    let start = Instant::now();
    while client.report()?.cycles < 1500 {
        ensure!(
            start.elapsed() < Duration::from_secs(60),
            "it does not fire"
        );
    }
    Ok(())
}

#[test]
fn laser_stops_once_for_a_silent_host_which_gets_the_reason() -> Result<()> {
    let Some(_alone) = enabled("the laser with a silent host", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let mut board = start(&image(&["photon-timer"], None)?, false)?;
    let (mut client, is_cut) = light(&mut board)?;
    fires(&mut client)?;
    // The emulator has its own time.
    let mut silence = Duration::from_secs(4);
    let report: Report = loop {
        thread::sleep(silence);
        let report = client.report()?;
        if report.sensor_stops > 0 {
            break report;
        }
        silence *= 2;
        ensure!(silence < Duration::from_secs(60), "{report:?}");
    };
    ensure!(
        (report.sensor_starts, report.sensor_stops) == (1, 1),
        "{report:?}"
    );
    ensure!(
        report.stop_reason == StopReason::Silence as u8,
        "{report:?}"
    );
    is_cut.store(true, Ordering::Relaxed);
    drop(client);
    let done = board.wait()?;
    let (_, dark) = dark_since(0.0, &done)?;
    println!("silent host: off for {dark:.0} ms; {report:?}");
    ensure!(done.boots.len() == 1, "{done:?}");
    Ok(())
}

#[test]
fn laser_goes_dark_when_the_monitor_is_interrupted_or_killed() -> Result<()> {
    let Some(_alone) = enabled("the laser of a killed monitor", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let (image, dtof) = (image(&["photon-timer"], None)?, dtof()?);
    for (signal, over_usb) in [("INT", false), ("KILL", false), ("KILL", true)] {
        let mut board = start(&image, over_usb)?;
        // The emulator listens once it has been connected to.
        drop(board.connect()?);
        let timeout = f64::from(HOST_TIMEOUT_MS) / 1000.0;
        let mut monitor = Command::new(&dtof);
        monitor
            .args(["monitor", "--device", &board.device(), "--host-timeout"])
            .arg(timeout.to_string());
        monitor.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut monitor = monitor.stderr(Stdio::null()).spawn()?;
        let mut header = String::new();
        let stdout = monitor.stdout.take().context("no output")?;
        let mut stdout = BufReader::new(stdout);
        // Printed once the device is configured.
        stdout.read_line(&mut header)?;
        ensure!(header.starts_with("cycle,"), "{header}");
        thread::sleep(Duration::from_secs(3));
        let pid = monitor.id().to_string();
        succeed(Command::new("kill").args(["-s", signal, &pid]))?;
        let ended = monitor.wait()?;
        ensure!(ended.success() == (signal == "INT"), "{ended}");
        let what = format!(
            "monitor, {signal}, {}",
            if over_usb { "USB" } else { "UART" }
        );
        match (signal, over_usb) {
            // It pauses before the session ends.
            ("INT", _) => {
                let until = -f64::from(HOST_TIMEOUT_MS) / 2.0..=ROUND_MS;
                fired_for(&what, until, |done| done.last_input_ms, board)?;
            }
            (_, true) => fired_for(&what, AT_ONCE_MS, |done| done.dtr_low_ms, board)?,
            (_, false) => fired_for(&what, SILENCE_MS, |done| done.last_input_ms, board)?,
        }
    }
    Ok(())
}

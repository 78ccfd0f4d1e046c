//! The examples of the host: photons to a file, and a device for `dtof monitor`.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::{printed, succeed};
use crate::cargo;

/// Pixels of both examples.
const PIXELS: u32 = 64;
const CYCLES: u32 = 1000;
/// The lines of the device when its sensor starts and stops.
const ON: &str = "sensor on";
const OFF: &str = "sensor off, reason ";
/// `DTOF_STOP_SILENCE`.
const SILENCE: u8 = 4;
/// The longest wait for a line of the device: a host may be silent for 3 s.
const PATIENCE: Duration = Duration::from_secs(20);

/// Builds the program of this workspace and compares both examples with it.
pub fn check(root: &Path, host: &Path, target: &Path) -> Result<()> {
    let mut build = cargo();
    build
        .current_dir(root)
        .args(["build", "--quiet", "--locked"]);
    build.args(["--release", "--package", "dtof", "--target-dir"]);
    succeed(build.arg(target))?;
    let dtof = target.join("release/dtof");
    let folder = target.join("c-bindings/out");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    events(&dtof, host, &folder)?;
    for (options, off) in TOGETHER {
        monitor(&dtof, host, options, off)?;
    }
    silence(&dtof, host)
}

/// The example finds the same events in a file of photons as `dtof replay`.
fn events(dtof: &Path, host: &Path, folder: &Path) -> Result<()> {
    let (photons, c, rust) = (
        folder.join("photons.csv"),
        folder.join("events.aer"),
        folder.join("replay"),
    );
    fs::write(&photons, list())?;
    let defaults = folder.join("defaults.toml");
    fs::write(&defaults, "")?;
    let mut example = Command::new(host.join("events"));
    let example = example.arg(&c).arg("-");
    let status = example
        .stdin(fs::File::open(&photons)?)
        .stdout(Stdio::null())
        .status()?;
    ensure!(status.success(), "events: {status}");
    let mut replay = Command::new(dtof);
    replay.arg("replay").arg("--input").arg(&photons);
    replay
        .arg("--out")
        .arg(&rust)
        .arg("--settings")
        .arg(&defaults)
        .args(["--bin-width-ps", "250", "--quiet"]);
    succeed(&mut replay)?;
    let found = printed(Command::new(dtof).arg("decode").arg(&c))?;
    let expected = fs::read_to_string(rust.join("events.csv"))?;
    let events = expected.lines().count() - 1;
    ensure!(events > 1000, "only {events} events");
    ensure!(found == expected, "events: differ from `dtof replay`");
    println!("events: {events}, the same as `dtof replay`");

    // It does not overwrite a file; the error is one line.
    let again = Command::new(host.join("events")).arg(&c).output()?;
    let why = String::from_utf8_lossy(&again.stderr).into_owned();
    ensure!(
        !again.status.success() && why.lines().count() == 1,
        "events: overwrites a file"
    );
    Ok(())
}

/// Generated photons of targets and background.
fn list() -> String {
    let mut text = "pixel,cycle,bin\n".to_owned();
    let mut drawn = 1u32;
    let mut below = |limit: u32| {
        drawn = drawn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((drawn >> 16) * limit) >> 16
    };
    for cycle in 0..CYCLES {
        for pixel in 0..PIXELS {
            if below(3) == 0 {
                let bin = 40 + pixel / 8 + u32::from(below(4) == 0);
                let _ = writeln!(text, "{pixel},{cycle},{bin}");
            }
            if below(4) == 0 {
                let _ = writeln!(text, "{pixel},{cycle},{}", below(128));
            }
        }
    }
    text
}

/// Starts a device. Returns its port, and the lines that it prints afterwards.
fn device(host: &Path) -> Result<(Child, String, Receiver<String>)> {
    let mut device = Command::new(host.join("device"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()?;
    let stdout = device.stdout.take().context("no output of the device")?;
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        let mut lines = BufReader::new(stdout).lines().map_while(Result::ok);
        lines.try_for_each(|line| sender.send(line))
    });
    let port = lines.recv_timeout(PATIENCE).context("no port")?;
    Ok((device, port, lines))
}

/// How pixels decide: alone, with blocks, with neighbours. With these, some events are at the targets of the rows
/// above and below, so many bins off.
const TOGETHER: [(&[&str], u32); 3] = [
    (&[], 0),
    (&["--binning", "3", "--once-per-bin"], 0),
    (
        &["--rule", "window", "--window", "3", "--neighbours", "8"],
        2,
    ),
];

/// A host watches the device for a second, with such options. The sensor is off before and after.
fn monitor(dtof: &Path, host: &Path, options: &[&str], off: u32) -> Result<()> {
    let (mut device, port, lines) = device(host)?;
    let mut watch = Command::new(dtof);
    watch.args(["monitor", "--seconds", "1", "--device", &port]);
    watch.args(options);
    let watched = watch.stdin(Stdio::null()).output()?;
    if !watched.status.success() {
        device.kill()?;
    }
    let ended = device.wait()?;
    let why = String::from_utf8_lossy(&watched.stderr).into_owned();
    ensure!(watched.status.success(), "monitor: {}", why.trim());
    ensure!(ended.success(), "device: {ended}");
    let lines: Vec<String> = lines.iter().collect();
    ensure!(
        lines.len() == 2 && lines[0] == ON && lines[1].starts_with(OFF),
        "device: {lines:?}"
    );
    let text = String::from_utf8(watched.stdout)?;
    let events: Vec<Vec<u32>> = text.lines().skip(1).map(numbers).collect();
    ensure!(events.len() > 100, "monitor: only {} events", events.len());
    let right = |event: &&Vec<u32>| {
        // Laser cycle, pixel, exposure, highest bin.
        matches!(event[..], [_, pixel, _, bin] if bin.abs_diff(30 + 2 * (pixel / 8)) <= off)
    };
    let right = events.iter().filter(right).count();
    ensure!(
        right * 100 > events.len() * 98,
        "monitor: {right} of {} events at their target",
        events.len()
    );
    println!(
        "device {}: {} events, {right} of them at their target",
        options.join(" "),
        events.len()
    );
    Ok(())
}

/// A stopped host, like a computer that goes to sleep: the device switches its sensor off.
fn silence(dtof: &Path, host: &Path) -> Result<()> {
    let (mut device, port, lines) = device(host)?;
    let mut watch = Command::new(dtof);
    watch.args(["monitor", "--seconds", "600", "--device", &port]);
    watch.stdin(Stdio::null()).stdout(Stdio::null());
    let mut watch = watch.stderr(Stdio::null()).spawn()?;
    let lines_while_stopped = || {
        let on = lines.recv_timeout(PATIENCE)?;
        let stop = ["-STOP".to_owned(), watch.id().to_string()];
        succeed(Command::new("kill").args(stop))?;
        Ok::<_, anyhow::Error>([on, lines.recv_timeout(PATIENCE)?])
    };
    let lines = lines_while_stopped();
    watch.kill()?;
    watch.wait()?;
    // It ends when the host is gone.
    device.wait()?;
    let lines = lines.context("no line about the sensor after the host fell silent")?;
    ensure!(
        lines == [ON.to_owned(), format!("{OFF}{SILENCE}")],
        "device: {lines:?}"
    );
    println!("device: off when the host is silent");
    Ok(())
}

/// The first four numbers of a line of events.
fn numbers(line: &str) -> Vec<u32> {
    let numbers = line.split(',').take(4);
    numbers.filter_map(|number| number.parse().ok()).collect()
}

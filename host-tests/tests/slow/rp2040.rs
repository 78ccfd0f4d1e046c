//! Runs images of the Pico with `firmware/rp2040js`.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use dtof_device::Port;
use serde_json::Value;

use crate::emulator::{PATIENCE, free_ports, open};
use crate::{root, succeed};

/// The programs it needs. `cargo xtask setup` installs both.
pub const NODE: &str = "node";
pub const NPM: &str = "npm";

/// The path of the image, by default the sidecar. `laser` is the rate of the photon timer in Hz and its
/// pulse in nanoseconds.
pub fn image(what: &[&str], laser: Option<(u32, u32)>) -> Result<PathBuf> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .args(["--locked", "xtask", "image", "pico"])
        .args(what);
    match laser {
        Some((hz, pulse_ns)) => cargo
            .env("LASER_HZ", hz.to_string())
            .env("LASER_PULSE_NS", pulse_ns.to_string()),
        None => cargo.env_remove("LASER_HZ").env_remove("LASER_PULSE_NS"),
    };
    let cargo = cargo.current_dir(root()).stdin(Stdio::null());
    let output = cargo.stderr(Stdio::inherit()).output()?;
    ensure!(output.status.success(), "no image of {what:?}, see above");
    Ok(String::from_utf8(output.stdout)?.trim().into())
}

/// Why the compiler refuses an image of the photon timer with such a laser, if it does. `cargo xtask` would refuse it
/// before.
pub fn refusal((hz, pulse_ns): (u32, u32)) -> Result<Option<String>> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .args(["check", "--locked", "--quiet", "--package", "dtof-firmware"])
        .args(["--features", "pico,sensor-photon-timer"])
        .args(["--target", "thumbv6m-none-eabi"])
        .env("LASER_HZ", hz.to_string())
        .env("LASER_PULSE_NS", pulse_ns.to_string());
    let output = cargo.current_dir(root()).stdin(Stdio::null()).output()?;
    let refused = String::from_utf8(output.stderr)?;
    Ok((!output.status.success()).then_some(refused))
}

/// Installs rp2040js unless it is installed.
pub fn install() -> Result<()> {
    let folder = folder();
    if folder.join("node_modules/.package-lock.json").exists() {
        return Ok(());
    }
    succeed(
        Command::new(NPM)
            .args(["ci", "--silent"])
            .current_dir(folder),
    )
}

fn folder() -> PathBuf {
    root().join("firmware/rp2040js")
}

/// The emulator, ended when dropped.
pub struct Rp2040 {
    child: Child,
    port: u16,
    /// That of the UART, if `port` is that of the USB.
    uart: Option<u16>,
}

/// The report of a run. Times are those of the image, in milliseconds since power-on.
#[derive(Debug)]
pub struct Done {
    /// The output.
    pub output: Vec<u8>,
    pub success: bool,
    /// The bytes of stack used.
    pub stack: u64,
    pub end_ms: f64,
    pub laser: Laser,
    /// The time of the last byte from the host.
    pub last_input_ms: Option<f64>,
    /// The time when the USB host closed the port.
    pub dtr_low_ms: Option<f64>,
    pub planted_ms: Option<f64>,
    /// Boots; the first is at power-on.
    pub boots: Vec<Boot>,
    /// Whether the panic handler has run.
    pub panicked: bool,
    pub hard_faults: u64,
}

/// The signal at the laser's pin of the chip.
#[derive(Clone, Debug)]
pub struct Laser {
    pub pulses: u64,
    pub longest_ns: u64,
    pub last_high_ms: Option<f64>,
    /// Whether it is high at the end.
    pub is_high: bool,
    /// Nanoseconds from one pulse's beginning to the next, and how often they came.
    pub intervals: BTreeMap<u64, u64>,
}

/// A start of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Boot {
    pub ms: f64,
    /// `power`, `watchdog`, `forced` (by software, through the watchdog) or `core`.
    pub reason: String,
}

impl Rp2040 {
    /// Starts an image with its serial port on a free TCP port. The file `edges` has the levels of pins,
    /// from the laser's first pulse at GP2.
    pub fn start(image: &Path, edges: Option<&Path>) -> Result<Self> {
        let mut node = command(image);
        if let Some(edges) = edges {
            node.arg("--edges").arg(edges);
        }
        Self::spawn(node)
    }

    /// Starts an image with the serial port of the USB, without edges.
    pub fn start_with_usb(image: &Path) -> Result<Self> {
        let mut node = command(image);
        node.arg("--usb");
        Self::spawn(node)
    }

    /// Starts an image with a planted fault, `fault_ms` after the laser's first pulse. The emulator ends
    /// `for_ms` after the fault, once the client has disconnected.
    pub fn start_with_fault(image: &Path, kind: &str, fault_ms: f64, for_ms: u32) -> Result<Self> {
        let mut node = command(image);
        node.args(["--plant", &format!("{kind}@{fault_ms}")]);
        Self::spawn(ending_after(node, for_ms))
    }

    /// The same with the serial port of the USB.
    pub fn start_with_usb_fault(
        image: &Path,
        kind: &str,
        fault_ms: f64,
        for_ms: u32,
    ) -> Result<Self> {
        let mut node = command(image);
        node.args(["--usb", "--plant", &format!("{kind}@{fault_ms}")]);
        Self::spawn(ending_after(node, for_ms))
    }

    /// Starts an image without a fault. Its serial port is the USB or the UART.
    pub fn start_for(image: &Path, over_usb: bool, for_ms: u32) -> Result<Self> {
        let mut node = command(image);
        node.args(over_usb.then_some("--usb"));
        Self::spawn(ending_after(node, for_ms))
    }

    /// Starts an image with the serial ports of the USB and of the UART.
    pub fn start_with_both(image: &Path) -> Result<Self> {
        let [uart, _] = free_ports()?;
        let mut node = command(image);
        node.args(["--usb", "--uart", &uart.to_string()]);
        let mut board = Self::spawn(node)?;
        board.uart = Some(uart);
        Ok(board)
    }

    fn spawn(mut node: Command) -> Result<Self> {
        let [port, _] = free_ports()?;
        node.args(["--port", &port.to_string(), "--from", "2", "--attached"]);
        let child = node.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let child = child.context("node does not start")?;
        Ok(Self {
            child,
            port,
            uart: None,
        })
    }

    /// Its serial port, as an argument for `dtof --device`.
    pub fn device(&self) -> String {
        format!("tcp:127.0.0.1:{}", self.port)
    }

    /// Connects to its serial port.
    pub fn connect(&mut self) -> Result<Box<dyn Port>> {
        let device = self.device();
        open(&mut self.child, || dtof_device::open(&device, None))
    }

    /// Connects to its UART, if its serial port is that of the USB.
    pub fn connect_uart(&mut self) -> Result<Box<dyn Port>> {
        let device = format!("tcp:127.0.0.1:{}", self.uart.context("no UART")?);
        open(&mut self.child, || dtof_device::open(&device, None))
    }

    /// Ends it.
    pub fn stop(mut self) -> Result<Done> {
        drop(self.child.stdin.take());
        self.wait()
    }

    /// Waits until it ends by itself.
    pub fn wait(mut self) -> Result<Done> {
        let mut report = String::new();
        let mut stderr = self.child.stderr.take().context("no report")?;
        stderr.read_to_string(&mut report)?;
        done(&report, Vec::new(), self.child.wait()?.success())
    }
}

impl Drop for Rp2040 {
    fn drop(&mut self) {
        // It may already have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs an image that ends.
pub fn run(image: &Path) -> Result<Done> {
    let start = Instant::now();
    let output = command(image).stdin(Stdio::null()).output()?;
    ensure!(start.elapsed() < PATIENCE, "it takes {:?}", start.elapsed());
    let report = String::from_utf8(output.stderr)?;
    done(&report, output.stdout, output.status.success())
}

fn ending_after(mut node: Command, for_ms: u32) -> Command {
    node.args(["--for", &for_ms.to_string()]);
    node
}

fn command(image: &Path) -> Command {
    let mut node = Command::new(NODE);
    node.arg(folder().join("run.js")).arg(image).arg("--report");
    node
}

/// The last line of a report.
fn done(report: &str, output: Vec<u8>, success: bool) -> Result<Done> {
    let line = report.lines().last().unwrap_or_default();
    let value: Value = serde_json::from_str(line).with_context(|| report.to_owned())?;
    let laser = &value["laser"];
    let number = |of: &Value, name: &str| of[name].as_u64().with_context(|| report.to_owned());
    let flag = |of: &Value, name: &str| of[name].as_bool().with_context(|| report.to_owned());
    let time = |name: &str| value[name].as_f64();
    let list = |name: &str| value[name].as_array().with_context(|| report.to_owned());
    let boots = list("bootsMs")?.iter().zip(list("bootReasons")?);
    let boots = boots.filter_map(|(ms, reason)| {
        let reason = reason.as_str()?.to_owned();
        Some(Boot {
            ms: ms.as_f64()?,
            reason,
        })
    });
    Ok(Done {
        output,
        success,
        stack: number(&value, "stack")?,
        end_ms: time("endMs").with_context(|| report.to_owned())?,
        laser: Laser {
            pulses: number(laser, "pulses")?,
            longest_ns: number(laser, "longestNs")?,
            last_high_ms: laser["lastHighMs"].as_f64(),
            is_high: flag(laser, "isHigh")?,
            intervals: serde_json::from_value::<Vec<(u64, u64)>>(laser["intervals"].clone())?
                .into_iter()
                .collect(),
        },
        last_input_ms: time("lastInputMs"),
        dtr_low_ms: time("dtrLowMs"),
        planted_ms: time("plantedMs"),
        boots: boots.collect(),
        panicked: flag(&value, "panicked")?,
        hard_faults: number(&value, "hardFaults")?,
    })
}

/// Writes edges as `(nanoseconds, pin, level)`.
pub fn write_edges(path: &Path, edges: &[(u64, u8, bool)]) -> Result<()> {
    let lines = edges.iter();
    let lines = lines.map(|(ns, pin, level)| format!("{ns} {pin} {}\n", u8::from(*level)));
    fs::write(path, lines.collect::<String>()).with_context(|| path.display().to_string())
}

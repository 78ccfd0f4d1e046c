//! Programs that are used if they are there.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

/// A program, and the one line that installs it.
pub struct Tool {
    pub program: &'static str,
    /// What it is asked to find out whether it is there: it prints its version.
    ask: &'static [&'static str],
    pub install: &'static str,
}

const VERSION: &[&str] = &["--version"];

pub const QEMU: Tool = Tool {
    program: "qemu-system-arm",
    ask: VERSION,
    install: "sudo apt-get install --yes qemu-system-arm",
};

/// For `cargo softcore`.
pub const QEMU_RISCV: Tool = Tool {
    program: "qemu-system-riscv32",
    ask: VERSION,
    install: "sudo apt-get install --yes qemu-system-misc",
};

/// For `cargo softcore`, with what it calls.
pub const VERILATOR: Tool = Tool {
    program: "verilator",
    ask: VERSION,
    install: "sudo apt-get install --yes verilator g++ make",
};

/// For `cargo softcore`: whether a memory becomes block RAM.
pub const YOSYS: Tool = Tool {
    program: "yosys",
    ask: &["-V"],
    install: "sudo apt-get install --yes yosys",
};

pub const DEFMT_PRINT: Tool = Tool {
    program: "defmt-print",
    ask: VERSION,
    install: "cargo install --locked defmt-print",
};

/// For sweeps in parts, as `docs/sweeps.md` has them.
pub const PARALLEL: Tool = Tool {
    program: "parallel",
    ask: VERSION,
    install: "sudo apt-get install --yes parallel",
};

/// For the reports, as readers see them.
pub const CHROMIUM: Tool = Tool {
    program: "chromium",
    ask: VERSION,
    install: "sudo apt-get install --yes chromium",
};

pub const PROBE_RS: Tool = Tool {
    program: "probe-rs",
    ask: VERSION,
    install: "cargo install --locked probe-rs-tools",
};

/// For the readers of exported files: with what makes virtual environments, and the headers that a
/// package may be compiled with, which Debian has apart.
pub const PYTHON: Tool = Tool {
    program: "python3",
    ask: &[
        "-c",
        "import ensurepip, platform, venv; print('Python', platform.python_version())",
    ],
    install: "sudo apt-get install --yes python3-venv python3-dev",
};

impl Tool {
    /// What it says of its version, if it is there.
    pub fn version(&self) -> Option<String> {
        let output = Command::new(self.program)
            .args(self.ask)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let line = text.lines().next().unwrap_or_default();
        output.status.success().then(|| line.to_owned())
    }

    pub fn is_there(&self) -> bool {
        self.version().is_some()
    }

    /// Says how to install it.
    pub fn missing(&self) -> String {
        format!("{} is missing: {}", self.program, self.install)
    }

    /// Its version, or an error that says how to install it.
    pub fn require(&self) -> Result<String> {
        self.version().with_context(|| self.missing())
    }
}

/// Installs what is missing if that needs no question; else says what to type. What
/// needs a tool says so itself, so that this never fails.
pub fn set_up() {
    install(&QEMU, || debian_package("qemu-system-arm"));
    install(&QEMU_RISCV, || debian_package("qemu-system-misc"));
    install(&VERILATOR, || debian_package("verilator g++ make"));
    install(&YOSYS, || debian_package("yosys"));
    install(&PARALLEL, || debian_package("parallel"));
    install(&CHROMIUM, || debian_package("chromium"));
    install(&PYTHON, || debian_package("python3-venv python3-dev"));
    install(&DEFMT_PRINT, || {
        let mut cargo = Command::new("cargo");
        cargo.args(["install", "--locked", "--quiet", "defmt-print"]);
        Some(cargo)
    });
}

/// How root installs packages on Debian.
fn debian_package(names: &str) -> Option<Command> {
    let is_root = Command::new("id").arg("-u").output().ok()?.stdout == b"0\n";
    if !(is_root && Path::new("/etc/debian_version").exists()) {
        return None;
    }
    // A new machine may never have heard of its packages.
    let install = format!(
        "apt-get update --quiet && \
         apt-get install --yes --quiet --no-install-recommends {names}"
    );
    let mut apt = Command::new("sh");
    apt.env("DEBIAN_FRONTEND", "noninteractive");
    apt.args(["-c", &install]);
    Some(apt)
}

fn install(tool: &Tool, command: impl FnOnce() -> Option<Command>) {
    if let Some(version) = tool.version() {
        println!("{version}: there");
        return;
    }
    if let Some(mut command) = command() {
        println!("{}: installing", tool.program);
        // What goes wrong is said by what is still missing.
        let _ = command.stdin(Stdio::null()).status();
    }
    if !tool.is_there() {
        println!("{}", tool.missing());
    }
}

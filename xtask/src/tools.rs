//! Programs that are used if they are there.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

/// A program, and the one line that installs it.
pub struct Tool {
    pub program: &'static str,
    /// Arguments with which it prints its version, if it is there.
    ask: &'static [&'static str],
    install: Install,
}

enum Install {
    /// Packages of Debian's.
    Packages(&'static str),
    /// A crate.
    Crate(&'static str),
    /// The same, but it takes so long that only a user starts it.
    LargeCrate(&'static str),
}

use Install::{Crate, LargeCrate, Packages};

const fn tool(program: &'static str, install: Install) -> Tool {
    Tool {
        program,
        ask: &["--version"],
        install,
    }
}

pub const QEMU: Tool = tool("qemu-system-arm", Packages("qemu-system-arm"));
pub const DEFMT_PRINT: Tool = tool("defmt-print", Crate("defmt-print"));
pub const PROBE_RS: Tool = tool("probe-rs", LargeCrate("probe-rs-tools"));

/// For the emulated Pico, with the packages of `tools/rp2040`.
pub const NODE: Tool = tool("node", Packages("nodejs"));
pub const NPM: Tool = tool("npm", Packages("npm"));

/// For `cargo xtask c-bindings`.
pub const CXX: Tool = tool("g++", Packages("g++"));
pub const CMAKE: Tool = tool("cmake", Packages("cmake make"));
pub const ARM_GCC: Tool = tool("arm-none-eabi-gcc", Packages("gcc-arm-none-eabi"));

/// For the readers of exported files: with what makes virtual environments, and the headers
/// that a package may be compiled with, which Debian has apart.
pub const PYTHON: Tool = Tool {
    ask: &[
        "-c",
        "import ensurepip, platform, venv; print('Python', platform.python_version())",
    ],
    ..tool("python3", Packages("python3-venv python3-dev"))
};

/// Every tool that [`set_up`] installs.
const ALL: [Tool; 13] = [
    QEMU,
    CXX,
    CMAKE,
    ARM_GCC,
    // For `cargo softcore`, the last for whether a memory becomes block RAM.
    tool("qemu-system-riscv32", Packages("qemu-system-misc")),
    tool("verilator", Packages("verilator g++ make")),
    Tool {
        ask: &["-V"],
        ..tool("yosys", Packages("yosys"))
    },
    // For sweeps in parts, as `docs/sweeps.md` has them.
    tool("parallel", Packages("parallel")),
    // For the reports, as readers see them.
    tool("chromium", Packages("chromium")),
    PYTHON,
    NODE,
    NPM,
    DEFMT_PRINT,
];

impl Tool {
    /// Its version, if it is there.
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
        let install = match self.install {
            Packages(names) => format!("sudo apt-get install --yes {names}"),
            Crate(name) | LargeCrate(name) => format!("cargo install --locked {name}"),
        };
        format!("{} is missing: {install}", self.program)
    }

    /// A command that installs it without a question.
    fn installer(&self) -> Option<Command> {
        match self.install {
            Packages(names) => debian(names),
            Crate(name) => {
                let mut cargo = Command::new("cargo");
                cargo.args(["install", "--locked", "--quiet", name]);
                Some(cargo)
            }
            LargeCrate(_) => None,
        }
    }

    /// Its version, or an error that says how to install it.
    pub fn require(&self) -> Result<String> {
        self.version().with_context(|| self.missing())
    }
}

/// Installs what is missing if that needs no question; else says what to type. What
/// needs a tool says so itself, so that this never fails.
pub fn set_up() {
    for tool in ALL {
        if let Some(version) = tool.version() {
            println!("{version}: there");
            continue;
        }
        if let Some(mut command) = tool.installer() {
            println!("{}: installing", tool.program);
            // A failure shows when the tool is still missing.
            let _ = command.stdin(Stdio::null()).status();
        }
        if !tool.is_there() {
            println!("{}", tool.missing());
        }
    }
}

/// How root installs packages on Debian.
fn debian(names: &str) -> Option<Command> {
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

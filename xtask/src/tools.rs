//! The tools that xtask calls, and how to install them.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

/// A program, and how to install it.
pub struct Tool {
    pub program: &'static str,
    /// Arguments that print its version.
    version: &'static [&'static str],
    install: Install,
}

enum Install {
    /// Debian packages.
    Packages(&'static str),
    /// A crate.
    Crate(&'static str),
    /// A crate that takes long to build, so it is left to the user.
    LargeCrate(&'static str),
}

use Install::{Crate, LargeCrate, Packages};

const fn tool(program: &'static str, install: Install) -> Tool {
    Tool {
        program,
        version: &["--version"],
        install,
    }
}

pub const QEMU: Tool = tool("qemu-system-arm", Packages("qemu-system-arm"));
pub const DEFMT_PRINT: Tool = tool("defmt-print", Crate("defmt-print"));
pub const PROBE_RS: Tool = tool("probe-rs", LargeCrate("probe-rs-tools"));

/// For the emulated Pico, with the packages of `firmware/rp2040js`, and for the tests of the pages' scripts.
pub const NODE: Tool = tool("node", Packages("nodejs"));
pub const NPM: Tool = tool("npm", Packages("npm"));

/// For `cargo xtask c-bindings`.
pub const CXX: Tool = tool("g++", Packages("g++"));
pub const CMAKE: Tool = tool("cmake", Packages("cmake make"));
pub const ARM_GCC: Tool = tool("arm-none-eabi-gcc", Packages("gcc-arm-none-eabi"));

/// For the readers of exported files. Debian packages virtual environments and the headers of
/// Python separately.
pub const PYTHON: Tool = Tool {
    version: &[
        "-c",
        "import ensurepip, platform, venv; print('Python', platform.python_version())",
    ],
    ..tool("python3", Packages("python3-venv python3-dev"))
};

/// Every tool that [`set_up`] installs.
const ALL: [Tool; 14] = [
    QEMU,
    CXX,
    CMAKE,
    ARM_GCC,
    // For `cargo softcore`; yosys shows which memories become block RAM.
    tool("qemu-system-riscv32", Packages("qemu-system-misc")),
    tool("verilator", Packages("verilator g++ make")),
    Tool {
        version: &["-V"],
        ..tool("yosys", Packages("yosys"))
    },
    // For sweeps in parts, see `docs/sweeps.md`.
    tool("parallel", Packages("parallel")),
    // Renders the reports.
    tool("chromium", Packages("chromium")),
    // Makes system calls of the program fail.
    tool("strace", Packages("strace")),
    PYTHON,
    NODE,
    NPM,
    DEFMT_PRINT,
];

impl Tool {
    /// Its version, if it is installed.
    pub fn version(&self) -> Option<String> {
        let output = Command::new(self.program)
            .args(self.version)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let line = text.lines().next().unwrap_or_default();
        output.status.success().then(|| line.to_owned())
    }

    pub fn is_installed(&self) -> bool {
        self.version().is_some()
    }

    /// The message for a missing tool: how to install it.
    pub fn missing(&self) -> String {
        let install = match self.install {
            Packages(names) => format!("sudo apt-get install --yes {names}"),
            Crate(name) | LargeCrate(name) => format!("cargo install --locked {name}"),
        };
        format!("{} is missing: {install}", self.program)
    }

    /// A command that installs it without asking anything.
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

    /// Its version.
    ///
    /// # Errors
    /// Fails if it is not installed; the error tells how to install it.
    pub fn require(&self) -> Result<String> {
        self.version().with_context(|| self.missing())
    }
}

/// Installs the missing tools where that needs no answer from the user; prints the command for the
/// others.
///
/// # Errors
/// Fails if a tool is still missing.
pub fn set_up() -> Result<()> {
    let mut missing = Vec::new();
    for tool in ALL {
        if let Some(version) = tool.version() {
            println!("{version}: installed");
            continue;
        }
        if let Some(mut command) = tool.installer() {
            println!("{}: installing", tool.program);
            // The check below finds a failure.
            let _ = command.stdin(Stdio::null()).status();
        }
        if !tool.is_installed() {
            println!("{}", tool.missing());
            missing.push(tool.program);
        }
    }
    ensure!(missing.is_empty(), "missing: {}", missing.join(", "));
    Ok(())
}

/// The command that installs packages as root on Debian.
fn debian(names: &str) -> Option<Command> {
    let is_root = Command::new("id").arg("-u").output().ok()?.stdout == b"0\n";
    if !(is_root && Path::new("/etc/debian_version").exists()) {
        return None;
    }
    // A new machine may have no package lists yet.
    let install = format!(
        "apt-get update --quiet && \
         apt-get install --yes --quiet --no-install-recommends {names}"
    );
    let mut apt = Command::new("sh");
    apt.env("DEBIAN_FRONTEND", "noninteractive");
    apt.args(["-c", &install]);
    Some(apt)
}

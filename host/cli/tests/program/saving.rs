//! Results while the disk is full, while the program is killed, and from inputs with names that
//! lead elsewhere: what is there is whole, and nothing else is touched.

mod elsewhere;
#[cfg(target_os = "linux")]
mod full;
#[cfg(unix)]
mod interrupted;
#[cfg(unix)]
mod killed;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

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
    /// Names of outputs with their commands, without the option that differs.
    commands: Vec<(&'static str, String)>,
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
        let export = |format| format!("export --quiet source/events.aer --format {format} --out");
        let mut commands = vec![
            // Its largest file is the report, which is written late.
            (
                "simulated",
                "simulate --quiet --no-csv --scene scene.toml --out".to_owned(),
            ),
            (
                "replayed",
                "replay --quiet --input photons.csv --columns 4 --out".to_owned(),
            ),
        ];
        commands.extend([
            ("events.csv", export("csv")),
            ("events.pcd", export("pcd")),
            ("events.ply", export("ply")),
            ("events.mcap", export("mcap")),
            ("events.raw", export("evt2")),
        ]);
        Self { scratch, commands }
    }

    /// The command line that writes `out`, as the earlier run or the new one.
    fn line(&self, out: &str, is_new: bool) -> String {
        let command = self.commands.iter().find(|(name, _)| *name == out);
        let (name, command) = command.unwrap();
        let other = match (*name, is_new) {
            // Depth noise.
            ("events.raw", true) => "--threshold-mm 1",
            ("events.raw", _) => "--threshold-mm 8",
            (_, true) => "",
            ("simulated", _) => "--seed 7",
            ("replayed", _) => "--alpha 5",
            _ => "--laser-hz 1000",
        };
        format!("{command} {name} {other}")
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
        let _ = std::fs::remove_dir_all(self.scratch.path(out));
        let _ = std::fs::remove_file(self.scratch.path(out));
        self.scratch.printed(&self.line(out, false));
        self.written(out)
    }
}

/// The program, as `shell` starts it: `exec "$@"` in it is `dtof LINE`.
fn through(shell: &str, scratch: &Scratch, line: &str) -> Output {
    let program = scratch.command(line);
    let mut command = Command::new("sh");
    command
        .current_dir(scratch.path(""))
        .args(["-c", shell, "sh"]);
    command.arg(program.get_program()).args(program.get_args());
    command.output().unwrap()
}

/// Names of incomplete files.
fn partial(files: &Files) -> Vec<&String> {
    let partial = files.keys().filter(|name| name.ends_with(".partial"));
    partial.collect()
}

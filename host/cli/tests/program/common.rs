//! Runs the program as a user would.

#![allow(dead_code, reason = "not every test needs all of it")]

pub mod aer;
pub mod port;
pub mod sensed;
#[cfg(target_os = "linux")]
pub mod strace;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::Duration;

use dtof_data::photons::npy;
use tempfile::TempDir;

/// The cells of each row of a table, `a | b | c`. A cell may hold `\n` for a line end.
pub fn table(rows: &str) -> impl Iterator<Item = Vec<String>> {
    let rows = rows.lines().filter(|row| !row.trim().is_empty());
    rows.map(|row| {
        let cells = row.split(" | ");
        cells.map(|cell| cell.trim().replace("\\n", "\n")).collect()
    })
}

/// A temporary folder for one test.
pub struct Scratch(TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes an input file, and creates its folder.
    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// `dtof LINE` in this folder, not started.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dtof"));
        command
            .current_dir(self.0.path())
            .args(line.split_whitespace());
        command
    }

    /// `dtof LINE` in this folder, as `shell` starts it: `exec "$@"` in it is the program.
    pub fn in_shell(&self, shell: &str, line: &str) -> Command {
        let program = self.command(line);
        let mut command = Command::new("sh");
        command
            .current_dir(self.0.path())
            .args(["-c", shell, "sh"])
            .arg(program.get_program())
            .args(program.get_args());
        command
    }

    /// The output of `dtof LINE` in this folder.
    pub fn run(&self, line: &str) -> Output {
        self.command(line).output().unwrap()
    }

    /// Standard output of `dtof LINE`, which must succeed.
    #[track_caller]
    pub fn printed(&self, line: &str) -> String {
        succeeded(self.run(line))
    }

    /// `dtof COMMAND OPTIONS` of each row of a table must be refused: `options | part | part`.
    #[track_caller]
    pub fn all_refused(&self, command: &str, rows: &str) {
        for row in table(rows) {
            self.refused(&self.run(&format!("{command} {}", row[0])), &row[1..]);
        }
    }

    /// `dtof replay` of a file into `out`.
    pub fn replay(&self, input: &Path, options: &str) -> Output {
        self.run(&format!(
            "replay --out out --input {} {options}",
            input.display()
        ))
    }

    /// Like [`Self::replay`], which must succeed.
    #[track_caller]
    pub fn replayed(&self, input: &Path, options: &str) -> serde_json::Value {
        succeeded(self.replay(input, options));
        self.summary()
    }

    /// The events of the last run into `out`: the cells of each row.
    pub fn events(&self) -> Vec<Vec<String>> {
        let text = self.read("out/events.csv");
        let rows = text.lines().skip(1);
        rows.map(|row| row.split(',').map(str::to_owned).collect())
            .collect()
    }

    /// An array of the last run into `out`, such as `depth`: a number for each pixel.
    pub fn map(&self, name: &str) -> Vec<f64> {
        let array = std::fs::read(self.path(&format!("out/{name}.npy"))).unwrap();
        let (values, _) = array[256..].as_chunks();
        let values = values.iter();
        values.map(|bytes| f64::from_le_bytes(*bytes)).collect()
    }

    /// The summary of the last run into `out`.
    pub fn summary(&self) -> serde_json::Value {
        serde_json::from_str(&self.read("out/summary.json")).unwrap()
    }

    /// `dtof simulate` of a scene file into `out`.
    pub fn simulate(&self, scene: &Path, options: &str) -> Output {
        self.run(&format!(
            "simulate --out out --scene {} {options}",
            scene.display()
        ))
    }

    /// Standard output of [`Self::simulate`], which must succeed.
    #[track_caller]
    pub fn simulated(&self, scene: &Path, options: &str) -> String {
        succeeded(self.simulate(scene, options))
    }

    /// The program must have failed with one line that contains all of `parts`, and left no results.
    #[track_caller]
    pub fn refused(&self, output: &Output, parts: &[impl AsRef<str>]) {
        let message = String::from_utf8(output.stderr.clone()).unwrap();
        assert!(!output.status.success(), "no failure: {output:?}");
        assert_eq!(message.lines().count(), 1, "not one line: {message}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert_contains(&message, part.as_ref());
        }
        let left = std::fs::read_dir(self.path("out")).map_or(0, Iterator::count);
        assert_eq!(left, 0, "files were left in the output folder");
    }
}

/// An array as NumPy writes them.
pub fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let lengths = shape.trim_matches(['(', ')']).split(',');
    let lengths = lengths.filter_map(|length| length.trim().parse().ok());
    let lengths: Vec<u64> = lengths.collect();
    [&npy::header(descr, &lengths, 128), data].concat()
}

/// The most memory a process had, in kB, as long as it ran.
pub fn peak_kb(mut child: Child) -> u64 {
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        if let Some(kb) = line.and_then(|line| line.trim().strip_suffix(" kB")) {
            peak = kb.parse().unwrap();
        }
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success() && peak > 0);
            return peak;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Prints that `test` was skipped for lack of `what`. It bypasses the harness, which hides the output
/// of passing tests.
pub fn skipped(test: &str, what: &str) {
    // In one piece: other tests write at the same time.
    let _ = std::io::stderr().write_all(format!("SKIPPED: {test}: no {what}\n").as_bytes());
}

/// Fails unless `text` contains `part`.
#[track_caller]
pub fn assert_contains(text: &str, part: &str) {
    assert!(text.contains(part), "{text:?} does not contain {part:?}");
}

/// Standard output of a program that must have succeeded.
#[track_caller]
pub fn succeeded(output: Output) -> String {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    String::from_utf8(output.stdout).unwrap()
}

//! Runs the program as a user would.

#![allow(dead_code, reason = "not every test needs all of it")]

pub mod aer;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder of its own for one test.
pub struct Scratch(TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes an input file.
    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// `dtof ARGUMENTS` in this folder.
    pub fn dtof(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dtof"));
        command
            .current_dir(self.0.path())
            .args(arguments)
            .output()
            .unwrap()
    }

    /// `dtof replay` of a file into `out`.
    pub fn replay(&self, input: &Path, more: &[&str]) -> Output {
        let input = input.to_str().unwrap();
        self.dtof(&[&["replay", "--input", input, "--out", "out"], more].concat())
    }

    /// As [`Self::replay`], which must succeed.
    #[track_caller]
    pub fn replayed(&self, input: &Path, more: &[&str]) -> serde_json::Value {
        let output = self.replay(input, more);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        self.summary()
    }

    /// What the last run into `out` came to.
    pub fn summary(&self) -> serde_json::Value {
        serde_json::from_str(&self.read("out/summary.json")).unwrap()
    }

    /// `dtof simulate` of a scene file into `out`.
    pub fn simulate(&self, scene: &Path, more: &[&str]) -> Output {
        let scene = scene.to_str().unwrap();
        self.dtof(&[&["simulate", "--scene", scene, "--out", "out"], more].concat())
    }

    /// The program must have failed with one line that says all of `parts`, and
    /// left nothing that could be taken for a result.
    #[track_caller]
    pub fn refused(&self, output: &Output, parts: &[&str]) {
        let message = String::from_utf8(output.stderr.clone()).unwrap();
        assert!(
            !output.status.success(),
            "succeeded, should have said {parts:?}"
        );
        assert_eq!(message.lines().count(), 1, "not one line: {message}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{message:?} does not say {part:?}");
        }
        let left = std::fs::read_dir(self.path("out")).map_or(0, Iterator::count);
        assert_eq!(left, 0, "files were left in the output folder");
    }
}

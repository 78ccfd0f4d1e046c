//! Runs the program as a user would.

use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// A temporary folder for one test.
pub struct Scratch(TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// `dtof-lab ARGUMENTS` in this folder.
    pub fn lab(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_dtof-lab"));
        let command = command.current_dir(self.0.path()).args(arguments);
        command.output().unwrap()
    }

    /// Checks that the program failed with one line that contains all of `parts`.
    #[track_caller]
    pub fn refused(output: &Output, parts: &[&str]) {
        let message = String::from_utf8(output.stderr.clone()).unwrap();
        assert!(!output.status.success(), "should have said {parts:?}");
        assert_eq!(message.lines().count(), 1, "not one line: {message}");
        assert!(!message.contains("panicked"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{message:?} does not say {part:?}");
        }
    }
}

//! Kept inputs: a finding of the fuzzer stays a test.

#![cfg(feature = "host")]

use std::fs;
use std::path::Path;

fn all(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target);
    let mut inputs = 0;
    for entry in fs::read_dir(&folder).unwrap() {
        run(&fs::read(entry.unwrap().path()).unwrap());
        inputs += 1;
    }
    assert!(inputs > 0, "{}: no inputs", folder.display());
}

#[test]
fn aer() {
    all("aer", dtof_fuzz::aer);
}

#[test]
fn aer_file() {
    all("aer_file", dtof_fuzz::aer_file);
}

#[test]
fn link() {
    all("link", dtof_fuzz::link);
}

#[test]
fn sensors() {
    all("sensors", dtof_fuzz::sensors);
}

#[test]
fn sidecar() {
    all("sidecar", dtof_fuzz::sidecar);
}

#[test]
fn recordings() {
    all("recordings", dtof_fuzz::recordings);
}

#[test]
fn settings() {
    all("settings", dtof_fuzz::settings);
}

//! Sweeps in parts: merged parts equal the single run bit for bit, and no seed counts twice.

mod common;

use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use common::Scratch;

const STUDY: &str = "hit-rate";

impl Scratch {
    fn sweep(&self, seeds: &str, out: &str) -> Output {
        self.lab(&["sweep", STUDY, "--seeds", seeds, "--out", out])
    }

    #[track_caller]
    fn swept(&self, seeds: &str, out: &str) -> String {
        self.written(&self.sweep(seeds, out), out)
    }

    #[track_caller]
    fn merged(&self, parts: &[&str], out: &str) -> String {
        let output = self.lab(&[&["merge", "--out", out], parts].concat());
        self.written(&output, out)
    }

    /// Checks that a run succeeded, and returns its part.
    #[track_caller]
    fn written(&self, output: &Output, out: &str) -> String {
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{error}");
        self.read(out)
    }
}

#[test]
fn parts_in_any_order_merge_into_the_single_run() {
    let scratch = Scratch::new();
    let single = scratch.swept("0..7", "single");
    scratch.swept("0..1", "a");
    scratch.swept("1..4", "b");
    scratch.swept("4..7", "c");
    assert_eq!(scratch.merged(&["c", "a", "b"], "abc"), single);
    // Also through a part with a gap.
    scratch.merged(&["c", "a"], "ac");
    assert_eq!(scratch.merged(&["b", "ac"], "bac"), single);
    assert_eq!(scratch.merged(&["single"], "same"), single);
    // Other seeds give other photons.
    assert_ne!(
        scratch.swept("7..14", "other").replace("7", "0"),
        single.replace("7", "0")
    );
}

/// Not even one of the merged parts.
#[test]
fn a_merge_replaces_nothing() {
    let scratch = Scratch::new();
    let part = scratch.swept("0..1", "a");
    scratch.swept("1..2", "b");
    for parts in [&["a", "b"][..], &["b"]] {
        let output = scratch.lab(&[&["merge", "--out", "a"], parts].concat());
        Scratch::refused(&output, &["a: already exists"]);
        assert_eq!(scratch.read("a"), part);
    }
}

/// A part has the permissions of any new file.
#[cfg(unix)]
#[test]
fn a_part_has_ordinary_permissions() {
    use std::os::unix::fs::PermissionsExt;

    let scratch = Scratch::new();
    let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
    scratch.swept("0..1", "part");
    let other = scratch.file("other", "");
    assert_eq!(mode(scratch.path("part")), mode(other));
}

#[test]
fn an_unfinished_part_is_resumed() {
    let scratch = Scratch::new();
    let single = scratch.swept("0..6", "single");
    scratch.swept("2..4", "part");
    assert_eq!(scratch.swept("0..6", "part"), single);
    // Complete: nothing is added.
    assert_eq!(scratch.swept("0..6", "part"), single);
    let output = scratch.sweep("1..6", "part");
    Scratch::refused(&output, &["part", "seeds outside the requested range"]);
    assert_eq!(scratch.read("part"), single);
}

#[test]
fn a_killed_run_is_resumed() {
    let scratch = Scratch::new();
    let part = scratch.path("part");
    let mut killed = Command::new(env!("CARGO_BIN_EXE_dtof-lab"))
        .args(["sweep", STUDY, "--seeds", "0..100000", "--save-every", "0"])
        .arg("--out")
        .arg(&part)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !part.exists() {
        thread::sleep(Duration::from_millis(10));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();

    let saved: serde_json::Value = serde_json::from_str(&scratch.read("part")).unwrap();
    assert_eq!(saved["seeds"].as_array().unwrap().len(), 1);
    let done = saved["seeds"][0][1].as_u64().unwrap();
    let seeds = format!("0..{}", done + 3);
    assert_eq!(
        scratch.swept(&seeds, "part"),
        scratch.swept(&seeds, "single")
    );
}

#[test]
fn incompatible_parts_are_refused() {
    let scratch = Scratch::new();
    let part = scratch.swept("0..4", "part");
    scratch.swept("3..5", "shares");
    let merge = |parts: &[&str]| scratch.lab(&[&["merge", "--out", "sum"], parts].concat());
    Scratch::refused(
        &merge(&["part", "shares"]),
        &["shares", "seed 3 would count twice"],
    );
    Scratch::refused(&merge(&["part", "nothing"]), &["nothing", "No such file"]);
    for (name, text, reason) in [
        ("cut", &part[..part.len() / 2], "EOF"),
        ("foreign", "{}", "missing field"),
        (
            "study",
            &part.replace(STUDY, "other"),
            "other (revision 2) cannot be added to hit-rate",
        ),
        (
            "revision",
            &part.replace("\"revision\":2", "\"revision\":3"),
            "revision 3",
        ),
        (
            "points",
            &part.replace("\"snr\":7.0", "\"snr\":7.5"),
            "not the same points",
        ),
        (
            "empty",
            &part.replace("[[0,4]]", "[[0,0]]"),
            "no seeds: 0..0",
        ),
    ] {
        scratch.file(name, text);
        Scratch::refused(&merge(&["part", name]), &[name, reason]);
    }
    // A single part must also be of a known study and its points.
    for (name, reason) in [
        ("study", "no study `other`"),
        ("revision", "revision 3"),
        ("points", "not the same points"),
    ] {
        Scratch::refused(&merge(&[name]), &[name, reason]);
    }
    assert!(!scratch.path("sum").exists());
}

#[test]
fn bad_command_lines_are_refused() {
    let scratch = Scratch::new();
    for (arguments, reason) in [
        (&["sweep", "no-such"][..], "no study `no-such`"),
        (&["sweep", STUDY], "--seeds A..B and --out FILE"),
        (&["sweep", STUDY, "--seeds", "3..3", "--out", "p"], "3..3"),
        (&["sweep", STUDY, "--seeds", "5", "--out", "p"], "A..B"),
        (&["sweep", STUDY, "--seeds", "-1..2", "--out", "p"], "-1"),
        (&["sweep", STUDY, "--seeds", "0..1"], "--out"),
        (
            &["sweep", STUDY, "--seeds", "0..1", "--out", "no/such/p"],
            "no/such",
        ),
        (&["merge", "--out", "p"], "PART"),
    ] {
        Scratch::refused(&scratch.lab(arguments), &[reason]);
    }
    let list = scratch.lab(&["sweep"]);
    assert!(list.status.success());
    assert!(String::from_utf8(list.stdout).unwrap().contains(STUDY));
}

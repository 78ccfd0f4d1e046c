//! Ctrl-C: the first ends the photons and the results until then are written, the second ends the
//! program.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Scratch, assert_contains, names};
use crate::view::until;

/// Hours of work.
const LINE: &str = "--cycles 400000000 --no-csv --quiet --out out";
/// Bytes of a file that has events.
const MORE_THAN_HEADER: u64 = 65_536;

/// Begins a simulation, and presses Ctrl-C once it has written events.
fn interrupted(scratch: &Scratch) -> Child {
    let scene = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenes/single-pixel.toml"
    );
    let mut command = scratch.command(&format!("simulate --scene {scene} {LINE}"));
    let child = command.stderr(Stdio::piped()).spawn().unwrap();
    let out = scratch.path("out");
    let bytes = || {
        let files = names(&out).into_iter();
        files.map(|name| out.join(name).metadata().map_or(0, |file| file.len()))
    };
    until("begun", || {
        out.is_dir() && bytes().any(|bytes| bytes > MORE_THAN_HEADER)
    });
    press(&child);
    child
}

fn press(child: &Child) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status();
    assert!(sent.unwrap().success());
}

#[test]
fn the_first_ends_the_photons_and_the_results_until_then_are_whole() {
    let scratch = Scratch::new();
    let since = Instant::now();
    let output = interrupted(&scratch).wait_with_output().unwrap();
    assert!(since.elapsed() < Duration::from_secs(60));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), message.lines().count()),
        (Some(1), 1)
    );
    let summary = scratch.summary();
    let cycles = summary["cycles"].as_u64().unwrap();
    assert!(cycles > 0 && cycles < 400_000_000);
    assert_contains(&message, "ended by Ctrl-C after ");
    assert_contains(
        &message,
        " of 400,000,000 laser cycles; out has the results until then",
    );
    let warning = summary["warnings"][0].as_str().unwrap();
    assert_contains(warning, "ended early, after ");
    // They are those of a run of so many laser cycles.
    let events = std::fs::read(scratch.path("out/events.aer")).unwrap();
    let scene = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenes/single-pixel.toml"
    );
    scratch.printed(&format!(
        "simulate --scene {scene} --cycles {cycles} --quiet --out same"
    ));
    assert!(events == std::fs::read(scratch.path("same/events.aer")).unwrap());
}

/// The results may be whole before the second comes: then it is tried again.
#[test]
fn the_second_ends_the_program_at_once() {
    let ended_at_once = (0..10).any(|_| {
        let scratch = Scratch::new();
        let child = interrupted(&scratch);
        press(&child);
        let code = child.wait_with_output().unwrap().status.code();
        assert!([Some(1), Some(130)].contains(&code), "{code:?}");
        code == Some(130)
    });
    assert!(ended_at_once);
}

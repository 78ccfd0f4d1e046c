//! A disk that is full.

use std::path::Path;
use std::process::Command;

use super::{Work, files};
use crate::common::{assert_contains, npy, skipped};

/// Returns whether the tools of a test are installed, and prints the missing ones.
pub(super) fn is_there(test: &str, tool: &[&str]) -> bool {
    let ran = Command::new(tool[0]).args(&tool[1..]).output();
    let is_there = ran.is_ok_and(|ran| ran.status.success());
    if !is_there {
        skipped(test, &tool.join(" "));
    }
    is_there
}

/// Checks for one line about a full disk that names one of `places`.
#[track_caller]
pub(super) fn is_named(message: &str, places: &[&str]) {
    assert_eq!(message.lines().count(), 1, "{message}");
    let named = |place: &&str| message.starts_with(&format!("error: {place}"));
    assert!(places.iter().any(named), "{message}");
    assert_contains(message, "No space left on device");
}

/// A small file system of so many kilobytes, with the earlier results.
const DISK: &str = "mount -t tmpfs -o size=SIZEk none disk && cp -a before/. disk && \"$@\"
status=$?
cp -a disk/. after/
exit $status";

/// Mounting needs privileges.
#[test]
#[ignore = "mounts a disk of its own"]
fn a_disk_that_fills_up_changes_nothing_on_it() {
    let tool = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"];
    if !is_there("a disk of its own", &tool) {
        return;
    }
    let work = Work::new();
    let before = work.earlier("simulated");
    let (scratch, line) = (&work.scratch, work.line("simulated", true));
    std::fs::rename(scratch.path("simulated"), scratch.path("before")).unwrap();
    std::fs::create_dir(scratch.path("disk")).unwrap();
    let taken: usize = before
        .values()
        .map(|bytes| bytes.len().div_ceil(4096) * 4)
        .sum();
    let line = line.replace(" simulated", " disk");
    let (mut refused, mut whole) = (0, 0);
    for room in [0, 4, 8, 20, 40, 100, 200, 300, 400, 500, 700, 2000] {
        let after = scratch.path("after");
        let _ = std::fs::remove_dir_all(&after);
        std::fs::create_dir(&after).unwrap();
        let shell = DISK.replace("SIZE", &(taken + room).to_string());
        let shell = format!("exec unshare -rm sh -c '{shell}' sh \"$@\"");
        let output = scratch.in_shell(&shell, &line).output().unwrap();
        let left = files(&after);
        if output.status.success() {
            assert!(left.contains_key("summary.json") && left != before);
            whole += 1;
        } else {
            is_named(&String::from_utf8(output.stderr).unwrap(), &["disk"]);
            assert!(left == before, "{room} kB more");
            refused += 1;
        }
    }
    assert!(refused > 3 && whole > 0, "{refused} refused, {whole} whole");
    println!("faults: {refused} full disks of their own: earlier results as they were");
}

#[test]
fn warnings_that_nobody_can_take_stop_nothing() {
    if !Path::new("/dev/full").exists() {
        skipped("a full standard error", "/dev/full");
        return;
    }
    let work = Work::new();
    let counts: Vec<u8> = [1, 0].into_iter().cycle().take(2 * 2 * 32 * 2).collect();
    work.scratch
        .file("in.npy", npy("<u2", "(2, 2, 32)", &counts));
    let line = "replay --input in.npy --bins 16 --out warned";
    let output = work.scratch.run(line);
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("warning: ")
    );
    let output = work
        .scratch
        .in_shell("exec \"$@\" 2>/dev/full", line)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}

#[test]
fn a_table_that_nobody_can_take_is_an_error() {
    if !Path::new("/dev/full").exists() {
        skipped("a full standard output", "/dev/full");
        return;
    }
    let work = Work::new();
    let shell = "exec \"$@\" >/dev/full";
    let output = work
        .scratch
        .in_shell(shell, "decode source/events.aer")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_contains(&message, "No space left on device");
}

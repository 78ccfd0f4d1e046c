//! The program killed at any moment.

use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread;
use std::time::Instant;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::{Files, Work, partial, times};

/// Removes files that are incomplete and will stay so.
fn complete(mut files: Files) -> Files {
    files.retain(|name, _| !name.ends_with(".partial"));
    files
}

/// Starts the new run into `out`.
fn begin(work: &Work, out: &str) -> Child {
    let mut command = work.scratch.command(&work.line(out, true));
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Checks that each file belongs to the earlier or the new run, and all to one run if there is a
/// summary. Returns whether the new run is complete.
#[track_caller]
fn check(found: &Files, earlier: &Files, new: &Files) -> bool {
    let has_summary = found
        .keys()
        .any(|name| name == "summary.json" || name.is_empty());
    if has_summary {
        assert!(found == earlier || found == new, "a mixture looks complete");
    }
    for (name, bytes) in found {
        let complete = [earlier.get(name), new.get(name)];
        assert!(complete.contains(&Some(bytes)), "{name} is not whole");
    }
    has_summary && found == new
}

#[test]
fn a_killed_run_leaves_nothing_that_looks_complete_and_is_not() {
    let work = Work::new();
    let mut random = Pcg32::seed_from_u64(11);
    let (mut killed, mut before, mut between) = (0, 0, 0);
    for (out, _) in &work.commands {
        let earlier = work.earlier(out);
        let since = Instant::now();
        assert!(begin(&work, out).wait().unwrap().success());
        let takes = since.elapsed();
        let new = work.written(out);
        for _ in 0..times(3, 20) {
            assert!(work.earlier(out) == earlier, "the same seed");
            let mut child = begin(&work, out);
            thread::sleep(takes.mul_f64(f64::from(random.next_u32()) / 2f64.powi(32)));
            child.kill().unwrap();
            child.wait().unwrap();
            killed += 1;
            let found = complete(work.written(out));
            let is_new = check(&found, &earlier, &new);
            before += u32::from(found == earlier);
            between += u32::from(!is_new && found != earlier);
        }
        // The next run succeeds and removes what the killed runs have left.
        assert!(begin(&work, out).wait().unwrap().success());
        let found = work.written(out);
        assert!(found == new, "{out}: left {:?}", partial(&found));
    }
    println!(
        "faults: killed {killed} times: {before} times the earlier results stayed, {between} times there \
         was no summary, 0 mixtures that look complete"
    );
}

#[test]
fn a_run_killed_while_files_move_to_their_places_has_no_summary() {
    let work = Work::new();
    let out = "simulated";
    let earlier = work.earlier(out);
    assert!(begin(&work, out).wait().unwrap().success());
    let new = work.written(out);
    let (mut between, all) = (0, times(5, 30));
    for _ in 0..all {
        work.earlier(out);
        // This file is moved first.
        let events = work.scratch.path("simulated/events.aer");
        let ino = |events: &Path| std::fs::metadata(events).map_or(0, |file| file.ino());
        let earlier_ino = ino(&events);
        let mut child = begin(&work, out);
        while ino(&events) == earlier_ino && child.try_wait().unwrap().is_none() {
            std::hint::spin_loop();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let found = complete(work.written(out));
        let is_new = check(&found, &earlier, &new);
        between += u32::from(!is_new);
    }
    // Some kills come before the end of a run.
    assert!(between > 0 || all < 30, "all of {all} came too late");
    println!(
        "faults: killed {all} times once files moved to their places: {between} times there was no \
         summary, else all was there"
    );
}

//! The disk is full, or the program is killed, at each system call that changes a file.

use std::os::unix::process::ExitStatusExt;

use super::full::{is_named, is_there};
use super::{Files, Work, Writer, files, partial, times};
use crate::common::strace::{Fault, calls, faulty};

/// Settings that are replaced are kept, under names that end so.
const KEPT: &str = "~1";
/// A signal that cannot be caught.
const KILL: i32 = 9;
/// Calls by which files move to their places.
const MOVES: [&str; 5] = ["rename", "renameat", "renameat2", "unlink", "unlinkat"];

/// The files without the incomplete ones, and without settings that were kept.
fn complete(mut files: Files, earlier: &Files) -> Files {
    files.retain(|name, bytes| {
        let kept = name.strip_suffix(KEPT);
        assert!(kept.is_none_or(|of| earlier.get(of) == Some(bytes)));
        kept.is_none() && !name.ends_with(".partial")
    });
    files
}

/// Checks that each file belongs to the earlier or the new run, and all to one run if the file is there that is
/// written last. Returns whether the new run is complete.
#[track_caller]
fn check(found: &Files, earlier: &Files, new: &Files, writer: &Writer) -> bool {
    for (name, bytes) in found {
        let complete = [earlier.get(name), new.get(name)];
        assert!(complete.contains(&Some(bytes)), "{name} is not whole");
    }
    let has_last = found.contains_key(writer.last);
    assert!(
        !has_last || found == new || found == earlier,
        "a mixture looks complete"
    );
    // A file alone is never missing.
    assert!(!writer.last.is_empty() || has_last, "no file is left");
    has_last && found == new
}

#[test]
fn each_file_is_the_old_or_the_new_one_whatever_call_fails_or_is_the_last() {
    if !is_there("faults at each call", &["strace", "--version"]) {
        return;
    }
    let work = Work::new();
    let (mut refused, mut went_on, mut killed) = (0, 0, [0; 3]);
    for (number, writer) in work.commands.iter().enumerate() {
        let out = writer.out;
        let earlier = work.earlier(out);
        let new_run = work.scratch.command(&work.line(out, true));
        let calls = calls(&new_run, &work.scratch.path(""));
        let new = complete(work.written(out), &earlier);
        assert!(
            new.get(writer.last) != earlier.get(writer.last),
            "{out}: the runs are the same"
        );
        let every = calls
            .len()
            .div_ceil(usize::try_from(times(2, 100_000)).unwrap());
        for call in calls.iter().skip(number % every).step_by(every) {
            let at = format!("{out}: {call:?}");
            let all = files(&work.scratch.path(""));
            for name in partial(&all) {
                std::fs::remove_file(work.scratch.path(name)).unwrap();
            }
            work.restore(out, &earlier);
            let output = faulty(&new_run, call, Fault::Full).output().unwrap();
            let found = work.written(out);
            // A temporary file that cannot be removed stays.
            let left = files(&work.scratch.path(""));
            assert!(
                partial(&left).is_empty() || call.name.starts_with("unlink"),
                "{at}: left {:?}",
                partial(&left)
            );
            let found = complete(found, &earlier);
            let is_new = check(&found, &earlier, &new, writer);
            if output.status.success() {
                // Another way was found, or what failed was not needed.
                assert!(is_new, "{at}: success, but not all is saved");
                went_on += 1;
            } else {
                assert_eq!(output.status.code(), Some(1), "{at}: {output:?}");
                is_named(&String::from_utf8(output.stderr).unwrap(), &[out]);
                let is_moving = MOVES.contains(&&call.name[..]);
                assert!(found == earlier || is_moving, "{at}");
                refused += 1;
            }

            work.restore(out, &earlier);
            let output = faulty(&new_run, call, Fault::Killed).output().unwrap();
            assert_eq!(output.status.signal(), Some(KILL), "{at}: {output:?}");
            let found = complete(work.written(out), &earlier);
            let is_new = check(&found, &earlier, &new, writer);
            let is_moving = MOVES.contains(&&call.name[..]);
            assert!(found == earlier || is_new || is_moving, "{at}");
            killed[0] += 1;
            killed[1] += u32::from(found == earlier);
            killed[2] += u32::from(!is_new && found != earlier);
        }
        // The next run succeeds. In the folder of a run it removes what the killed ones have left.
        assert!(work.scratch.run(&work.line(out, true)).status.success());
        let found = work.written(out);
        assert!(
            partial(&found).is_empty() || writer.last != "summary.json",
            "{out}"
        );
        assert!(complete(found, &earlier) == new, "{out}");
    }
    let [killed, before, between] = killed;
    assert!(refused > 0 && killed > 0 && before < killed);
    println!(
        "faults: {} commands, the disk full at each of {} calls: {refused} times one line and an exit code, {went_on} \
         times all was saved, 0 files damaged",
        work.commands.len(),
        refused + went_on
    );
    println!(
        "faults: killed at each of {killed} calls: {before} times the earlier results stayed, {between} times the \
         folder was incomplete, 0 mixtures that look complete"
    );
}

//! The time of day may be set back or forward at any moment. So it is read in a few places only, where a jump does no
//! harm; all waits and intervals have clocks that only go forward.

use crate::doors::{files, root};

/// How code reads the time of day, or times of files.
const READS: [&str; 17] = [
    "SystemTime",
    "chrono::",
    ".modified()",
    ".created()",
    ".accessed()",
    ".mtime",
    "CLOCK_REALTIME",
    "gettimeofday",
    "time(NULL)",
    "Date.now",
    "new Date",
    "Date()",
    "time.time(",
    "from time import",
    "st_mtime",
    "datetime",
    "getmtime",
];

/// The files that read it, in how many lines, and what for.
const READERS: [(&str, usize, &str); 5] = [
    (
        "host/device/src/client.rs",
        2,
        "another number for each session",
    ),
    (
        "host/device/src/setup.rs",
        3,
        "start of a recording in its header, seed of the delays",
    ),
    (
        "host/live/src/feed/session.rs",
        2,
        "start of a recording in its header",
    ),
    (
        "host/live/src/foxglove.rs",
        2,
        "another name for each start of the program",
    ),
    (
        "host/live/src/foxglove/frames/timing.rs",
        2,
        "time of messages before the first laser cycle",
    ),
];

#[test]
fn the_time_of_day_is_read_where_a_jump_does_no_harm() {
    let mut all = Vec::new();
    for folder in ["bindings", "core", "firmware", "host", "link", "sensors"] {
        let ends = ["rs", "py", "js", "html", "c", "h", "hpp"];
        files(&root().join(folder), &ends, &mut all);
    }
    // Programs, not their tests.
    all.retain(|(name, _)| !name.contains("/tests/") && !name.contains("/bench/"));
    let reads = |line: &&str| READS.iter().any(|reads| line.contains(reads));
    let readers = all
        .iter()
        .map(|(name, text)| (&name[..], text.lines().filter(reads).count()));
    let mut readers: Vec<_> = readers.filter(|&(_, lines)| lines > 0).collect();
    readers.sort_unstable();
    assert_eq!(readers, READERS.map(|(name, lines, _)| (name, lines)));
    println!(
        "faults: {} of {} files read the time of day, none to wait, to measure or to name a file",
        readers.len(),
        all.len()
    );
}

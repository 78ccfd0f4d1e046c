//! The time of day may be set back or forward at any moment. So it is read in a few places only, where a jump does no
//! harm; all waits and intervals have clocks that only go forward.

use std::fs;
use std::path::Path;

/// How code reads the time of day, or times of files.
const READS: [&str; 13] = [
    "SystemTime",
    "chrono::",
    ".modified()",
    ".mtime",
    "CLOCK_REALTIME",
    "gettimeofday",
    "time(NULL)",
    "Date.now",
    "new Date",
    "Date()",
    "time.time(",
    "datetime",
    "getmtime",
];

/// The files that read it, and what for.
const READERS: [(&str, &str); 5] = [
    (
        "host/device/src/client.rs",
        "another number for each session",
    ),
    (
        "host/device/src/setup.rs",
        "start of a recording in its header, seed of the delays",
    ),
    (
        "host/live/src/feed/session.rs",
        "start of a recording in its header",
    ),
    (
        "host/live/src/foxglove.rs",
        "another name for each start of the program",
    ),
    (
        "host/live/src/foxglove/frames/timing.rs",
        "time of messages before the first laser cycle",
    ),
];

/// Files of programs below `folder`, without their tests.
fn files(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            if !["target", "tests", "bench", "node_modules"].contains(&&name[..]) {
                files(&path, found);
            }
        } else if [".rs", ".py", ".js", ".html", ".c", ".h", ".hpp"]
            .iter()
            .any(|end| name.ends_with(end))
        {
            found.push((
                path.display().to_string(),
                fs::read_to_string(&path).unwrap(),
            ));
        }
    }
}

#[test]
fn the_time_of_day_is_read_where_a_jump_does_no_harm() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .canonicalize()
        .unwrap();
    let mut all = Vec::new();
    for folder in [
        "bindings", "core", "draw", "firmware", "host", "link", "sensors", "theory",
    ] {
        files(&root.join(folder), &mut all);
    }
    let readers = all
        .iter()
        .filter(|(_, text)| READS.iter().any(|reads| text.contains(reads)));
    let readers = readers.map(|(name, _)| name.strip_prefix(root.to_str().unwrap()).unwrap());
    let mut readers: Vec<&str> = readers.map(|name| name.trim_start_matches('/')).collect();
    readers.sort_unstable();
    assert_eq!(readers, READERS.map(|(name, _)| name));
    println!(
        "faults: {} of {} files read the time of day, none to wait, to measure or to name a file",
        readers.len(),
        all.len()
    );
}

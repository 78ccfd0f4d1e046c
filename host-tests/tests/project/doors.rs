//! Sockets and files: every listener is bound to this computer, and files are written in a few places
//! only, which have tests with faults.

use std::fs;
use std::path::{Path, PathBuf};

/// Code and commands that listen.
const LISTENS: [&str; 15] = [
    "Listener::bind(",
    "UdpSocket::bind(",
    " bind(",
    ".bind(",
    ".listen(",
    "listen(",
    "server=on",
    "-gdb",
    "dask scheduler",
    "dask worker",
    "LocalCluster(",
    "Client(n_workers",
    "Client(processes",
    "http.server",
    "socketserver",
];

/// The same words without a listener.
const HARMLESS: [&str; 4] = [
    // Replaces the server for Foxglove, and refuses.
    "pub fn bind(_port",
    // The function in the tests that listens.
    "listen(move |",
    "listen(|",
    "use crate::{",
];

/// Addresses of this computer.
const LOOPBACK: [&str; 4] = [
    "LOCALHOST",
    "127.0.0.1",
    "INADDR_LOOPBACK",
    "dashboard_address=None",
];

/// The same in a command of Dask, which opens two ports or more.
const DASK: [&str; 2] = ["--host 127.0.0.1", "--dashboard-address 127.0.0.1"];

/// Addresses of all interfaces, which must not occur.
const EVERYWHERE: [&str; 5] = [
    "0.0.0.0",
    "INADDR_ANY",
    "UNSPECIFIED",
    "tcp::",
    "in6addr_any",
];

/// Code that writes files.
const WRITES: [&str; 13] = [
    "fs::write(",
    "File::create",
    "OpenOptions",
    "fs::rename(",
    "fs::copy(",
    "fs::hard_link(",
    "create_dir",
    ".persist(",
    ".persist_noclobber(",
    "os.replace(",
    "os.makedirs(",
    "\"xb\"",
    "\"wb\"",
];

/// The files that write results: below `--out`, or to a file that an option names.
const WRITERS: [&str; 7] = [
    "bindings/python/src/aer.rs",
    "host/data/src/options/files.rs",
    "host/device/src/monitor/event_file.rs",
    "host/live/src/outputs.rs",
    "host/run/src/compare/page.rs",
    "host/run/src/export.rs",
    "host/run/src/output.rs",
];

pub fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    root.canonicalize().unwrap()
}

/// Files below `folder` with one of these endings, by their paths from the root.
pub fn files(folder: &Path, ends: &[&str], found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() {
            let is_built = matches!(
                name,
                "target" | "out" | "corpus" | "artifacts" | "node_modules"
            );
            if !is_built && (!name.starts_with('.') || [".ci", ".github"].contains(&name)) {
                files(&path, ends, found);
            }
            continue;
        }
        // Scripts in `.ci` have no ending.
        let is_script = folder.file_name().is_some_and(|folder| folder == ".ci");
        let end = path.extension().and_then(|end| end.to_str());
        if is_script || end.is_some_and(|end| ends.contains(&end)) {
            let short = path.strip_prefix(root()).unwrap().to_str().unwrap();
            let text = fs::read_to_string(&path).unwrap_or_default();
            found.push((short.to_owned(), text));
        }
    }
}

/// This file has all these words.
fn is_this(name: &str) -> bool {
    name.ends_with("project/doors.rs")
}

/// Lines of `text` that listen without an address of this computer nearby.
fn open_doors(text: &str) -> (usize, Vec<&str>) {
    let lines: Vec<&str> = text.lines().collect();
    let (mut doors, mut open) = (0, Vec::new());
    for (at, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let is_comment = ["//", "*", "/*"].iter().any(|mark| code.starts_with(mark));
        if is_comment || !LISTENS.iter().any(|listens| line.contains(listens)) {
            continue;
        }
        let is_prose = line.contains("dask ") && !code.starts_with("dask ");
        if is_prose || HARMLESS.iter().any(|harmless| line.contains(harmless)) {
            continue;
        }
        doors += 1;
        let mut nearby = lines[at.saturating_sub(4)..lines.len().min(at + 3)].iter();
        let is_local = if code.starts_with("dask ") {
            DASK.iter().all(|local| line.contains(local))
        } else {
            nearby.any(|line| LOOPBACK.iter().any(|local| line.contains(local)))
        };
        if !is_local {
            open.push(*line);
        }
    }
    (doors, open)
}

#[test]
fn what_listens_does_so_for_this_computer_alone() {
    let mut all = Vec::new();
    files(
        &root(),
        &[
            "rs", "py", "js", "html", "c", "cpp", "h", "sh", "toml", "md", "ipynb",
        ],
        &mut all,
    );
    // Firmware has no network.
    all.retain(|(name, _)| !is_this(name) && !name.starts_with("firmware/src/"));
    let (mut doors, mut open) = (0, Vec::new());
    for (name, text) in &all {
        let (more, lines) = open_doors(text);
        doors += more;
        open.extend(lines.into_iter().map(|line| format!("{name}: {line}")));
        let everywhere = text
            .lines()
            .filter(|line| EVERYWHERE.iter().any(|all| line.contains(all)));
        open.extend(everywhere.map(|line| format!("{name}: {line}")));
    }
    assert_eq!(open, [""; 0]);
    for harmless in HARMLESS {
        assert!(
            all.iter().any(|(_, text)| text.contains(harmless)),
            "{harmless}"
        );
    }
    let page = include_str!("../../../docs/reliability.md");
    let said = page.matches(&format!("{doors} places ")).count();
    assert_eq!(
        said, 2,
        "{doors} doors are not what docs/reliability.md says"
    );
    println!("doors: {doors} places listen, all for this computer alone");
}

#[test]
fn a_door_that_is_open_is_found() {
    for text in [
        "let listener = TcpListener::bind((host, 0))?;",
        "dask scheduler --dashboard-address 127.0.0.1:0 --scheduler-file scheduler.json &",
        "dask worker --host 127.0.0.1 --scheduler-file scheduler.json &",
        "let uart = format!(\"tcp:{host}:{port},server=on,wait=off\");",
    ] {
        assert_eq!(open_doors(text), (1, vec![text]));
    }
    let local = "let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;";
    assert_eq!(open_doors(local), (1, Vec::new()));
}

#[test]
fn results_are_written_in_a_few_places_only() {
    let mut all = Vec::new();
    for folder in ["host", "bindings/python/src", "bindings/python/python"] {
        files(&root().join(folder), &["rs", "py"], &mut all);
    }
    // Tests and examples write their own input.
    all.retain(|(name, _)| !name.contains("/tests/") && !name.contains("/examples/"));
    let writes = |text: &str| WRITES.iter().any(|writes| text.contains(writes));
    let code = |text: &str| {
        let end = text.find("#[cfg(test)]\nmod tests {");
        text[..end.unwrap_or(text.len())].to_owned()
    };
    let mut writers: Vec<&str> = all
        .iter()
        .filter(|(name, text)| !name.ends_with("/tests.rs") && writes(&code(text)))
        .map(|(name, _)| &name[..])
        .collect();
    writers.sort_unstable();
    assert_eq!(writers, WRITERS);
}

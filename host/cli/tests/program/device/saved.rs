//! A recording while the disk is full, and of a program that is killed: what was printed is in the
//! file that is not complete, and nothing else is touched.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::common::{Scratch, assert_contains, names, skipped};
use crate::device::monitor::{LONG, device, reference};
use crate::view::http::{Stream, post};

const OLDER: &str = "older";

/// The rows of the remaining temporary file, which must be the only file beside the older one. It is
/// refused as incomplete.
#[track_caller]
fn left(scratch: &Scratch) -> String {
    let names = names(&scratch.path(""));
    let [partial, events] = &names[..] else {
        panic!("{names:?}");
    };
    assert_eq!(
        (&events[..], &scratch.read(events)[..]),
        ("events.aer", OLDER)
    );
    assert!(partial.starts_with(".dtof-recording-") && partial.ends_with(".partial"));
    let decoded = scratch.run(&format!("decode {partial}"));
    assert_eq!(decoded.status.code(), Some(1));
    let message = String::from_utf8(decoded.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_contains(&message, "the file ends ");
    let rows = String::from_utf8(decoded.stdout).unwrap();
    assert!(reference().starts_with(&rows), "{rows}");

    // Other programs can read as much.
    let exported = scratch.run(&format!("export {partial} --format csv --out points.csv"));
    assert_eq!(exported.status.code(), Some(1));
    let points = scratch.read("points.csv").lines().count();
    assert_eq!(points, rows.lines().count().max(1));
    rows
}

/// Complete rows of the output.
fn complete_lines(printed: &str) -> &str {
    &printed[..printed.rfind('\n').map_or(0, |end| end + 1)]
}

/// Rows below the names of the columns.
fn events(rows: &str) -> usize {
    complete_lines(rows).lines().count().saturating_sub(1)
}

/// Kills a recording at a time that depends on the seed. Returns the printed and the remaining rows.
fn killed(seed: u64) -> [usize; 2] {
    let scratch = Scratch::new();
    scratch.file("events.aer", OLDER);
    let line = format!(
        "monitor --pixels 4 --columns 2 --device {} --record events.aer",
        device(true, LONG)
    );
    let mut command = scratch.command(&line);
    let command = command.stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let mut stdout = child.stdout.take().unwrap();
    // The first column name shows that it has begun.
    stdout.read_exact(&mut [0; 5]).unwrap();
    let microseconds = Pcg32::seed_from_u64(seed).next_u32() % 1_500_000;
    thread::sleep(Duration::from_micros(microseconds.into()));
    child.kill().unwrap();
    let mut printed = "cycle".to_owned();
    stdout.read_to_string(&mut printed).unwrap();
    child.wait().unwrap();
    let rows = left(&scratch);
    assert!(
        rows.starts_with(complete_lines(&printed)) || events(&printed) == 0,
        "seed {seed}: printed, not saved"
    );
    [&printed[..], &rows].map(events)
}

#[test]
fn what_was_printed_before_the_program_was_killed_is_in_the_file_it_left() {
    let kills: u64 = match std::env::var_os("DTOF_LONG") {
        Some(_) => 60,
        None => 20,
    };
    let mut sums = [0; 2];
    for first in (0..kills).step_by(10) {
        thread::scope(|scope| {
            let runs = (first..first + 10).map(|seed| scope.spawn(move || killed(seed)));
            for run in runs.collect::<Vec<_>>() {
                let rows = run.join().unwrap();
                sums[0] += rows[0];
                sums[1] += rows[1];
            }
        });
    }
    assert!(sums[0] > 0 && sums[1] >= sums[0], "{sums:?}");
    println!(
        "faults: recording killed {kills} times: {} events printed, {} saved, 0 wrong, 0 earlier files damaged",
        sums[0], sums[1]
    );
}

/// The bytes of the header of a recording, which has the settings.
fn header() -> usize {
    let scratch = Scratch::new();
    let name = device(true, LONG);
    let line = format!("monitor --pixels 4 --columns 2 --device {name} --record events.aer");
    scratch.printed(&format!("{line} --seconds 1"));
    let bytes = std::fs::read(scratch.path("events.aer")).unwrap();
    usize::from(u16::from_le_bytes([bytes[10], bytes[11]]))
}

/// `dtof LINE` on a disk that takes so many bytes of a file.
fn limited(scratch: &Scratch, line: &str, bytes: usize) -> Command {
    let shell = format!("trap '' XFSZ; exec prlimit --fsize={bytes} \"$@\"");
    scratch.in_shell(&shell, line)
}

/// A disk that takes so many bytes of a file with a header of this length.
fn full(bytes: usize, header: usize) -> usize {
    let scratch = Scratch::new();
    scratch.file("events.aer", OLDER);
    let line = format!(
        "monitor --pixels 4 --columns 2 --seconds 30 --device {} --record events.aer",
        device(true, LONG)
    );
    let output = limited(&scratch, &line, bytes).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{bytes} bytes: {output:?}");
    let message = String::from_utf8(output.stderr).unwrap();
    let mut errors = message
        .lines()
        .filter(|line| !line.starts_with("events/s "));
    let error = errors.next().unwrap();
    assert_eq!(errors.next(), None, "{message}");
    assert_contains(error, "events.aer: File too large");
    if bytes < header {
        // Without a header there is nothing to keep.
        assert_eq!(names(&scratch.path("")), ["events.aer"]);
        assert_eq!(scratch.read("events.aer"), OLDER);
        return 0;
    }
    let partial = names(&scratch.path("")).swap_remove(0);
    assert_contains(error, &format!("{partial} has what was recorded"));
    let printed = String::from_utf8(output.stdout).unwrap();
    let rows = left(&scratch);
    assert!(rows.starts_with(complete_lines(&printed)) || events(&printed) == 0);
    // All that fits is there. The rest is shorter than an event with its time word.
    let saved = events(&rows);
    assert!(
        header + 16 * saved + 32 + 16 > bytes,
        "{bytes} bytes hold {saved} events"
    );
    saved
}

#[test]
fn a_recording_on_a_full_disk_keeps_what_came_and_says_where() {
    if !Path::new("/usr/bin/prlimit").exists() {
        skipped("a recording on a full disk", "prlimit");
        return;
    }
    let header = header();
    assert!(header > 64);
    let whole = [0, 1, 15, 16, 31, 32, 33, 136, 436, 936, 1170].map(|more| header + more);
    let limits = [&[0, 1, 63, 64, header - 1], &whole[..]].concat();
    let mut saved = 0;
    thread::scope(|scope| {
        let runs = limits
            .iter()
            .map(|&bytes| scope.spawn(move || full(bytes, header)));
        let runs: Vec<_> = runs.collect();
        saved = runs.into_iter().map(|run| run.join().unwrap()).sum();
    });
    assert!(saved > 0);
    println!(
        "faults: recording on {} full disks: {saved} events kept where the line says, 0 wrong, 0 earlier files \
         damaged",
        limits.len()
    );
}

/// A recording that a page has begun, on a disk that takes so many bytes of a file. The program says at its end where
/// the events are.
fn full_of_the_page(bytes: usize) {
    let scratch = Scratch::new();
    scratch.file("events.aer", OLDER);
    let line = format!(
        "view --pixels 4 --columns 2 --device {} --out .",
        device(true, LONG)
    );
    let mut limited = limited(&scratch, &line, bytes);
    let limited = limited.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = limited.spawn().unwrap();
    let mut address = String::new();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    stdout.read_line(&mut address).unwrap();
    let port = address.trim().trim_end_matches('/').rsplit(':').next();
    let port = port.unwrap().parse().unwrap();
    let mut page = Stream::open(port, 0);
    page.until("live", |frame| frame["connection"]["state"] == "live");
    let answer = post(port, "/record", "{\"on\":true}");
    assert_eq!(answer.status, 200, "{answer:?}");
    let frame = page.until("ended", |frame| frame["recorded"]["error"] != "");
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status();
    assert!(sent.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");

    let names = names(&scratch.path(""));
    assert_eq!(names.len(), 2, "{names:?}");
    assert_eq!(scratch.read("events.aer"), OLDER);
    let end = format!("{} has what was recorded", names[0]);
    for said in [frame["recorded"]["error"].as_str().unwrap(), &message] {
        assert_contains(said, "events-2.aer: cannot be written, ");
        assert_contains(said, &end);
    }
    let decoded = scratch.run(&format!("decode {}", names[0]));
    let rows = String::from_utf8(decoded.stdout).unwrap();
    let (_, rows) = rows.split_once('\n').unwrap();
    assert!(reference().contains(rows), "{rows}");
}

#[test]
fn a_recording_of_the_page_on_a_full_disk_is_no_success() {
    if !Path::new("/usr/bin/prlimit").exists() {
        skipped("a recording of the page on a full disk", "prlimit");
        return;
    }
    let header = header();
    let more: &[usize] = match std::env::var_os("DTOF_LONG") {
        Some(_) => &[0, 1, 15, 16, 31, 32, 33, 63, 64, 65, 136, 436],
        None => &[0, 33, 136],
    };
    thread::scope(|scope| {
        for more in more {
            scope.spawn(move || full_of_the_page(header + more));
        }
    });
    println!(
        "faults: recording of the live page on {} full disks: each one line and an exit code, 0 earlier files damaged",
        more.len()
    );
}

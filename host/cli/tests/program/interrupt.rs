//! Long calculations on a terminal: progress from the first second, and Ctrl-C.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Scratch, npy};

/// Runs `dtof` with `arguments` on a terminal of util-linux until a progress bar appears, then presses Ctrl-C. The
/// command replaces its shell, and Ctrl-C ends it also where this test runs in the background, which ignores it.
fn interrupted(scratch: &Scratch, arguments: &str) {
    let command = format!(
        "exec env --default-signal=INT '{}' {arguments}",
        env!("CARGO_BIN_EXE_dtof")
    );
    let begun = Instant::now();
    let mut terminal = Command::new("script")
        .args(["--quiet", "--return", "--flush", "--command"])
        .args([&command, "/dev/null"])
        .current_dir(scratch.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut screen = terminal.stdout.take().unwrap();
    let (mut shown, mut bytes) = (String::new(), [0; 4096]);
    while !shown.contains(" steps, ") {
        let read = screen.read(&mut bytes).unwrap();
        assert!(read > 0, "{arguments}: no progress: {shown}");
        shown += &String::from_utf8_lossy(&bytes[..read]);
    }
    let appeared = begun.elapsed();
    let pressed = Instant::now();
    terminal.stdin.as_mut().unwrap().write_all(b"\x03").unwrap();
    // Else `script` would wait until somebody reads.
    let mut rest = Vec::new();
    screen.read_to_end(&mut rest).unwrap();
    shown += &String::from_utf8_lossy(&rest);
    let status = terminal.wait().unwrap();
    let ended = pressed.elapsed();
    assert!(!status.success(), "{arguments}: {shown}");
    // Half a second and three on an idle machine, whose processors others may use.
    for (took, most) in [(ended, 5), (appeared, 10)] {
        assert!(took < Duration::from_secs(most), "{arguments}: {took:?}");
    }
}

#[test]
fn tune_shows_progress_and_ends_at_ctrl_c() {
    let light = "--background 0.01 --sigma-bins 1 --l2 50000 --x 11";
    // Each takes at least three seconds.
    for (rule, signal) in [("paper", 0.02), ("average", 0.005), ("window", 0.001)] {
        let arguments = format!("tune --rule {rule} --signal {signal} {light}");
        interrupted(&Scratch::new(), &arguments);
    }
}

#[test]
fn calibrate_shows_progress_and_ends_at_ctrl_c_without_a_file() {
    let scratch = Scratch::new();
    let counts = (0..64 * 1024).map(|place| {
        if place % 1024 == 300 {
            90_000u32
        } else {
            40_000
        }
    });
    let bytes: Vec<u8> = counts.flat_map(u32::to_le_bytes).collect();
    scratch.file("counts.npy", npy("<u4", "(8, 8, 1024)", &bytes));
    let arguments = "calibrate counts.npy --recorded-cycles 100000 --out dtof.toml";
    interrupted(&scratch, arguments);
    assert!(!scratch.path("dtof.toml").exists());
    assert!(!scratch.path("dtof.html").exists());
}

//! The map that `dtof monitor --map` draws on a terminal.

use crate::common::Scratch;

#[test]
fn a_map_needs_a_terminal() {
    let output = Scratch::new().run("monitor --device tcp:127.0.0.1:1 --map");
    assert_eq!(output.status.code(), Some(1));
    let error = b"error: --map draws on standard error, which is not a terminal here\n";
    assert_eq!(output.stderr, error);
}

/// `script` of util-linux gives the command a terminal. The command replaces its shell: an interrupted
/// shell would change the exit code.
#[cfg(target_os = "linux")]
#[test]
fn a_map_is_drawn_on_a_terminal_and_ctrl_c_gives_the_cursor_back() {
    use std::io::{BufRead, BufReader, Read, Write};
    use std::process::{Command, Stdio};

    use crate::device::monitor::{LONG, device};

    let name = device(true, LONG);
    let dtof = env!("CARGO_BIN_EXE_dtof");
    let command = format!("exec '{dtof}' monitor --pixels 4 --map --device {name}");
    let mut terminal = Command::new("script")
        .args(["--quiet", "--return", "--flush", "--command"])
        .args([&command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut screen = BufReader::new(terminal.stdout.take().unwrap());
    let mut drawn = String::new();
    // Wait for a second.
    while !drawn.contains("events/s ") {
        assert!(screen.read_line(&mut drawn).unwrap() > 0, "{drawn}");
    }
    // Ctrl-C.
    terminal.stdin.as_mut().unwrap().write_all(b"\x03").unwrap();
    screen.read_to_string(&mut drawn).unwrap();
    let status = terminal.wait().unwrap();
    assert!(status.success(), "{status}: {drawn}");

    assert!(drawn.contains("4 of 4 pixels"), "{drawn}");
    assert!(drawn.contains("\r\x1b["), "drawn in place: {drawn}");
    assert!(drawn.contains('▀') && !drawn.contains("cycle,pixel"));
    let (_, end) = drawn.rsplit_once("\x1b[?25l").unwrap();
    assert!(end.ends_with("\x1b[?25h"), "{end}");
}

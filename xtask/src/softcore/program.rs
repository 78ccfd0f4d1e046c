//! A program run to its end, or to the end of patience.

use std::io::Read;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

/// What came of a program.
pub struct Ran {
    /// Its exit code; `None` if it was ended, after the time it was given or by a
    /// signal.
    pub code: Option<i32>,
    pub output: String,
    pub errors: String,
}

/// Runs a program, for so long.
pub fn run(command: &mut Command, limit: Duration) -> Result<Ran> {
    let name = command.get_program().to_string_lossy().into_owned();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("{name} does not start"))?;
    let output = child.stdout.take().context("no output")?;
    let errors = child.stderr.take().context("no error output")?;
    let [output, errors] = [
        thread::spawn(move || text(output)),
        thread::spawn(move || text(errors)),
    ];
    let start = Instant::now();
    let code = loop {
        if let Some(status) = child.try_wait()? {
            break status.code();
        }
        if start.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            break None;
        }
        thread::sleep(Duration::from_millis(5));
    };
    Ok(Ran {
        code,
        output: output.join().unwrap_or_default(),
        errors: errors.join().unwrap_or_default(),
    })
}

/// All there is to read; what came before an error is all.
fn text(mut source: impl Read) -> String {
    let mut bytes = Vec::new();
    let _ = source.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_what_does_not_end() {
        let mut endless = Command::new("sleep");
        let ran = run(endless.arg("60"), Duration::from_millis(50)).unwrap();
        assert_eq!(ran.code, None);
    }

    #[test]
    fn tells_both_outputs_and_the_code() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "echo out; echo error >&2; exit 3"]);
        let ran = run(&mut shell, Duration::from_secs(20)).unwrap();
        assert_eq!(
            (ran.code, &*ran.output, &*ran.errors),
            (Some(3), "out\n", "error\n")
        );
    }
}

//! A program run to its end, or to the end of patience.

use std::io::Read;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

/// How long a program may take that ends by itself: only one that hangs takes as long, even on a
/// computer that does much else.
const PATIENCE: Duration = Duration::from_secs(1800);

/// The end of a program and its output.
pub struct ProgramRun {
    /// Its exit code; `None` if it was ended.
    pub code: Option<i32>,
    /// Whether it was ended because it took too long.
    pub timed_out: bool,
    pub output: String,
    pub errors: String,
}

impl ProgramRun {
    /// A success with this output and these errors.
    #[cfg(test)]
    pub fn success(output: &str, errors: &str) -> Self {
        Self {
            code: Some(0),
            timed_out: false,
            output: output.to_owned(),
            errors: errors.to_owned(),
        }
    }

    pub fn has_failed(&self) -> bool {
        self.code.is_some_and(|code| code != 0)
    }

    /// Fails if it did not succeed, with all that it said.
    pub fn succeeded(self, name: &str) -> Result<Self> {
        ensure!(self.code == Some(0), "{name}: {}", self.output());
        Ok(self)
    }

    /// All that it said, and how it ended.
    pub fn output(&self) -> String {
        let end = match self.code {
            _ if self.timed_out => "took too long".to_owned(),
            Some(code) => format!("ends with {code}"),
            None => "was ended by a signal".to_owned(),
        };
        format!("{}{}({end})", self.output, self.errors)
    }
}

/// Runs a program and what it starts to its end; or until it has written a line, and so long
/// after that.
pub fn run(command: &mut Command, awaited: Option<(&str, Duration)>) -> Result<ProgramRun> {
    run_for(PATIENCE, command, awaited)
}

/// Runs a program that has to succeed.
pub fn succeed(command: &mut Command) -> Result<ProgramRun> {
    let ran = run(command, None)?;
    ran.succeeded(&command.get_program().to_string_lossy())
}

fn run_for(
    most: Duration,
    command: &mut Command,
    mut awaited: Option<(&str, Duration)>,
) -> Result<ProgramRun> {
    let name = command.get_program().to_string_lossy().into_owned();
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("{name} does not start: `cargo xtask setup` installs it"))?;
    let output = Text::read(child.stdout.take().context("no output")?);
    let errors = Text::read(child.stderr.take().context("no error output")?);
    let mut end = Instant::now() + most;
    let (code, timed_out) = loop {
        if let Some(status) = child.try_wait()? {
            break (status.code(), false);
        }
        if let Some((line, rest)) = awaited
            && output.has(line)
        {
            (end, awaited) = (Instant::now() + rest, None);
        }
        if Instant::now() > end {
            if cfg!(unix) {
                // Its children hold the other ends of the pipes.
                let kill = format!("kill -s KILL -- -{}", child.id());
                let killed = Command::new("sh").args(["-c", &kill]).status();
                killed.context("sh does not start")?;
            } else {
                child.kill()?;
            }
            child.wait()?;
            break (None, true);
        }
        thread::sleep(Duration::from_millis(5));
    };
    Ok(ProgramRun {
        code,
        timed_out,
        output: output.all(),
        errors: errors.all(),
    })
}

/// Text that a thread reads.
struct Text {
    bytes: Arc<Mutex<Vec<u8>>>,
    reader: JoinHandle<()>,
}

impl Text {
    fn read(mut source: impl Read + Send + 'static) -> Self {
        let bytes = Arc::<Mutex<Vec<u8>>>::default();
        let read = Arc::clone(&bytes);
        let reader = thread::spawn(move || {
            let mut part = [0; 1 << 14];
            // Text before an error is kept.
            while let Ok(length @ 1..) = source.read(&mut part) {
                if let (Ok(mut read), Some(part)) = (read.lock(), part.get(..length)) {
                    read.extend_from_slice(part);
                }
            }
        });
        Self { bytes, reader }
    }

    fn has(&self, line: &str) -> bool {
        text(&self.bytes).lines().any(|written| written == line)
    }

    fn all(self) -> String {
        // It does not panic.
        let _ = self.reader.join();
        text(&self.bytes)
    }
}

/// The text read so far.
fn text(bytes: &Mutex<Vec<u8>>) -> String {
    let bytes = bytes.lock().map(|bytes| bytes.clone());
    String::from_utf8_lossy(&bytes.unwrap_or_default()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_what_does_not_end_and_what_it_has_started() {
        let mut endless = Command::new("sh");
        endless.args(["-c", "echo begun; sleep 600 & sleep 600"]);
        let rest = Duration::from_millis(50);
        for (most, awaited) in [(rest, None), (PATIENCE, Some(("begun", rest)))] {
            let ran = run_for(most, &mut endless, awaited).unwrap();
            assert!(ran.timed_out && ran.code.is_none());
            assert!(ran.output().ends_with("(took too long)"));
        }
    }

    #[test]
    fn the_line_that_is_awaited_is_a_whole_one() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "echo a line more; exit 1"]);
        let ran = run(&mut shell, Some(("a line", Duration::ZERO))).unwrap();
        assert_eq!((ran.code, ran.timed_out), (Some(1), false));
    }

    #[test]
    fn tells_both_outputs_and_the_code() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "echo out; echo error >&2; exit 3"]);
        let ran = run(&mut shell, None).unwrap();
        assert_eq!(
            (ran.code, &*ran.output, &*ran.errors),
            (Some(3), "out\n", "error\n")
        );
    }
}

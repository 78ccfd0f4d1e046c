//! `cargo xtask hil`: tests a real board as the emulators are tested, and writes the results to one
//! file.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};

use crate::bench;
use crate::firmware::{Board, Build};
use crate::flash::chip;
use crate::self_test::{self, EXPECTED};
use crate::tools::PROBE_RS;
use crate::{cargo, succeed};

/// The array and the laser cycles of the photons that are sent to the board.
const ARRAY: &str = "8x8";
const CYCLES: &str = "1000";

/// Steps that need a person: the name, what to do, and what the log of `cargo xtask flash` then
/// shows. The results list them as not tried, until the person edits the line.
const BY_HAND: [(&str, &str, &str); 3] = [
    (
        "Stack overflow",
        "halt the board with a debugger, set the stack pointer to `_stack_end` + 4 and the next instruction to \
         `main`, and let it run",
        "`stack overflow`, then `started: Fault`; the laser is off at once",
    ),
    (
        "Watchdog",
        "flash an image with a real sensor, and halt the board with a debugger for two seconds",
        "`started: Watchdog`; the laser is off after one second",
    ),
    (
        "Brown-out",
        "lower the supply until the board stops, and raise it again",
        "`started: PowerOn`, on an STM32F405 whose option bytes have BOR_LEV on `started: BrownOut`; the \
         laser is off",
    ),
];

/// A board with a debug probe and a serial line.
pub struct Rig {
    root: &'static Path,
    board: Board,
    /// The probe-rs name of its controller.
    chip: String,
    /// Its serial line, as an argument for `dtof --device`.
    device: String,
    /// The folder for the results.
    out: PathBuf,
}

/// The result of a part: a line of text, and more lines below it.
type Found = Result<(String, String)>;

/// A part of the test.
type Part = fn(&Rig) -> Found;

/// Tests a board and writes the file, even if a part fails.
///
/// # Errors
/// Fails if a part fails; the file has the reason.
pub fn run(rig: &Rig) -> Result<()> {
    let version = PROBE_RS.require()?;
    fs::create_dir_all(&rig.out).with_context(|| rig.out.display().to_string())?;
    let name = rig.board.name();
    let mut text = format!("# {name}, a real board\n\n");
    let commit = commit(rig.root).unwrap_or_else(|| "unknown".into());
    let chip = &rig.chip;
    let _ = writeln!(text, "- source: {commit}\n- chip: {chip}\n- {version}");
    let mut failed = Vec::new();
    let parts: [(&str, Part); 3] = [
        ("Self-test", Rig::self_test),
        ("Clock cycles", Rig::bench),
        ("Photons over the serial line", Rig::stream),
    ];
    for (part, run) in parts {
        println!("{part} …");
        let (line, more) = run(rig).unwrap_or_else(|error| {
            failed.push(part);
            (format!("**failed**: {error:#}"), String::new())
        });
        println!("{line}");
        let _ = write!(text, "\n## {part}\n\n{line}\n{more}");
    }
    let mut by_hand = String::from("\n## By hand\n\n");
    for (what, to_do, to_see) in BY_HAND {
        let _ = writeln!(by_hand, "- {what}: not tried. Do: {to_do}. See: {to_see}.");
    }
    print!("{by_hand}");
    text.push_str(&by_hand);
    let file = rig.out.join(format!("{name}.md"));
    fs::write(&file, text).with_context(|| file.display().to_string())?;
    println!("{}: written; please send it", file.display());
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}

impl Rig {
    /// A board. The defaults are its usual controller and the folder `out/hil`.
    ///
    /// # Errors
    /// Fails if the board is emulated only, or `device` is missing.
    pub fn new(
        root: &'static Path,
        board: Board,
        named: Option<String>,
        device: Option<String>,
        out: Option<String>,
    ) -> Result<Self> {
        Ok(Self {
            root,
            board,
            chip: named.map_or_else(|| Ok(chip(board)?.into()), anyhow::Ok)?,
            device: device
                .context("the serial line is missing, for example `--device /dev/ttyUSB0`")?,
            out: match out {
                Some(out) => std::path::absolute(out)?,
                None => root.join("out/hil"),
            },
        })
    }

    /// Writes an image and runs it until it ends. Returns its output.
    fn output(&self, image: &Path) -> Result<String> {
        let mut probe = self.probe("run");
        let output = probe.arg(image).stderr(Stdio::inherit()).output();
        let output = output.context("probe-rs does not start")?;
        let text = String::from_utf8(output.stdout)?;
        ensure!(
            output.status.success(),
            "probe-rs: {}: {text}",
            output.status
        );
        Ok(text)
    }

    fn probe(&self, command: &str) -> Command {
        let mut probe = Command::new(PROBE_RS.program);
        probe.args([command, "--non-interactive", "--chip", &self.chip]);
        probe.stdin(Stdio::null());
        probe
    }

    fn self_test(&self) -> Found {
        let image = self.board.build_bare(self.root, Build::SelfTest)?;
        let found = self.output(&image)?;
        let expected = fs::read_to_string(self.root.join(EXPECTED)).context(EXPECTED)?;
        let differences = self_test::differences(&expected, &found);
        if !differences.is_empty() {
            bail!(
                "differs from {EXPECTED}:\n\n    {}",
                differences.join("\n    ")
            );
        }
        let line = format!("{} lines as in `{EXPECTED}`.", expected.lines().count());
        Ok((line, String::new()))
    }

    fn bench(&self) -> Found {
        let image = self.board.bench(self.root, false)?;
        let rows = bench::rows(&self.output(&image)?, "3")?;
        ensure!(!rows.is_empty(), "the image counted nothing");
        let line = format!(
            "{} operations, with their instructions in the emulator.",
            rows.len()
        );
        Ok((line, bench::beside(self.root, self.board, &rows)?))
    }

    /// The board and this computer find the same events in the photons of the demo.
    fn stream(&self) -> Found {
        let image = self.board.build_bare(self.root, Build::Sidecar)?;
        succeed(self.probe("download").arg(&image))?;
        succeed(&mut self.probe("reset"))?;
        let here = self.demo("here", &[])?;
        let start = Instant::now();
        let there = self.demo(self.board.name(), &["--device", &self.device])?;
        let seconds = start.elapsed().as_secs_f64();
        let [here, there] = [here, there].map(|folder| folder.join("events.csv"));
        let read = |file: &Path| fs::read_to_string(file).context(file.display().to_string());
        let (expected, found) = (read(&here)?, read(&there)?);
        let events = expected.lines().count().saturating_sub(1);
        ensure!(
            expected == found,
            "{} of {events} events here and {} there differ: {} and {}",
            self_test::differences(&expected, &found).len(),
            found.lines().count().saturating_sub(1),
            here.display(),
            there.display()
        );
        let line = format!(
            "{CYCLES} laser cycles of {ARRAY} macropixels in {seconds:.1} s: {events} events, all as on this \
             computer."
        );
        Ok((line, String::new()))
    }

    /// Runs the demo. Returns the folder of its results.
    fn demo(&self, name: &str, arguments: &[&str]) -> Result<PathBuf> {
        let out = self.out.join(name);
        let mut cargo = cargo();
        cargo
            .current_dir(self.root)
            .args(["run", "--locked", "--release", "--quiet"]);
        cargo.args(["--package", "dtof", "--", "demo", "--quiet"]);
        cargo
            .args(["--array", ARRAY, "--cycles", CYCLES, "--out"])
            .arg(&out);
        succeed(cargo.args(arguments))?;
        Ok(out)
    }
}

/// The commit of the sources, with `-dirty` if they have changed since.
fn commit(root: &Path) -> Option<String> {
    let mut git = Command::new("git");
    let git = git.args(["describe", "--always", "--dirty", "--abbrev=40"]);
    let output = git.current_dir(root).stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

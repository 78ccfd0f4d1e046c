//! `cargo xtask check-image`: builds `library-image` for three targets or all, and checks the linked images.
//!
//! The linker itself refuses an image with a reachable panic. The symbols show the rest. On the
//! targets without a floating-point unit (all but thumbv7em) every floating-point operation calls
//! a library routine by name. The same source is compiled for thumbv7em, so its instructions need
//! no disassembler.

mod frames;
mod panics;
pub mod symbols;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::toolchain::{self, Toolchain};
use crate::{cargo, target_folder};

/// For speed, and for size.
const PROFILES: [&str; 2] = ["firmware", "firmware-small"];
/// The target of the boards.
const BOARDS: &str = "thumbv7em-none-eabihf";
/// Targets and the profiles of each that are checked unless `all` is set: the boards' in both, and
/// the smallest Cortex-M and a soft-core for size.
const FIRST: [(&str, &[&str]); 3] = [
    (BOARDS, &PROFILES),
    ("thumbv6m-none-eabi", &[PROFILES[1]]),
    ("riscv32im-unknown-none-elf", &[PROFILES[1]]),
];

/// The undefined function that the panic handler of the image calls.
const UNDEFINED: &str = "dtof_has_a_reachable_panic";

/// The functions by which an image panics if a finished future is polled, which the handler leaves alone.
const RESUMED: [&str; 2] = ["panic_const_async_fn_resumed", "9panicking9panic_fmt"];

/// The functions of `library_image`, which together use all of dtof-core, dtof-link and dtof-sensors.
const PARTS: &str = "events::units events::roots events::ranges events::words events::products events::texts
    events::processor histograms::gates histograms::trees histograms::thresholds histograms::histograms
    histograms::excluded_bins histograms::live_counts pixels::pixels pixels::once_per_bin arrays::layout
    arrays::driven arrays::whole link::frames link::sessions link::configurations link::reports link::tokens
    link::whole_histograms link::reasons sensors::tdc7200 sensors::calibrations sensors::tmf882x
    sensors::tmf8829 sensors::photon_timer sensors::simulated sensors::dithers sensors::software_i2c
    awaited::tmf882x awaited::tmf8829 awaited::tmf8829_spi";

/// With fewer bytes of code, something has been optimised away. About half of the smallest image.
const MIN_TEXT: u64 = 384 * 1024;

/// Builds and checks the images of `all` targets in both profiles, or the most important ones. Fails
/// if one has a problem.
pub fn check(root: &Path, all: bool) -> Result<()> {
    let targets = Toolchain::read(root)?.targets;
    let images: Vec<(&str, &[&str])> = match all {
        true => targets
            .iter()
            .map(|target| (&**target, &PROFILES[..]))
            .collect(),
        false => FIRST.to_vec(),
    };
    let mut bad = 0;
    println!(
        "{:<28} {:<14} {:>7} {:>8} {:>11}  verdict",
        "target", "profile", ".text", ".rodata", ".data+.bss"
    );
    for (target, profiles) in images {
        toolchain::ensure_target(target)?;
        for profile in profiles {
            let (image, mut problems) = match build(root, target, profile, &[])? {
                Build::Done(path) => (Image::read(&path)?, vec![]),
                // Links it anyway, to find what can panic.
                Build::CanPanic => {
                    let defined = format!("link-arg=--defsym={UNDEFINED}=0");
                    let Build::Done(path) = build(root, target, profile, &["-C", &defined])? else {
                        bail!("{target}, {profile}: does not link even with {UNDEFINED} defined");
                    };
                    let places = panics::places(root, &fs::read(&path)?)?;
                    let places = places
                        .into_iter()
                        .map(|place| format!("can panic at {place}"));
                    (Image::read(&path)?, places.collect())
                }
            };
            problems.extend(image.problems());
            let verdict = if problems.is_empty() { "ok" } else { "BAD" };
            println!(
                "{target:<28} {profile:<14} {:>7} {:>8} {:>11}  {verdict}",
                image.text, image.constants, image.memory
            );
            for problem in &problems {
                println!("    {problem}");
            }
            bad += usize::from(!problems.is_empty());
        }
    }
    ensure!(bad == 0, "library-image: {bad} bad images, see above");
    frames::check(root)
}

enum Build {
    /// The path of the image.
    Done(PathBuf),
    /// The linker refused it: a panic is reachable.
    CanPanic,
}

/// Builds one image, with additional arguments for the compiler.
fn build(root: &Path, target: &str, profile: &str, compiler: &[&str]) -> Result<Build> {
    // Also passed to cargo, so that the path of the image is known.
    let folder = target_folder(root);
    let output = cargo()
        .current_dir(root)
        .args(["rustc", "--quiet", "--locked"])
        .args(["--package", "dtof-firmware", "--bin", "library-image"])
        .args(["--features", "library-image"])
        .args(["--target", target, "--profile", profile, "--target-dir"])
        .arg(&folder)
        .arg("--")
        .args(compiler)
        .output()
        .context("cargo does not start")?;
    if output.status.success() {
        let path = folder.join(target).join(profile).join("library-image");
        return Ok(Build::Done(path));
    }
    let errors = String::from_utf8_lossy(&output.stderr);
    if errors.contains(&format!("undefined symbol: {UNDEFINED}")) {
        return Ok(Build::CanPanic);
    }
    eprintln!("{errors}");
    bail!("{target}, {profile}: library-image does not build, see above");
}

/// The parts of an image that are checked.
#[derive(Clone, Default)]
struct Image {
    /// Mangled names of symbols.
    symbols: Vec<String>,
    /// Bytes of code.
    text: u64,
    /// Bytes of constants.
    constants: u64,
    /// Bytes of RAM.
    memory: u64,
}

impl Image {
    fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        let file = object::File::parse(&*bytes)?;
        let mut image = Self::default();
        for symbol in file.symbols() {
            image.symbols.push(symbol.name()?.into());
        }
        for section in file.sections() {
            // Tables for unwinding, from the standard library.
            if section.name()?.starts_with(".eh_frame") {
                continue;
            }
            match section.kind() {
                SectionKind::Text => image.text += section.size(),
                SectionKind::ReadOnlyData | SectionKind::ReadOnlyString => {
                    image.constants += section.size();
                }
                SectionKind::Data | SectionKind::UninitializedData => {
                    image.memory += section.size();
                }
                _ => {}
            }
        }
        Ok(image)
    }

    /// The problems, one line each.
    fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        let is_resumed = |name: &&String| RESUMED.iter().any(|part| name.contains(part));
        let names: Vec<_> = self
            .symbols
            .iter()
            .filter(|name| !is_resumed(name))
            .collect();
        problems.extend(symbols::problems(&names));
        if !self.symbols.iter().any(|name| name == "_start") {
            problems.push("the entry `_start` is missing".into());
        }
        for part in PARTS.split_whitespace() {
            let mangled = mangled(part);
            if !self.symbols.iter().any(|name| name.contains(&mangled)) {
                problems.push(format!("the part `{part}` of library-image is missing"));
            }
        }
        if self.text < MIN_TEXT {
            problems.push(format!("less than {MIN_TEXT} bytes of code"));
        }
        problems
    }
}

/// A part in the name of its symbol: both manglings write the length of a name before it.
fn mangled(part: &str) -> String {
    let names = ["library_image"].into_iter().chain(part.split("::"));
    names.map(|name| format!("{}{name}", name.len())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Image {
        let parts = PARTS.split_whitespace();
        let parts = parts.map(|part| format!("_ZN{}17h0123E", mangled(part)));
        let mut symbols = vec!["_start".to_owned(), "__aeabi_memcpy".to_owned()];
        symbols.extend(parts);
        Image {
            symbols,
            text: MIN_TEXT,
            ..Image::default()
        }
    }

    #[test]
    fn a_good_image_passes() {
        assert_eq!(good().problems(), [""; 0]);
    }

    #[test]
    fn an_image_from_which_something_was_dropped_fails() {
        let mut image = good();
        image.text -= 1;
        assert_eq!(image.problems(), ["less than 393216 bytes of code"]);

        for (index, missing) in [(0, "the entry `_start`"), (2, "the part `events::units`")] {
            let mut image = good();
            image.symbols.remove(index);
            let problems = image.problems();
            assert!(
                problems.len() == 1 && problems[0].starts_with(missing),
                "{problems:?}"
            );
        }
        let nothing = Image::default().problems();
        assert_eq!(nothing.len(), PARTS.split_whitespace().count() + 2);
    }

    #[test]
    fn an_image_with_a_forbidden_symbol_fails() {
        let mut image = good();
        image.symbols.push("__mulsf3".into());
        assert_eq!(image.problems(), ["calculates in floating point: __mulsf3"]);
    }

    #[test]
    fn only_the_panic_of_a_finished_future_passes() {
        let mut image = good();
        for name in [
            "_RNvNtCs1234_4core9panicking9panic_fmt",
            "_RNvNtNtCs1234_4core9panicking11panic_const28panic_const_async_fn_resumed",
        ] {
            image.symbols.push(name.into());
        }
        assert_eq!(image.problems(), [""; 0]);
        let bounds = "_RNvNtCs1234_4core9panicking18panic_bounds_check";
        image.symbols.push(bounds.into());
        assert_eq!(image.problems(), [format!("panics: {bounds}")]);
    }
}

//! `cargo xtask check-image`: builds `core-image` for three targets or all, and checks the linked images.
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
const UNDEFINED: &str = "dtof_core_has_a_reachable_panic";

/// The functions of `core_image/main.rs`, which together use all of dtof-core.
const PARTS: &str = "units roots ranges words products texts gates trees thresholds histograms pixels blocks excluded_bins";

/// With fewer bytes of code, something has been optimised away. About half of the smallest image.
const MIN_TEXT: u64 = 16 * 1024;

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
                    let places = panics::places(&fs::read(&path)?)?;
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
    ensure!(bad == 0, "core-image: {bad} bad images, see above");
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
        .args(["--package", "dtof-firmware", "--bin", "core-image"])
        .args(["--features", "core-image"])
        .args(["--target", target, "--profile", profile, "--target-dir"])
        .arg(&folder)
        .arg("--")
        .args(compiler)
        .output()
        .context("cargo does not start")?;
    if output.status.success() {
        let path = folder.join(target).join(profile).join("core-image");
        return Ok(Build::Done(path));
    }
    let errors = String::from_utf8_lossy(&output.stderr);
    if errors.contains(&format!("undefined symbol: {UNDEFINED}")) {
        return Ok(Build::CanPanic);
    }
    eprintln!("{errors}");
    bail!("{target}, {profile}: core-image does not build, see above");
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
        problems.extend(symbols::problems(&self.symbols));
        if !self.symbols.iter().any(|name| name == "_start") {
            problems.push("the entry `_start` is missing".into());
        }
        for part in PARTS.split(' ') {
            // Both manglings write a name's length before it.
            let mangled = format!("10core_image{}{part}", part.len());
            if !self.symbols.iter().any(|name| name.contains(&mangled)) {
                problems.push(format!("the part `{part}` of core-image is missing"));
            }
        }
        if self.text < MIN_TEXT {
            problems.push(format!("less than {MIN_TEXT} bytes of code"));
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Image {
        let parts = PARTS.split(' ');
        let parts = parts.map(|part| format!("_ZN10core_image{}{part}17h0123E", part.len()));
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
        assert_eq!(image.problems(), ["less than 16384 bytes of code"]);

        for (index, missing) in [(0, "the entry `_start`"), (2, "the part `units`")] {
            let mut image = good();
            image.symbols.remove(index);
            let problems = image.problems();
            assert!(
                problems.len() == 1 && problems[0].starts_with(missing),
                "{problems:?}"
            );
        }
        let nothing = Image::default().problems();
        assert_eq!(nothing.len(), PARTS.split(' ').count() + 2);
    }

    #[test]
    fn an_image_with_a_forbidden_symbol_fails() {
        let mut image = good();
        image.symbols.push("__mulsf3".into());
        assert_eq!(image.problems(), ["calculates in floating point: __mulsf3"]);
    }
}

//! `cargo xtask c-bindings`: builds the library and the examples of `bindings/c`, runs them here
//! and in QEMU, and compares the results with Rust.

mod examples;
mod figures;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::firmware::Board;
use crate::image::symbols;
use crate::self_test;
use crate::sizes::Sizes;
use crate::tools::{ARM_GCC, CMAKE, CXX, QEMU, Tool};
use crate::{cargo, emulator, succeed, target_folder, toolchain};

use self::figures::Figures;

const FOLDER: &str = "bindings/c";
const HEADER: &str = "bindings/c/include/dtof.h";
/// What the example of histograms prints.
const MILLIMETRES: &str = "bindings/c/examples/histogram.out";
const README: &str = "bindings/c/README.md";
const TARGET: &str = "thumbv7em-none-eabihf";
/// With these, an instruction takes 256 ns of the emulator's clock.
const COUNT_INSTRUCTIONS: [&str; 2] = ["-icount", "shift=8"];
/// The part of the self-test that exists in C: its first line, and the line after its last.
const PARTS: [&str; 2] = ["stream of 128 bins\n", "stream of a block\n"];

/// Builds, runs and compares everything. With `bless` it writes the header and the figures.
pub fn check(root: &Path, bless: bool) -> Result<()> {
    let missing = [CXX, CMAKE, ARM_GCC, QEMU];
    let missing: Vec<String> = missing
        .iter()
        .filter(|tool| !tool.is_installed())
        .map(Tool::missing)
        .collect();
    ensure!(missing.is_empty(), "{}", missing.join("\n"));
    toolchain::ensure_target(TARGET)?;
    if bless {
        let mut test = cargo();
        test.current_dir(root).env("DTOF_BLESS", "1");
        succeed(test.args(["test", "--quiet", "--package", "dtof-c", "--test", "header"]))?;
    }
    header(root)?;

    let target = fs::canonicalize(target_folder(root)).context("no target folder")?;
    let host = build(root, &target, "host", &[])?;
    let expected = expected(root)?;
    let golden = printed(&mut Command::new(host.join("golden")))?;
    same("golden vectors here", &expected, &golden)?;
    // A test of dtof-c compares this file with Rust.
    let millimetres = fs::read_to_string(root.join(MILLIMETRES)).context(MILLIMETRES)?;
    let histogram = printed(&mut Command::new(host.join("histogram")))?;
    same("millimetres here", &millimetres, &histogram)?;
    examples::check(root, &host, &target)?;

    let board = build_for_board(root, &target)?;
    let golden = in_emulator(&board.join("golden"), &[])?;
    same("golden vectors in QEMU", &expected, &golden)?;
    let histogram = in_emulator(&board.join("histogram"), &[])?;
    same("millimetres in QEMU", &millimetres, &histogram)?;
    for image in ["golden", "histogram", "count-c", "all-functions"] {
        no_panic(&board.join(image))?;
    }
    let [c, rust] = ["count-c", "count-rust"].map(|image| {
        let path = board.join(image);
        let text = in_emulator(&path, &COUNT_INSTRUCTIONS)?;
        Figures::read(&text, &Sizes::read(&path)?)
    });
    figures::check(root, &c?, &rust?, bless)
}

/// Fails unless the README's C code, and with it the header, compiles as C99 and C++17 without a
/// warning.
fn header(root: &Path) -> Result<()> {
    let page = fs::read_to_string(root.join(README))?;
    let block = page
        .split_once("```c\n")
        .and_then(|(_, rest)| rest.split_once("```"));
    let (block, _) = block.with_context(|| format!("{README}: no C"))?;
    let strict = "-Wall -Wextra -Wpedantic -Werror -fsyntax-only -I";
    for (compiler, language) in [
        ("gcc", "-std=c99 -x c"),
        ("g++", "-std=c++17 -x c++"),
        ("arm-none-eabi-gcc", "-std=c99 -x c"),
    ] {
        let mut command = Command::new(compiler);
        command.current_dir(root).args(strict.split(' '));
        command.arg("bindings/c/include").args(language.split(' '));
        // As an include: compilers have other warnings for the main file.
        let mut compiler = command.arg("-").stdin(Stdio::piped()).spawn()?;
        let stdin = compiler.stdin.take().context("no standard input")?;
        std::io::Write::write_all(&mut { stdin }, block.as_bytes())?;
        let status = compiler.wait()?;
        ensure!(status.success(), "{HEADER}: {language}: see above");
    }
    println!("{HEADER}: C99 and C++17 without a warning");
    Ok(())
}

/// Builds with `CMake`. Returns the folder of the examples.
fn build(root: &Path, target: &Path, name: &str, options: &[String]) -> Result<PathBuf> {
    let folder = target.join("c-bindings").join(name);
    let mut configure = Command::new(CMAKE.program);
    configure.current_dir(root).args(["-S", FOLDER, "-B"]);
    configure.arg(&folder).args(options);
    configure.arg(format!("-DDTOF_CARGO_DIR={}", target.display()));
    succeed(configure.stdout(Stdio::null()))?;
    let mut build = Command::new(CMAKE.program);
    build.arg("--build").arg(&folder);
    succeed(build.stdout(Stdio::null()))?;
    Ok(folder.join("examples"))
}

/// Builds for the Cortex-M4, with the operations in Rust.
fn build_for_board(root: &Path, target: &Path) -> Result<PathBuf> {
    let mut twin = cargo();
    twin.current_dir(root)
        .args(["build", "--quiet", "--locked"]);
    twin.args(["--package", "dtof-c", "--example", "operations"]);
    twin.args(["--target", TARGET, "--profile", "firmware", "--target-dir"]);
    succeed(twin.arg(target))?;
    let twin = target
        .join(TARGET)
        .join("firmware/examples/liboperations.a");
    let file = root
        .join(FOLDER)
        .join("examples/cortex-m4/arm-none-eabi.cmake");
    let options = [
        format!("-DCMAKE_TOOLCHAIN_FILE={}", file.display()),
        format!("-DDTOF_TWIN={}", twin.display()),
    ];
    Ok(build(root, target, "cortex-m4", &options)?.join("cortex-m4"))
}

/// The lines of the self-test that the example prints.
fn expected(root: &Path) -> Result<String> {
    let name = self_test::EXPECTED;
    let text = fs::read_to_string(root.join(name)).context(name)?;
    let [first, after] = PARTS.map(|line| text.find(line));
    let part = first.zip(after).and_then(|(from, to)| text.get(from..to));
    let part = part.with_context(|| format!("{name}: a part is missing"))?;
    Ok(format!("{part}end\n"))
}

fn same(what: &str, expected: &str, found: &str) -> Result<()> {
    let differences = self_test::differences(expected, found);
    for line in &differences {
        println!("{line}");
    }
    ensure!(
        differences.is_empty(),
        "{what}: differ from Rust, see above"
    );
    println!("{what}: {} lines as in Rust", expected.lines().count());
    Ok(())
}

/// Fails if an image has a panic, floating point or a heap.
fn no_panic(path: &Path) -> Result<()> {
    use object::{Object, ObjectSymbol};
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let file = object::File::parse(&*bytes)?;
    let name = path.file_name().unwrap_or_default().display();
    let found: Result<Vec<&str>, _> = file.symbols().map(|symbol| symbol.name()).collect();
    let found = found?;
    if let Some(problem) = symbols::problems(&found).next() {
        bail!("{name}: {problem}");
    }
    let functions = found
        .iter()
        .filter(|name| name.starts_with("dtof_"))
        .count();
    ensure!(functions > 5, "{name}: has only {functions} functions");
    println!("{name}: {functions} functions; no panic, no floating point, no heap");
    Ok(())
}

fn in_emulator(image: &Path, arguments: &[&str]) -> Result<String> {
    let (status, output) = emulator::run(Board::Mps2An386, image, arguments)?;
    ensure!(status.success(), "QEMU: {status}: {}", output.trim());
    Ok(output)
}

/// Runs a command that must succeed. Returns its output.
fn printed(command: &mut Command) -> Result<String> {
    let name = command.get_program().display().to_string();
    let command = command.stdin(Stdio::null()).stderr(Stdio::inherit());
    let output = command.output().context(name.clone())?;
    ensure!(output.status.success(), "{name}: {}", output.status);
    Ok(String::from_utf8(output.stdout)?)
}

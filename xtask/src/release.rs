//! `cargo xtask release`: a folder with the images that need no vendor's program, for boards whose users have no
//! toolchain.

use std::collections::BTreeSet;
use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sha2::{Digest, Sha256};

use crate::firmware::{Board, Build, Sensor};
use crate::{cargo, cargo_home};

/// The folder, of the workspace.
const FOLDER: &str = "out/release";

const HEAD: &str = "\
# Images for boards

None has run on a real board yet. An image that drives a laser has its pulse, rate and duty in its name. Read
`docs/eye-safety.md` before you connect one.

- Raspberry Pi Pico, Pico 2: hold BOOTSEL while you plug the board in, and copy the `.uf2` onto the drive that appears.
- STM32F405, STM32F407: `probe-rs download --chip STM32F407VGTx FILE.elf`, then reset the board.
- Then `dtof monitor --device PORT` shows its events. `docs/boards.md` says how to connect it.

The `.elf` files are also for debug probes; they decode the log. `SHA256SUMS` has the sums of all files. `licences` has the
licences of this project and of each crate that an image may contain. Crates that are published without a file of it have their
own README and `Cargo.toml` there, with authors and the licence's name; its text is in `licences`. Rust's own libraries are under
MIT or Apache-2.0, too.

| file | board | photons |
|---|---|---|
";

/// Some crates are published without this text.
const BSD: &str = "\
Redistribution and use in source and binary forms, with or without modification, are permitted provided that the following
conditions are met:

1. Redistributions of source code must retain the above copyright notice, this list of conditions and the following disclaimer.

2. Redistributions in binary form must reproduce the above copyright notice, this list of conditions and the following disclaimer in
   the documentation and/or other materials provided with the distribution.

3. Neither the name of the copyright holder nor the names of its contributors may be used to endorse or promote products derived from
   this software without specific prior written permission.

THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS \"AS IS\" AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT
LIMITED TO, THE IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE DISCLAIMED. IN NO EVENT SHALL THE
COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL DAMAGES
(INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION)
HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY, OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE)
ARISING IN ANY WAY OUT OF THE USE OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
";

/// The images of a release.
fn images() -> impl Iterator<Item = (Board, Build)> {
    let boards = Board::ALL
        .into_iter()
        .filter(|board| board.row().chip.is_some());
    boards.flat_map(|board| {
        let sensors = board.row().sensors.iter().copied();
        let sensors = sensors.filter(|sensor| sensor.image().is_none());
        let sensors = sensors.map(move |sensor| (board, Build::With(sensor)));
        std::iter::once((board, Build::Sidecar)).chain(sensors)
    })
}

/// The row of an image, whose files have this name without their endings.
fn row(name: &str, board: Board, build: Build) -> String {
    let photons = match build {
        Build::With(Sensor::PhotonTimer) => "of a SPAD, timed by the board; drives a laser",
        Build::With(Sensor::Tdc7200) => "of a TDC7200",
        _ => "simulated",
    };
    let ending = if board.row().uf2_family.is_some() {
        "uf2"
    } else {
        "elf"
    };
    format!(
        "| `{name}.{ending}` | {} | {photons} |\n",
        board.row().full_name
    )
}

/// Writes the folder anew, and prints its path.
pub fn release(root: &Path) -> Result<()> {
    let folder = root.join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let licences = folder.join("licences");
    fs::create_dir_all(&licences).with_context(|| licences.display().to_string())?;
    for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
        copy(&root.join(name), &licences.join(name))?;
    }
    fs::write(licences.join("BSD-3-Clause"), BSD)?;
    let mut readme = HEAD.to_owned();
    let mut crates = BTreeSet::new();
    for (board, build) in images() {
        let image = board.build(root, build, &[])?;
        let name = image.file_name().and_then(|name| name.to_str());
        let name = name.with_context(|| image.display().to_string())?;
        readme.push_str(&row(name, board, build));
        copy(&image, &folder.join(format!("{name}.elf")))?;
        if board.row().uf2_family.is_some() {
            let name = format!("{name}.uf2");
            copy(&image.with_file_name(&name), &folder.join(&name))?;
        }
        crates.extend(dependencies(root, board, build)?);
    }
    for name in crates {
        copy_licences(&name, &licences.join(&name))?;
    }
    fs::write(folder.join("README.md"), readme)?;
    let mut sums = String::new();
    for file in files(&folder)? {
        let name = || file.display().to_string();
        let bytes = fs::read(&file).with_context(name)?;
        if let Some(path) = machine_path(root, &bytes) {
            anyhow::bail!("{} has a path of this machine: {path}", file.display());
        }
        let inside = file.strip_prefix(&folder).with_context(name)?;
        let _ = writeln!(sums, "{:x}  {}", Sha256::digest(&bytes), inside.display());
    }
    fs::write(folder.join("SHA256SUMS"), sums)?;
    println!("{}", folder.display());
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).with_context(|| format!("{} to {}", from.display(), to.display()))?;
    Ok(())
}

/// The files of a folder and of those in it, in order.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(files(&path)?);
        } else {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The published crates that an image may contain, as `name-version`.
fn dependencies(root: &Path, board: Board, build: Build) -> Result<Vec<String>> {
    let features = [Some(board.name()), build.feature()];
    let features: Vec<&str> = features.into_iter().flatten().collect();
    let output = cargo()
        .current_dir(root)
        .args([
            "tree",
            "--locked",
            "--package",
            "dtof-firmware",
            "--prefix",
            "none",
        ])
        .args(["--edges", "normal", "--no-dedupe", "--format", "{p}"])
        .args([
            "--features",
            &features.join(","),
            "--target",
            board.target(),
        ])
        .output()
        .context("cargo does not start")?;
    let text = String::from_utf8_lossy(&output.stdout);
    ensure!(
        output.status.success(),
        "cargo tree: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(text.lines().filter_map(dependency).collect())
}

/// The crate in a line of `cargo tree`. Crates of this workspace have a path.
fn dependency(line: &str) -> Option<String> {
    let (name, version) = line.split_once(" v")?;
    let version = version.trim_end_matches(" (proc-macro)");
    (!version.contains('(')).then(|| format!("{name}-{version}"))
}

/// Copies the licences of a crate as it is published; from a crate without them what names its authors and licence.
fn copy_licences(name: &str, folder: &Path) -> Result<()> {
    let sources = cargo_home()?.join("registry/src");
    let registries = fs::read_dir(&sources).with_context(|| sources.display().to_string())?;
    let mut registries = registries.flatten().map(|entry| entry.path().join(name));
    let source = registries.find(|path| path.is_dir());
    let source = source.with_context(|| format!("no source of {name}"))?;
    let mut files = files(&source)?;
    files.retain(|file| file.parent() == Some(&source));
    let begins = |path: &Path, starts: &[&str]| {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let file = file.to_uppercase();
        starts.iter().any(|start| file.starts_with(start))
    };
    let licences = ["LICENSE", "LICENCE", "COPYING", "NOTICE"];
    let has_licences = files.iter().any(|path| begins(path, &licences));
    let copied: &[&str] = if has_licences {
        &licences
    } else {
        &["README", "CARGO.TOML"]
    };
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for path in files.iter().filter(|path| begins(path, copied)) {
        copy(path, &folder.join(path.file_name().unwrap_or_default()))?;
    }
    Ok(())
}

/// A path of this machine in a file.
fn machine_path(root: &Path, bytes: &[u8]) -> Option<String> {
    let paths = [Some(root.to_owned()), cargo_home().ok(), env::home_dir()];
    let paths = paths.into_iter().flatten();
    let texts = paths.filter_map(|path| Some(format!("{}/", path.canonicalize().ok()?.display())));
    let mut texts = texts.filter(|text| text != "//");
    texts.find(|text| {
        bytes
            .windows(text.len())
            .any(|part| part == text.as_bytes())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::root;

    #[test]
    fn every_image_without_a_vendors_program_is_named() {
        let rows: Vec<String> = images()
            .map(|(board, build)| row("FILE", board, build))
            .collect();
        let timer = "of a SPAD, timed by the board; drives a laser";
        assert_eq!(
            rows,
            [
                "| `FILE.uf2` | Raspberry Pi Pico | simulated |\n".to_owned(),
                format!("| `FILE.uf2` | Raspberry Pi Pico | {timer} |\n"),
                "| `FILE.uf2` | Raspberry Pi Pico 2 | simulated |\n".to_owned(),
                format!("| `FILE.uf2` | Raspberry Pi Pico 2 | {timer} |\n"),
                "| `FILE.elf` | STM32F405, STM32F407 | simulated |\n".to_owned(),
                "| `FILE.elf` | STM32F405, STM32F407 | of a TDC7200 |\n".to_owned(),
            ]
        );
    }

    #[test]
    fn crates_of_the_workspace_are_no_dependencies() {
        assert_eq!(dependency("nb v1.1.0").unwrap(), "nb-1.1.0");
        assert_eq!(
            dependency("paste v1.0.15 (proc-macro)").unwrap(),
            "paste-1.0.15"
        );
        assert_eq!(dependency("dtof-core v0.2.0 (/a/core)"), None);
        assert_eq!(dependency(""), None);
    }

    #[test]
    fn a_path_of_this_machine_is_found() {
        let root = root().unwrap();
        let inside = root.canonicalize().unwrap().join("core/src/lib.rs");
        let text = format!("panicked at {}", inside.display());
        assert!(machine_path(root, text.as_bytes()).is_some());
        assert_eq!(machine_path(root, b"panicked at core/src/lib.rs"), None);
    }
}

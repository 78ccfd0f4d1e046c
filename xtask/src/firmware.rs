//! The images a board runs: `cargo xtask image`.

use std::env;
use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::{target_folder, toolchain};

const TARGET: &str = "thumbv7em-none-eabihf";
const PROFILE: &str = "firmware";
const SMALL_PROFILE: &str = "firmware-small";

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    Mps2An386,
    Stm32F405,
}

impl Board {
    pub const ALL: [Self; 2] = [Self::Mps2An386, Self::Stm32F405];

    /// Its name and that of its feature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Stm32F405 => "stm32f405",
        }
    }

    pub fn named(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|board| board.name() == name);
        found.with_context(|| format!("no board `{name}`: mps2-an386 or stm32f405"))
    }

    /// Builds the sidecar, with these features more, and without a program for a
    /// sensor.
    pub fn sidecar(self, root: &Path, features: &[&str]) -> Result<PathBuf> {
        self.sidecar_with(root, features, None)
    }

    fn sidecar_with(
        self,
        root: &Path,
        features: &[&str],
        program: Option<&Path>,
    ) -> Result<PathBuf> {
        let image = format!("sidecar-{}", self.name());
        let features = [&[self.name()], features].concat();
        build(root, &image, &features, program, PROFILE)
    }

    /// Builds the self-test.
    pub fn self_test(self, root: &Path) -> Result<PathBuf> {
        build(
            root,
            "self-test",
            &[self.name(), "self-test"],
            None,
            PROFILE,
        )
    }

    /// Builds the image that counts instructions, `small` or fast.
    pub fn bench(self, root: &Path, small: bool) -> Result<PathBuf> {
        let profile = if small { SMALL_PROFILE } else { PROFILE };
        build(root, "bench", &[self.name(), "bench"], None, profile)
    }
}

/// What is connected to the real board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    Tdc7200,
    Tmf882x,
}

impl Sensor {
    pub const ALL: [Self; 2] = [Self::Tdc7200, Self::Tmf882x];

    pub fn name(self) -> &'static str {
        match self {
            Self::Tdc7200 => "tdc7200",
            Self::Tmf882x => "tmf882x",
        }
    }

    pub fn feature(self) -> &'static str {
        match self {
            Self::Tdc7200 => "sensor-tdc7200",
            Self::Tmf882x => "sensor-tmf882x",
        }
    }

    pub fn named(name: &str) -> Result<Self> {
        let name = match name {
            "tmf8820" | "tmf8821" | "tmf8828" => "tmf882x",
            name => name,
        };
        let found = Self::ALL.into_iter().find(|sensor| sensor.name() == name);
        found.with_context(|| format!("no sensor `{name}`: tdc7200 or tmf882x"))
    }

    /// The sidecar that takes its photons.
    pub fn sidecar(self, root: &Path) -> Result<PathBuf> {
        if self == Self::Tmf882x {
            let path = env::var_os(IMAGE).map(PathBuf::from);
            let path = path.with_context(|| {
                format!("{IMAGE} has to name the sensor's program, raw bytes from its vendor")
            })?;
            let name = || format!("{IMAGE}={}", path.display());
            let bytes = fs::read(&path).with_context(name)?;
            check_program(&bytes).with_context(name)?;
            // The build script runs in another folder.
            let path = path.canonicalize().with_context(name)?;
            return Board::Stm32F405.sidecar_with(root, &[self.feature()], Some(&path));
        }
        Board::Stm32F405.sidecar(root, &[self.feature()])
    }
}

/// What `firmware/build.rs` takes the program of the TMF8820/21/28 from.
const IMAGE: &str = "TMF882X_IMAGE";

/// Whether this may be a program of the TMF8820/21/28, whose bootloader counts
/// addresses in 16 bits.
fn check_program(bytes: &[u8]) -> Result<()> {
    ensure!(!bytes.is_empty(), "an empty file");
    ensure!(
        bytes.len() <= 1 << 16,
        "{} bytes: more than the sensor holds",
        bytes.len()
    );
    ensure!(
        !bytes.is_ascii(),
        "a text file, not raw bytes; of a HEX file `objcopy -I ihex -O binary` makes them"
    );
    Ok(())
}

/// Builds one image and says where it is. Each set of features has a folder of
/// its own, so that none takes another's place.
fn build(
    root: &Path,
    image: &str,
    features: &[&str],
    program: Option<&Path>,
    profile: &str,
) -> Result<PathBuf> {
    toolchain::ensure_target(TARGET)?;
    let folder = target_folder(root);
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    match program {
        Some(path) => cargo.env(IMAGE, path),
        None => cargo.env_remove(IMAGE),
    };
    let status = cargo
        .current_dir(root)
        .args(["build", "--locked", "--package", "dtof-firmware"])
        .args((!io::stderr().is_terminal()).then_some("--quiet"))
        .args(["--bin", image, "--features", &features.join(",")])
        .args(["--target", TARGET, "--profile", profile, "--target-dir"])
        .arg(&folder)
        .status()
        .context("cargo does not start")?;
    ensure!(status.success(), "{image} does not build, see above");

    let built = folder.join(TARGET).join(profile).join(image);
    if !built.is_file() {
        bail!("{image} was built, but is not at {}", built.display());
    }
    let kept = folder.join(TARGET).join("images");
    fs::create_dir_all(&kept).with_context(|| kept.display().to_string())?;
    let kept = kept.join(format!("{image}+{}", features.join("+")));
    fs::copy(&built, &kept).with_context(|| kept.display().to_string())?;
    Ok(kept)
}

/// Builds the sidecar of a board and says where it is.
pub fn image(root: &Path, board: &str, sensor: Option<&str>) -> Result<()> {
    let board = Board::named(board)?;
    let path = match sensor {
        None => board.sidecar(root, &[])?,
        Some(sensor) => {
            ensure!(
                board == Board::Stm32F405,
                "only stm32f405 has a place for a sensor"
            );
            Sensor::named(sensor)?.sidecar(root)?
        }
    };
    println!("{}", path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_raw_bytes_that_fit() {
        assert!(check_program(&[0, 0x20, 0xff]).is_ok());
        assert!(check_program(&vec![0xff; 1 << 16]).is_ok());
        assert!(check_program(&vec![0xff; (1 << 16) + 1]).is_err());
        assert!(check_program(b"").is_err());
        assert!(check_program(b":10000000").is_err());
        assert!(check_program(b"const unsigned char image[] = {").is_err());
    }
}

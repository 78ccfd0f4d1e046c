//! The images a board runs: `cargo xtask image`.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::toolchain;

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

    /// Builds the sidecar, with these features more.
    pub fn sidecar(self, root: &Path, features: &[&str]) -> Result<PathBuf> {
        let image = format!("sidecar-{}", self.name());
        let features = [&[self.name()], features].concat();
        build(root, &image, &features, PROFILE)
    }

    /// Builds the self-test.
    pub fn self_test(self, root: &Path) -> Result<PathBuf> {
        build(root, "self-test", &[self.name(), "self-test"], PROFILE)
    }

    /// Builds the image that counts instructions, `small` or fast.
    pub fn bench(self, root: &Path, small: bool) -> Result<PathBuf> {
        let profile = if small { SMALL_PROFILE } else { PROFILE };
        build(root, "bench", &[self.name(), "bench"], profile)
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
        let found = Self::ALL.into_iter().find(|sensor| sensor.name() == name);
        found.with_context(|| format!("no sensor `{name}`: tdc7200 or tmf882x"))
    }

    /// The sidecar that takes its photons.
    pub fn sidecar(self, root: &Path) -> Result<PathBuf> {
        if self == Self::Tmf882x {
            ensure!(
                env::var_os(IMAGE).is_some(),
                "{IMAGE} has to be the path of the sensor's program, raw bytes from its vendor"
            );
        }
        Board::Stm32F405.sidecar(root, &[self.feature()])
    }
}

/// What `firmware/build.rs` takes the program of the TMF8820/21/28 from.
const IMAGE: &str = "TMF882X_IMAGE";

/// Builds one image and says where it is. Each set of features has a folder of
/// its own, so that none takes another's place.
fn build(root: &Path, image: &str, features: &[&str], profile: &str) -> Result<PathBuf> {
    toolchain::ensure_target(TARGET)?;
    let folder = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    let folder = root.join(folder);
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    if let Some(image) = env::var_os(IMAGE) {
        // The build script runs in another folder.
        let path = PathBuf::from(image);
        cargo.env(
            IMAGE,
            path.canonicalize()
                .with_context(|| path.display().to_string())?,
        );
    }
    let status = cargo
        .current_dir(root)
        .args(["build", "--quiet", "--locked", "--package", "dtof-firmware"])
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
    std::fs::create_dir_all(&kept).with_context(|| kept.display().to_string())?;
    let kept = kept.join(format!("{image}+{}", features.join("+")));
    std::fs::copy(&built, &kept).with_context(|| kept.display().to_string())?;
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

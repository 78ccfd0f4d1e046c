//! The images a board runs: `cargo xtask image`.

use std::env;
use std::fs;
use std::io::{self, IsTerminal};
use std::iter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::{cargo, target_folder, toolchain};

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

    fn named(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|board| board.name() == name);
        found.with_context(|| format!("no board `{name}`: mps2-an386 or stm32f405"))
    }

    /// Builds an image as it goes onto the board; that of a TMF8820/21/28 has the
    /// sensor's own program in it, which `TMF882X_IMAGE` names.
    pub fn build(self, root: &Path, what: Build) -> Result<PathBuf> {
        let program = match what {
            Build::With(Sensor::Tmf882x) => Some(sensor_program()?),
            _ => None,
        };
        self.link(root, what, None, program.as_deref())
    }

    /// The same without the sensor's own program.
    pub fn build_bare(self, root: &Path, what: Build) -> Result<PathBuf> {
        self.link(root, what, None, None)
    }

    /// The same for QEMU, whose `stm32f405` has no PLL.
    pub fn build_for_emulator(self, root: &Path, what: Build) -> Result<PathBuf> {
        let feature = (self == Self::Stm32F405).then_some("pll-off");
        self.link(root, what, feature, None)
    }

    /// Builds the image that counts instructions, `small` or fast.
    pub fn bench(self, root: &Path, small: bool) -> Result<PathBuf> {
        let profile = if small { SMALL_PROFILE } else { PROFILE };
        link(root, "bench", &[self.name(), "bench"], None, profile)
    }

    fn link(
        self,
        root: &Path,
        what: Build,
        more: Option<&str>,
        program: Option<&Path>,
    ) -> Result<PathBuf> {
        let sidecar = format!("sidecar-{}", self.name());
        let is_real = self == Self::Stm32F405;
        let (image, feature) = match what {
            Build::Sidecar => (&*sidecar, None),
            Build::With(sensor) if is_real => (&*sidecar, Some(sensor.feature())),
            Build::With(_) => bail!("only stm32f405 has a place for a sensor"),
            Build::SelfTest => ("self-test", Some("self-test")),
        };
        let board = [self.name()].into_iter();
        let features: Vec<&str> = board.chain(feature).chain(more).collect();
        link(root, image, &features, program, PROFILE)
    }
}

/// The images of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Build {
    /// The sidecar with simulated photons.
    Sidecar,
    /// The sidecar with those of a sensor.
    With(Sensor),
    SelfTest,
}

impl Build {
    /// The sidecar with simulated photons, unless another is named.
    pub fn named(name: Option<&str>) -> Result<Self> {
        Ok(match name {
            None => Self::Sidecar,
            Some("self-test") => Self::SelfTest,
            Some("tdc7200") => Self::With(Sensor::Tdc7200),
            Some("tmf882x" | "tmf8820" | "tmf8821" | "tmf8828") => Self::With(Sensor::Tmf882x),
            Some(name) => bail!("what is `{name}`? tdc7200, tmf882x or self-test"),
        })
    }
}

/// The sensor on the real board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    Tdc7200,
    Tmf882x,
}

impl Sensor {
    pub const ALL: [Self; 2] = [Self::Tdc7200, Self::Tmf882x];

    fn feature(self) -> &'static str {
        match self {
            Self::Tdc7200 => "sensor-tdc7200",
            Self::Tmf882x => "sensor-tmf882x",
        }
    }

    pub fn name(self) -> &'static str {
        self.feature().trim_start_matches("sensor-")
    }
}

/// The variable that names the program of the TMF8820/21/28 to `firmware/build.rs`.
const IMAGE: &str = "TMF882X_IMAGE";

/// Where the program of the TMF8820/21/28 is.
fn sensor_program() -> Result<PathBuf> {
    let path = env::var_os(IMAGE).map(PathBuf::from);
    let path = path.with_context(|| {
        format!("{IMAGE} has to name the sensor's program, raw bytes from its vendor")
    })?;
    let name = || format!("{IMAGE}={}", path.display());
    check_program(&fs::read(&path).with_context(name)?).with_context(name)?;
    // The build script runs in another folder.
    path.canonicalize().with_context(name)
}

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

/// Links one image and gives the path of a copy that no other image replaces.
fn link(
    root: &Path,
    image: &str,
    features: &[&str],
    program: Option<&Path>,
    profile: &str,
) -> Result<PathBuf> {
    toolchain::ensure_target(TARGET)?;
    let folder = target_folder(root);
    let kept = folder.join("images");
    fs::create_dir_all(&kept).with_context(|| kept.display().to_string())?;
    let more = features.iter().filter(|&&feature| !image.contains(feature));
    let name: Vec<&str> = iter::once(image).chain(more.copied()).collect();
    let name = name.join("+");
    let kept = kept.join(&name);
    if !kept.exists() {
        eprintln!("building {name} for the first time");
    }
    let mut cargo = cargo();
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
    fs::copy(&built, &kept).with_context(|| built.display().to_string())?;
    Ok(kept)
}

/// Builds an image and prints its path.
pub fn image(root: &Path, board: &str, what: Option<&str>, emulator: bool) -> Result<()> {
    let board = Board::named(board)?;
    let what = Build::named(what)?;
    let path = if emulator {
        board.build_for_emulator(root, what)?
    } else {
        board.build(root, what)?
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

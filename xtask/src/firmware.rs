//! `cargo xtask image`: builds the images of boards.

use std::env;
use std::fs::{self, File};
use std::io::{self, IsTerminal};
use std::iter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::laser::{self, Laser};
use crate::{cargo, cargo_home, layout, target_folder, toolchain, uf2};

const PROFILE: &str = "firmware";
const SMALL_PROFILE: &str = "firmware-small";

/// What sets a board apart.
pub struct Row {
    /// The name of the board and of its feature.
    pub name: &'static str,
    /// Its name for people.
    pub full_name: &'static str,
    /// The compilation target of its processor.
    pub target: &'static str,
    /// The family ID of its chip, if it takes images as files.
    pub uf2_family: Option<u32>,
    /// The name that probe-rs has for its controller; `None` if there is no such board, only an emulator.
    pub chip: Option<&'static str>,
    /// What runs its images on a computer.
    pub emulator: Emulator,
    /// The board whose counted instructions are like its own, for `cargo xtask bench`.
    pub counts_like: Board,
    /// The binary of its sidecar. Boards may share one.
    pub sidecar: &'static str,
    /// The sensors that its sidecar drives.
    pub sensors: &'static [Sensor],
    /// The most bytes of flash that its sidecar may take, without and with a sensor.
    pub most_flash: Option<[u64; 2]>,
    /// Its bytes of RAM that an image may take, with the reserve for the stack.
    pub most_ram: Option<u64>,
}

/// What runs the images of a board on a computer.
pub enum Emulator {
    /// Nothing: they are linked and measured only.
    None,
    /// QEMU, with arguments; images may have one more feature for it, and may be known to run in one version only.
    Qemu {
        arguments: &'static [&'static str],
        feature: Option<&'static str>,
        version: Option<&'static str>,
    },
    /// rp2040js in Node.js.
    Rp2040js,
}

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    Mps2An386,
    Pico,
    Pico2,
    Stm32F405,
}

impl Board {
    pub const ALL: [Self; 4] = [Self::Mps2An386, Self::Pico, Self::Pico2, Self::Stm32F405];

    /// What sets the board apart: a new board is a row here.
    pub fn row(self) -> &'static Row {
        match self {
            Self::Mps2An386 => &Row {
                name: "mps2-an386",
                full_name: "MPS2 AN386",
                target: "thumbv7em-none-eabihf",
                uf2_family: None,
                chip: None,
                emulator: Emulator::Qemu {
                    arguments: &["-machine", "mps2-an386"],
                    feature: None,
                    version: None,
                },
                counts_like: Self::Mps2An386,
                sidecar: "sidecar-mps2-an386",
                sensors: &[],
                most_flash: None,
                most_ram: None,
            },
            Self::Pico => &Row {
                name: "pico",
                full_name: "Raspberry Pi Pico",
                target: "thumbv6m-none-eabi",
                uf2_family: Some(uf2::RP2040),
                chip: Some("RP2040"),
                emulator: Emulator::Rp2040js,
                counts_like: Self::Pico,
                sidecar: "sidecar-pico",
                sensors: &[Sensor::PhotonTimer],
                most_flash: None,
                most_ram: None,
            },
            Self::Pico2 => &Row {
                name: "pico2",
                full_name: "Raspberry Pi Pico 2",
                target: "thumbv8m.main-none-eabihf",
                uf2_family: Some(uf2::RP2350_ARM_S),
                chip: Some("RP235x"),
                emulator: Emulator::None,
                counts_like: Self::Mps2An386,
                sidecar: "sidecar-pico",
                sensors: &[Sensor::PhotonTimer],
                most_flash: None,
                // All of its 520 KiB but 1 KiB for its boot ROM.
                most_ram: Some(519 * 1024),
            },
            Self::Stm32F405 => &Row {
                name: "stm32f405",
                full_name: "STM32F405, STM32F407",
                target: "thumbv7em-none-eabihf",
                uf2_family: None,
                // That of the Discovery.
                chip: Some("STM32F407VGTx"),
                emulator: Emulator::Qemu {
                    // The first serial port is USART1, ours is USART2.
                    arguments: &["-machine", "netduinoplus2", "-serial", "null"],
                    // QEMU's has no PLL.
                    feature: Some("pll-off"),
                    // QEMU 10, for instance, ends at a reset of the clocks.
                    version: Some("version 7.2."),
                },
                counts_like: Self::Mps2An386,
                sidecar: "sidecar-stm32f405",
                sensors: &[
                    Sensor::Tdc7200,
                    Sensor::Tmf8829,
                    Sensor::Tmf8829Spi,
                    Sensor::Tmf882x,
                    Sensor::Tmf8828,
                ],
                // Decisions take most of it: they are compiled for the 10-bit counters of pixels, the 16-bit counters
                // of blocks and, with a TMF8820/21/28, the 24-bit counters of its histograms. A driver stops its
                // sensor after errors and tries a failed stop again.
                most_flash: Some([84 * 1024, 105 * 1024]),
                most_ram: Some(128 * 1024),
            },
        }
    }

    /// The name of the board and of its feature.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The compilation target of its processor.
    pub fn target(self) -> &'static str {
        self.row().target
    }

    fn named(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|board| board.name() == name);
        let names = Self::ALL.map(Self::name).join(", ");
        found.with_context(|| format!("no board `{name}`: {names}"))
    }

    /// The board that the first word names, or `default`, and the other words.
    pub fn chosen<'a>(words: &'a [&'a str], default: Self) -> (Self, &'a [&'a str]) {
        let named = words.split_first();
        let named = named.and_then(|(name, rest)| Some((Self::named(name).ok()?, rest)));
        named.unwrap_or((default, words))
    }

    /// Builds an image for the board. An image for a TMF8820/21/28 or TMF8829 contains the sensor's
    /// own program, the file in `TMF882X_IMAGE` or `TMF8829_IMAGE`.
    pub fn build(self, root: &Path, what: Build, choices: &[Choice]) -> Result<PathBuf> {
        let program = match what {
            Build::With(sensor) => sensor.program()?,
            _ => None,
        };
        self.link(root, what, &features(what, choices)?, program.as_ref())
    }

    /// Builds an image without the sensor's own program, and without choices.
    pub fn build_bare(self, root: &Path, what: Build) -> Result<PathBuf> {
        self.link(root, what, &[], None)
    }

    /// Builds an image for the emulator of the board.
    pub fn build_for_emulator(
        self,
        root: &Path,
        what: Build,
        choices: &[Choice],
    ) -> Result<PathBuf> {
        let mut features = features(what, choices)?;
        if let Emulator::Qemu { feature, .. } = self.row().emulator {
            features.extend(feature);
        }
        self.link(root, what, &features, None)
    }

    /// Builds the image that counts instructions, for size if `small`, else for speed.
    pub fn bench(self, root: &Path, small: bool) -> Result<PathBuf> {
        let profile = if small { SMALL_PROFILE } else { PROFILE };
        let features = [self.name(), "bench"];
        link(root, self, "bench", &features, None, profile)
    }

    fn link(
        self,
        root: &Path,
        what: Build,
        more: &[&str],
        program: Option<&Program>,
    ) -> Result<PathBuf> {
        let binary = match what {
            Build::SelfTest => "self-test",
            _ => self.row().sidecar,
        };
        let board = [self.name()].into_iter();
        let features = board.chain(what.feature()).chain(more.iter().copied());
        let features: Vec<&str> = features.collect();
        let image = link(root, self, binary, &features, program, PROFILE)?;
        if let Some(laser) = Laser::read(&image)? {
            eprintln!("{}", laser.text());
        }
        if let Some(family) = self.row().uf2_family {
            let file = uf2::write(&image, family)?;
            eprintln!("to copy onto the board: {}", file.display());
        }
        Ok(image)
    }
}

/// An option of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The photon timer may have pulses over 1 µs and over 2 % of the time.
    LaserBeyondLimits,
    /// A host may switch its timeout off.
    LaserOnWithoutHost,
    /// Counters of 8 bits, and more pixels.
    Count8,
}

impl Choice {
    /// The name of the option of `cargo xtask image` and `flash`, and of the feature.
    pub fn name(self) -> &'static str {
        match self {
            Self::LaserBeyondLimits => "laser-beyond-limits",
            Self::LaserOnWithoutHost => "laser-on-without-host",
            Self::Count8 => "count8",
        }
    }

    fn warning(self) -> Option<&'static str> {
        Some(match self {
            Self::LaserBeyondLimits => {
                "the laser may have pulses over 1 us and be on for more than 2 % of the time"
            }
            Self::LaserOnWithoutHost => "a host may let the laser go on after it falls silent",
            Self::Count8 => return None,
        })
    }
}

/// The features of `choices` for an image, whose laser is checked. Warns of each.
fn features(what: Build, choices: &[Choice]) -> Result<Vec<&'static str>> {
    if what == Build::With(Sensor::PhotonTimer) {
        laser::check(!choices.contains(&Choice::LaserBeyondLimits))?;
    }
    for &choice in choices {
        let applies = match choice {
            Choice::LaserBeyondLimits => what == Build::With(Sensor::PhotonTimer),
            Choice::LaserOnWithoutHost | Choice::Count8 => what != Build::SelfTest,
        };
        let name = choice.name();
        ensure!(applies, "--{name} does not apply to this image");
        if let Some(warning) = choice.warning() {
            eprintln!("warning: --{name}: {warning}");
        }
    }
    Ok(choices.iter().map(|choice| choice.name()).collect())
}

/// The images of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Build {
    /// The sidecar with simulated photons.
    Sidecar,
    /// The sidecar with the photons of a sensor.
    With(Sensor),
    SelfTest,
}

impl Build {
    /// The image of this name; without a name, the sidecar with simulated photons.
    pub fn named(board: Board, name: Option<&str>) -> Result<Self> {
        let build = match name {
            None => Self::Sidecar,
            Some("self-test") => Self::SelfTest,
            Some("tdc7200") => Self::With(Sensor::Tdc7200),
            Some("photon-timer") => Self::With(Sensor::PhotonTimer),
            Some("tmf8828-8x8") => Self::With(Sensor::Tmf8828),
            Some("tmf8829") => Self::With(Sensor::Tmf8829),
            Some("tmf8829-spi") => Self::With(Sensor::Tmf8829Spi),
            Some("tmf882x" | "tmf8820" | "tmf8821") => Self::With(Sensor::Tmf882x),
            Some("tmf8828") => bail!("`tmf882x` for its 9 zones, or `tmf8828-8x8` for its 64?"),
            Some(name) => bail!(
                "unknown image `{name}` of this board: {}",
                Self::names(board)
            ),
        };
        match build {
            Self::With(sensor) if !board.row().sensors.contains(&sensor) => {
                bail!(
                    "{} has no {}: {}",
                    board.name(),
                    sensor.name(),
                    Self::names(board)
                )
            }
            _ => Ok(build),
        }
    }

    /// Its feature besides that of the board.
    pub fn feature(self) -> Option<&'static str> {
        match self {
            Self::Sidecar => None,
            Self::With(sensor) => Some(sensor.feature()),
            Self::SelfTest => Some("self-test"),
        }
    }

    /// The names of the images of a board.
    fn names(board: Board) -> String {
        let sensors = board.row().sensors.iter();
        let mut names: Vec<&str> = sensors.map(|sensor| sensor.name()).collect();
        names.push("self-test");
        format!("it has {}", names.join(", "))
    }
}

/// A sensor that a board may drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    PhotonTimer,
    Tdc7200,
    Tmf8829,
    /// A TMF8829 over SPI.
    Tmf8829Spi,
    Tmf882x,
    /// A TMF8828 with 8×8 zones.
    Tmf8828,
}

impl Sensor {
    fn feature(self) -> &'static str {
        match self {
            Self::PhotonTimer => "sensor-photon-timer",
            Self::Tdc7200 => "sensor-tdc7200",
            Self::Tmf8829 => "sensor-tmf8829",
            Self::Tmf8829Spi => "sensor-tmf8829-spi",
            Self::Tmf882x => "sensor-tmf882x",
            Self::Tmf8828 => "sensor-tmf8828-8x8",
        }
    }

    pub fn name(self) -> &'static str {
        self.feature().trim_start_matches("sensor-")
    }

    /// The variable with the path of the sensor's own program, for `firmware/build.rs`, and the most
    /// bytes: the bootloader of a TMF8820/21/28 takes 65,536 bytes, that of a TMF8829 4,096 words.
    pub fn image(self) -> Option<(&'static str, usize)> {
        match self {
            Self::PhotonTimer | Self::Tdc7200 => None,
            Self::Tmf8829 | Self::Tmf8829Spi => Some(("TMF8829_IMAGE", 1 << 14)),
            Self::Tmf882x | Self::Tmf8828 => Some(("TMF882X_IMAGE", 1 << 16)),
        }
    }

    /// The program of the sensor, `None` if it needs none.
    fn program(self) -> Result<Option<Program>> {
        let Some((variable, most)) = self.image() else {
            return Ok(None);
        };
        let path = env::var_os(variable).map(PathBuf::from);
        let path = path.with_context(|| {
            format!("set {variable} to the file of the sensor's program, raw bytes from its vendor")
        })?;
        let name = || format!("{variable}={}", path.display());
        check_program(&fs::read(&path).with_context(name)?, most).with_context(name)?;
        // The build script runs in another folder.
        let path = path.canonicalize().with_context(name)?;
        Ok(Some(Program { variable, path }))
    }
}

/// The program of a sensor, and the variable with its path.
struct Program {
    variable: &'static str,
    path: PathBuf,
}

/// Fails if the bytes cannot be the program of a sensor that takes `most` bytes.
fn check_program(bytes: &[u8], most: usize) -> Result<()> {
    ensure!(!bytes.is_empty(), "an empty file");
    ensure!(
        bytes.len() <= most,
        "{} bytes: the sensor takes at most {most}",
        bytes.len()
    );
    ensure!(
        !bytes.is_ascii(),
        "a text file, not raw bytes; `objcopy -I ihex -O binary` converts a HEX file"
    );
    Ok(())
}

/// Links one image. Returns the path of a copy that no other image replaces.
fn link(
    root: &Path,
    board: Board,
    binary: &str,
    features: &[&str],
    program: Option<&Program>,
    profile: &str,
) -> Result<PathBuf> {
    let target = board.target();
    toolchain::ensure_target(target)?;
    let target_folder = target_folder(root);
    let folder = target_folder.join("images");
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let name = image_name(board, binary, features, profile);
    let is_first = !is_kept(&folder, &name);
    if is_first {
        eprintln!("building {name} for the first time");
    }
    // No other run replaces what is built before it is copied.
    let lock = folder.join("lock");
    let lock = File::create(&lock).with_context(|| lock.display().to_string())?;
    if lock.try_lock().is_err() {
        eprintln!("waiting for another build of an image");
        lock.lock()?;
    }
    let mut cargo = cargo();
    let sensors = Board::ALL.into_iter().flat_map(|board| board.row().sensors);
    for (variable, _) in sensors.filter_map(|sensor| sensor.image()) {
        cargo.env_remove(variable);
    }
    if let Some(Program { variable, path }) = program {
        cargo.env(variable, path);
    }
    let status = cargo
        .current_dir(root)
        .env("CARGO_ENCODED_RUSTFLAGS", compiler_flags(root)?)
        .args(["build", "--locked", "--package", "dtof-firmware"])
        .args((!is_first && !io::stderr().is_terminal()).then_some("--quiet"))
        .args(["--bin", binary, "--features", &features.join(",")])
        .args(["--target", target, "--profile", profile, "--target-dir"])
        .arg(&target_folder)
        .status()
        .context("cargo does not start")?;
    ensure!(status.success(), "{name} does not build, see above");

    let built = target_folder.join(target).join(profile).join(binary);
    layout::check(&built, binary == "bench")?;
    let kept = folder.join(match Laser::read(&built)? {
        Some(laser) => format!("{name}+{}", laser.file_name()),
        None => name,
    });
    // Whoever has the older one open keeps it.
    let copy = folder.join("copy");
    fs::copy(&built, &copy).with_context(|| built.display().to_string())?;
    fs::rename(&copy, &kept).with_context(|| kept.display().to_string())?;
    Ok(kept)
}

/// The compiler's flags of the environment, and those that keep paths of this machine out of the image.
fn compiler_flags(root: &Path) -> Result<String> {
    let mut flags: Vec<String> = match env::var("CARGO_ENCODED_RUSTFLAGS") {
        Ok(flags) => vec![flags],
        Err(_) => {
            let flags = env::var("RUSTFLAGS").unwrap_or_default();
            flags.split_whitespace().map(Into::into).collect()
        }
    };
    let mut remap =
        |from: &Path, to: &str| flags.push(format!("--remap-path-prefix={}={to}", from.display()));
    remap(&root.canonicalize()?, ".");
    let registries = cargo_home()?.join("registry/src");
    // None before the first download.
    for registry in fs::read_dir(registries).into_iter().flatten() {
        remap(&registry?.path(), "crates");
    }
    flags.retain(|flag| !flag.is_empty());
    Ok(flags.join("\u{1f}"))
}

/// The name of the file that keeps an image. Those for speed and for size have names of their own: a run beside this one may
/// build the other before this one is started.
fn image_name(board: Board, binary: &str, features: &[&str], profile: &str) -> String {
    let image = match binary == board.row().sidecar {
        true => format!("sidecar-{}", board.name()),
        false => binary.to_owned(),
    };
    let more = features.iter().filter(|&&feature| !image.contains(feature));
    let mut name: Vec<&str> = iter::once(&*image).chain(more.copied()).collect();
    if profile == SMALL_PROFILE {
        name.push("small");
    }
    name.join("+")
}

/// Whether the folder has an image of this name. The numbers of its laser may follow the name.
fn is_kept(folder: &Path, name: &str) -> bool {
    let is_it = |file: &str| {
        let rest = file.strip_prefix(name);
        let numbers = rest.and_then(|rest| rest.strip_prefix('+'));
        rest == Some("")
            || numbers.is_some_and(|text| text.starts_with(|c: char| c.is_ascii_digit()))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .any(|file| is_it(&file))
}

/// Builds an image and prints its path.
pub fn image(
    root: &Path,
    board: &str,
    what: Option<&str>,
    emulator: bool,
    choices: &[Choice],
) -> Result<()> {
    let board = Board::named(board)?;
    let what = Build::named(board, what)?;
    let path = if emulator {
        board.build_for_emulator(root, what, choices)?
    } else {
        board.build(root, what, choices)?
    };
    println!("{}", path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_risk_is_the_feature_of_its_name_and_for_images_that_it_concerns() {
        let choices = [Choice::LaserBeyondLimits, Choice::LaserOnWithoutHost];
        let names = choices.map(Choice::name);
        let manifest = include_str!("../../firmware/Cargo.toml");
        for name in names {
            assert!(manifest.contains(&format!("\n{name} = []\n")), "{name}");
        }
        let timer = Build::With(Sensor::PhotonTimer);
        assert_eq!(features(timer, &choices).unwrap(), names);
        assert_eq!(features(timer, &[]).unwrap(), [""; 0]);
        for what in [Build::Sidecar, Build::With(Sensor::Tdc7200)] {
            assert!(features(what, &[Choice::LaserOnWithoutHost]).is_ok());
            assert!(features(what, &[Choice::LaserBeyondLimits]).is_err());
        }
        assert!(features(Build::SelfTest, &[Choice::LaserOnWithoutHost]).is_err());
    }

    #[test]
    fn each_image_has_its_own_name() {
        let board = Board::Pico;
        let bench = |profile| image_name(board, "bench", &["pico", "bench"], profile);
        assert_eq!(bench(PROFILE), "bench+pico");
        assert_eq!(bench(SMALL_PROFILE), "bench+pico+small");
        let sidecar = |features| image_name(board, board.row().sidecar, features, PROFILE);
        assert_eq!(sidecar(&["pico"]), "sidecar-pico");
        assert_eq!(sidecar(&["pico", "count8"]), "sidecar-pico+count8");
    }

    #[test]
    fn a_program_is_raw_bytes_that_fit() {
        let sensors = Board::ALL.into_iter().flat_map(|board| board.row().sensors);
        let images = sensors.filter_map(|sensor| sensor.image());
        for most in images.map(|(_, most)| most) {
            assert!(check_program(&[0, 0x20, 0xff], most).is_ok());
            assert!(check_program(&vec![0xff; most], most).is_ok());
            assert!(check_program(&vec![0xff; most + 1], most).is_err());
            assert!(check_program(b"", most).is_err());
            assert!(check_program(b":10000000", most).is_err());
            assert!(check_program(b"const unsigned char image[] = {", most).is_err());
        }
    }
}

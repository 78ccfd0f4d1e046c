//! What the linker needs for each image. It is said here and not in
//! `.cargo/config.toml`, whose rustflags vanish as soon as `RUSTFLAGS` is set.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

/// The images a board runs, each with the features of the boards it is for.
const IMAGES: [(&str, &[&str]); 5] = [
    ("bench", &["MPS2_AN386", "PICO", "PICO2", "STM32F405"]),
    ("sidecar-mps2-an386", &["MPS2_AN386"]),
    ("sidecar-pico", &["PICO", "PICO2"]),
    ("sidecar-stm32f405", &["STM32F405"]),
    ("self-test", &["MPS2_AN386", "PICO", "PICO2", "STM32F405"]),
];
/// The targets of boards; elsewhere the linker's own layout does.
const TARGETS: [&str; 3] = [
    "thumbv6m-none-eabi",
    "thumbv7em-none-eabihf",
    "thumbv8m.main-none-eabihf",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory");
    println!("cargo::rerun-if-changed=../memory.x");

    // A Cortex-M0, M0+ or M23 has fewer instructions and registers of faults.
    println!("cargo::rustc-check-cfg=cfg(armv6m)");
    let target = env::var("TARGET")?;
    if target.starts_with("thumbv6m") || target.starts_with("thumbv8m.base") {
        println!("cargo::rustc-cfg=armv6m");
    }

    sensor_image("TMF8829")?;
    sensor_image("TMF882X")?;

    if !TARGETS.contains(&&*env::var("TARGET")?) {
        return Ok(());
    }
    let here = env::var("CARGO_MANIFEST_DIR")?;
    let link = |image: &str, argument: &str| {
        println!("cargo::rustc-link-arg-bin={image}={argument}");
    };

    for (image, boards) in IMAGES {
        let is_for = |board: &&&str| env::var_os(format!("CARGO_FEATURE_{board}")).is_some();
        match boards.iter().find(is_for) {
            // Whole: the linker looks for the `memory.x` that cortex-m-rt's
            // `link.x` includes in the folder it is started in before all others,
            // and cargo starts it where the other board's is.
            Some(&"MPS2_AN386") => link(image, &format!("-T{}", mps2_an386(&here)?)),
            Some(&"PICO") => link(image, &format!("-T{here}/memory/pico.x")),
            Some(&"PICO2") => link(image, &format!("-T{here}/memory/pico2.x")),
            Some(&"STM32F405") => {
                link(image, &format!("-L{here}/.."));
                link(image, "-Tlink.x");
            }
            Some(board) => return Err(format!("which linker script has {board}?").into()),
            None => continue,
        }
        link(image, "-Tdefmt.x");
        // Sections start where the one before ends, not at the next page.
        link(image, "--nmagic");
    }
    Ok(())
}

/// The linker script of the board. If pixels have counters of 8 bits it takes 192 KiB, of which the
/// stack needs at most 10.
fn mps2_an386(here: &str) -> Result<String, Box<dyn Error>> {
    let path = format!("{here}/memory/mps2-an386.x");
    if env::var_os("CARGO_FEATURE_COUNT8").is_none() {
        return Ok(path);
    }
    let mut script = fs::read_to_string(path)?;
    for (whole, small) in [
        ("LENGTH = 19K", "LENGTH = 10752"),
        (
            "LENGTH = 4M - LENGTH(STACK)",
            "LENGTH = 192K - LENGTH(STACK)",
        ),
    ] {
        if !script.contains(whole) {
            return Err(format!("the linker script has no `{whole}`").into());
        }
        script = script.replace(whole, small);
    }
    let small = format!("{}/mps2-an386.x", env::var("OUT_DIR")?);
    fs::write(&small, script)?;
    Ok(small)
}

/// Puts the vendor's image of a sensor where the sidecar includes it from. `TMF882X_IMAGE` and the
/// like name it: raw bytes, from the beginning of the RAM on. Without it the driver says that there
/// is none.
fn sensor_image(sensor: &str) -> Result<(), Box<dyn Error>> {
    let variable = format!("{sensor}_IMAGE");
    println!("cargo::rerun-if-env-changed={variable}");
    if env::var_os(format!("CARGO_FEATURE_SENSOR_{sensor}")).is_none() {
        return Ok(());
    }
    let image = match env::var_os(variable) {
        None => Vec::new(),
        Some(path) => {
            let path = Path::new(&path);
            println!("cargo::rerun-if-changed={}", path.display());
            fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?
        }
    };
    let out = env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?;
    let name = sensor.to_lowercase();
    fs::write(Path::new(&out).join(name).with_extension("bin"), image)?;
    Ok(())
}

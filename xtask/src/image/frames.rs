//! The stack frames of programs with arrays of pixels, two examples of dtof-core:
//! `pixel_array` fills them in place, `pixel_array_moved` must be refused.

use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::{BOARDS, Image};
use crate::{cargo, target_folder};

const IN_PLACE: &str = "pixel_array";
const MOVED: &str = "pixel_array_moved";
const PICO: &str = "thumbv6m-none-eabi";
/// Targets, profiles, their folders, and the most bytes of a stack frame. Without optimisation
/// the variables of a function do not share their bytes: its largest frame, where neighbours are
/// added up, has 2,664 with debug information. Otherwise the
/// largest has a `PixelArray`: configuration and counts, but no pixel.
const BUILDS: [(&str, &str, &str, u32); 4] = [
    (BOARDS, "dev", "debug", 3072),
    (BOARDS, "firmware", "firmware", 2048),
    (BOARDS, "firmware-small", "firmware-small", 2048),
    (PICO, "firmware-small", "firmware-small", 2048),
];
const PIXEL: u32 = 320;
/// Bytes of the arrays of `pixel_array`: 64 and 256 pixels.
const ARRAYS: u32 = (64 + 256) * PIXEL;
/// Bytes of the array of `pixel_array_moved`.
const ARRAY: u32 = 256 * PIXEL;

/// Builds the examples for the boards. Fails if a frame is too large, or if the frame of
/// `pixel_array_moved` is not found.
pub fn check(root: &Path) -> Result<()> {
    let folder = target_folder(root);
    for (target, profile, output, most) in BUILDS {
        let built = cargo()
            .current_dir(root)
            .args(["build", "--quiet", "--locked", "--package", "dtof-core"])
            .args(["--example", IN_PLACE, "--example", MOVED])
            .args(["--target", target, "--profile", profile, "--target-dir"])
            .arg(&folder)
            .status()
            .context("cargo does not start")?;
        ensure!(
            built.success(),
            "{IN_PLACE} or {MOVED} does not build for {target}"
        );
        let examples = folder.join(target).join(output).join("examples");
        let bytes = |example: &str, arrays: u32| {
            let path = examples.join(example);
            let memory = Image::read(&path)?.memory;
            ensure!(
                memory >= u64::from(arrays),
                "{example} has no arrays of pixels"
            );
            let (name, bytes) = xtask::stack_bound::largest_frame(&path)?;
            println!("{target}, {profile}, {example}: the largest stack frame has {bytes} bytes");
            Ok((name, bytes))
        };
        let (name, in_place) = bytes(IN_PLACE, ARRAYS)?;
        ensure!(
            in_place <= most,
            "{name} has a stack frame of {in_place} bytes, more than {most}"
        );
        let (_, moved) = bytes(MOVED, ARRAY)?;
        ensure!(
            moved >= ARRAY,
            "{MOVED}: the stack frame of {ARRAY} bytes is not found"
        );
    }
    Ok(())
}

//! The recipe of docs/recordings.md for arrays with more pixels than addresses. With `DTOF_LONG=1` an array of 2^20 pixels.
//!
//! ```sh
//! DTOF_SLOW=1 DTOF_LONG=1 cargo test --package dtof-host-tests --test slow large -- --nocapture
//! ```

use std::env;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use dtof_data::photons::npy::header;

use crate::{dtof, enabled, python, root, succeed};

/// Memory that a tile may take, in MB.
const MOST_MB: f64 = 600.0;

/// Runs a shell script, and prints the most memory of a program in it, in kB.
const PEAK: &str = "
import resource, subprocess, sys
subprocess.run(['sh', '-euc', sys.argv[1]], check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)";

/// The bin of the target of a pixel.
fn bin(row: usize, column: usize, bins: usize) -> usize {
    bins / 4 + (row / 16 + column / 16) % (bins / 2)
}

/// Histograms in which every pixel sees a target.
fn write(path: &Path, [rows, columns, bins]: [usize; 3]) -> Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let shape = [rows, columns, bins].map(|length| length as u64);
    file.write_all(&header("|u1", &shape, 128))?;
    let mut noise = 1u32;
    let mut counts = vec![0; bins];
    for pixel in 0..rows * columns {
        for count in &mut counts {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *count = u8::from(noise >> 28 == 0);
        }
        let peak = bin(pixel / columns, pixel % columns, bins);
        for (offset, count) in [20, 40, 20].into_iter().enumerate() {
            counts[peak - 1 + offset] += count;
        }
        file.write_all(&counts)?;
    }
    Ok(file.flush()?)
}

/// The code blocks of the recipe.
fn recipe() -> Result<[String; 3]> {
    let page = fs::read_to_string(root().join("docs/recordings.md"))?;
    let (_, section) = page
        .split_once("\n## Larger arrays\n")
        .context("no recipe")?;
    let parts = section
        .split("\n## ")
        .next()
        .unwrap_or_default()
        .split("```");
    let blocks = parts.skip(1).step_by(2).map(|block| {
        let (_, code) = block.split_once('\n').unwrap_or_default();
        code.to_owned()
    });
    let blocks: Vec<String> = blocks.collect();
    <[String; 3]>::try_from(blocks)
        .ok()
        .context("not three blocks")
}

#[test]
fn a_large_array_in_tiles_has_the_depth_of_every_pixel() -> Result<()> {
    let test = "a large array in tiles";
    let Some(_alone) = enabled(test, &["python3"]) else {
        return Ok(());
    };
    let Some(python) = python(test, "host-tests/readers/requirements.txt") else {
        return Ok(());
    };
    let dtof = dtof()?;
    let [rows, columns, bins] = match env::var_os("DTOF_LONG") {
        Some(_) => [1024, 1024, 128],
        None => [300, 280, 16],
    };
    let folder = tempfile::tempdir()?;
    let place = |name: &str| folder.path().join(name);
    write(&place("large.npy"), [rows, columns, bins])?;
    let python = |code: &str| {
        let mut command = Command::new(&python);
        command.current_dir(folder.path()).args(["-c", code]);
        command
    };

    let [cut, replay, join] = recipe()?;
    let begun = Instant::now();
    succeed(&mut python(&cut))?;
    let cut = begun.elapsed();
    fs::remove_file(place("large.npy"))?;
    let replay = replay.replace("cargo run --release --", &format!("'{}'", dtof.display()));
    let begun = Instant::now();
    let output = python(PEAK).arg(replay).stderr(Stdio::inherit()).output()?;
    let replayed = begun.elapsed();
    let peak = String::from_utf8(output.stdout)?;
    let peak: f64 = peak.trim().parse().with_context(|| peak.clone())?;
    write(&place("large.npy"), [rows, columns, bins])?;
    succeed(&mut python(&join))?;

    let depth = fs::read(place("depth.npy"))?;
    let (depths, _) = depth[depth.len() - 8 * rows * columns..].as_chunks();
    let mut wrong = 0;
    for (pixel, bytes) in depths.iter().enumerate() {
        // Bins of 250 ps.
        let middle = bin(pixel / columns, pixel % columns, bins) as f64 + 0.5;
        let off = f64::from_le_bytes(*bytes) / 37.474_057 - middle;
        wrong += usize::from(off.is_nan() || off.abs() >= 1.0);
    }
    let tiles = rows.div_ceil(256) * columns.div_ceil(256);
    println!(
        "load: {rows} x {columns} pixels, {bins} bins: cut into {tiles} tiles in {:.1} s, replayed in {:.0} s with at most \
         {:.0} MB; depth of {wrong} pixels wrong or missing",
        cut.as_secs_f64(),
        replayed.as_secs_f64(),
        peak / 1e3
    );
    ensure!(wrong == 0, "{wrong} pixels are wrong");
    ensure!(peak / 1e3 < MOST_MB, "{peak} kB");
    Ok(())
}

//! How long an event takes in the whole system, from the end of the laser cycle that decides to
//! REQ at the AER port.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use dtof_softcore::stream;

use super::scene::{Events, Pixels, Scene};
use super::{Outcome, simulate};
use crate::image::Images;
use crate::rtl::{package_folder, verilate};

/// A program for the system, and what it does.
const PROGRAMS: [(&str, &str); 2] = [
    ("pixels-hardware", "packed by the pixel processor"),
    ("pixels-program", "packed by the program"),
];

/// Photons a clock, in 1/256.
const RATES: [u32; 6] = [4, 8, 16, 32, 64, 256];

/// Clocks of a laser cycle of 10 MHz, at 75 MHz: one or the other.
const CLOCKS: [u64; 2] = [7, 8];

/// What events took.
pub struct Latencies {
    pub packer: &'static str,
    pub photons: f64,
    pub outcome: Outcome,
    pub sorted: Vec<u64>,
}

impl Latencies {
    /// The latency that so many of 1000 events do not exceed, in clocks.
    pub fn of_1000(&self, share: usize) -> Option<u64> {
        let place = (self.sorted.len() * share).div_ceil(1000);
        self.sorted.get(place.checked_sub(1)?).copied()
    }
}

/// Runs the system at several rates of photons, `length` clocks each.
pub fn measure(root: &Path, length: u64) -> Result<Vec<Latencies>> {
    let processor = package_folder(root, "pythondata_cpu_vexriscv")?;
    let sizes = ["-GPIXELS_LOG2=2", "-GRAM_BITS=16"];
    let simulator = verilate(root, "system", "system", &processor, &sizes)?;
    let images = Images::build(root, "rv32im", false)?;
    let mut all = Vec::new();
    for (program, packer) in PROGRAMS {
        let flat = images.flat(program);
        let words = flat.with_extension("hex");
        fs::write(&words, hexadecimal(&fs::read(&flat)?))?;
        for rate in RATES {
            let scene = Scene {
                name: format!("the system, {rate}/256 photons a clock, events {packer}"),
                pixels_log2: 2,
                config: stream::config()?,
                clocks: CLOCKS,
                rate,
                signal: 100,
                spread: 1,
                pixels: Pixels::All,
                link: 256,
                events: Events::System,
                length,
                seed: rate.into(),
            };
            let mut command = Command::new(&simulator);
            command.arg(format!("+ram={}", words.display()));
            let mut outcome = simulate(&mut command, &scene)?;
            let mut sorted = std::mem::take(&mut outcome.latencies);
            sorted.sort_unstable();
            ensure!(!sorted.is_empty(), "{}: no events", scene.name);
            let latencies = Latencies {
                packer,
                photons: f64::from(rate) / 256.0,
                outcome,
                sorted,
            };
            println!(
                "{}: {} events, one in {:.0} clocks; {} looks late, {} decisions put off; \
                 clocks until REQ: median {}, 99 % {}, all {}",
                scene.name,
                latencies.sorted.len(),
                length as f64 / latencies.sorted.len() as f64,
                latencies.outcome.late,
                latencies.outcome.statistics.deferred,
                latencies.of_1000(500).context("none")?,
                latencies.of_1000(990).context("none")?,
                latencies.of_1000(1000).context("none")?,
            );
            all.push(latencies);
        }
    }
    Ok(all)
}

/// A line a word, as `$readmemh` reads it.
fn hexadecimal(bytes: &[u8]) -> String {
    let words = bytes.chunks(4).map(|bytes| {
        let mut word = [0; 4];
        for (to, from) in word.iter_mut().zip(bytes) {
            *to = *from;
        }
        format!("{:08x}\n", u32::from_le_bytes(word))
    });
    words.collect()
}

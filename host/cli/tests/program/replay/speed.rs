//! How many photons a second `dtof replay` takes on one core, and how much memory. Prints the
//! figures of the documentation:
//!
//! ```sh
//! cargo test --release --package dtof --test program photons_a_second -- --ignored --nocapture
//! ```

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::Stdio;
use std::time::Instant;

use crate::common::{Scratch, npy, peak_kb};

const PIXELS: u64 = 64 * 64;
const BINS: u32 = 128;

/// Pseudo-random numbers with a fixed seed.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
        let mixed = (mixed ^ mixed >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
        ((u128::from(mixed ^ mixed >> 32) * u128::from(end)) >> 64) as u64
    }

    /// A photon of `pixel`: three of ten lie in the pulse.
    fn bin(&mut self, pixel: u64) -> u64 {
        match self.below(10) {
            0..3 => 20 + pixel / 48 + self.below(3),
            _ => self.below(BINS.into()),
        }
    }
}

/// Histograms with so many photons a pixel.
fn write_histograms(path: &Path, photons: u64) {
    let mut numbers = Numbers(1);
    let mut counts = Vec::new();
    for pixel in 0..PIXELS {
        let mut bins = [0u32; 128];
        for _ in 0..photons {
            bins[usize::try_from(numbers.bin(pixel)).unwrap()] += 1;
        }
        counts.extend(bins.iter().flat_map(|count| count.to_le_bytes()));
    }
    std::fs::write(path, npy("<u4", "(64, 64, 128)", &counts)).unwrap();
}

/// A list of so many photons, `a_cycle` in each laser cycle.
fn write_list(path: &Path, photons: u64, a_cycle: u64) {
    let fields = "[('pixel', '<u2'), ('cycle', '<u4'), ('bin', '<u2')]";
    let header = format!("{{'descr': {fields}, 'fortran_order': False, 'shape': ({photons},), }}");
    let mut file = BufWriter::new(File::create(path).unwrap());
    file.write_all(b"\x93NUMPY\x01\x00\xf6\x00").unwrap();
    writeln!(file, "{header:<245}").unwrap();
    let mut numbers = Numbers(2);
    for photon in 0..photons {
        let pixel = numbers.below(PIXELS);
        let cycle = u32::try_from(photon / a_cycle).unwrap();
        let bin = numbers.bin(pixel);
        file.write_all(&u16::try_from(pixel).unwrap().to_le_bytes())
            .unwrap();
        file.write_all(&cycle.to_le_bytes()).unwrap();
        file.write_all(&u16::try_from(bin).unwrap().to_le_bytes())
            .unwrap();
    }
    file.flush().unwrap();
}

/// Photons a second on one core, from start to end, and the most memory in kB.
fn replay(scratch: &Scratch, line: &str) -> (f64, u64) {
    let mut dtof = scratch.command(&format!("replay --out out --no-csv --quiet {line}"));
    dtof.env("RAYON_NUM_THREADS", "1").stdout(Stdio::null());
    let began = Instant::now();
    let peak = peak_kb(dtof.spawn().unwrap());
    let seconds = began.elapsed().as_secs_f64();
    let photons = scratch.summary()["photons"].as_f64().unwrap();
    (photons / seconds, peak)
}

#[test]
#[ignore = "prints figures; a minute with --release"]
fn photons_a_second() {
    println!("64 × 64 pixels, 128 bins, one core, without events.csv");
    println!("photons a pixel and laser cycle  input       rule    million photons a second");
    for (tenths, cycles) in [(5, 20_000), (10, 10_000), (20, 5000), (50, 2000)] {
        let scratch = Scratch::new();
        write_histograms(&scratch.path("histograms.npy"), tenths * 4000);
        let a_cycle = PIXELS * tenths / 10;
        write_list(&scratch.path("list.npy"), a_cycle * cycles, a_cycle);
        for (input, options) in [
            ("histograms", "--recorded-cycles 40000"),
            ("list", "--columns 64"),
        ] {
            for (rule, chosen) in [("paper", ""), ("window", "--rule window --sigma-bins 1")] {
                let line = format!("--input {input}.npy --cycles {cycles} {options} {chosen}");
                let best = (0..3).map(|_| replay(&scratch, &line).0);
                let best = best.fold(0.0, f64::max) / 1e6;
                let rate = tenths as f64 / 10.0;
                println!("{rate:<31}  {input:<10}  {rule:<6}  {best:.1}");
            }
        }
    }
}

#[test]
#[ignore = "writes a file of 8 GB; some minutes with --release"]
fn a_billion_photons_take_little_memory() {
    let scratch = Scratch::new();
    write_list(&scratch.path("list.npy"), 1_000_000_000, PIXELS);
    let line = "--input list.npy --columns 64 --cycles 1e9";
    let (rate, peak) = replay(&scratch, line);
    assert_eq!(scratch.summary()["photons"], 1_000_000_000);
    println!(
        "10^9 photons: at most {peak} kB, {:.1} million a second",
        rate / 1e6
    );
    assert!(peak < 300_000, "{peak} kB");
}

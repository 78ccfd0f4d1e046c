//! How many photons a second `dtof replay` takes on one core, and how much memory. Prints the
//! figures of the documentation, on Linux:
//!
//! ```sh
//! cargo test --release --package dtof --test program photons_a_second -- --ignored --nocapture
//! ```

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use dtof_data::options::rows::grouped;
use dtof_data::photons::npy::header;

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

/// A list of so many photons, `a_cycle` in each laser cycle, as an `.npy` and as a `.csv` file.
fn write_lists(npy: &Path, csv: Option<&Path>, photons: u64, a_cycle: u64) {
    let fields = "[('pixel', '<u2'), ('cycle', '<u4'), ('bin', '<u2')]";
    let mut npy = BufWriter::new(File::create(npy).unwrap());
    npy.write_all(&header(fields, &[photons], 256)).unwrap();
    let mut csv = csv.map(|path| BufWriter::new(File::create(path).unwrap()));
    if let Some(csv) = &mut csv {
        writeln!(csv, "pixel,cycle,bin").unwrap();
    }
    let mut numbers = Numbers(2);
    for photon in 0..photons {
        let pixel = numbers.below(PIXELS);
        let cycle = u32::try_from(photon / a_cycle).unwrap();
        let bin = numbers.bin(pixel);
        npy.write_all(&u16::try_from(pixel).unwrap().to_le_bytes())
            .unwrap();
        npy.write_all(&cycle.to_le_bytes()).unwrap();
        npy.write_all(&u16::try_from(bin).unwrap().to_le_bytes())
            .unwrap();
        if let Some(csv) = &mut csv {
            writeln!(csv, "{pixel},{cycle},{bin}").unwrap();
        }
    }
    npy.flush().unwrap();
    if let Some(csv) = &mut csv {
        csv.flush().unwrap();
    }
}

/// Photons a second on one core, from start to end, and the most memory in kB.
fn replay(scratch: &Scratch, line: &str) -> (f64, u64) {
    let dtof = scratch.command(&format!("replay --out out --no-csv --quiet {line}"));
    // One thread that decides, and the one that reads, take turns.
    let mut pinned = Command::new("taskset");
    pinned.args(["--cpu-list", "0"]).arg(dtof.get_program());
    pinned
        .args(dtof.get_args())
        .current_dir(dtof.get_current_dir().unwrap());
    pinned.env("RAYON_NUM_THREADS", "1").stdout(Stdio::null());
    let began = Instant::now();
    let peak = peak_kb(pinned.spawn().unwrap());
    let seconds = began.elapsed().as_secs_f64();
    let photons = scratch.summary()["photons"].as_f64().unwrap();
    (photons / seconds, peak)
}

#[test]
#[ignore = "prints figures; some minutes with --release"]
fn photons_a_second() {
    const PAPER: &str = "";
    const WINDOW: &str = "--rule window --sigma-bins 1";
    const NEIGHBOURS: &str = "--rule window --sigma-bins 1 --neighbours 8";
    println!("64 × 64 pixels, 128 bins, one core, without events.csv, in million photons a second");
    println!("photons a pixel  histograms      list            list in a CSV   with neighbours");
    println!("and laser cycle  paper   window  paper   window  paper   window  histograms  list");
    for (tenths, cycles) in [
        (1, 100_000),
        (5, 20_000),
        (10, 10_000),
        (20, 5000),
        (50, 2000),
    ] {
        let scratch = Scratch::new();
        scratch.file("defaults.toml", "");
        write_histograms(&scratch.path("histograms.npy"), tenths * cycles / 5);
        let a_cycle = PIXELS * tenths / 10;
        let [npy, csv] = ["list.npy", "list.csv"].map(|name| scratch.path(name));
        write_lists(&npy, Some(&csv), a_cycle * cycles, a_cycle);
        let histograms = format!("--input histograms.npy --recorded-cycles {}", 2 * cycles);
        let [list, csv] = ["npy", "csv"].map(|end| format!("--input list.{end} --columns 64"));
        print!("{:<15}", tenths as f64 / 10.0);
        for (input, options) in [
            (&histograms, PAPER),
            (&histograms, WINDOW),
            (&list, PAPER),
            (&list, WINDOW),
            (&csv, PAPER),
            (&csv, WINDOW),
            (&histograms, NEIGHBOURS),
            (&list, NEIGHBOURS),
        ] {
            let line = format!("{input} --settings defaults.toml --cycles {cycles} {options}");
            let best = (0..3).map(|_| replay(&scratch, &line).0);
            print!("  {:<6.1}", best.fold(0.0, f64::max) / 1e6);
        }
        println!();
    }
}

#[test]
#[ignore = "writes a file of 8 GB; some minutes with --release"]
fn a_billion_photons_take_little_memory() {
    let scratch = Scratch::new();
    write_lists(&scratch.path("list.npy"), None, 1_000_000_000, PIXELS);
    let line = "--input list.npy --columns 64 --cycles 1e9";
    let (rate, peak) = replay(&scratch, line);
    assert_eq!(scratch.summary()["photons"], 1_000_000_000);
    println!(
        "load: 10^9 photons: {:.1} million a second, at most {} MB",
        rate / 1e6,
        peak / 1000
    );
    assert!(peak < 300_000, "{peak} kB");
}

#[test]
#[ignore = "writes a file of 67 MB; a minute with --release"]
fn the_most_pixels_and_bins_take_known_memory() {
    const SIDE: u64 = 256;
    let scratch = Scratch::new();
    let mut file = BufWriter::new(File::create(scratch.path("wide.npy")).unwrap());
    let shape = [SIDE, SIDE, 1024];
    file.write_all(&header("|u1", &shape, 128)).unwrap();
    let mut numbers = Numbers(3);
    for pixel in 0..SIDE * SIDE {
        // Two photons a bin, and a pulse.
        let mut counts = [0u8; 1024];
        for _ in 0..counts.len() {
            counts[usize::try_from(numbers.below(1024)).unwrap()] += 2;
        }
        let peak = usize::try_from(200 + pixel / SIDE * 2).unwrap();
        counts[peak - 1..=peak + 1].copy_from_slice(&[40, 60, 40]);
        file.write_all(&counts).unwrap();
    }
    file.flush().unwrap();
    let began = Instant::now();
    let line = "replay --quiet --no-csv --input wide.npy --recorded-cycles 2000 --out out";
    let mut dtof = scratch.command(line);
    let peak = peak_kb(dtof.stdout(Stdio::null()).spawn().unwrap());
    let seconds = began.elapsed().as_secs_f64();
    let summary = scratch.summary();
    println!(
        "load: 65,536 pixels of 1024 bins, {} photons: {seconds:.0} s, at most {} MB",
        grouped(summary["photons"].as_u64().unwrap()),
        peak / 1000
    );
    assert!(
        summary["pixels_reporting"].as_u64() > Some(65_000),
        "{summary}"
    );
    assert!(peak < 3_000_000, "{peak} kB");
}

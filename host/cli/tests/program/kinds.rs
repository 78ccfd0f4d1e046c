//! Kinds of recordings, many draws of each: are the depths right, or does a warning name the cause?
//!
//! A test draws five recordings of its kind, `clean` forty. With `DTOF_SLOW` it draws 200, or 500, which takes long:
//!
//! ```sh
//! cargo test --package dtof --test program kinds:: -- --nocapture # prints a table
//! DTOF_SLOW=1 cargo test --release --package dtof --test program kinds:: -- --nocapture
//! DTOF_DRAWS=17..18 cargo test --package dtof --test program kinds::a_sunlit_patch -- --exact
//! ```
//!
//! `DTOF_DRAWS` names the draws. `DTOF_KEEP` names a folder for the recordings that fail, each with its command.
//! `DTOF_PROGRAM` names another program.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers are drawn from small ranges"
)]

mod recordings;

use std::env::var;
use std::ops::Range;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;

use dtof_data::photons::MM_PER_PS;
use dtof_light::counts::dead_time::arrived;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;

use crate::common::{Scratch, npy};
use recordings::{Array, KINDS, Kind, Need, Recording, Truth};

const BIN_WIDTH_PS: f64 = 250.0;

impl Kind {
    fn of(name: &str) -> &'static Self {
        KINDS.iter().find(|kind| kind.name == name).unwrap()
    }

    /// A draw depends on the name and its number only.
    fn recording(&self, draw: u64) -> Recording {
        let seed = self.name.bytes().fold(draw, |seed, byte| {
            seed.wrapping_mul(0x100_0000_01b3) ^ u64::from(byte)
        });
        (self.draw)(&mut Pcg64::seed_from_u64(seed))
    }

    fn draws(&self) -> Range<u64> {
        if let Ok(range) = var("DTOF_DRAWS") {
            let (first, end) = range.split_once("..").expect("DTOF_DRAWS is FIRST..END");
            return first.parse().unwrap()..end.parse().unwrap();
        }
        match (self.name, var("DTOF_SLOW").is_ok()) {
            ("clean", false) => 0..40,
            ("clean", true) => 0..500,
            (_, false) => 0..5,
            (_, true) => 0..200,
        }
    }

    /// How many of so many draws may fail: 5 %, of clean ones 1 %. One may in any case, since a draw of five that fails
    /// says little about a kind that has to hold in 95 %.
    fn most_failures(&self, draws: usize) -> usize {
        let each = if self.name == "clean" { 100 } else { 20 };
        match draws {
            1 => 0,
            _ => (draws / each).max(1),
        }
    }
}

impl Recording {
    /// The file.
    fn npy(&self) -> Vec<u8> {
        match &self.array {
            Array::Histograms { shape, counts } => {
                let most = counts.iter().copied().max().unwrap();
                let (descr, bytes) = match most {
                    0..=0xffff => ("<u2", 2),
                    0x1_0000..=0xffff_ffff => ("<u4", 4),
                    _ => ("<u8", 8),
                };
                let data: Vec<u8> = counts
                    .iter()
                    .flat_map(|count| count.to_le_bytes().into_iter().take(bytes))
                    .collect();
                let shape = shape.iter().map(ToString::to_string);
                npy(descr, &shape.collect::<Vec<_>>().join(","), &data)
            }
            Array::Photons(photons) => {
                let numbers = photons.as_flattened().iter();
                let data: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
                npy("<u4", &format!("{},3", photons.len()), &data)
            }
        }
    }

    /// Whether a depth in bins is right.
    fn is_right(&self, truth: Truth, depth: f64) -> bool {
        let is_at = |position: f64| (depth - position).abs() < self.tolerance;
        match truth {
            Truth::Nothing => depth.is_nan(),
            Truth::Anything => true,
            Truth::At(position) => is_at(position),
            Truth::Either(first, second) => is_at(first) || is_at(second),
        }
    }

    /// The photons of all bins of a pixel, also of a list. Those that came after the first one are added.
    fn histogram(&self, pixel: usize) -> Vec<f64> {
        let mut histogram = vec![0.0; self.bins];
        match &self.array {
            Array::Histograms { counts, .. } => {
                let counts = &counts[pixel * self.bins..][..self.bins];
                let counts = counts.iter().map(|&count| count as f64);
                histogram = counts.collect();
            }
            Array::Photons(photons) => {
                for [_, _, bin] in photons.iter().filter(|photon| photon[0] == pixel as u32) {
                    histogram[*bin as usize] += 1.0;
                }
            }
        }
        match self.first_photons_of {
            Some(cycles) => arrived(&histogram, cycles as f64, self.bins),
            None => histogram,
        }
    }
}

/// What the program did.
struct Outcome {
    is_right: bool,
    is_told: bool,
    holds: bool,
    /// The share that is right, and the warnings.
    text: String,
}

/// Replays a recording in a new folder.
fn replay(recording: &Recording) -> Outcome {
    let scratch = Scratch::new();
    scratch.file("a.npy", recording.npy());
    let program = var("DTOF_PROGRAM").unwrap_or_else(|_| env!("CARGO_BIN_EXE_dtof").to_owned());
    let output = Command::new(program)
        .current_dir(scratch.path(""))
        .args(arguments("a.npy", recording).split_whitespace())
        .output()
        .unwrap();
    let (share, warnings) = if output.status.success() {
        let depths = scratch.map("depth");
        let depths = depths.iter().map(|mm| mm / (BIN_WIDTH_PS * MM_PER_PS));
        let pixels = recording.truth.iter().zip(depths);
        let right = pixels.filter(|(truth, depth)| recording.is_right(**truth, *depth));
        let share = right.count() as f64 / recording.truth.len() as f64;
        let warnings = scratch.summary()["warnings"].clone();
        let warnings: Vec<String> = serde_json::from_value(warnings).unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        let is_short = !warnings.is_empty() || printed.lines().count() <= 15;
        assert!(is_short, "{printed}");
        (share, warnings)
    } else {
        // An error names the cause as well, unless the program stopped on its own.
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        match output.status.code() {
            Some(1 | 2) => (0.0, vec![error]),
            _ => (0.0, Vec::new()),
        }
    };
    let contains = |words: &[&str]| {
        warnings.iter().any(|warning| {
            let warning = warning.to_lowercase();
            words.iter().any(|word| warning.contains(word))
        })
    };
    let is_right = share >= recording.least_right;
    let is_told = match &recording.need {
        Need::Right | Need::Clean => !warnings.is_empty(),
        Need::Told(words) | Need::Either(words) | Need::RightAndTold(words) => contains(words),
    };
    Outcome {
        is_right,
        is_told,
        holds: match recording.need {
            Need::Right => is_right,
            Need::Told(_) => is_told,
            Need::Either(_) => is_right || is_told,
            Need::RightAndTold(_) => is_right && is_told,
            Need::Clean => is_right && !is_told,
        },
        text: format!("right in {share:.3} of the pixels; {warnings:?}"),
    }
}

/// The arguments of `dtof`.
fn arguments(file: &str, recording: &Recording) -> String {
    let options = recording.options.trim();
    format!("replay {file} --out out --bin-width-ps {BIN_WIDTH_PS} {options}")
}

/// Writes a recording and its command into the folder `DTOF_KEEP`.
fn keep(kind: &Kind, draw: u64, recording: &Recording, outcome: &Outcome) {
    let Ok(folder) = var("DTOF_KEEP") else { return };
    let name = format!("{}-{draw}", kind.name);
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder).unwrap();
    let file = format!("{name}.npy");
    std::fs::write(folder.join(&file), recording.npy()).unwrap();
    let truth = &recording.truth;
    let text = format!(
        "dtof {}\n{}\ntolerance {} bins, least share right {}\ntruth {truth:?}\n",
        arguments(&file, recording),
        outcome.text,
        recording.tolerance,
        recording.least_right,
    );
    std::fs::write(folder.join(format!("{name}.txt")), text).unwrap();
}

/// Replays all draws of a kind, and prints a row of the table.
#[track_caller]
fn holds(name: &str) {
    let kind = Kind::of(name);
    let left = Mutex::new(kind.draws());
    let done = Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let next = left.lock().unwrap().next();
                    let Some(draw) = next else { break };
                    let recording = kind.recording(draw);
                    let outcome = replay(&recording);
                    if !outcome.holds {
                        keep(kind, draw, &recording, &outcome);
                    }
                    done.lock().unwrap().push((draw, outcome));
                }
            });
        }
    });
    let mut outcomes = done.into_inner().unwrap();
    outcomes.sort_by_key(|(draw, _)| *draw);
    let number = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|(_, one)| is(one)).count();
    let draws = outcomes.len();
    println!(
        "| {name:<40} | {draws:>4} draws | {:>4} right | {:>4} told | {:>4} hold |",
        number(|one| one.is_right),
        number(|one| one.is_told),
        number(|one| one.holds),
    );
    let failures: Vec<String> = outcomes
        .iter()
        .filter(|(_, outcome)| !outcome.holds)
        .map(|(draw, outcome)| format!("{name} {draw}: {}\n", outcome.text))
        .collect();
    print!("{}", failures.concat());
    let (failed, most) = (failures.len(), kind.most_failures(draws));
    assert!(failed <= most, "{failed} of {draws} fail, {most} may");
}

#[test]
fn a_wall_and_something_behind() {
    holds("a_wall_and_something_behind");
}

#[test]
fn a_wall_under_pile_up() {
    holds("a_wall_under_pile_up");
}

#[test]
fn a_wall_under_pile_up_as_list() {
    holds("a_wall_under_pile_up_as_list");
}

#[test]
fn near_targets_behind_glass_under_pile_up() {
    holds("near_targets_behind_glass_under_pile_up");
}

#[test]
fn pile_up_moves_the_depth() {
    holds("pile_up_moves_the_depth");
}

#[test]
fn bright_pixels_are_not_hot() {
    holds("bright_pixels_are_not_hot");
}

#[test]
fn a_bin_that_is_stuck() {
    holds("a_bin_that_is_stuck");
}

#[test]
fn a_bin_that_is_stuck_decide_once() {
    holds("a_bin_that_is_stuck_decide_once");
}

#[test]
fn many_recorded_cycles() {
    holds("many_recorded_cycles");
}

#[test]
fn a_sunlit_patch() {
    holds("a_sunlit_patch");
}

#[test]
fn retroreflectors() {
    holds("retroreflectors");
}

#[test]
fn glass_before_most_targets() {
    holds("glass_before_most_targets");
}

#[test]
fn pile_up_without_background() {
    holds("pile_up_without_background");
}

#[test]
fn much_light_without_background_as_list() {
    holds("much_light_without_background_as_list");
}

#[test]
fn glass_and_few_targets() {
    holds("glass_and_few_targets");
}

#[test]
fn glass_in_most_pixels() {
    holds("glass_in_most_pixels");
}

#[test]
fn glass_that_shifts() {
    holds("glass_that_shifts");
}

#[test]
fn an_object_that_moves() {
    holds("an_object_that_moves");
}

#[test]
fn an_object_that_comes_near() {
    holds("an_object_that_comes_near");
}

#[test]
fn background_is_taken_off() {
    holds("background_is_taken_off");
}

#[test]
fn counts_are_multiplied() {
    holds("counts_are_multiplied");
}

#[test]
fn bins_differ_in_width() {
    holds("bins_differ_in_width");
}

#[test]
fn counts_are_averaged() {
    holds("counts_are_averaged");
}

#[test]
fn laser_cycles_are_times() {
    holds("laser_cycles_are_times");
}

#[test]
fn ends_are_hardly_filled() {
    holds("ends_are_hardly_filled");
}

#[test]
fn counters_were_full() {
    holds("counters_were_full");
}

#[test]
fn counters_began_again() {
    holds("counters_began_again");
}

#[test]
fn a_spike_in_some_captures() {
    holds("a_spike_in_some_captures");
}

#[test]
fn bins_come_first() {
    holds("bins_come_first");
}

#[test]
fn a_background_that_is_not_flat() {
    holds("a_background_that_is_not_flat");
}

#[test]
fn too_many_recorded_cycles() {
    holds("too_many_recorded_cycles");
}

#[test]
fn rain() {
    holds("rain");
}

#[test]
fn another_lidar() {
    holds("another_lidar");
}

#[test]
fn clean() {
    holds("clean");
}

/// A detector that knows where to look and what a TDC loses finds at least 97 % of the targets.
#[test]
fn each_pulse_can_be_found() {
    for kind in KINDS {
        let (mut targets, mut found) = (0, 0);
        for draw in kind.draws() {
            let recording = kind.recording(draw);
            for (pixel, truth) in recording.truth.iter().enumerate() {
                let positions = match *truth {
                    Truth::At(position) => vec![position],
                    Truth::Either(first, second) => vec![first, second],
                    Truth::Nothing | Truth::Anything => continue,
                };
                let histogram = recording.histogram(pixel);
                targets += 1;
                let is_found = |position: &f64| is_found(&recording, &histogram, *position);
                found += usize::from(positions.iter().any(is_found));
            }
        }
        let share = f64::from(found as u32) / f64::from(targets.max(1));
        println!("{}: {share:.3} of {targets}", kind.name);
        assert!(
            100 * found >= 97 * targets as usize,
            "{}: {share}",
            kind.name
        );
    }
}

/// Whether the photons around `position` are five times the noise of what surrounds them, and their mean is right.
fn is_found(recording: &Recording, histogram: &[f64], position: f64) -> bool {
    let reach = 2.5 * recording.sigma + 1.0 + (recording.tolerance - 0.6).max(0.0);
    let distance = |bin: usize| (bin as f64 + 0.5 - position).abs();
    let bins = |from: f64, to: f64| {
        let is_there = move |bin: &usize| (from..to).contains(&distance(*bin));
        (0..histogram.len()).filter(is_there)
    };
    let around = bins(reach, 2.0 * reach);
    let number = around.clone().count() as f64;
    let background = around.map(|bin| histogram[bin]).sum::<f64>() / number;
    let (mut photons, mut moment, mut noise) = (0.0, 0.0, 1.0);
    for bin in bins(0.0, reach) {
        photons += histogram[bin] - background;
        moment += (histogram[bin] - background) * (bin as f64 + 0.5);
        noise += background;
    }
    photons > 5.0 * f64::sqrt(noise) && recording.is_right(Truth::At(position), moment / photons)
}

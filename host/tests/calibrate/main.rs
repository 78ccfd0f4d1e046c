//! `dtof calibrate`: what it writes, says and refuses.

#[path = "../common/mod.rs"]
mod common;

use std::fmt::Write as _;

use common::{Scratch, npy, says};
use dtof::settings::SettingsFile;
use dtof::simulate::scene::Scene;

/// A glass before two surfaces; a hot pixel.
const SCENE: &str = "columns = 8\nrows = 4\nbins = 64\nbackground = 0.01\npulse_sigma_bins = 0.7\n\
                     [[surface]]\nposition_bins = 40.3\nsignal = 0.3\n\
                     [[surface]]\nposition_bins = 25.8\nsignal = 0.4\n\
                     rectangle = { columns = [0, 3], rows = [0, 4] }\n\
                     [cover_glass]\nsignal = 1.5\nposition_bins = 4.4\n\
                     [hot_pixels]\nmultiple = 100\npixels = [13]\n";
const CYCLES: u16 = 8000;

/// The photons of `scene`: pixel, laser cycle, bin.
fn photons(scene: &str) -> Vec<(usize, u16, u16)> {
    use dtof::input::source::PhotonSource;
    let scene = Scene::parse(scene).unwrap();
    let mut source = scene.photons(7, CYCLES.into()).unwrap();
    let slice = source.next_slice(CYCLES).unwrap();
    let mut all = Vec::new();
    for (pixel, received) in slice.pixels.iter().enumerate() {
        let each = received.photons.iter();
        all.extend(each.map(|photon| (pixel, photon.cycle, photon.code)));
    }
    all.sort_by_key(|photon| photon.1);
    all
}

/// As an array of histograms.
fn histograms(scene: &str) -> Vec<u8> {
    let mut counts = vec![0u32; 32 * 64];
    for (pixel, _, bin) in photons(scene) {
        counts[pixel * 64 + usize::from(bin)] += 1;
    }
    let bytes: Vec<u8> = counts
        .iter()
        .flat_map(|count| count.to_le_bytes())
        .collect();
    npy("<u4", "(4, 8, 64)", &bytes)
}

fn settings(scratch: &Scratch, name: &str) -> SettingsFile {
    SettingsFile::read(&scratch.path(name)).unwrap()
}

#[test]
fn a_recording_becomes_settings_and_a_report_and_a_replay_takes_them() {
    let scratch = Scratch::new();
    scratch.file("a.npy", histograms(SCENE));
    let line = "calibrate --input a.npy --out dtof.toml --recorded-cycles 8000 --target-mm 1700";
    let printed = scratch.printed(line);
    for part in ["hot pixels", "13", "cover glass", "σ = 0."] {
        says(&printed, part);
    }
    let found = settings(&scratch, "dtof.toml");
    let sensor = &found.sensor;
    assert_eq!(sensor.masked, Some(vec![13]));
    assert_eq!(sensor.gate.unwrap().1, 63);
    assert_eq!(sensor.columns, Some(8));
    let glass = sensor.glass.unwrap();
    assert!((glass / 1.5 - 1.0).abs() < 0.03, "{glass}");
    // 1700 less 40.3 bins of 37.474 mm.
    let offset: f64 = sensor.offset_mm.unwrap().to_num();
    assert!((offset - 189.8).abs() < 3.7, "{offset}");
    let report = scratch.read("dtof.html");
    for part in ["<svg", "gate", "Settings written"] {
        says(&report, part);
    }
    // The second run finds its own files, and writes the same on one thread.
    let first = scratch.read("dtof.toml");
    let mut again = scratch.command(line);
    let again = again.env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert!(again.status.success());
    assert_eq!(scratch.read("dtof.toml"), first);
    assert_eq!(scratch.read("dtof.html"), report);

    scratch.printed(
        "replay --input a.npy --out out --settings dtof.toml --recorded-cycles 8000 --cycles 8000",
    );
    let events = scratch.events();
    assert!(events.len() > 500, "{}", events.len());
    let ranges = events.iter().map(|row| row[5].parse::<f64>().unwrap());
    let near = |range: &f64| {
        let to = |bins: f64| (range - bins * 37.474 - offset).abs() < 3.0 * 37.5;
        to(40.3) || to(25.8)
    };
    let wrong = ranges.filter(|range| !near(range)).count();
    assert!(100 * wrong <= events.len(), "{wrong} of {}", events.len());
}

#[test]
fn what_a_recording_does_not_tell_is_asked_for() {
    let scratch = Scratch::new();
    scratch.file("a.npy", histograms(SCENE));
    let printed = scratch.printed("calibrate --input a.npy --out a.toml");
    for option in ["--recorded-cycles N", "--target-mm D"] {
        says(&printed, option);
    }
    let sensor = settings(&scratch, "a.toml").sensor;
    assert_eq!((sensor.background, sensor.glass), (None, None));
    assert!(sensor.gate.is_some() && sensor.sigma_bins.is_some());

    let wall = "columns = 8\nrows = 4\nbins = 64\nbackground = 0.01\n\
                [[surface]]\nposition_bins = 9.5\nsignal = 0.5\n";
    scratch.file("wall.npy", histograms(wall));
    let line = "calibrate --input wall.npy --recorded-cycles 8000 --out wall.toml";
    let printed = scratch.printed(line);
    for part in ["--glass yes", "--glass no", "bin 9"] {
        says(&printed, part);
    }
    assert_eq!(settings(&scratch, "wall.toml").sensor.gate, None);
    scratch.printed(&format!("{line} --glass yes"));
    assert!(settings(&scratch, "wall.toml").sensor.gate.unwrap().0 > 10);
}

#[test]
fn photon_lists_know_their_laser_cycles() {
    let scratch = Scratch::new();
    let mut text = "pixel,cycle,bin\n".to_owned();
    for (pixel, cycle, bin) in photons(SCENE) {
        writeln!(text, "{pixel},{cycle},{bin}").unwrap();
    }
    scratch.file("a.csv", text);
    scratch.file("a.npy", histograms(SCENE));
    scratch.printed("calibrate --input a.csv --out csv.toml --columns 8 --bins 64");
    scratch.printed("calibrate --input a.npy --out npy.toml --recorded-cycles 8000");
    let [csv, npy] = ["csv.toml", "npy.toml"].map(|name| settings(&scratch, name));
    assert_eq!(csv.sensor, npy.sensor);
}

#[test]
fn nothing_found_is_an_answer() {
    let scratch = Scratch::new();
    scratch.file("dark.npy", npy("<u4", "(4, 16)", &[0; 4 * 64]));
    let printed =
        scratch.printed("calibrate --input dark.npy --out dark.toml --recorded-cycles 100");
    says(&printed, "No peak is bright enough");
    let found = settings(&scratch, "dark.toml");
    assert_eq!(found.sensor.gate, None);
    assert_eq!(found.sensor.sigma_bins, None);
    assert_eq!(found.detection.rule, None);
    // One photon in one pixel.
    let mut bytes = [0; 64];
    bytes[20] = 1;
    scratch.file("one.npy", npy("<u4", "(1, 16)", &bytes));
    scratch.printed("calibrate --input one.npy --out one.toml");
}

#[test]
fn older_settings_are_compared_and_keep_what_is_not_found() {
    let scratch = Scratch::new();
    scratch.file("a.npy", histograms(SCENE));
    let brighter = SCENE.replace("signal = 1.5", "signal = 1.95");
    scratch.file("b.npy", histograms(&brighter));
    scratch.printed("calibrate --input a.npy --out a.toml --recorded-cycles 8000 --target-mm 1700");
    let old = scratch.read("a.toml");
    scratch.file(
        "old.toml",
        format!("{old}\n[rays]\nfield_of_view_degrees = [40.0, 20.0]\n"),
    );
    let printed = scratch
        .printed("calibrate --input b.npy --out b.toml --recorded-cycles 8000 --settings old.toml");
    let line = printed.lines().find(|line| line.contains("was 1.5"));
    says(line.expect("the glass"), "1.30 times");
    let [old, new] = ["a.toml", "b.toml"].map(|name| settings(&scratch, name));
    assert_eq!(new.sensor.offset_mm, old.sensor.offset_mm);
    assert!(new.rays.field_of_view_degrees.is_some());
    says(&scratch.read("b.html"), "Since the older settings");
}

#[test]
fn what_is_not_a_recording_or_would_be_lost_is_refused() {
    let scratch = Scratch::new();
    scratch.file("a.npy", histograms(SCENE));
    scratch.file("small.npy", npy("<u4", "(2, 8)", &[0; 64]));
    scratch.file("mine.toml", "mine = 1\n");
    scratch.file("mine.html", "mine\n");
    std::fs::create_dir(scratch.path("out")).unwrap();
    scratch.all_refused(
        "calibrate --input",
        "none.npy --out out/a.toml | none.npy
         a.txt --out out/a.toml | a.txt
         small.npy --out out/a.toml | small.npy | 8 bins are too few
         a.npy --out a.npy | a.npy
         a.npy --out mine.toml --report out/a.html | mine.toml: was not written by this program
         a.npy --out out/a.toml --report mine.html | mine.html: was not written by this program
         a.npy --out out/a.html | two names
         a.npy --out none/a.toml | none
         a.npy --out out/a.toml --glass maybe | --glass
         a.npy --out out/a.toml --target-mm far | --target-mm
         a.npy --out out/a.toml --false-alarm 0.5 | --false-alarm
         a.npy --out out/a.toml --recorded-cycles 8000 --false-alarm 1e-6 | --false-alarm | a.npy
         a.npy --out out/a.toml --recorded-cycles 5 --photons-per-cycle 1 | --photons-per-cycle
         a.npy --out out/a.toml --settings none.toml | none.toml
         a.npy --out out/a.toml --settings mine.toml | mine.toml",
    );
    assert_eq!(scratch.read("mine.toml"), "mine = 1\n");
    assert_eq!(scratch.read("mine.html"), "mine\n");
}

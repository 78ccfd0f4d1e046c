//! The depth map: one decision a pixel on all photons, end to end.

use std::fmt::Write;
use std::path::Path;

use rand_core::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;
use serde_json::Value;

use crate::common::{Scratch, assert_contains, npy};

/// Millimetres of a bin of 250 ps.
const BIN_MM: f64 = 37.474;

/// Two rows of four pixels with a wall in bin 60, as `u2`, and five photons of the background a bin.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few photons"
)]
fn wall() -> Vec<u8> {
    let mut rng = Pcg64::seed_from_u64(1);
    let mean = |bin: u16| match bin {
        59 | 61 => 80.0,
        60 => 140.0,
        _ => 5.0,
    };
    let counts = (0..8 * 128_u16).map(|place| {
        let count = Poisson::new(mean(place % 128)).unwrap();
        count.sample(&mut rng) as u16
    });
    counts.flat_map(u16::to_le_bytes).collect()
}

fn near(depths: &[f64], bin: f64) -> bool {
    depths
        .iter()
        .all(|depth| (depth / BIN_MM - bin - 0.5).abs() < 0.5)
}

#[test]
fn all_photons_of_histograms_decide() {
    let scratch = Scratch::new();
    let recorded = scratch.file("wall.npy", npy("<u2", "(2, 4, 128)", &wall()));
    let options = "--recorded-cycles 549888 --bin-width-ps 250";
    let printed = scratch.printed(&format!(
        "replay {} --out out {options}",
        recorded.display()
    ));
    assert_contains(
        &printed,
        "from 10,000 of 549,888 laser cycles: histograms have no time",
    );
    assert_contains(&printed, "8 of 8");
    let summary = scratch.summary();
    assert_eq!(
        ["depth_from", "pixels_with_depth"].map(|key| &summary[key]),
        [&Value::from("all photons"), &Value::from(8)]
    );
    assert_eq!(summary["warnings"], Value::Array(Vec::new()));
    let depths = scratch.map("depth");
    assert!(near(&depths, 60.0), "{depths:?}");
    assert!(near(&scratch.map("depth-best"), 60.0));
    // So few photons are no events.
    assert!(
        scratch
            .map("depth-events")
            .iter()
            .all(|depth| depth.is_nan())
    );
    assert!(!scratch.path("out/age.npy").exists());
    // It is what one decision on all photons gives.
    scratch.replayed(&recorded, &format!("{options} --decide-once"));
    assert_eq!(scratch.map("depth"), depths);
    assert_eq!(scratch.map("depth-events"), depths);
    // And the best windows are those of all pixels that are not left out.
    scratch.replayed(&recorded, &format!("{options} --mask 3"));
    let (depths, best) = (scratch.map("depth"), scratch.map("depth-best"));
    let confidence = scratch.map("confidence");
    for (pixel, values) in (0..).zip(depths.iter().zip(&best).zip(&confidence)) {
        let ((depth, best), confidence) = values;
        let are_left_out = [depth, best, confidence].map(|value| value.is_nan());
        assert_eq!(are_left_out, [pixel == 3; 3]);
    }
}

#[test]
fn what_decides_together_with_others_still_has_a_map() {
    let scratch = Scratch::new();
    let recorded = scratch.file("wall.npy", npy("<u2", "(2, 4, 128)", &wall()));
    let axes = "--axes rows,columns,bins --recorded-cycles 3000";
    for options in [
        "--binning 1",
        "--neighbours 8 --dead-time 0",
        "--tracking",
        "--rule paper",
    ] {
        scratch.replayed(&recorded, &format!("{axes} {options}"));
        assert!(near(&scratch.map("depth"), 60.0), "{options}");
    }
    let two = scratch.file("two.npy", npy("<u2", "(2, 2, 2, 128)", &wall()));
    let axes = "--axes captures,rows,columns,bins --recorded-cycles 3000";
    scratch.replayed(&two, axes);
    assert!(near(&scratch.map("depth"), 60.0));
}

#[test]
fn an_object_that_moves_is_told_and_its_old_place_is_old() {
    let scratch = Scratch::new();
    let mut list = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..8000 {
        for pixel in 0..4 {
            let bin = match (cycle < 4000, (cycle * 3 + pixel) % 10) {
                (true, 0..6) => 59 + cycle / 10 % 3,
                (false, 0..2) => 89 + cycle / 10 % 3,
                (_, 9) => cycle / 7 % 128,
                _ => continue,
            };
            writeln!(list, "{pixel},{cycle},{bin}").unwrap();
        }
    }
    let list = scratch.file("list.csv", list);
    scratch.file("defaults.toml", "");
    let options = "--settings defaults.toml --rule window --sigma-bins 1 --bin-width-ps 250 --cycles 8000 --columns 2";
    scratch.replayed(&list, options);
    let warnings = scratch.summary()["warnings"].to_string();
    assert_contains(&warnings, "4 of 4 pixels see one surface in the first half");
    assert!(near(&scratch.map("depth"), 60.0));
    assert!(near(&scratch.map("depth-events"), 90.0));
    let ages = scratch.map("age");
    assert!(
        ages.iter().all(|age| (3990.0..4100.0).contains(age)),
        "{ages:?}"
    );
    let table = scratch.read("out/depth.csv");
    assert!(
        table.lines().skip(1).all(|row| row.ends_with(",3")),
        "{table}"
    );
    // Both halves alone do not.
    scratch.replayed(&list, &options.replace("8000", "4000"));
    assert_eq!(scratch.summary()["warnings"], Value::Array(Vec::new()));
    assert!(scratch.map("age").iter().all(|age| *age < 500.0));
}

/// A run that does not write a file removes that of another run.
#[test]
fn a_folder_has_the_files_of_one_run() {
    let scratch = Scratch::new();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let echoes = ["depth-nearest.npy", "depth-farthest.csv"];
    let has = |name: &&str| scratch.path("out").join(name).exists();
    let scene = scenes.join("room.toml");
    scratch.simulated(
        &scene,
        "--cycles 500 --rule window --sigma-bins 1 --echoes 2",
    );
    assert!(echoes.iter().all(has) && has(&"age.npy"));
    scratch.simulated(&scene, "--cycles 500 --rule window --sigma-bins 1");
    assert!(!echoes.iter().any(has) && has(&"age.npy"));
    scratch.replayed(&scenes.join("room.npy"), "");
    assert!(!has(&"age.npy"));
}

//! The offset of each pixel, end to end: `calibrate` finds those of a simulated TMF8828, whose zones differ in
//! patches, and everything that shows millimetres applies them.

use std::collections::BTreeMap;

use crate::common::{Scratch, assert_contains, npy, succeeded};
use dtof_core::{Array, PixelAddress};
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::geometry::{FieldOfView, Rays};
use rand_distr::{Distribution, Poisson};

const PIXELS: usize = 64;
const BINS: u32 = 128;
const MM_PER_BIN: f64 = 373.6 * MM_PER_PS;
const CYCLES: f64 = 20_000.0;
const FOV: [f64; 2] = [41.0, 52.0];
const SENSOR: &str = "--bin-width-ps 373.6 --recorded-cycles 20000";
/// Millimetres that zones see everything too near: patches of 2 columns and 4 rows.
const PATCHES: [f64; 8] = [-78.0, 31.0, 12.0, -55.0, 78.0, -23.0, 47.0, 5.0];

fn zones() -> Vec<f64> {
    let patch = |pixel: usize| pixel % 8 / 2 + 4 * (pixel / 32);
    (0..PIXELS).map(|pixel| PATCHES[patch(pixel)]).collect()
}

/// How much farther away a flat target is in each pixel.
fn slants() -> Vec<f64> {
    let view = FieldOfView::new(FOV).unwrap();
    Rays::pinhole(Array::new(8, 8).unwrap(), view).slants()
}

/// The ranges of a flat target `mm` straight ahead.
fn target(mm: f64) -> Vec<f64> {
    slants().iter().map(|slant| mm * slant).collect()
}

/// The ranges of a scene: a floor that comes nearer, and a box before a wall.
fn scene() -> Vec<f64> {
    let range = |pixel: usize| match (pixel % 8, pixel / 8) {
        (_, row @ 5..) => 1700.0 - 130.0 * (row as f64 - 5.0),
        (2..=4, 2..) => 910.0,
        (column, row) => 2400.0 + 37.0 * column as f64 - 19.0 * row as f64,
    };
    (0..PIXELS).map(range).collect()
}

/// A recording of surfaces at these ranges by zones that see them `too_near`.
fn recording(ranges: &[f64], too_near: &[f64], seed: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (pixel, (range, too_near)) in (0..).zip(ranges.iter().zip(too_near)) {
        let mut rng = dtof_data::random::pixel_rng(seed, PixelAddress::new(pixel));
        let position = (range - too_near) / MM_PER_BIN;
        for bin in 0..BINS {
            let signal = 0.05 * dtof_light::rates::bin_share(bin, position, 0.9);
            let photons = Poisson::new(CYCLES * (0.002 + signal)).unwrap();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let count = photons.sample(&mut rng) as u32;
            bytes.extend(count.to_le_bytes());
        }
    }
    npy("<u4", "(8, 8, 128)", &bytes)
}

/// The mean absolute error of `depth.npy` in millimetres.
fn error_mm(scratch: &Scratch, folder: &str, truth: &[f64]) -> f64 {
    let bytes = std::fs::read(scratch.path(&format!("{folder}/depth.npy"))).unwrap();
    let numbers = bytes[256..].chunks_exact(8);
    let depths = numbers.map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
    let errors: Vec<f64> = depths
        .zip(truth)
        .map(|(depth, truth)| (depth - truth).abs())
        .collect();
    assert_eq!(errors.len(), truth.len());
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// The number in the column of this name, of each event in lines of CSV.
fn ranges(csv: &str) -> Vec<(String, f64)> {
    let rows = csv.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        (cells[1].to_owned(), cells[5].parse().unwrap())
    });
    rows.collect()
}

#[test]
fn a_flat_target_gives_the_offset_of_each_zone_and_another_scene_gets_right() {
    let scratch = Scratch::new();
    let zones = zones();
    scratch.file("target.npy", recording(&target(1200.0), &zones, 1));
    scratch.file("scene.npy", recording(&scene(), &zones, 2));
    let [horizontal, vertical] = FOV;
    let calibrate = format!("calibrate target.npy {SENSOR} --target-mm 1200");
    // Without the field of view a flat target does not tell the pixels apart: it is said.
    let plain = scratch.run(&format!("{calibrate} --out plain.toml"));
    assert_contains(&succeeded(plain), "--fov");
    assert!(!scratch.read("plain.toml").contains("offsets_mm"));
    let printed = scratch.printed(&format!(
        "{calibrate} --fov {horizontal}x{vertical} --out own.toml"
    ));
    assert_contains(&printed, "offsets of pixels");
    assert_contains(&printed, "row 7, mm");
    assert_contains(&scratch.read("own.html"), "Offsets of the pixels");
    assert_contains(&scratch.read("own.toml"), "offsets_mm = [");

    // Before: one offset for all.
    let own = scratch.read("own.toml");
    let one: String = own
        .lines()
        .filter(|line| !line.starts_with("offsets_mm"))
        .map(|line| format!("{line}\n"))
        .collect();
    scratch.file("one.toml", one);
    for settings in ["one", "own"] {
        scratch.printed(&format!(
            "replay scene.npy {SENSOR} --cycles 20000 --settings {settings}.toml --out {settings}"
        ));
    }
    let [before, after] = ["one", "own"].map(|folder| error_mm(&scratch, folder, &scene()));
    println!("mean absolute error: {before:.1} mm before, {after:.1} mm after");
    assert!(before > 30.0 && after < 8.0, "{before} {after}");

    // One range of an event, wherever it is shown.
    let events = scratch.read("own/events.csv");
    assert_eq!(scratch.printed("decode own/events.aer"), events);
    scratch.printed("export own/events.aer --format csv --out points.csv");
    let points = scratch.read("points.csv");
    let header: Vec<&str> = points.lines().next().unwrap().split(',').collect();
    let column = header.iter().position(|name| *name == "range_mm").unwrap();
    let exported = points
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(column).unwrap());
    assert!(
        exported.eq(events
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(5).unwrap()))
    );

    // The same bins, with and without the offset of the pixel.
    let [plain, own] =
        ["one", "own"].map(|folder| ranges(&scratch.read(&format!("{folder}/events.csv"))));
    let mut differences = BTreeMap::<String, f64>::new();
    for ((pixel, before), (same, after)) in plain.iter().zip(&own) {
        assert_eq!(pixel, same);
        let difference = after - before;
        let first = *differences.entry(pixel.clone()).or_insert(difference);
        assert!((first - difference).abs() < 0.002, "{pixel}");
    }
    assert_eq!(differences.len(), PIXELS);
}

/// The value of a key in a settings file.
fn value(scratch: &Scratch, file: &str, key: &str) -> Option<f64> {
    let text = scratch.read(file);
    let key = format!("{key} = ");
    let line = text.lines().find_map(|line| line.strip_prefix(&key));
    line.map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
}

#[test]
fn the_distance_of_a_flat_target_is_straight_ahead() {
    let scratch = Scratch::new();
    scratch.file("target.npy", recording(&target(1200.0), &[25.0; PIXELS], 1));
    let calibrate = format!("calibrate target.npy {SENSOR} --target-mm 1200");
    let printed = scratch.printed(&format!("{calibrate} --fov 41x52 --out fov.toml"));
    assert_contains(&printed, ", from a flat target 1200 mm straight ahead\n");
    let offset = value(&scratch, "fov.toml", "offset_mm").unwrap();
    assert!((offset - 25.0).abs() < 2.0, "{offset}");
    // Without the field of view it is that of the median pixel.
    let printed = scratch.printed(&format!("{calibrate} --out plain.toml"));
    assert_contains(
        &printed,
        ", from a target that the median pixel sees at 1200 mm\n",
    );
    let mut ranges = target(1200.0);
    ranges.sort_by(f64::total_cmp);
    let offset = value(&scratch, "plain.toml", "offset_mm").unwrap();
    // Half a pixel's step of these ranges is 3 mm; most of them lie within 1.5 bins.
    assert!(
        (offset - (25.0 + 1200.0 - ranges[31])).abs() < 25.0,
        "{offset}"
    );
}

#[test]
fn nothing_is_corrected_twice() {
    let scratch = Scratch::new();
    let zones = zones();
    scratch.file("target.npy", recording(&target(1200.0), &zones, 1));
    let calibrate = format!("calibrate target.npy {SENSOR} --target-mm 1200");
    // Points subtract the range bias of each pixel, so offsets must leave it as it is.
    let view = FieldOfView::new(FOV).unwrap();
    let place = |index: usize| (index as f64 + 0.5) / 8.0;
    let rays: Vec<String> = (0..PIXELS)
        .map(|pixel| {
            let [x, y, z] = view.ray(place(pixel % 8), place(pixel / 8));
            format!("[{x:?}, {y:?}, {z:?}, {:?}]", -zones[pixel])
        })
        .collect();
    let rays = format!("columns = 8\nrows = 8\npixels = [{}]\n", rays.join(","));
    scratch.file("rays.toml", rays);
    scratch.printed(&format!(
        "{calibrate} --calibration rays.toml --out biased.toml"
    ));
    let written = scratch.read("biased.toml");
    assert!(!written.contains("offsets_mm"), "{written}");
    let offset = value(&scratch, "biased.toml", "offset_mm").unwrap();
    assert!(offset.abs() < 3.0, "{offset}");
    scratch.printed(&format!(
        "replay target.npy {SENSOR} --cycles 20000 --settings biased.toml --out out"
    ));
    scratch.printed("export out/events.aer --format csv --settings biased.toml --out points.csv");
    let points = scratch.read("points.csv");
    let names: Vec<&str> = points.lines().next().unwrap().split(',').collect();
    let forward = names.iter().position(|name| *name == "z_m").unwrap();
    let forward = points.lines().skip(1).map(|line| {
        let number = line.split(',').nth(forward).unwrap();
        number.parse::<f64>().unwrap()
    });
    let mut forward: Vec<f64> = forward.collect();
    forward.sort_by(f64::total_cmp);
    let spread = forward[forward.len() * 9 / 10] - forward[forward.len() / 10];
    // It is 0.15 with the bias twice.
    assert!(spread < 0.06, "{spread}");

    // Offsets of pixels that are kept shift the offset of all.
    scratch.file("target.npy", recording(&target(1200.0), &[0.0; PIXELS], 1));
    let fifty = ["50"; PIXELS].join(",");
    scratch.printed(&format!("{calibrate} --out plain.toml"));
    scratch.printed(&format!("{calibrate} --offsets-mm={fifty} --out kept.toml"));
    let [plain, kept] =
        ["plain.toml", "kept.toml"].map(|file| value(&scratch, file, "offset_mm").unwrap());
    assert!((plain - 50.0 - kept).abs() < 0.1, "{plain} {kept}");
    // Each its own: most pixels do not see the target, and have none.
    let ranges = target(1200.0);
    let is_seen = |pixel: usize| pixel.is_multiple_of(3);
    let too_near: Vec<f64> = (0..PIXELS)
        .map(|pixel| if is_seen(pixel) { 0.0 } else { -1e6 })
        .collect();
    scratch.file("target.npy", recording(&ranges, &too_near, 1));
    let own: Vec<&str> = (0..PIXELS)
        .map(|pixel| if is_seen(pixel) { "50" } else { "0" })
        .collect();
    let own = own.join(",");
    for fov in ["", "--fov 41x52"] {
        scratch.printed(&format!("{calibrate} {fov} --out plain.toml"));
        scratch.printed(&format!(
            "{calibrate} {fov} --offsets-mm={own} --out kept.toml"
        ));
        let [plain, kept] =
            ["plain.toml", "kept.toml"].map(|file| value(&scratch, file, "offset_mm").unwrap());
        assert!((plain - 50.0 - kept).abs() < 0.1, "{fov}: {plain} {kept}");
        assert_contains(&scratch.read("kept.toml"), "offsets_mm = [");
    }
}

/// Offsets that pixels have already are not lost; those that have changed are corrected.
#[test]
fn a_second_calibration_keeps_the_offsets_of_the_first() {
    let scratch = Scratch::new();
    let zones = zones();
    let calibrate = format!("calibrate target.npy {SENSOR} --target-mm 1200 --fov 41x52");
    scratch.file("target.npy", recording(&target(1200.0), &zones, 1));
    scratch.printed(&format!("{calibrate} --out first.toml"));
    scratch.file("target.npy", recording(&target(1200.0), &zones, 2));
    scratch.printed(&format!(
        "{calibrate} --settings first.toml --out second.toml"
    ));
    let [first, second] = ["first.toml", "second.toml"].map(|file| {
        let text = scratch.read(file);
        let (_, list) = text.split_once("offsets_mm = [").unwrap();
        let own = list.split(']').next().unwrap().split(", ");
        let all = value(&scratch, file, "offset_mm").unwrap();
        own.map(|own| all + own.parse::<f64>().unwrap())
            .collect::<Vec<_>>()
    });
    for (first, second) in first.iter().zip(&second) {
        assert!((first - second).abs() < 10.0, "{first} {second}");
    }
    let mut moved = zones;
    moved[9] += 60.0;
    scratch.file("target.npy", recording(&target(1200.0), &moved, 3));
    scratch.printed(&format!(
        "{calibrate} --settings first.toml --out third.toml"
    ));
    scratch.file("scene.npy", recording(&scene(), &moved, 4));
    scratch.printed(&format!(
        "replay scene.npy {SENSOR} --cycles 20000 --settings third.toml --out out"
    ));
    let error = error_mm(&scratch, "out", &scene());
    assert!(error < 8.0, "{error}");
}

/// Blocks have the mean offset of their pixels that are not left out.
#[test]
fn events_of_blocks_and_captures_have_the_offsets_of_their_pixels() {
    let scratch = Scratch::new();
    let one = recording(&target(1200.0), &[0.0; PIXELS], 1);
    let file = scratch.file("one.npy", &one);
    let offsets: Vec<String> = (0..PIXELS).map(|pixel| pixel.to_string()).collect();
    let offsets = format!("--offsets-mm={}", offsets.join(","));
    let options = "--rule paper --alpha 30 --binning 1 --patience 8 --mask 1,8,9";
    scratch.replayed(&file, options);
    let before = scratch.events();
    scratch.replayed(&file, &format!("{options} {offsets}"));
    let after = scratch.events();
    let mut blocks = 0;
    for (before, after) in before.iter().zip(&after) {
        let number = |row: &[String], column: usize| row[column].parse::<f64>().unwrap();
        let (pixel, level) = (number(after, 1), number(after, 9));
        let first = f64::from(u8::from(pixel == 0.0 && level == 1.0));
        let mean = match level {
            0.0 => pixel,
            // Of the first block only pixel 0 counts, of others the mean of +0, +1, +8 and +9.
            _ => pixel + 4.5 * (1.0 - first),
        };
        let difference = number(after, 5) - number(before, 5);
        assert!((difference - mean).abs() < 0.002, "{after:?}");
        blocks += usize::from(level > 0.0);
    }
    assert!(before.len() == after.len() && blocks > 10, "{blocks}");

    // Those of one capture hold for each.
    let two = [&one[128..], &one[128..]].concat();
    let file = scratch.file("two.npy", npy("<u4", "(2, 8, 8, 128)", &two));
    let options = "--axes captures,rows,columns,bins --l1 40";
    scratch.replayed(&file, options);
    let before = scratch.events();
    scratch.replayed(&file, &format!("{options} {offsets}"));
    for (before, after) in before.iter().zip(&scratch.events()) {
        let number = |row: &[String], column: usize| row[column].parse::<f64>().unwrap();
        let difference = number(after, 5) - number(before, 5);
        assert!(
            (difference - number(after, 1) % 64.0).abs() < 0.002,
            "{after:?}"
        );
    }
}

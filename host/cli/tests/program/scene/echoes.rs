//! Runs with several echoes and with blocks: what maps, report and truth take of them.

use crate::common::{Scratch, assert_contains};

/// Two surfaces in each of 8x4 pixels, the nearer one brighter.
const TWO: &str = "columns = 8\nrows = 4\nbackground = 0.01\ncycles = 3000\n[[surface]]\n\
                   name = \"glass\"\nrange_mm = 1000\nsignal = 0.6\n\
                   [second_echo]\nshare = 0.3\nbehind_mm = 1500\n";
const RUN: &str = "--rule window --sigma-bins 1 --echoes 2 --seed 3";

/// The summary's row on echoes, and the picture of the last range.
fn shown(options: &str) -> (String, String, Vec<Vec<String>>) {
    let scratch = Scratch::new();
    let scene = scratch.file("scene.toml", TWO);
    scratch.simulated(&scene, &format!("{RUN} {options}"));
    let report = scratch.read("out/report.html");
    (report, scratch.read("out/depth-last.svg"), scratch.events())
}

/// The lowest and the highest number at the colours of a map, in millimetres. All other numbers are
/// columns and rows.
fn span(svg: &str) -> [f64; 2] {
    let texts = svg.split('>').filter_map(|part| part.split_once('<'));
    let numbers =
        texts.filter_map(|(text, _)| text.trim_start_matches(['≤', '≥']).trim().parse().ok());
    let numbers = numbers.filter(|number: &f64| *number > 300.0);
    numbers.fold([f64::MAX, f64::MIN], |[low, high], number| {
        [low.min(number), high.max(number)]
    })
}

#[test]
fn maps_show_the_echo_that_is_asked_for_and_files_hold_all() {
    let (report, strongest, events) = shown("");
    assert_contains(
        &report,
        "all as events, the strongest of an exposure in the maps",
    );
    assert_contains(
        &report,
        &format!(
            "All {} events are shown.",
            dtof_data::options::rows::grouped(events.len() as u64)
        ),
    );
    let (of_first, first, same) = shown("--echo first");
    assert_eq!(events, same);
    let (_, last, same) = shown("--echo last");
    assert_eq!(events, same);
    let (_, all, same) = shown("--echo all");
    assert_eq!(events, same);
    assert_contains(&of_first, "the nearest of an exposure");
    let exposures = events.iter().filter(|event| event[10] == "1").count();
    assert!(exposures < events.len());
    let shown = format!(
        "All {} events are shown.",
        dtof_data::options::rows::grouped(exposures as u64)
    );
    assert_contains(&of_first, &shown);
    assert!(
        (900.0..1100.0).contains(&span(&first)[1]),
        "{:?}",
        span(&first)
    );
    assert!(
        (2400.0..2600.0).contains(&span(&last)[1]),
        "{:?}",
        span(&last)
    );
    assert!((900.0..1100.0).contains(&span(&strongest)[0]));
    assert!(first != last && all != first);
}

#[test]
fn an_echo_of_the_second_surface_is_no_false_alarm_where_two_are_reported() {
    let scratch = Scratch::new();
    let scene = scratch.file("scene.toml", TWO);
    scratch.simulated(&scene, RUN);
    let truth = &scratch.summary()["against_truth"];
    let share = |truth: &serde_json::Value| truth["false_alarm_share"].as_f64().unwrap();
    assert!(share(truth) < 0.02, "{truth}");
    let far = scratch.events();
    let far = far
        .iter()
        .filter(|event| event[5].parse::<f64>().unwrap() > 2000.0);
    assert!(far.count() > 500);
    // With one echo only the first surface is reported.
    scratch.simulated(&scene, "--rule window --sigma-bins 1 --gate 50..127");
    assert!(share(&scratch.summary()["against_truth"]) > 0.9);
}

/// A dim plane, tilted by some bins over the array: the range of a block suits its pixels.
#[test]
fn blocks_are_compared_with_what_their_pixels_see() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 8\nrows = 8\nbackground = 0.01\ncycles = 6000\n[[surface]]\nname = \"wall\"\n\
         range_mm = 1500\nrange_right_mm = 1800\nsignal = 0.02\n",
    );
    scratch.simulated(&scene, "--rule window --sigma-bins 1 --binning 2 --seed 3");
    let summary = scratch.summary();
    let truth = &summary["against_truth"];
    assert!(
        summary["events_of_blocks"].as_u64() > Some(100),
        "{summary}"
    );
    assert!(
        truth["false_alarm_share"].as_f64().unwrap() < 0.05,
        "{truth}"
    );
    // The first column of a block of four lies 64 mm before its middle.
    assert!(truth["bias_mm"].as_f64().unwrap().abs() < 12.0, "{truth}");
    assert_eq!(truth["surfaces"][0]["pixels"], 64);
}

/// A pane before a wall on the left, the wall alone on the right: a map of each surface, and none between.
#[test]
fn two_surfaces_have_two_maps() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 8\nrows = 4\nbackground = 0.01\ncycles = 8000\n\
         [[surface]]\nrange_mm = 3000\nsignal = 0.4\n\
         [[surface]]\nrange_mm = 1000\nsignal = 0.4\ntransmittance = 0.8\n\
         rectangle = { columns = [0, 4], rows = [0, 4] }\n",
    );
    let depths = |name: &str| -> Vec<f64> {
        let (depths, table) = (scratch.map(name), scratch.read(&format!("out/{name}.csv")));
        let rows = table.lines().skip(1);
        for (row, depth) in rows.zip(&depths) {
            let in_table = row.split(',').nth(3);
            assert_eq!(in_table, Some(&*format!("{depth:.3}")), "{row}");
        }
        depths
    };
    let are = |depths: &[f64], left: f64, right: f64| {
        for (pixel, depth) in depths.iter().enumerate() {
            let truth = if pixel % 8 < 4 { left } else { right };
            assert!((depth - truth).abs() < 30.0, "{pixel}: {depth} mm");
        }
    };
    scratch.simulated(&scene, &format!("{RUN} --echo-wait 4"));
    are(&depths("depth-nearest"), 1000.0, 3000.0);
    are(&depths("depth-farthest"), 3000.0, 3000.0);
    // Without several echoes there is one map, and none of an earlier run.
    scratch.simulated(&scene, "--rule window --sigma-bins 1");
    are(&depths("depth"), 1000.0, 3000.0);
    assert!(!scratch.path("out/depth-nearest.npy").exists());
    assert!(!scratch.path("out/depth-farthest.csv").exists());
}

//! `dtof calibrate`, end to end: what it finds in a recording makes runs with a cover glass right,
//! and tells when the glass has become brighter.

use std::path::Path;

use crate::common::{Scratch, assert_contains, npy, succeeded};
use dtof_core::PixelAddress;
use dtof_data::photons::source::PhotonSource;
use dtof_light::scene::Scene;

/// A wall and a smaller one before it, behind a cover glass of `glass` photons.
fn scene(background: f64, glass: f64) -> String {
    format!(
        "columns = 16\nrows = 8\ncycles = 8000\nbackground = {background}\n\
         [[surface]]\nrange_mm = 3000\nsignal = 0.5\n\
         [[surface]]\nrange_mm = 2000\nsignal = 0.5\n\
         rectangle = {{ columns = [4, 12], rows = [2, 6] }}\n\
         [cover_glass]\nsignal = {glass}\nposition_bins = 4.5\n"
    )
}

/// A wall of 24 photons a pixel and a nearer one of half as many, among 1.5 of the background a bin.
const DIM: &str = "columns = 16\nrows = 8\ncycles = 8000\nbackground = 0.00019\n\
                   [[surface]]\nrange_mm = 3000\nsignal = 0.003\n\
                   [[surface]]\nrange_mm = 2000\nsignal = 0.0015\n\
                   rectangle = { columns = [4, 12], rows = [2, 6] }\n";

/// How many pixels have events within 150 mm of the scene, 4 bins.
fn right(scratch: &Scratch, map: &str, text: &str) -> usize {
    let scene = Scene::parse(text).unwrap();
    let is_right = |(pixel, depth): &(u16, f64)| {
        let truth = scene.truth(PixelAddress::new(*pixel), 0).unwrap();
        (depth - truth.range_mm).abs() < 150.0
    };
    let depths = scratch.map(map);
    (0..).zip(depths).filter(is_right).count()
}

/// The histograms of a scene as NumPy writes them.
fn recording(text: &str) -> Vec<u8> {
    with_hot(text, None)
}

/// The photons of a scene: laser cycle, pixel and bin.
fn photons(text: &str) -> Vec<(u32, usize, u16)> {
    let scene = Scene::parse(text).unwrap();
    let mut photons = scene.photons(5, scene.cycles).unwrap();
    let mut all = Vec::new();
    for first in (0..u32::try_from(scene.cycles).unwrap()).step_by(250) {
        for (pixel, photons) in photons.next_slice(250).unwrap().pixels.iter().enumerate() {
            let photons = photons.photons.iter();
            all.extend(photons.map(|one| (first + u32::from(one.cycle), pixel, one.code)));
        }
    }
    all
}

/// The same, so many photons more in each bin of a pixel.
fn with_hot(text: &str, hot: Option<(usize, u32)>) -> Vec<u8> {
    let mut counts = vec![0u32; 128 * 128];
    for (_, pixel, bin) in photons(text) {
        counts[128 * pixel + usize::from(bin)] += 1;
    }
    if let Some((pixel, photons)) = hot {
        let bins = &mut counts[128 * pixel..128 * (pixel + 1)];
        bins.iter_mut().for_each(|count| *count += photons);
    }
    let bytes: Vec<u8> = counts.into_iter().flat_map(u32::to_le_bytes).collect();
    npy("<u4", "(8, 16, 128)", &bytes)
}

#[test]
fn a_cover_glass_is_gated_and_its_dirt_is_flagged() {
    let scratch = Scratch::new();
    scratch.file("glass.npy", recording(&scene(0.02, 5.0)));
    let printed = scratch.printed(
        "calibrate --input glass.npy --recorded-cycles 8000 --target-mm 3000 --out dtof.toml",
    );
    assert_contains(&printed, "cover glass");
    let run = |name: &str, text: &str, options: &str| {
        let file = scratch.file(name, text);
        scratch.simulated(&file, options);
        scratch.summary()
    };
    let settings = "--settings dtof.toml --seed 9";
    let share_and_flags = |summary: &serde_json::Value| {
        let share = &summary["against_truth"]["false_alarm_share"];
        (share.as_f64().unwrap(), summary["cover_glass"].clone())
    };
    let clean = scene(0.02, 5.0);
    let (share, _) = share_and_flags(&run("clean.toml", &clean, "--rule window --sigma-bins 1"));
    assert!(share > 0.9, "{share}");
    let (share, flagged) = share_and_flags(&run("clean.toml", &clean, settings));
    assert!(share < 0.01 && flagged.is_null(), "{share} {flagged}");
    let (share, flagged) = share_and_flags(&run("dirty.toml", &scene(0.02, 6.5), settings));
    assert!(share < 0.01, "{share}");
    let times = flagged[0].as_f64().unwrap();
    assert!((1.25..1.35).contains(&times), "{flagged}");
    assert_contains(
        &scratch.read("out/report.html"),
        "times as bright as when it was calibrated",
    );
    // Sunlight alone is not taken for dirt.
    let (_, flagged) = share_and_flags(&run("sunny.toml", &scene(0.08, 5.0), settings));
    assert!(flagged.is_null(), "{flagged}");
    // Replay detects it, too.
    scratch.file("dirty.npy", recording(&scene(0.02, 6.5)));
    let line = "--settings dtof.toml --recorded-cycles 8000";
    let summary = scratch.replayed(&scratch.path("dirty.npy"), line);
    assert!(summary["cover_glass"][0].as_f64().unwrap() > 1.2);
    let summary = scratch.replayed(&scratch.path("glass.npy"), line);
    assert!(summary["cover_glass"].is_null());
}

/// The length is unknown, so it comes from the brightest pixel, which is the hot one.
#[test]
fn a_hot_pixel_changes_nothing_for_the_others() {
    let scratch = Scratch::new();
    let text = scene(0.02, 0.0);
    let [clean, hot] = [None, Some((5, 200_000))].map(|hot| {
        let name = format!("{}.npy", hot.is_some());
        scratch.file(&name, with_hot(&text, hot));
        scratch.printed(&format!(
            "calibrate --input {name} --glass no --out {name}.toml"
        ));
        scratch.printed(&format!(
            "replay --input {name} --settings {name}.toml --out out"
        ));
        scratch.summary()
    });
    assert_eq!(hot["settings"]["masked"], serde_json::json!([5]));
    assert!(hot["masked"].as_u64() > Some(1_000_000));
    for same in ["l1", "l2", "min_count"] {
        assert_eq!(hot["settings"][same], clean["settings"][same], "{same}");
    }
    let [clean, hot] = [clean, hot].map(|summary| summary["events"].as_f64().unwrap());
    assert!(
        clean > 1000.0 && (hot / clean - 1.0).abs() < 0.05,
        "{hot} {clean}"
    );
}

/// The list of the photons of a scene in 2000 of its laser cycles, in their order.
fn list(text: &str) -> String {
    let mut all = photons(&text.replace("cycles = 8000", "cycles = 2000"));
    all.sort_by_key(|&(cycle, ..)| cycle);
    let rows = all.iter();
    let rows = rows.map(|(cycle, pixel, bin)| format!("{pixel},{cycle},{bin}\n"));
    "pixel,cycle,bin\n".to_owned() + &rows.collect::<String>()
}

/// Without settings a replay is a calibration, and a replay with what that has found.
#[test]
fn a_recording_alone_is_calibrated_first() {
    let scratch = Scratch::new();
    let text = scene(0.02, 5.0);
    scratch.file("hot.npy", with_hot(&text, Some((3, 20_000))));
    scratch.file("list.csv", list(&text));
    let read = |folder: &str| scratch.read(&format!("{folder}/events.csv"));
    let bytes = |file: &str| std::fs::read(scratch.path(file)).unwrap();
    let list = "list.csv --columns 16 --rebin 2 --bin-width-ps 125";
    for (recording, run) in [
        ("hot.npy", ""),
        (
            "hot.npy --bin-width-ps 373.6 --recorded-cycles 8000",
            "--seed 4",
        ),
        (list, ""),
        // What is wanted of the result is no rule of detection.
        ("hot.npy", "--neighbours 8"),
        ("hot.npy --mask 3,70", "--tracking"),
        ("hot.npy --recorded-cycles 8000 --gate 20..100", ""),
        // A pulse that is known is that of both.
        ("hot.npy --sigma-bins 0.5", "--neighbours 4"),
        (&format!("{list} --mask 7"), "--neighbours 8"),
    ] {
        // The search and the run are each on one thread here, and on all there.
        let mut dtof = scratch.command(&format!("replay {recording} {run} --out alone"));
        let printed = succeeded(dtof.env("RAYON_NUM_THREADS", "1").output().unwrap());
        assert_contains(&printed, "Found in the recording, saved as ");
        assert_contains(&printed, "\n  cover glass ");
        assert!(read("alone").lines().count() > 1000);
        assert_contains(&scratch.read("alone/report.html"), "Found in the recording");

        scratch.printed(&format!("calibrate {recording} --out found.toml"));
        scratch.printed(&format!(
            "replay {recording} {run} --settings found.toml --out by-hand"
        ));
        for file in ["events.aer", "events.csv", "depth.npy", "dtof.toml"] {
            let [by_hand, alone] = ["by-hand", "alone"].map(|folder| format!("{folder}/{file}"));
            assert!(
                bytes(&by_hand) == bytes(&alone),
                "{recording} {run}: {file}"
            );
        }
        // The settings that it writes need no option.
        let settings = scratch.read("alone/dtof.toml");
        scratch.file("settings.toml", settings);
        let file = recording.split(' ').next().unwrap();
        scratch.printed(&format!(
            "replay {file} --settings settings.toml --out again"
        ));
        assert_eq!(read("again"), read("alone"), "{recording}");
    }
}

/// Options change what is found, as they change a settings file. With the laser cycles a z is found as well, which is for what
/// was found.
#[test]
fn options_override_what_is_found() {
    let scratch = Scratch::new();
    scratch.file("glass.npy", recording(&scene(0.02, 5.0)));
    let run = |length: &str, options: &str| {
        let line = format!("replay glass.npy --cycles 3000 --out out {length} {options}");
        let printed = scratch.printed(&line);
        let files = ["events.csv", "dtof.toml"].map(|name| scratch.read(&format!("out/{name}")));
        (printed, files)
    };
    for length in ["", "--recorded-cycles 8000"] {
        scratch.printed(&format!("calibrate glass.npy {length} --out found.toml"));
        let without_z = |row: &str| match row.starts_with("z = ") {
            true => "false_alarm = 0.01\n".to_owned(),
            false => format!("{row}\n"),
        };
        let text = scratch.read("found.toml");
        assert_eq!(text.contains("\nz = "), !length.is_empty());
        scratch.file(
            "for-z.toml",
            text.lines().map(without_z).collect::<String>(),
        );
        let (printed, [found, _]) = run(length, "");
        assert!(!printed.contains("overridden"), "{printed}");
        // What a z depends on where there is one, and the rest where there is none.
        let rows = match length {
            "" => &[
                ("--z 6", "found.toml", ""),
                ("--estimator centroid", "found.toml", "--estimator"),
                ("--echoes 2 --echo-wait 4", "found.toml", ""),
                ("--rule average --alpha 5", "found.toml", "--alpha, --rule"),
                ("--rule paper", "found.toml", "--rule"),
                ("--frame 200", "found.toml", ""),
            ][..],
            _ => &[
                ("--z 6", "found.toml", "--z"),
                ("--l1 60", "for-z.toml", "--l1"),
                ("--min-count 8", "for-z.toml", "--min-count"),
                ("--window 5", "for-z.toml", "--window"),
                ("--binning 2", "for-z.toml", ""),
                ("--counter-bits 8 --x 8", "for-z.toml", "--x"),
                ("--false-alarm 0.001 --l1 50", "for-z.toml", "--l1"),
            ],
        };
        for &(options, settings, overridden) in rows {
            let (printed, files) = run(length, options);
            assert_contains(&printed, "Found in the recording, saved as ");
            let row = printed.lines().find(|row| row.contains("  overridden "));
            let flags = row.and_then(|row| row.split(" by ").nth(1)).unwrap_or("");
            assert_eq!(flags, overridden, "{options}");
            let (again, by_hand) = run(length, &format!("{options} --settings {settings}"));
            assert!(!again.contains("Found in the recording"), "{again}");
            assert_eq!(files, by_hand, "{length} {options}");
            assert_ne!(files[0], found, "{length} {options}");
        }
        // The search is for these false alarms.
        scratch.printed(&format!(
            "calibrate glass.npy {length} --false-alarm 0.001 --out rare.toml"
        ));
        let (_, files) = run(length, "--false-alarm 0.001");
        let (_, by_hand) = run(length, "--settings rare.toml");
        assert_eq!(files, by_hand, "{length}");
    }
    // An error names what was found.
    std::fs::remove_dir_all(scratch.path("out")).unwrap();
    scratch.all_refused(
        "replay glass.npy --out out",
        "
        --l1 2 | error: found in the recording: x 4: must not be greater than --l1 2
        --x 50 | error: found in the recording: --x 50: must not be greater than l1 40
        --l1 3000 | error: --l2 2000: must be greater than --l1 3000; 2000 is the default of --l2
        --alpha 4 | error: --alpha is for --rule paper or average: say which
        ",
    );
    // A settings file says all.
    scratch.file("empty.toml", "");
    let (printed, _) = run("", "--settings empty.toml");
    assert!(!printed.contains("Found in the recording"), "{printed}");
    assert_eq!(scratch.summary()["settings"]["rule"], "paper");
    assert_eq!(scratch.summary()["found"], serde_json::json!({}));
}

#[test]
fn a_mask_adds_to_what_is_found_unless_it_is_none() {
    let scratch = Scratch::new();
    let hot = scratch.file("hot.npy", with_hot(&scene(0.02, 5.0), Some((3, 20_000))));
    for (options, masked) in [
        ("", serde_json::json!([3])),
        ("--mask 5", serde_json::json!([3, 5])),
        ("--mask 3,5", serde_json::json!([3, 5])),
        ("--mask none", serde_json::Value::Null),
    ] {
        let summary = scratch.replayed(&hot, &format!("--bin-width-ps 250 {options}"));
        assert_eq!(summary["settings"]["masked"], masked, "{options}");
        // A hot pixel that stays in sets how long the recording lasted.
        let warnings = summary["warnings"].to_string();
        let is_warned = warnings.starts_with("[\"pixel 3 has 40 times the photons of most others");
        assert_eq!(is_warned, options == "--mask none", "{warnings}");
        assert_eq!(warnings == "[]", !is_warned, "{warnings}");
    }
}

/// A gate is taken as it is, so that a warning says where the photons of the glass are.
#[test]
fn a_gate_that_takes_the_glass_in_is_warned_of() {
    let scratch = Scratch::new();
    let glass = scratch.file("glass.npy", recording(&scene(0.02, 5.0)));
    let found = &scratch.replayed(&glass, "")["settings"]["gate"];
    let (first, last) = (found[0].as_u64().unwrap(), found[1].as_u64().unwrap());
    let warnings = |gate: String| {
        let summary = scratch.replayed(&glass, &format!("--bin-width-ps 250 --gate {gate}"));
        summary["warnings"].clone()
    };
    assert_eq!(warnings(format!("{first}..{last}")), serde_json::json!([]));
    let warning = format!(
        "--gate begins at bin 0, but what seems to be a cover glass matters up to bin {}: events may show it",
        first - 1
    );
    assert_eq!(warnings(format!("0..{last}")), serde_json::json!([warning]));
}

/// It reads no laser cycle that it does not replay.
#[test]
fn a_list_is_calibrated_from_what_is_replayed() {
    let scratch = Scratch::new();
    let text = list(&scene(0.02, 5.0));
    scratch.file("all.csv", &text);
    let is_early = |row: &&str| {
        row.split(',')
            .nth(1)
            .unwrap()
            .parse()
            .is_ok_and(|c: u32| c < 900)
    };
    let early: Vec<&str> = text.lines().skip(1).filter(is_early).collect();
    scratch.file(
        "early.csv",
        format!("pixel,cycle,bin\n{}\n", early.join("\n")),
    );
    let run = |line: &str| {
        scratch.printed(&format!("replay {line} --columns 16 --out out"));
        scratch.read("out/events.csv")
    };
    assert_eq!(run("all.csv --cycles 900"), run("early.csv"));
}

/// Where no peak shows the pulse, the window rule is found all the same: few photons decide better than with the paper's.
#[test]
fn a_dim_recording_gets_the_window_rule() {
    let scratch = Scratch::new();
    let dim = scratch.file("dim.npy", recording(DIM));
    let defaults = format!("--settings {}", scratch.file("defaults.toml", "").display());
    for (length, most_before, least_after) in [("", 90, 100), ("--recorded-cycles 8000", 25, 75)] {
        let with = |options: &str| {
            let summary = scratch.replayed(&dim, &format!("{length} {options}"));
            (right(&scratch, "depth-events", DIM), summary)
        };
        let (before, _) = with(&defaults);
        let (after, summary) = with("");
        let (once, _) = with("--decide-once");
        println!(
            "{length}: of 128 pixels {before} right with the paper's rule, {after} with what is found, {once} once"
        );
        assert!(before <= most_before && after >= least_after, "{length}");
        assert!(once >= 105, "{length}");
        let pulse = "no peak is bright enough; the window is that for σ = 1 bin";
        assert_eq!(summary["found"]["pulse"], pulse);
        let settings = &summary["settings"];
        assert_eq!(settings["rule"], "window");
        assert_eq!(settings["window"], 3);
        assert_eq!(settings["sigma_bins"], 1.0);
    }
}

/// A quarter of the light of the dim one.
#[test]
fn few_depths_name_the_option_that_finds_dim_targets() {
    let scratch = Scratch::new();
    let scene = DIM
        .replace("0.003", "0.0007")
        .replace("0.0015", "0.0007")
        .replace("0.00019", "0.00004");
    let dim = scratch.file("dim.npy", recording(&scene));
    let is_hinted = |file: &Path, options: &str| {
        let printed = scratch.printed(&format!("replay {} --out out {options}", file.display()));
        printed.contains("dim targets")
    };
    let is_hinted_alone = is_hinted(&dim, "");
    let alone = right(&scratch, "depth", &scene);
    assert!(!is_hinted(&dim, "--neighbours 8"));
    let together = right(&scratch, "depth", &scene);
    println!("of 128 pixels {alone} right, {together} with 8 neighbours");
    assert!(is_hinted_alone && alone < 64 && together >= 120);
    // Not if the option would be refused, nor if most of the pixels have a depth.
    for options in [
        "--frame 8000",
        "--rule paper",
        "--binning 2",
        "--axes captures,columns,bins",
    ] {
        assert!(!is_hinted(&dim, options), "{options}");
    }
    let bright = scratch.file("bright.npy", recording(&self::scene(0.02, 0.0)));
    assert!(!is_hinted(&bright, ""));
    let half: Vec<String> = (0..70).map(|pixel| pixel.to_string()).collect();
    assert!(!is_hinted(&bright, &format!("--mask {}", half.join(","))));
}

/// The pulse is the given one, else the measured one, else that of older settings with its half widths.
#[test]
fn settings_are_for_the_pulse_that_is_known() {
    let scratch = Scratch::new();
    scratch.file("dim.npy", recording(DIM));
    scratch.file("bright.npy", recording(&scene(0.02, 0.0)));
    scratch.file(
        "old.toml",
        "[sensor]\nsigma_bins = 0.5\n[detection]\nrule = 'paper'\nhalf_widths = [1, 4]\n",
    );
    let found = |options: &str| {
        let printed = scratch.printed(&format!("calibrate {options} --out new.toml"));
        let written = scratch.read("new.toml");
        let key = |key: &str| {
            let line = written.lines().find(|line| line.starts_with(key));
            line.map(|line| line.split(" #").next().unwrap().trim().to_owned())
        };
        assert_eq!(key("rule").unwrap(), "rule = \"window\"");
        let keys = ["sigma_bins", "window", "half_widths"];
        (keys.map(|name| key(&format!("{name} = "))), printed)
    };
    let keys = |sigma: &str, window: &str, half_widths: Option<&str>| {
        let half_widths = half_widths.map(|half_widths| format!("half_widths = {half_widths}"));
        [
            Some(format!("sigma_bins = {sigma}")),
            Some(format!("window = {window}")),
            half_widths,
        ]
    };
    let (old, printed) = found("dim.npy --settings old.toml");
    assert_eq!(old, keys("0.5", "2", Some("[1.0, 4.0]")));
    assert_contains(&printed, "σ = 0.5 bins are kept, from the older settings");
    assert_contains(&printed, "so that of the older settings is kept");
    let (given, printed) = found("dim.npy --settings old.toml --sigma-bins 1.5");
    assert_eq!(given, keys("1.5", "5", None));
    assert_contains(&printed, "σ = 1.5 bins are used, as given");
    assert!(!printed.contains("No peak"), "{printed}");
    let (none, printed) = found("dim.npy");
    assert_eq!(none, keys("1.0", "3", None));
    assert_contains(
        &printed,
        "so the window is that for σ = 1 bin: record a target",
    );
    // In a bright one older settings do not matter, a given pulse does.
    let (measured, printed) = found("bright.npy --settings old.toml");
    assert_eq!(measured[1], Some("window = 3".to_owned()));
    assert!(!printed.contains("kept, from"), "{printed}");
    let (given, printed) = found("bright.npy --settings old.toml --sigma-bins 1.5");
    assert_eq!(given, keys("1.5", "5", None));
    assert_contains(&printed, "peaks; σ = 1.5 bins are used, as given");
    // A comparison still needs to know it.
    let output = scratch.run("compare dim.npy --quiet --out compared");
    let reason = "--sigma-bins is needed: no peak of dim.npy is bright enough to measure the pulse";
    scratch.refused(&output, &[reason]);
}

/// If no settings can be found, the defaults hold, and a warning names the reason.
#[test]
fn without_findings_the_defaults_hold() {
    let scratch = Scratch::new();
    let list = scratch.file("few.csv", "pixel,cycle,bin\n0,1,3\n0,70,9\n");
    let short = scratch.file("short.npy", npy("|u1", "(2, 8)", &[50; 16]));
    let summary = scratch.replayed(&short, "");
    let warning =
        "no settings were found: 8 bins are too few to calibrate by; the defaults are used";
    assert_eq!(summary["warnings"][0], warning);
    let settings = &summary["settings"];
    assert_eq!(settings["rule"], "paper");
    // What needs the window rule says so.
    for option in ["--neighbours", "--tracking"] {
        let value = if option == "--tracking" { "" } else { "=8" };
        let output = scratch.run(&format!("replay short.npy --out other {option}{value}"));
        let message = String::from_utf8(output.stderr).unwrap();
        let reason = "needs the window rule, but no settings were found in the recording: give --rule window and --sigma-bins";
        assert_contains(&message, &format!("error: {option} {reason}\n"));
    }
    // Two photons do not show the pulse, but are enough for settings.
    let summary = scratch.replayed(&list, "");
    assert_eq!(&summary["settings"]["rule"], "window");
}

/// The recording that the README replays: nearly all pixels are right without an option.
#[test]
fn the_sample_recording_becomes_a_depth_map() {
    let scratch = Scratch::new();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let scene = Scene::parse(&std::fs::read_to_string(scenes.join("room.toml")).unwrap()).unwrap();
    let summary = scratch.replayed(&scenes.join("room.npy"), "--bin-width-ps 250");
    assert_eq!(summary["warnings"], serde_json::json!([]));
    let depth = scratch.map("depth");
    let is_right = |(pixel, depth): &(u16, &f64)| {
        let truth = scene.truth(PixelAddress::new(*pixel), 0).unwrap();
        (**depth - truth.range_mm).abs() < 30.0
    };
    let right = (0..).zip(&depth).filter(is_right).count();
    // One is hot, and a few have too few photons.
    assert!(right >= 755 && depth.len() == 768, "{right}");
}

#[test]
fn the_rows_of_the_readme_are_printed() {
    let scratch = Scratch::new();
    let room = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/room.npy");
    let printed = scratch.printed(&format!("replay {room} --bin-width-ps 250"));
    let readme = include_str!("../../../../README.md");
    let (_, rows) = readme.split_once("```text\n").unwrap();
    let (rows, _) = rows.split_once("```").unwrap();
    assert!(rows.lines().count() >= 5);
    for row in rows.lines() {
        assert!(printed.lines().any(|line| line == row), "{row}");
    }
}

/// 8 × 8 histograms of 32 bins with so many photons a bin, pixel by pixel.
fn even(photons: impl Fn(usize) -> [u8; 32]) -> Vec<u8> {
    let data: Vec<u8> = (0..64).flat_map(photons).collect();
    npy("|u1", "(8, 8, 32)", &data)
}

#[test]
fn a_pixel_is_dead_only_if_the_darkest_of_the_others_are_not_dark() {
    let scratch = Scratch::new();
    scratch.file(
        "even.npy",
        even(|pixel| [if pixel == 9 { 0 } else { 4 }; 32]),
    );
    let dark = |pixel| match pixel {
        9 => [0; 32],
        10..14 => {
            let mut bins = [0; 32];
            bins[3 + pixel] = 3;
            bins
        }
        _ => [4; 32],
    };
    scratch.file("dark.npy", even(dark));
    for (name, dead) in [("even", " 1: pixel 9"), ("dark", " none")] {
        let printed = scratch.printed(&format!(
            "calibrate --input {name}.npy --recorded-cycles 1000 --out {name}.toml"
        ));
        let row = printed
            .lines()
            .find(|line| line.contains("dead pixels"))
            .unwrap();
        assert!(row.trim_end().ends_with(dead), "{row}");
    }
}

#[test]
fn an_offset_of_the_older_settings_that_is_kept_is_said() {
    let scratch = Scratch::new();
    scratch.file("even.npy", even(|_| [4; 32]));
    let calibrate = "calibrate --input even.npy --out new.toml";
    let printed = scratch.printed(calibrate);
    assert_contains(&printed, "The range offset is not known");
    scratch.file("old.toml", "[sensor]\noffset_mm = 12.5\n");
    let printed = scratch.printed(&format!("{calibrate} --settings old.toml"));
    assert_contains(&printed, "offset: 12.5 mm are kept");
    assert!(!printed.contains("not known: put"), "{printed}");
    assert_contains(&scratch.read("new.toml"), "offset_mm = 12.5");
}

#[test]
fn a_distance_in_metres_is_warned_of() {
    let scratch = Scratch::new();
    scratch.file("even.npy", even(|_| [4; 32]));
    let warned = |distance| {
        let line = format!("calibrate --input even.npy --out new.toml --target-mm {distance}");
        let error = String::from_utf8(scratch.run(&line).stderr).unwrap();
        error.contains("--target-mm takes millimetres; 1.383 m are 1383")
    };
    assert!(warned("1.383") && !warned("1383"));
}

/// A pulse of σ = 2.5 bins, wider than the widest window.
#[test]
fn a_pulse_that_no_window_suits_is_warned_of() {
    let scratch = Scratch::new();
    let text = "columns = 8\nrows = 8\ncycles = 8000\nbackground = 0.001\npulse_sigma_bins = 2.5\n\
                [[surface]]\nrange_mm = 3000\nsignal = 0.1\n";
    let wide = scratch.file("wide.npy", recording(text));
    for (options, is_warned) in [
        ("", true),
        ("--rebin 2", false),
        ("--sigma-bins 1.75", false),
    ] {
        let summary = scratch.replayed(&wide, &format!("--recorded-cycles 8000 {options}"));
        let warnings = summary["warnings"].to_string();
        assert_eq!(
            warnings.contains("--rebin 2"),
            is_warned,
            "{options}: {warnings}"
        );
    }
}

/// Nothing can be measured from no photons. A replay of them goes on.
#[test]
fn a_recording_without_photons_is_refused_and_replayed() {
    let scratch = Scratch::new();
    let zeros = scratch.file("zeros.npy", even(|_| [0; 32]));
    scratch.all_refused(
        "calibrate",
        "zeros.npy --out new.toml | error: zeros.npy: no photons, so nothing can be measured",
    );
    assert!(!scratch.path("new.toml").exists() && !scratch.path("new.html").exists());
    let summary = scratch.replayed(&zeros, "");
    assert_contains(&summary["warnings"].to_string(), "no photons");
}

/// Of two surfaces a gate chooses one: the target is that, and the pulse.
#[test]
fn a_gate_chooses_the_target() {
    let scratch = Scratch::new();
    let two = even(|pixel| {
        let noise = |bin: usize| [4, 5, 6, 5][(pixel * 7 + bin * bin) % 4];
        let mut counts: [u8; 32] = std::array::from_fn(noise);
        for (at, times) in [(6, 3), (22, 1)] {
            for (bin, light) in [(at - 1, 16), (at, 60), (at + 1, 16)] {
                counts[bin] += light * times;
            }
        }
        counts
    });
    scratch.file("two.npy", two);
    for (gate, bin) in [("", 6.5), ("--gate 0..15", 6.5), ("--gate 14..31", 22.5)] {
        scratch.printed(&format!(
            "calibrate two.npy --bin-width-ps 250 --target-mm 1000 --glass no {gate} --out found.toml"
        ));
        let settings = scratch.read("found.toml");
        let line = settings
            .lines()
            .find_map(|line| line.strip_prefix("offset_mm = "));
        let offset: f64 = line
            .unwrap()
            .split_whitespace()
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let expected = 1000.0 - bin * 250.0 * 0.149_896_229;
        assert!(
            (offset - expected).abs() < 4.0,
            "{gate}: {offset} {expected}"
        );
    }
}

/// A gate and pixels to leave out hold for the search, and are in its settings. A pixel that is left out does not set how long
/// the recording lasted.
#[test]
fn a_gate_and_a_mask_hold_for_the_search() {
    let scratch = Scratch::new();
    let bright = even(|pixel| {
        let times = if pixel == 2 { 20 } else { 1 };
        let mut counts = [times; 32];
        counts[15..18].copy_from_slice(&[3, 12, 3].map(|count| count * times));
        counts
    });
    let empty = Scratch::new();
    empty.file("bright.npy", &bright);
    let bright = scratch.file("bright.npy", bright);
    for (options, is_warned) in [("", true), ("--mask 2", false)] {
        let summary = scratch.replayed(&bright, options);
        let warnings = summary["warnings"].to_string();
        assert_eq!(
            warnings.contains("pixel 2 has 20 times"),
            is_warned,
            "{warnings}"
        );
    }
    scratch.printed("calibrate --input bright.npy --gate 10..20 --mask 2 --out new.toml");
    let settings = scratch.read("new.toml");
    assert_contains(&settings, "gate = [10, 20]");
    assert_contains(&settings, "masked = [2]");
    empty.all_refused(
        "calibrate",
        "
        bright.npy --gate 10..32 --out a.toml | error: bright.npy: --gate 10..32: there are 32 bins
        bright.npy --mask 64 --out a.toml | error: --mask 64: there are 64 pixels
        ",
    );
}

//! `--decide-once`: one decision a pixel on all photons, end to end.

use std::path::Path;

use dtof_core::PixelAddress;
use dtof_light::scene::Scene;

use crate::common::{Scratch, assert_contains, npy};

fn scenes() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

/// How many pixels of the room are within 30 mm of the truth.
fn right(scratch: &Scratch) -> usize {
    let scene = std::fs::read_to_string(scenes().join("room.toml")).unwrap();
    let scene = Scene::parse(&scene).unwrap();
    let is_right = |(pixel, depth): &(u16, f64)| {
        let truth = scene.truth(PixelAddress::new(*pixel), 0).unwrap();
        (depth - truth.range_mm).abs() < 30.0
    };
    (0..).zip(scratch.map("depth")).filter(is_right).count()
}

/// Nothing shows how long a recording without photons is; it still ends.
#[test]
fn a_recording_without_photons_ends() {
    let scratch = Scratch::new();
    for (shape, bytes) in [("(2, 8)", 16), ("(2, 2, 2, 16)", 128)] {
        let dark = scratch.file("dark.npy", npy("|u1", shape, &vec![0; bytes]));
        let summary = scratch.replayed(&dark, "--decide-once");
        assert_eq!(
            (&summary["events"], &summary["cycles"]),
            (&0.into(), &10_000.into())
        );
    }
    let scratch = Scratch::new();
    for (name, descr, shape, part) in [
        (
            "no_row.npy",
            "<u2",
            "(0, 4, 128)",
            "the array [0, 4, 128] is empty",
        ),
        (
            "no_bin.npy",
            "<u2",
            "(4, 4, 0)",
            "the array [4, 4, 0] is empty",
        ),
        ("no_photon.npy", "<u2", "(0, 3)", "no photons"),
    ] {
        scratch.file(name, npy(descr, shape, &[]));
        let output = scratch.run(&format!("replay {name} --decide-once --out out"));
        scratch.refused(&output, &[name, part]);
    }
}

#[test]
fn all_photons_decide_once_with_settings_from_the_recording() {
    let scratch = Scratch::new();
    let room = scenes().join("room.npy");
    scratch.replayed(&room, "--decide-once");
    let summary = scratch.summary();
    assert_eq!(summary["not_replayed"], 0);
    assert_eq!(summary["settings"]["decide_once"], true);
    assert_eq!(summary["events"], summary["pixels_reporting"]);
    assert!(right(&scratch) >= 760, "{}", right(&scratch));
    let (depths, confidences) = (scratch.map("depth"), scratch.map("confidence"));
    let table = scratch.read("out/depth.csv");
    assert!(table.starts_with("pixel,column,row,depth_mm,confidence,flags\n"));
    let optional = |value: f64| match value.is_nan() {
        true => String::new(),
        false => format!("{value:.3}"),
    };
    let rows = table.lines().skip(1);
    for ((row, depth), confidence) in rows.zip(&depths).zip(&confidences) {
        let part = format!(",{},{},", optional(*depth), optional(*confidence));
        assert!(row.contains(&part), "{row} {part}");
        // What stands clear has more than the z of 3.75.
        assert!(depth.is_nan() || *confidence > 3.7, "{row}");
    }
    // Only the hot pixel has none.
    assert_eq!(confidences.iter().filter(|value| value.is_nan()).count(), 1);

    // L1, L2 and a z for looks were not used.
    let found = summary["found"].to_string();
    assert_contains(&found, "pulse");
    assert!(!found.contains("L2"), "{found}");

    // The settings that it writes repeat it, in any number of slices.
    let first = scratch.read("out/events.csv");
    let settings = scratch.file("again.toml", scratch.read("out/dtof.toml"));
    scratch.replayed(&room, &format!("--settings {}", settings.display()));
    assert_eq!(scratch.read("out/events.csv"), first);
    assert_eq!(scratch.map("confidence").len(), 768);

    // With neighbours at least as many are right.
    scratch.replayed(
        &room,
        &format!("--settings {} --neighbours 8", settings.display()),
    );
    assert!(right(&scratch) >= 760, "{}", right(&scratch));

    // Frames have no confidence, and leave none of another run.
    scratch.replayed(&room, "--frame 100");
    let left = [
        "confidence.npy",
        "depth-events.npy",
        "depth-best.npy",
        "depth.svg",
    ];
    assert!(
        left.iter()
            .all(|name| !scratch.path("out").join(name).exists())
    );
    assert_eq!(scratch.summary()["depth_from"], "frames");
    assert!(
        scratch
            .read("out/depth.csv")
            .starts_with("pixel,column,row,depth_mm\n")
    );
}

#[test]
fn photons_of_a_list_are_all_taken() {
    let scratch = Scratch::new();
    let mut list = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..20_000 {
        let bin = if cycle % 3 == 0 { 60 } else { cycle % 128 };
        list += &format!("{},{cycle},{bin}\n", cycle % 2);
    }
    let list = scratch.file("list.csv", list);
    scratch.replayed(
        &list,
        "--decide-once --rule window --sigma-bins 1 --bins 128",
    );
    let summary = scratch.summary();
    assert_eq!(
        (&summary["cycles"], &summary["photons"]),
        (&20_000.into(), &20_000.into())
    );
    let events = scratch.events();
    let of: Vec<_> = events
        .iter()
        .map(|event| [&event[0], &event[1], &event[3]])
        .collect();
    assert_eq!(of, [["19999", "0", "60"], ["19999", "1", "60"]]);
}

/// The z in a settings file.
fn z(scratch: &Scratch, file: &str) -> f64 {
    let text = scratch.read(file);
    let line = text.lines().find_map(|line| line.strip_prefix("z = "));
    let number = line.unwrap().split_whitespace().next();
    number.unwrap().parse().unwrap()
}

#[test]
fn a_z_for_looks_and_one_for_a_single_decision_do_not_replace_each_other() {
    let scratch = Scratch::new();
    let room = scenes().join("room.npy");
    scratch.printed(&format!(
        "calibrate {} --recorded-cycles 4000 --out looks.toml",
        room.display()
    ));
    scratch.replayed(&room, "--decide-once --recorded-cycles 4000");
    scratch.file("once.toml", scratch.read("out/dtof.toml"));
    assert!(z(&scratch, "once.toml") < z(&scratch, "looks.toml") - 0.3);
    scratch.replayed(&room, "--settings looks.toml --decide-once");
    assert_eq!(z(&scratch, "out/dtof.toml"), z(&scratch, "once.toml"));
    // One that is given is kept.
    scratch.replayed(&room, "--settings looks.toml --decide-once --z 5");
    assert_eq!(z(&scratch, "out/dtof.toml"), 5.0);

    // An older calibration that decided once has no z for looks in the new one.
    scratch.printed(&format!(
        "calibrate {} --recorded-cycles 4000 --settings once.toml --out new.toml",
        room.display()
    ));
    let new = scratch.read("new.toml");
    assert!(!new.contains("\nz = "), "{new}");
    assert_contains(&new, "false_alarm = 0.01");
    scratch.replayed(&room, "--settings new.toml");
    assert_eq!(z(&scratch, "out/dtof.toml"), z(&scratch, "once.toml"));
}

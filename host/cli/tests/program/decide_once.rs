//! `--decide-once`: one decision a pixel on all photons, end to end.

use std::path::Path;

use dtof_core::PixelAddress;
use dtof_simulate::scene::Scene;

use crate::common::{Scratch, assert_contains};

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
    assert!(table.starts_with("pixel,column,row,depth_mm,confidence\n"));
    let optional = |value: f64| match value.is_nan() {
        true => String::new(),
        false => format!("{value:.3}"),
    };
    let rows = table.lines().skip(1);
    for ((row, depth), confidence) in rows.zip(&depths).zip(&confidences) {
        let ends = format!(",{},{}", optional(*depth), optional(*confidence));
        assert!(row.ends_with(&ends), "{row} {ends}");
        // What stands clear has more than the z of 3.75.
        assert!(depth.is_nan() || *confidence > 3.7, "{row}");
    }
    // Only the hot pixel has none.
    assert_eq!(confidences.iter().filter(|value| value.is_nan()).count(), 1);

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

    // A run with looks has no confidence, and leaves none of another run.
    scratch.replayed(&room, "--rule paper");
    assert!(!scratch.path("out/confidence.npy").exists());
    assert!(
        scratch
            .read("out/depth.csv")
            .starts_with("pixel,column,row,depth_mm\n")
    );
}

#[test]
fn two_surfaces_are_two_maps() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 8\nrows = 4\nbackground = 0.01\ncycles = 3000\n\
         [[surface]]\nrange_mm = 3000\nsignal = 0.4\n\
         [[surface]]\nrange_mm = 1000\nsignal = 0.4\ntransmittance = 0.8\n",
    );
    scratch.simulated(
        &scene,
        "--decide-once --rule window --sigma-bins 1 --echoes 2",
    );
    assert_eq!(scratch.summary()["events"], 64);
    for (name, truth) in [("depth-nearest", 1000.0), ("depth-farthest", 3000.0)] {
        let depths = scratch.map(name);
        assert!(
            depths.iter().all(|depth| (depth - truth).abs() < 20.0),
            "{depths:?}"
        );
    }
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

#[test]
fn what_needs_looks_is_refused() {
    let scratch = Scratch::new();
    let room = scenes().join("room.npy");
    for (options, reason) in [
        ("--binning 2", "--decide-once cannot be used with --binning"),
        ("--frame 100", "--decide-once cannot be used with --frame"),
    ] {
        let line = format!(
            "replay {} --out out --axes rows,columns,bins --decide-once {options}",
            room.display()
        );
        let output = scratch.run(&line);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), message.lines().count()),
            (Some(1), 1),
            "{message}"
        );
        assert_contains(&message, reason);
    }
}

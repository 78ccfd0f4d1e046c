//! `dtof export`: points, kinds of event, the result line, links.

use std::fs;

use crate::common::aer::{HEADER, depth, depth_event, dynamic, events, file};
use crate::common::{Scratch, assert_contains, table};
use dtof_core::{Array, BlockLevel, DepthEvent, EchoNumber, PixelAddress};
use dtof_data::events::aer_file::Event;
use dtof_data::photons::geometry::Rays;

#[test]
fn csv_has_time_and_point_before_the_columns_of_decode() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    let printed = scratch.printed("export events.aer --format csv --out points.csv");
    assert_eq!(printed, "points.csv: 12 events (60x32.2 degrees, 10 MHz)\n");
    let decoded = scratch.printed("decode events.aer");
    let text = scratch.read("points.csv");
    let cut = |line: &str| line.splitn(5, ',').nth(4).unwrap().to_owned();
    let rest: Vec<String> = text.lines().map(cut).collect();
    assert_eq!(rest, decoded.lines().collect::<Vec<_>>());
    assert!(text.starts_with("time_us,x_m,y_m,z_m,cycle,pixel,"));
}

#[test]
fn a_file_of_both_kinds_needs_to_be_told_which() {
    let events = [depth(0, 1, 9), dynamic(1, 2, 9, 1), depth(2, 3, 9)];
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events));
    scratch.all_refused(
        "export events.aer --format ply",
        "
            --out out/x.ply | there is no folder out
            --out x.ply | 2 depth events and 1 dynamic depth events | --events
        ",
    );
    assert!(!scratch.path("x.ply").exists());
}

#[test]
fn one_echo_of_each_exposure_is_exported() {
    let echo = |cycle, number, bin| {
        Event::Depth(DepthEvent {
            echo: EchoNumber::new(number).unwrap(),
            ..depth_event(0, cycle, bin)
        })
    };
    let scratch = Scratch::new();
    let events = [echo(43, 1, 50), echo(80, 2, 20), echo(400, 1, 30)];
    scratch.file("events.aer", file(&HEADER, &events));
    for (options, expected) in [("", 3), ("--echo all", 3), ("--echo last", 2)] {
        let line = format!("export events.aer --format csv --out x {options}");
        let events = format!("x: {expected} events (");
        assert_contains(&scratch.printed(&line), &events);
        assert_eq!(scratch.read("x").lines().count(), expected + 1);
    }
}

#[test]
fn the_result_line_says_what_points_and_times_rest_on() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("none.aer", file(&HEADER, &[]));
    let rays = "[0, 0, 1, 0],\n".repeat(2048);
    let calibration = format!("columns = 64\nrows = 32\npixels = [\n{rays}]\n");
    scratch.file("rays.toml", calibration);
    // The run lasts 105 ms, or no time.
    for row in table(
        "
            events.aer --format ply --fov 45x24.5 | 12 events (45x24.5 degrees, 10 MHz)
            events.aer --format pcd --calibration rays.toml | 12 events (rays.toml, 10 MHz)
            events.aer --format evt2 --laser-hz 12500 | 0 events (12.5 kHz)
            events.aer --format mcap | 12 events (60x32.2 degrees, 10 MHz, clouds every 1049 µs)
            events.aer --format mcap --slice-us 5 | clouds every 5 µs)
            none.aer --format mcap --events depth | 0 events (60x32.2 degrees, 10 MHz, clouds every 10 µs)
        ",
    ) {
        let line = format!("export --out x {}", row[0]);
        let printed = scratch.printed(&line);
        assert!(printed.starts_with("x: "), "{printed}");
        assert!(printed.ends_with(&format!("{}\n", row[1])), "{printed}");
        assert_eq!(scratch.printed(&format!("{line} --quiet")), "");
        fs::remove_file(scratch.path("x")).unwrap();
    }
}

#[test]
fn a_file_without_events_has_a_reason() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("none.aer", file(&HEADER, &[]));
    let none = "warning: none.aer: no events, so the new file has none\n";
    let warned = |line: &str| {
        let output = scratch.run(&format!("export {line} --laser-hz 10000000"));
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    for format in ["csv", "pcd", "ply", "mcap", "ros2", "evt2"] {
        let line = format!("none.aer --format {format} --out none.{format}");
        assert_eq!(warned(&line), none);
        assert_eq!(warned(&format!("{line} --quiet")), "");
    }
    assert_eq!(
        warned("events.aer --format evt2 --out x --threshold-mm 50"),
        "warning: events.aer: no change of depth above 50 mm in 12 events, so the new file has none\n"
    );
    assert_eq!(warned("events.aer --format csv --out y"), "");
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced() {
    use std::os::unix::fs::symlink;

    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("folder/points.csv", "time_us,x_m,y_m,z_m\n");
    symlink("folder/points.csv", scratch.path("link.csv")).unwrap();
    symlink("folder/none.csv", scratch.path("lost.csv")).unwrap();
    scratch.printed("export events.aer --format csv --out link.csv");
    assert!(scratch.path("link.csv").is_symlink());
    assert_eq!(scratch.read("folder/points.csv").lines().count(), 13);
    let lost = scratch.run("export events.aer --format csv --out lost.csv");
    scratch.refused(&lost, &["lost.csv: is a broken link"]);
    assert!(scratch.path("lost.csv").is_symlink());
}

#[test]
fn the_calibration_of_the_documentation_is_one() {
    let docs = include_str!("../../../../../docs/export.md");
    let (_, rest) = docs.split_once("```toml\n").unwrap();
    let (text, _) = rest.split_once("```").unwrap();
    let scratch = Scratch::new();
    let rays = Rays::read(&scratch.file("rays.toml", text), Array::new(2, 1).unwrap()).unwrap();
    // Its second pixel measures 12.5 mm too little.
    let point = rays.point(PixelAddress::new(1), BlockLevel::PIXEL, 987.5);
    let length = point.unwrap().iter().map(|side| side * side).sum::<f64>();
    assert!((length - 1.0).abs() < 1e-12, "{length}");
}

#[test]
fn the_commands_of_the_readme_run() {
    let scratch = Scratch::new();
    scratch.file("out/demo/events.aer", file(&HEADER, &events()));
    let readme = include_str!("../../../../../README.md");
    let start = "cargo run --release -- export out/demo/";
    let mut commands = 0;
    for line in readme.lines().filter(|line| line.starts_with(start)) {
        let arguments: Vec<&str> = line.split_whitespace().skip(4).collect();
        scratch.printed(&arguments.join(" "));
        assert!(scratch.path(arguments[arguments.len() - 1]).exists());
        commands += 1;
    }
    assert_eq!(commands, 1);
}

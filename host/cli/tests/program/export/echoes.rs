//! `dtof export --echo`: one event of each exposure, or all.

use dtof_core::{BlockLevel, Count, EchoNumber};

use dtof_events::aer_file::Event;

use crate::common::aer::{HEADER, depth_event, dynamic, file};
use crate::common::{Scratch, assert_contains};

/// An echo of a pixel whose exposure has lasted `exposure` laser cycles.
fn echo(pixel: u16, cycle: u64, exposure: u16, number: u8, bin: u16, peak: u32) -> Event {
    Event::Depth(dtof_core::DepthEvent {
        echo: EchoNumber::new(number).unwrap(),
        exposure,
        peak_count: Count::saturating(peak),
        ..depth_event(pixel, cycle, bin)
    })
}

/// Two exposures of a pixel, one of another that never reports again, one of a block.
fn events() -> Vec<Event> {
    let Event::Depth(of_block) = echo(0, 60, 61, 1, 90, 20) else {
        unreachable!()
    };
    let block = Event::Depth(dtof_core::DepthEvent {
        level: BlockLevel::new(2).unwrap(),
        ..of_block
    });
    vec![
        echo(0, 43, 44, 1, 50, 14),    // 10 / 44 above the background
        echo(1, 47, 48, 1, 70, 14),    // 10 / 48
        block,                         // 16 / 61
        echo(0, 99, 100, 2, 20, 19),   // 15 / 100
        echo(1, 147, 148, 2, 80, 104), // 100 / 148
        echo(0, 199, 200, 3, 60, 24),  // 20 / 200
        echo(0, 400, 60, 1, 30, 14),
    ]
}

/// Peak bins of the exported events.
fn exported(scratch: &Scratch, options: &str) -> Vec<u16> {
    let printed = scratch.printed(&format!(
        "export events.aer --format csv --out e.csv {options}"
    ));
    let text = scratch.read("e.csv");
    let bins: Vec<u16> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(7).unwrap().parse().unwrap())
        .collect();
    assert_contains(&printed, &format!("{} events", bins.len()));
    bins
}

#[test]
fn one_echo_of_each_exposure_is_exported_in_the_order_of_the_file() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    let all = [50, 70, 90, 20, 80, 60, 30];
    assert_eq!(exported(&scratch, ""), all);
    assert_eq!(exported(&scratch, "--echo all"), all);
    assert_eq!(exported(&scratch, "--echo first"), [70, 90, 20, 30]);
    assert_eq!(exported(&scratch, "--echo last"), [90, 80, 60, 30]);
    assert_eq!(exported(&scratch, "--echo strongest"), [50, 90, 80, 30]);
}

/// A header's number of points is that of the selected echoes.
#[test]
fn every_format_has_as_many_as_its_header_says() {
    let scratch = Scratch::new();
    let whole = file(&HEADER, &events());
    scratch.file("events.aer", &whole);
    for (format, header) in [("pcd", "POINTS 4\n"), ("ply", "element vertex 4\n")] {
        let line = format!("export events.aer --format {format} --out points --echo last");
        assert_contains(&scratch.printed(&line), "points: 4 events");
        let bytes = std::fs::read(scratch.path("points")).unwrap();
        assert_contains(&String::from_utf8_lossy(&bytes), header);
        let end = bytes
            .windows(7)
            .position(|part| part == b"binary\n" || part == b"header\n");
        let end = bytes.len() - end.unwrap() - 7;
        assert_eq!(end % 31, 0);
        assert_eq!(end / 31, 4, "{format}");
    }
    scratch.printed("export events.aer --format mcap --out e.mcap --echo first");
    // A file that ends too early: the echo is chosen among the events before.
    scratch.file("short.aer", &whole[..whole.len() - 32]);
    let output = scratch.run("export short.aer --format csv --out e.csv --echo last");
    assert!(!output.status.success());
    assert_contains(
        &String::from_utf8(output.stderr).unwrap(),
        "e.csv has the 3 events before the damage",
    );
    assert_eq!(scratch.read("e.csv").lines().count(), 4);
}

#[test]
fn changes_of_depth_have_no_echoes_to_choose_from() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &[dynamic(0, 50, 20, 5)]));
    let refused = |options: &str, part: &str| {
        let output = scratch.run(&format!(
            "export events.aer --format csv --out e.csv {options}"
        ));
        scratch.refused(&output, &[part]);
        assert!(!scratch.path("e.csv").exists());
    };
    refused("--echo strongest", "--echo is only for depth events");
    refused("--echo second", "--echo");
    scratch.printed("export events.aer --format csv --out e.csv --echo all");
}

//! `dtof export` of damaged files, of late events, and that is interrupted.

use crate::common::aer::{HEADER, depth, dynamic, events, file};
use crate::common::{Scratch, names};
use dtof_data::events::aer_file::Event;

#[test]
fn the_program_says_what_is_damaged_and_fails() {
    let scratch = Scratch::new();
    scratch.file("cut.aer", &file(&HEADER, &events())[..100]);
    let damage = "cut.aer: byte 96: the file ends inside a word";
    let output = scratch.run("export cut.aer --format csv --out x.csv");
    let left = format!("{damage}; x.csv has the 1 events before the damage");
    scratch.refused(&output, &[left]);
    assert_eq!(scratch.read("x.csv").lines().count(), 2);
    scratch.refused(&scratch.run("decode cut.aer"), &[damage]);
}

#[test]
fn events_that_are_too_late_are_left_out_and_said() {
    // More events than are held back, then an earlier one.
    let mut events = vec![dynamic(1, 1000, 40, 1); 65_537];
    events.push(dynamic(2, 0, 40, 1));
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events));
    let output = scratch.run("export events.aer --format evt2 --out x.raw --laser-hz 10000000");
    assert!(output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    let late = "more than 65,536 later events came before them";
    let expected = format!("events.aer: 1 events were left out of x.raw: {late}\n");
    assert_eq!(message, expected);
}

#[test]
fn an_interrupted_export_leaves_no_output() {
    let scratch = Scratch::new();
    let events: Vec<Event> = (0..1_000_000).map(|cycle| depth(7, cycle, 40)).collect();
    scratch.file("events.aer", file(&HEADER, &events));
    let mut dtof = scratch.command("export events.aer --format csv --out x.csv");
    let mut child = dtof.spawn().unwrap();
    // It fails only when it writes.
    while !names(&scratch.path(""))
        .iter()
        .any(|name| name.ends_with(".partial"))
    {
        assert!(child.try_wait().unwrap().is_none(), "ended too early");
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    assert!(!scratch.path("x.csv").exists());
}

//! Masked pixels of a device: the monitor leaves out their events and counts them.

use std::io::Write;
use std::time::Duration;

use crate::device::monitor::{LONG, device, reference, watch_with};
use crate::device::{client, settings};
use dtof_core::{BlockLevel, Neighbours};
use dtof_engine::settings::{AdaptiveBinning, Settings};

#[test]
fn events_of_masked_pixels_are_left_out_and_counted() {
    let mut client = client(&device(true, LONG));
    let (mut events, mut statistics) = (Vec::new(), Vec::new());
    let masked = Settings {
        masked: vec![1],
        ..settings()
    };
    let outputs: [&mut dyn Write; 2] = [&mut events, &mut statistics];
    let length = Duration::from_millis(1_600);
    watch_with(&masked, &mut client, None, length, outputs).unwrap();
    let [events, statistics] = [events, statistics].map(|text| String::from_utf8(text).unwrap());
    let pixel = |row: &str| row.split(',').nth(1).unwrap().to_owned();
    let is_masked = |row: &&str| pixel(row) == "1";
    assert!(events.lines().count() > 20 && !events.lines().any(|row| is_masked(&row)));
    assert!(statistics.contains(", events left out "), "{statistics}");
    // The events of the other pixels are complete.
    let others = reference();
    let others: Vec<&str> = others.lines().filter(|row| !is_masked(row)).collect();
    assert!(
        events
            .lines()
            .zip(&others)
            .all(|(row, other)| row == *other)
    );

    // Blocks would count their photons.
    let blocks = masked.clone().configured(|array| {
        array.binning = Some(AdaptiveBinning {
            levels: BlockLevel::saturating(1),
            patience: 64,
        });
    });
    // Neighbours would ask them.
    let neighbours = masked.configured(|array| array.neighbours = Some(Neighbours::Eight));
    for (settings, reason) in [
        (blocks, "leave out masked or binning"),
        (neighbours, "leave out masked or neighbours"),
    ] {
        let outputs: [&mut dyn Write; 2] = [&mut Vec::new(), &mut Vec::new()];
        let refused = watch_with(&settings, &mut client, None, length, outputs).unwrap_err();
        assert!(refused.to_string().contains(reason), "{refused}");
    }
}

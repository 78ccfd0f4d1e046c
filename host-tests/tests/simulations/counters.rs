//! Counters of 8 bits beside those of 10: which scenes and recordings they decide alike, and how often a counter
//! passes 255.

use std::path::Path;

use crate::capture_log::{captures, log, tell};
use dtof_core::{Array, DepthEvent, Neighbours, Statistics};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::open::{ReadOptions, counts};
use dtof_data::photons::recorded::{RecordedHistograms, RecordingLength};
use dtof_data::photons::source::PhotonSource;
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_light::demo;

/// The events and counts of pixels and blocks.
type Outcome = (Vec<DepthEvent>, [Statistics; 2]);

fn run(
    settings: &Settings,
    counter_bits: u8,
    array: Array,
    photons: &mut dyn PhotonSource,
    cycles: u16,
) -> Outcome {
    let settings = Settings {
        counter_bits,
        ..settings.clone()
    };
    let mut engine = host_engine(&settings, array, &photons.addresses()).unwrap();
    let mut events = Vec::new();
    let mut left = cycles;
    while left > 0 {
        let cycles = left.min(500);
        events.extend(engine.run(&photons.next_slice(cycles).unwrap()).unwrap());
        left -= cycles;
    }
    (events, engine.statistics())
}

/// Checks that no counter passes 255, and that everything is the same.
fn are_the_same(name: &str, [narrow, wide]: &[Outcome; 2]) {
    tell(&format!(
        "counters of 8 and 10 bits, {name}: {} events each, {} photons past 255",
        wide.0.len(),
        narrow.1[0].saturated
    ));
    assert!(!wide.0.is_empty());
    assert_eq!(narrow.1[0].saturated, 0, "{name}");
    assert!(narrow == wide, "{name}");
}

#[test]
fn the_demo_is_decided_alike() {
    let array = Array::new(16, 12).unwrap();
    let settings = Settings::demo(1).unwrap();
    let of_pixels = settings.clone().configured(|array| array.binning = None);
    let confirmed = of_pixels
        .clone()
        .configured(|array| array.neighbours = Neighbours::new(8));
    for (name, settings) in [
        ("the demo", settings),
        ("the demo without blocks", of_pixels),
        ("the demo with neighbours", confirmed),
    ] {
        let outcomes = [8, 10].map(|bits| {
            let mut photons = demo::photons(array, 1, 4000).unwrap();
            run(&settings, bits, array, &mut photons, 4000)
        });
        are_the_same(name, &outcomes);
    }
}

fn recording_is_decided_alike(name: &str, path: &Path) {
    let recorded = counts(path, &ReadOptions::default()).unwrap();
    for text in ["", "rule = 'window'\nwindow = 3"] {
        for photons_per_cycle in [0.5, 4.0] {
            let file = SettingsFile::parse(&format!("[detection]\n{text}")).unwrap();
            let (mut narrow, mut wide) = (Vec::new(), Vec::new());
            for capture in captures(&recorded).into_iter().step_by(8) {
                let settings = file.settings(capture[0].len()).unwrap();
                let pixels = u32::try_from(capture.len()).unwrap();
                let array = Array::new(pixels, 1).unwrap();
                let length = RecordingLength::PhotonsPerCycle(photons_per_cycle);
                let captures = Histograms::of(capture).unwrap();
                for (bits, outcomes) in [(8, &mut narrow), (10, &mut wide)] {
                    let photons = RecordedHistograms::new(array, &captures, length, 4000, 1);
                    let photons = &mut photons.unwrap();
                    outcomes.push(run(&settings, bits, array, photons, 4000));
                }
            }
            let lost: u64 = narrow.iter().map(|outcome| outcome.1[0].saturated).sum();
            let events: usize = wide.iter().map(|outcome| outcome.0.len()).sum();
            tell(&format!(
                "counters of 8 and 10 bits, {name}, {photons_per_cycle} photons a laser cycle: \
                 {events} events each, {lost} photons past 255"
            ));
            assert_eq!(lost, 0);
            assert!(events > 100 && narrow == wide, "{name}");
        }
    }
}

#[test]
fn recordings_are_decided_alike() {
    if let Some(log) = log() {
        recording_is_decided_alike("TMF8820", &log);
    }
    let newer = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8829_log/tmf8829_log.json.gz"
    ));
    if newer.exists() {
        recording_is_decided_alike("TMF8829", newer);
    } else {
        tell("SKIPPED: recorded counters: no TMF8829 log beside the workspace");
    }
}

//! Recorded histograms of a TMF8820, when the public capture log lies at
//! `../shared/data/tmf8820_plane_gt/distance_data.json` beside the workspace or
//! where `TMF8820_LOG` says: as packets on a mocked bus they come out exactly as
//! recorded, and in the sidecar give the decision of the core.

use std::io::Write;
use std::path::PathBuf;

use crate::common::host::{CONFIGURATION, configured};
use crate::common::mocks::tmf882x::{Bench, Counts, packet, packets, settings};
use dtof_core::fixed::types::U8F8;
use dtof_core::rule::detect;
use dtof_core::{Count, Count24, DepthEstimator, DepthEvent, Histogram, PaperRule, RangeGate};
use dtof_link::Configuration;
use dtof_sensors::Sensor;
use serde_json::Value;

/// Writes past the test harness, which hides what passing tests print.
fn tell(line: &str) {
    writeln!(std::io::stderr().lock(), "{line}").unwrap();
}

fn log() -> Option<PathBuf> {
    let beside = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8820_plane_gt/distance_data.json"
    );
    let path = std::env::var_os("TMF8820_LOG").map_or_else(|| beside.into(), PathBuf::from);
    path.exists().then_some(path)
}

fn histogram(value: &Value) -> [u32; 128] {
    let counts = value.as_array().unwrap().iter();
    let counts: Vec<u32> = counts
        .map(|count| u32::try_from(count.as_u64().unwrap()).unwrap())
        .collect();
    counts.try_into().unwrap()
}

/// The reference first, then the nine zones.
fn counts(capture: &Value) -> Counts {
    let zones = capture["hists"].as_array().unwrap();
    let histograms: Vec<_> = [&capture["reference_hist"]]
        .into_iter()
        .chain(zones)
        .map(histogram)
        .collect();
    histograms.try_into().unwrap()
}

/// All captures, if the log is there.
fn captures(of: &str) -> Option<Vec<Counts>> {
    let Some(path) = log() else {
        tell(&format!(
            "SKIPPED: recorded histograms {of}: no TMF8820 capture log beside the workspace, nor in TMF8820_LOG"
        ));
        return None;
    };
    let captures: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let captures: Vec<_> = captures.as_array().unwrap().iter().map(counts).collect();
    assert!(!captures.is_empty());
    Some(captures)
}

#[test]
fn recorded_histograms_come_out_as_recorded() {
    let Some(captures) = captures("over I2C") else {
        return;
    };
    let mut bench = Bench::<128>::new(settings(), &[]);
    bench.bring_up_running();
    for capture in &captures {
        bench.set(capture);
    }
}

#[test]
fn the_sidecar_decides_recorded_histograms_as_the_core_does() {
    let Some(captures) = captures("in the sidecar") else {
        return;
    };
    // The reference is pixel 99, which is none of the sidecar's; the zones are 10
    // to 18, the centre one 14.
    let requested = Configuration {
        pixels: 19,
        ..CONFIGURATION
    };
    let (mut device, mut host) = configured::<19>(&requested);
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let gate = RangeGate::full();

    let mut bench = Bench::<128>::new(settings(), &[]);
    bench.bring_up_running();
    let mut expected = Vec::new();
    for capture in &captures {
        for bytes in packets(capture) {
            bench.interrupt.set(false);
            bench.i2c.update_expectations(&packet(0x41, &bytes, 128));
            bench.sensor.poll(bench.now_ms, &mut device).unwrap();
            bench.i2c.done();
            bench.interrupt.set(true);
        }
        host.exchange(&mut device, 0);
        host.read(4);
        let mut histogram = Histogram::<128, Count24>::new();
        // The reference comes first, the centre zone is the fifth of nine.
        histogram.add_frame(&capture[5], &gate);
        expected.push(detect(&histogram, &gate, &rule, &DepthEstimator::default()));
    }
    let report = host.report(&mut device, 0);
    let decided = captures.len() as u64 * 9;
    let statistics = report.statistics;
    assert_eq!(statistics.events + statistics.expired, decided);
    assert_eq!(report.cycles, captures.len() as u64 * 537 * 1024);
    assert_eq!(statistics.deferred, 0);
    let reference = captures.iter().flat_map(|capture| capture[0]);
    assert_eq!(report.unaddressed, reference.map(u64::from).sum::<u64>());

    // All zones of a capture end with its last laser cycle.
    let ends = |event: &DepthEvent| (event.cycle.raw() + 1).is_multiple_of(537 * 1024);
    assert!(host.events.iter().all(ends));
    let mut events = host.events.iter().filter(|event| event.pixel.raw() == 14);
    for (capture, detection) in (1..).zip(&expected) {
        let Some(detection) = detection else {
            continue;
        };
        let event = events.next().unwrap();
        assert_eq!(event.cycle.raw() + 1, capture * 537 * 1024);
        assert_eq!(event.peak_bin, detection.peak.bin);
        assert_eq!(event.peak_count, detection.peak.count);
        assert_eq!(event.offset, detection.depth.offset);
        assert_eq!(event.background, detection.background);
        assert_eq!(
            (event.flags, event.exposure),
            (detection.depth.flags, u16::MAX)
        );
    }
    assert!(events.next().is_none());
    let centre = expected.iter().flatten().count();
    assert!(centre > 0);
    println!(
        "{} captures: {} events, {centre} of the centre zone",
        captures.len(),
        statistics.events
    );
}

//! Recorded histograms of a TMF8829, when the public log lies at
//! `../shared/data/tmf8829_log/tmf8829_log.json.gz` beside the workspace or where `TMF8829_LOG` says:
//! as frames of a simulated chip they come out of the driver exactly as recorded, and give the
//! sensor's own distances in the core.
//!
//! All columns of this log are the same, and its distances are those of the first row: only 16
//! histograms a frame are recorded. So the chip's columns are those of several frames.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::rc::Rc;

use crate::common::mocks::SinkCall;
use crate::common::mocks::tmf8829::bench::{Bench, settings};
use dtof_core::{
    Count, Count24, EchoNumber, Histogram, PixelConfig, RangeGate, RangeScale, WindowRule, z_for,
};
use dtof_sensors::tmf8829::Zones;
use flate2::read::GzDecoder;
use serde_json::Value;

const ROWS: usize = 16;

/// Writes past the test harness, which hides what passing tests print.
fn tell(line: &str) {
    writeln!(std::io::stderr().lock(), "{line}").unwrap();
}

/// What was recorded of a frame.
struct Frame {
    /// In each row: its histogram, and the sensor's distances in millimetres.
    rows: Vec<(Vec<u32>, Vec<f64>)>,
    references: Vec<Vec<u32>>,
}

fn counts(of: &Value) -> Vec<u32> {
    let counts = of["bin"].as_array().unwrap().iter();
    let counts = counts.map(|count| u32::try_from(count.as_u64().unwrap()).unwrap());
    counts.collect()
}

fn frame(value: &Value) -> Frame {
    let row = |row: usize| {
        let histograms = value["mp_histo"][row].as_array().unwrap();
        assert!(histograms.iter().all(|other| *other == histograms[0]));
        let peaks = value["results"][0][row]["peaks"].as_array().unwrap();
        let distances = peaks.iter().map(|peak| peak["distance"].as_f64().unwrap());
        (counts(&histograms[0]), distances.collect())
    };
    let references = value["ref_histo"].as_array().unwrap().iter();
    Frame {
        rows: (0..ROWS).map(row).collect(),
        references: references.map(counts).collect(),
    }
}

fn log() -> Option<Vec<Frame>> {
    let beside = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8829_log/tmf8829_log.json.gz"
    );
    let path = std::env::var_os("TMF8829_LOG").map_or_else(|| beside.into(), PathBuf::from);
    if !path.exists() {
        tell(
            "SKIPPED: recorded histograms of a TMF8829: no log beside the workspace, nor in TMF8829_LOG",
        );
        return None;
    }
    let text = GzDecoder::new(File::open(path).unwrap());
    let log: Value = serde_json::from_reader(text).unwrap();
    let frames: Vec<Frame> = log["Result_Set"]
        .as_array()
        .unwrap()
        .iter()
        .map(frame)
        .collect();
    assert!(!frames.is_empty());
    Some(frames)
}

#[test]
fn recorded_histograms_come_out_as_recorded_and_give_the_sensors_distances() {
    let Some(frames) = log() else {
        return;
    };
    let frames = Rc::new(frames);
    let of = |frames: &[Frame], measurement: usize, x: usize| (measurement + x) % frames.len();
    let mut requested = settings(Zones::Z16x16);
    requested.reference = Some(dtof_core::PixelAddress::new(1000));
    let mut bench = Bench::<128>::new(requested);
    let recorded = Rc::clone(&frames);
    bench.bus.0.borrow_mut().chip.scene = Rc::new(move |measurement, zone, bins| {
        let measurement = measurement as usize;
        match zone {
            Some((x, y)) => recorded[of(&recorded, measurement, x)].rows[y].0.clone(),
            None => recorded[measurement % recorded.len()].references[bins].clone(),
        }
    });
    bench.bring_up();

    let info = bench.sensor.info();
    let scale = RangeScale::new(info.bin_width.unwrap(), info.offset).unwrap();
    let gate = RangeGate::<128>::new(0, info.bins - 1).unwrap();
    // As in `host-tests/tests/simulations/recorded_echoes.rs`.
    let z = z_for(100, &gate, 4, 40, 2000);
    let rule = WindowRule::new(3, z, Count::saturating(5)).unwrap();
    let two = EchoNumber::new(2).unwrap();
    let config = PixelConfig::with_rule(rule).gate(gate).echoes(two, 4);
    let config = config.build().unwrap();

    let (mut errors, mut zones, mut lost) = (Vec::new(), 0, 0);
    for measurement in 0..frames.len() {
        for slot in 0..2 {
            let given = bench.frames(1);
            // The frame, four references, half of the zones.
            assert_eq!(given.len(), 1 + 4 + 128);
            for given in &given[1..] {
                let SinkCall::Histogram(pixel, counts) = given else {
                    panic!("{given:?}");
                };
                assert_eq!(counts.len(), 128);
                assert!(counts[64..].iter().all(|&count| count == 0));
                let counts = &counts[..64];
                if let Some(reference) = pixel.checked_sub(1000) {
                    let references = &frames[measurement].references;
                    assert_eq!(counts, references[usize::from(reference)]);
                    continue;
                }
                let zone = usize::from(*pixel - 10);
                let (x, y) = (zone % 16, zone / 16);
                assert_eq!(x / 8, slot);
                let (recorded, distances) = &frames[of(&frames, measurement, x)].rows[y];
                assert_eq!(counts, recorded, "measurement {measurement}, zone {zone}");
                zones += 1;

                let mut all = [0; 128];
                all[..64].copy_from_slice(counts);
                let mut histogram = Histogram::<128, Count24>::new();
                histogram.add_frame(&all, &gate);
                let mut nearest = f64::INFINITY;
                config.detect_echoes(&mut histogram, 0, |_, detection| {
                    let range = scale.range(detection.position()).to_num::<f64>();
                    for distance in distances {
                        nearest = nearest.min((range - distance).abs());
                    }
                });
                if nearest < 150.0 {
                    errors.push(nearest);
                } else {
                    lost += 1;
                }
            }
        }
        // The sensor's own results.
        bench.frames(1);
    }
    assert_eq!(bench.sensor.counts().errors, 0);
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    let most = errors[errors.len() * 19 / 20];
    tell(&format!(
        "recorded TMF8829: {zones} zones bit-exact, {lost} without the sensor's distance, median error \
         {median:.1} mm, 95 % below {most:.1} mm"
    ));
    assert_eq!(zones, frames.len() * 256);
    assert!(median < 4.0, "{median} mm");
    assert!(most < 17.5, "{most} mm");
    assert!(lost * 100 < zones, "{lost} of {zones}");
}

/// The offset is not only fitted to the sensor's distances: the pulse of the detector beside the
/// laser is there. Its centre in the reference histograms, bin 0 beginning at 0.
#[test]
fn the_reference_pulse_is_where_the_offset_has_time_zero() {
    let Some(frames) = log() else {
        return;
    };
    let info = Bench::<128>::new(settings(Zones::Z16x16)).sensor.info();
    let millimetres_per_bin = info.bin_width.unwrap().to_num::<f64>() * 0.149_896_229;
    for counts in frames.iter().flat_map(|frame| &frame.references) {
        let mut sorted = counts[..54].to_vec();
        sorted.sort_unstable();
        let background = f64::from(sorted[27]);
        let top = (0..54).max_by_key(|&bin| counts[bin]).unwrap();
        let (mut photons, mut moment) = (0.0, 0.0);
        for (bin, &count) in counts.iter().enumerate().skip(top - 2).take(5) {
            let signal = f64::from(count) - background;
            photons += signal;
            moment += signal * (bin as f64 + 0.5);
        }
        let zero = moment / photons * millimetres_per_bin;
        let offset = info.offset.to_num::<f64>();
        assert!(
            (zero + offset).abs() < 12.0,
            "{zero} mm, offset {offset} mm"
        );
    }
}

//! Several echoes of recorded photons: which targets they find beyond the highest peak.

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::capture_log::{captures, ground_truth, log, tell};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    Array, Count, Count16, EchoNumber, Flags, Histogram, LaserCycle, PixelAddress, PixelConfig,
    RangeGate, RangeScale, WindowRule, z_for,
};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::open::{Metadata, ReadOptions, counts};
use dtof_data::photons::recorded::{RecordedHistograms, RecordingLength};
use dtof_data::photons::source::PhotonSource;
use dtof_data::photons::tmf8820;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_sensors::tmf882x;
use flate2::read::GzDecoder;

const CYCLES: u16 = 20_000;
const CENTRE: usize = 4;
/// In captures nearer than this, in millimetres, the target merges with the cover glass.
const NEAR_MM: f64 = 29.9;

fn two() -> EchoNumber {
    EchoNumber::new(2).unwrap()
}

/// The reports of the centre zone of a capture, in millimetres.
#[derive(Default)]
struct Found {
    firsts: Vec<f64>,
    seconds: Vec<f64>,
    tails: usize,
}

/// NaN without values.
fn median(ranges: &mut [f64]) -> f64 {
    ranges.sort_by(f64::total_cmp);
    ranges.get(ranges.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The captures nearer than [`NEAR_MM`], at four photons per laser cycle: the truth and the echoes. The
/// bins that are excluded around an echo depend on `sigma`, the width of the pulse in bins.
fn near_captures(log: &PathBuf, sigma: &str) -> Vec<(f64, Found)> {
    let settings = Settings::static_scene(1)
        .with_bins(tmf8820::BINS)
        .for_pulse(sigma.parse::<U8F8>().unwrap())
        .configured(|array| {
            array.bin_width_ps = tmf882x::BIN_WIDTH_PS;
            array.offset_mm = tmf882x::OFFSET_MM;
            array.rule = WindowRule::new(2, U4F12::lit("4.5"), Count::saturating(5))
                .unwrap()
                .into();
            array.l1 = 40;
            array.l2 = 2000;
            array.x = 4;
            array.echoes = two();
        });
    let truth = ground_truth(log);
    let recorded = counts(log, &ReadOptions::default()).unwrap();
    let length = RecordingLength::PhotonsPerCycle(4.0);
    let ranges = settings.ranges(Array::new(1, 1).unwrap()).unwrap();
    let captures = captures(&recorded);
    let captures = truth.into_iter().zip(&captures);
    let near = captures.filter(|(mm, _)| *mm < NEAR_MM);
    near.map(|(mm, capture)| {
        let centre = Histograms::of([capture[CENTRE].clone()]).unwrap();
        let one = Array::new(1, 1).unwrap();
        let mut photons = RecordedHistograms::new(one, &centre, length, CYCLES.into(), 1).unwrap();
        let mut engine = host_engine(&settings, one, &photons.addresses()).unwrap();
        let mut found = Found::default();
        for event in engine.run(&photons.next_slice(CYCLES).unwrap()).unwrap() {
            let range = ranges
                .of(event.pixel, event.level, event.position())
                .to_num();
            if event.echo == EchoNumber::FIRST {
                found.firsts.push(range);
            } else {
                found.seconds.push(range);
                found.tails += usize::from(event.flags.contains(Flags::TAIL));
            }
        }
        (mm, found)
    })
    .collect()
}

/// The second echo of a target would keep its distance. These move with the excluded bins, and nearly
/// all have the flag of a tail: they are the tail of the first.
#[test]
fn behind_the_first_echo_of_near_captures_there_is_its_tail_and_no_target() {
    let Some(log) = log() else { return };
    let mut seconds_at = Vec::new();
    for sigma in ["0.55", "1", "1.75"] {
        tell(&format!(
            "recorded echoes, captures nearer than 30 mm, 4 photons a laser cycle, sigma {sigma}:"
        ));
        tell("truth mm  first mm  events  second mm  events  tails");
        let (mut all, mut tails, mut lit, mut seconds) = (0, 0, 0, Vec::new());
        for (truth, mut found) in near_captures(&log, sigma) {
            let (firsts, further) = (found.firsts.len(), found.seconds.len());
            all += further;
            tails += found.tails;
            seconds.extend_from_slice(&found.seconds);
            let (first, second) = (median(&mut found.firsts), median(&mut found.seconds));
            tell(&format!(
                "{truth:8.1} {first:9.1} {firsts:7} {second:10.1} {further:7} {:6}",
                found.tails
            ));
            // The others have fewer photons than an event needs.
            if firsts > 1 {
                lit += 1;
                let near = if truth < 19.9 { 11.0 } else { 3.0 };
                assert!((first - truth).abs() < near, "{first} mm at {truth} mm");
            }
        }
        assert_eq!(lit, 6, "captures with light");
        assert!(
            all > 100 && tails * 100 >= all * 95,
            "{tails} of {all} flagged"
        );
        seconds_at.push(median(&mut seconds));
    }
    // 3, 4 and 7 bins of 13.8 mm to either side.
    let [narrow, middle, wide] = seconds_at[..] else {
        unreachable!()
    };
    assert!(
        middle > narrow + 10.0 && wide > middle + 30.0,
        "{seconds_at:?}"
    );
}

/// A histogram, and the distance that the sensor reported for it.
type Measured = ([u16; 64], f64);

/// The log of a TMF8829, `../shared/data/tmf8829_log` beside the workspace: histograms of one
/// column of 16 pixels in 26 frames, with the distances that the sensor reported.
fn tmf8829() -> Option<(Metadata, Vec<Measured>)> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8829_log/tmf8829_log.json.gz"
    );
    if !Path::new(path).exists() {
        tell("SKIPPED: recorded echoes: no TMF8829 log beside the workspace");
        return None;
    }
    let recorded = counts(Path::new(path), &ReadOptions::default()).unwrap();
    // All columns of a row of histograms are the same: they belong to the first row of results.
    assert_eq!(recorded.array, Array::new(1, 16).unwrap());
    assert_eq!(recorded.captures(), 26);
    assert_eq!(recorded.metadata.gate, Some((0, 53)));
    let log: serde_json::Value =
        serde_json::from_reader(GzDecoder::new(File::open(path).unwrap())).unwrap();
    let frames = log["Result_Set"].as_array().unwrap();
    let mut all = Vec::new();
    for (frame, capture) in frames.iter().zip(captures(&recorded)) {
        for (pixel, bins) in capture.iter().enumerate() {
            let bins = std::array::from_fn(|bin| u16::try_from(bins[bin]).unwrap());
            let peaks = &frame["results"][0][pixel]["peaks"];
            all.push((bins, peaks[0]["distance"].as_f64().unwrap()));
        }
    }
    Some((recorded.metadata, all))
}

/// Without a gate. In two histograms something in front of the target is brighter: with one echo they
/// have no event at the sensor's distance.
#[test]
fn the_distances_of_a_newer_sensor_are_among_the_echoes() {
    let Some((metadata, log)) = tmf8829() else {
        return;
    };
    let scale = RangeScale::new(metadata.bin_width_ps, metadata.offset_mm.unwrap()).unwrap();
    let (mut errors, mut shifts) = (Vec::new(), Vec::new());
    let mut found = [[0; 3]; 2];
    for (bins, distance) in &log {
        // The sensor measured 54 bins and a half.
        let gate = RangeGate::<64>::new(0, 53).unwrap();
        let z = z_for(100, &gate, 4, 40, 2000);
        let rule = WindowRule::new(3, z, Count::saturating(5)).unwrap();
        for (most, found) in [EchoNumber::FIRST, two()].into_iter().zip(&mut found) {
            let config = PixelConfig::with_rule(rule).gate(gate).echoes(most, 4);
            let config = config.build().unwrap();
            let mut histogram = Histogram::<64, Count16>::new();
            histogram.add_frame(bins, &gate);
            let mut right = 0;
            config.detect_echoes(&mut histogram, 1, |echo, detection| {
                let event = detection.event(PixelAddress::new(0), LaserCycle::new(0), 1);
                let range = scale.range(event.position()).to_num::<f64>();
                let error = (range - distance).abs();
                if right == 0 && error < 150.0 {
                    right = usize::from(echo.raw());
                    errors.push(error);
                    shifts.push(range - distance);
                }
            });
            found[right] += 1;
        }
    }
    tell(&format!(
        "recorded echoes, TMF8829: sensor's distance not found, first echo, second echo: with one \
         {:?}, with two {:?}",
        found[0], found[1]
    ));
    assert_eq!(found, [[2, 414, 0], [0, 414, 2]]);
    // The bin width and the offset for such logs were fitted to these distances.
    let (all, error, shift) = (errors.len(), median(&mut errors), median(&mut shifts));
    let most = errors[all * 95 / 100];
    tell(&format!(
        "recorded echoes, TMF8829: {all} ranges, median error {error:.1} mm, 95 % within {most:.1} mm, median shift \
         {shift:.1} mm"
    ));
    assert!(error < 3.3 && shift.abs() < 0.5, "{error} mm, {shift} mm");
}

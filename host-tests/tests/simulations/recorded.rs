//! Recorded photons with ground truth: the public TMF8820 capture log. Prints the results of each zone.

use std::path::PathBuf;

use crate::capture_log::{ground_truth, log, tell};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule};
use dtof_data::photons::open::{ReadOptions, counts};
use dtof_data::photons::recorded::{RecordedHistograms, RecordingLength};
use dtof_data::photons::source::PhotonSource;
use dtof_data::photons::tmf8820;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_sensors::tmf882x;

const ZONES: usize = 9;
const CENTRE: usize = 4;

/// The reports of one zone over all captures from 30 to 400 mm.
struct Zone {
    events: usize,
    distances: usize,
    offset: f64,
    median: f64,
    within_95: f64,
    beyond_50: usize,
}

fn replay(log: &PathBuf, photons_per_cycle: f64, min_count: u16) -> [Zone; ZONES] {
    let settings = Settings::static_scene(1)
        .with_bins(tmf8820::BINS)
        .configured(|array| {
            array.bin_width_ps = tmf882x::BIN_WIDTH_PS;
            array.offset_mm = tmf882x::OFFSET_MM;
            array.rule = PaperRule::new(U8F8::lit("4"), Count::saturating(min_count.into())).into();
            array.l1 = 40;
            array.x = 4;
        });
    let truth = ground_truth(log);
    let recorded = counts(log, &ReadOptions::default()).unwrap();
    let length = RecordingLength::PhotonsPerCycle(photons_per_cycle);
    let mut photons =
        RecordedHistograms::new(recorded.array, &recorded.histograms, length, 10_000, 1).unwrap();
    let mut engine = host_engine(&settings, photons.array(), &photons.addresses()).unwrap();
    let events = engine.run(&photons.next_slice(10_000).unwrap()).unwrap();
    let ranges = settings.ranges(photons.array()).unwrap();

    std::array::from_fn(|zone| {
        // The capture and the error of the range, for every event of this zone.
        let errors: Vec<(usize, f64)> = events
            .iter()
            .map(|event| {
                (
                    usize::from(event.pixel.raw()),
                    ranges.of(event.pixel, event.level, event.position()),
                )
            })
            .map(|(pixel, range)| (pixel % ZONES, pixel / ZONES, range.to_num::<f64>()))
            .filter(|&(of, capture, _)| of == zone && truth[capture] > 29.9)
            .map(|(_, capture, range)| (capture, range - truth[capture]))
            .collect();
        let mut captures: Vec<usize> = errors.iter().map(|error| error.0).collect();
        captures.sort_unstable();
        captures.dedup();
        // One constant offset per zone is subtracted.
        let mut signed: Vec<f64> = errors.iter().map(|error| error.1).collect();
        signed.sort_by(f64::total_cmp);
        let offset = signed[signed.len() / 2];
        let mut absolute: Vec<f64> = signed.iter().map(|error| (error - offset).abs()).collect();
        absolute.sort_by(f64::total_cmp);
        Zone {
            events: absolute.len(),
            distances: captures.len(),
            offset,
            median: absolute[absolute.len() / 2],
            within_95: absolute[absolute.len() * 95 / 100],
            beyond_50: absolute.iter().filter(|&&error| error > 50.0).count(),
        }
    })
}

#[test]
fn recorded_photons_give_every_distance_within_bounds() {
    let Some(log) = log() else {
        return;
    };
    let all = ground_truth(&log)
        .iter()
        .filter(|&&distance| distance > 29.9)
        .count();
    assert_eq!(all, 149);
    for (photons_per_cycle, min_count) in [(0.5, 5), (1.0, 5), (0.5, 1), (0.5, 3)] {
        tell(&format!(
            "recorded photons, {photons_per_cycle} a laser cycle in the brightest zone; alpha 4, L1 40, \
             L2 2000, X 4, minimum {min_count}; {all} distances from 30 to 400 mm"
        ));
        tell("zone  events  distances  offset mm  median mm  95 % mm  beyond 50 mm");
        for (zone, result) in replay(&log, photons_per_cycle, min_count)
            .iter()
            .enumerate()
        {
            let Zone {
                events,
                distances,
                offset,
                median,
                within_95,
                beyond_50,
            } = result;
            tell(&format!(
                "{zone:>4} {events:>7} {distances:>10} {offset:>10.2} {median:>10.2} {within_95:>8.2} \
                 {beyond_50:>13}"
            ));
            // The other zones see the same plane, but have no ground truth of their own.
            assert_eq!(*distances, all, "zone {zone}: a distance without an event");
            if zone == CENTRE && min_count == 5 {
                assert!(
                    offset.abs() < 1.0,
                    "the default offset is the centre zone's"
                );
                assert!(*median <= 4.0);
                assert!(
                    beyond_50 * 1000 <= *events,
                    "{beyond_50} of {events} beyond 50 mm"
                );
            }
        }
    }
}

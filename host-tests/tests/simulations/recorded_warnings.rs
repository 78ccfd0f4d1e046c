//! Warnings about recordings: none for a good recording.

use crate::capture_log::{captures, log, tell};
use dtof_calibrate::Scatter;
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::open::{ReadOptions, counts};
use dtof_data::photons::source::PhotonSource;
use dtof_data::photons::warnings::{bins_may_be_first, swapped_axes};
use dtof_light::scene::Scene;
use std::ops::Range;
use std::path::Path;

/// The same numbers with the bins as the first axis: a line for each bin and row, of `columns`.
fn bins_first(pixels: &[Vec<u64>], columns: usize) -> (usize, Vec<Vec<u64>>) {
    let bins = pixels[0].len();
    let flat: Vec<u64> = (0..bins)
        .flat_map(|bin| pixels.iter().map(move |histogram| histogram[bin]))
        .collect();
    (bins, flat.chunks(columns).map(<[u64]>::to_vec).collect())
}

#[test]
fn recorded_photons_of_a_log_are_warned_of_when_turned_and_only_then() {
    let Some(log) = log() else { return };
    let recorded = counts(&log, &ReadOptions::default()).unwrap();
    assert_eq!(recorded.metadata.warnings, [""; 0]);
    let (captures, pixels) = (self::captures(&recorded), recorded.histograms);
    assert_eq!(swapped_axes(&[captures.len(), 9], &pixels), None);
    for capture in &captures {
        let capture = Histograms::of(capture.clone()).unwrap();
        assert_eq!(swapped_axes(&[9], &capture), None);
    }
    let pixels: Vec<Vec<u64>> = pixels.iter().collect();
    assert_scatter("TMF8820", &pixels, 0.99..1.05);
    // So many photons show how unequal the bins are.
    let sums = over_captures(&captures);
    assert_scatter("TMF8820, captures summed", &sums, 1.5..4.0);
    let sums = over_pixels(&captures);
    assert_scatter("TMF8820, zones summed", &sums, 0.95..1.1);
    let (bins, turned) = bins_first(&pixels, 9);
    let rows = turned.len() / bins;
    assert!(swapped_axes(&[bins, rows], &Histograms::of(turned).unwrap()).is_some());
    let beside = "../../shared/data/tmf8829_log/tmf8829_log.json.gz";
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join(beside);
    if !beside.exists() {
        tell("SKIPPED: recorded warnings: no TMF8829 log beside the workspace");
        return;
    }
    let recorded = counts(&beside, &ReadOptions::default()).unwrap();
    assert_eq!(recorded.metadata.warnings, [""; 0]);
    let (captures, pixels) = (self::captures(&recorded), recorded.histograms);
    assert_eq!(swapped_axes(&[26, 16], &pixels), None);
    let pixels = pixels.iter().collect();
    // The sensor leaves out the last ten bins.
    let measured = |histograms: Vec<Vec<u64>>| -> Vec<Vec<u64>> {
        histograms
            .iter()
            .map(|counts| counts[..54].to_vec())
            .collect()
    };
    assert_scatter("TMF8829", &measured(pixels), 0.95..1.1);
    let sums = over_captures(&captures);
    assert_scatter("TMF8829, frames summed", &measured(sums), 0.8..1.1);
    // Its columns are alike: the first stands for all.
    let column: Vec<Vec<Vec<u64>>> = captures
        .iter()
        .map(|capture| capture.iter().step_by(16).cloned().collect())
        .collect();
    let sums = over_pixels(&column);
    assert_scatter("TMF8829, rows summed", &measured(sums), 0.9..1.15);
}

fn summed<'a>(histograms: impl Iterator<Item = &'a Vec<u64>>) -> Vec<u64> {
    histograms
        .cloned()
        .reduce(|sum, counts| {
            let bins = sum.iter().zip(&counts);
            bins.map(|(sum, count)| sum + count).collect()
        })
        .unwrap()
}

fn over_pixels(captures: &[Vec<Vec<u64>>]) -> Vec<Vec<u64>> {
    captures
        .iter()
        .map(|capture| summed(capture.iter()))
        .collect()
}

fn over_captures(captures: &[Vec<Vec<u64>>]) -> Vec<Vec<u64>> {
    (0..captures[0].len())
        .map(|pixel| summed(captures.iter().map(|capture| &capture[pixel])))
        .collect()
}

/// How neighbouring bins differ, where photon counts have 1.
fn assert_scatter(name: &str, histograms: &[Vec<u64>], expected: Range<f64>) {
    let number = |&count: &u64| count as f64;
    let counts: Vec<Vec<f64>> = histograms
        .iter()
        .map(|counts| counts.iter().map(number).collect())
        .collect();
    let found = Scatter::of(&counts.iter().map(|counts| &counts[..]).collect::<Vec<_>>());
    tell(&format!(
        "scatter: {name}: {:.2} ± {:.2}, median {:.2}, {:.0} photons, {} triples",
        found.mean, found.error, found.median, found.photons, found.triples
    ));
    assert!(expected.contains(&found.mean), "{found:?}");
}

/// The histograms of a scene of this repository over a number of laser cycles.
fn histograms(name: &str, laser_off: bool) -> (usize, usize, Vec<Vec<u64>>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut scene = Scene::read(&folder.join(name)).unwrap();
    if laser_off {
        scene = scene.with_laser_off();
    }
    let mut photons = scene.photons(1, 400).unwrap();
    let array = photons.array();
    let mut pixels = vec![vec![0; usize::from(scene.bins)]; array.pixels() as usize];
    for (histogram, received) in pixels
        .iter_mut()
        .zip(photons.next_slice(400).unwrap().pixels)
    {
        for photon in received.photons {
            if let Some(count) = histogram.get_mut(usize::from(photon.code)) {
                *count += 1;
            }
        }
    }
    (array.rows() as usize, array.columns() as usize, pixels)
}

#[test]
fn simulated_scenes_are_not_warned_of() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut scenes = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.ends_with(".toml") {
            continue;
        }
        for laser_off in [false, true] {
            let (rows, columns, pixels) = histograms(&name, laser_off);
            assert_eq!(
                swapped_axes(&[rows, columns], &Histograms::of(pixels.clone()).unwrap()),
                None,
                "{name}, laser off: {laser_off}"
            );
            let (bins, turned) = bins_first(&pixels, columns);
            let turned = Histograms::of(turned).unwrap();
            let axes = [bins, rows];
            let is_warned = swapped_axes(&axes, &turned).is_some()
                || bins_may_be_first(&axes, &turned).is_some();
            // Without a pulse only the shape tells: a square behind more bins.
            let by_shape = rows == columns && columns >= 8;
            assert!(
                !laser_off || is_warned == by_shape,
                "{name}: a passive image"
            );
            println!("{name}: {rows} rows, {columns} columns, turned: warned {is_warned}");
        }
        scenes += 1;
    }
    assert!(scenes > 2, "{scenes} scenes");
}

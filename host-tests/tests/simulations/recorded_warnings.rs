//! Warnings about recordings: none for a good recording.

use crate::capture_log::{log, tell};
use dtof_calibrate::Scatter;
use dtof_photons::open::{ReadOptions, counts};
use dtof_photons::source::PhotonSource;
use dtof_photons::warnings::swapped_axes;
use dtof_simulate::scene::Scene;
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
    let pixels = recorded.captures.concat();
    assert_eq!(swapped_axes(&[recorded.captures.len(), 9], &pixels), None);
    for capture in &recorded.captures {
        assert_eq!(swapped_axes(&[9], capture), None);
    }
    assert_scatter(&pixels, 0.99..1.05);
    let zone = |zone: usize| {
        let captures = recorded.captures.iter().map(|capture| &capture[zone]);
        captures.fold(vec![0; 128], |sum: Vec<u64>, counts| {
            sum.iter()
                .zip(counts)
                .map(|(sum, count)| sum + count)
                .collect()
        })
    };
    // So many photons show how unequal the bins are.
    assert_scatter(&(0..9).map(zone).collect::<Vec<_>>(), 1.5..2.5);
    let (bins, turned) = bins_first(&pixels, 9);
    let rows = turned.len() / bins;
    assert!(swapped_axes(&[bins, rows], &turned).is_some());
    let beside = "../../shared/data/tmf8829_log/tmf8829_log.json.gz";
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join(beside);
    if !beside.exists() {
        tell("SKIPPED: recorded warnings: no TMF8829 log beside the workspace");
        return;
    }
    let recorded = counts(&beside, &ReadOptions::default()).unwrap();
    assert_eq!(recorded.metadata.warnings, [""; 0]);
    let pixels = recorded.captures.concat();
    assert_eq!(swapped_axes(&[26, 16], &pixels), None);
    // The sensor leaves out the last ten bins.
    let measured: Vec<Vec<u64>> = pixels.iter().map(|counts| counts[..54].to_vec()).collect();
    assert_scatter(&measured, 0.95..1.05);
}

/// How neighbouring bins differ, where photon counts have 1.
fn assert_scatter(histograms: &[Vec<u64>], expected: Range<f64>) {
    let number = |&count: &u64| count as f64;
    let counts: Vec<Vec<f64>> = histograms
        .iter()
        .map(|counts| counts.iter().map(number).collect())
        .collect();
    let found = Scatter::of(&counts.iter().map(|counts| &counts[..]).collect::<Vec<_>>());
    tell(&format!("{found:?}"));
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
                swapped_axes(&[rows, columns], &pixels),
                None,
                "{name}, laser off: {laser_off}"
            );
            let (bins, turned) = bins_first(&pixels, columns);
            let is_warned = swapped_axes(&[bins, rows], &turned).is_some();
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

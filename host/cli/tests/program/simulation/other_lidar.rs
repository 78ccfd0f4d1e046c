//! The pulses of another LiDAR.

use dtof_engine::settings::SettingsFile;
use dtof_light::scene::Scene;
use dtof_sensors::dither::Dither;

use crate::common::{Scratch, succeeded};

use super::{Photons, array, histogram, near, near_count, pixel, seeded, sliced};

/// A laser cycle of 400 bins of 250 ps.
fn scene(keys: &str, other: &str) -> String {
    format!("laser_rate_mhz = 10\n{keys}\n[other_lidar]\n{other}\n")
}

/// The mean place of the photons of each laser cycle that has some.
fn places(photons: &Photons) -> Vec<(u64, f64)> {
    let cycles = photons.chunk_by(|one, other| one.0 == other.0);
    let mean = |of_cycle: &[(u64, u16)]| {
        let sum: f64 = of_cycle
            .iter()
            .map(|(_, code)| f64::from(*code) + 0.5)
            .sum();
        (of_cycle[0].0, sum / of_cycle.len() as f64)
    };
    cycles.map(mean).collect()
}

/// The places far enough from both ends that no photon is cut off.
fn inside(photons: &Photons) -> Vec<(u64, f64)> {
    let all = places(photons).into_iter();
    all.filter(|(_, place)| (8.0..120.0).contains(place))
        .collect()
}

/// The photons with the first seed whose first pulse is in the middle of the histogram.
fn from_the_middle(text: &str, cycles: u64) -> Photons {
    let middle = (1..).find(|&seed| {
        let first = seeded(text, seed, 1, 1).remove(0);
        let first = inside(&first);
        first
            .first()
            .is_some_and(|(_, place)| (30.0..100.0).contains(place))
    });
    seeded(text, middle.unwrap(), cycles, 1000).remove(0)
}

#[test]
fn pulses_of_the_same_clock_stay_where_they_are_and_have_their_photons() {
    let photons = from_the_middle(&scene("", "photons = 3"), 20_000);
    near_count("photons", photons.len(), 60_000.0);
    let places = inside(&photons);
    let mean = |of: &[(u64, f64)]| of.iter().map(|(_, place)| place).sum::<f64>() / of.len() as f64;
    let (first, last) = (&places[..5000], &places[places.len() - 5000..]);
    // The mean of some 3 photons, one at least, with a sigma of 1.05 bins with that of the bin.
    near(
        "place",
        mean(first),
        mean(last),
        (2.0 * 0.5 / 5000.0f64).sqrt(),
    );
}

#[test]
fn pulses_of_a_slower_clock_come_later_and_later() {
    // 20 ppm of 400 bins are 0.008 bins a laser cycle.
    let photons = from_the_middle(&scene("", "photons = 20\nppm = 20"), 2000);
    let places = inside(&photons);
    let ((first, start), (last, end)) = (places[0], places[places.len() - 1]);
    let drift = (end - start) / (last - first) as f64;
    near("drift", drift, 0.008, 0.5 / (last - first) as f64);
}

#[test]
fn all_pixels_see_its_pulses_at_the_same_times() {
    let text = scene("columns = 4\ndither_bins = 64", "photons = 50\nppm = 100");
    let pixels = array(&text, 2000);
    let [first, others @ ..] = &*pixels else {
        panic!()
    };
    let first = inside(first);
    assert!(first.len() > 300);
    for other in others {
        let other: std::collections::BTreeMap<u64, f64> = inside(other).into_iter().collect();
        for (cycle, place) in &first {
            if let Some(same) = other.get(cycle) {
                // Means of some 50 photons each.
                assert!((place - same).abs() < 1.5, "{cycle}: {place} and {same}");
            }
        }
    }
}

#[test]
fn dither_moves_its_pulses_by_the_lengths_of_the_own_laser_cycles() {
    let photons = pixel(&scene("dither_bins = 64", "photons = 400"), 20_000);
    let added: Vec<u8> = Dither::new(64, 1).unwrap().added().take(20_000).collect();
    let mut steps = 0;
    for pair in inside(&photons).windows(2) {
        let [(cycle, place), (next, next_place)] = *pair else {
            panic!()
        };
        if next - cycle == 1 {
            let cycle = usize::try_from(cycle).unwrap();
            steps += 1;
            // A longer laser cycle brings the next one of the other nearer.
            let step = 32.0 - f64::from(added[cycle]);
            assert!((next_place - place - step).abs() < 0.5, "{cycle}");
        }
    }
    assert!(steps > 1000, "{steps}");
}

#[test]
fn slices_of_any_length_have_the_same_photons() {
    let text = scene("columns = 2\ndither_bins = 128", "photons = 2\nppm = -30");
    assert_eq!(sliced(&text, 3000, 1000), sliced(&text, 3000, 24));
}

#[test]
fn without_another_lidar_dither_changes_no_photon() {
    let plain = "background = 0.05\n[[surface]]\nposition_bins = 80\nsignal = 0.5\n";
    let dithered = format!("dither_bins = 128\n{plain}");
    assert_eq!(array(plain, 5000), array(&dithered, 5000));
}

#[test]
fn a_dithered_run_is_the_same_on_any_number_of_threads_and_its_photons_replay_to_its_events() {
    let scratch = Scratch::new();
    let text = scene(
        "columns = 4\nrows = 2\ncycles = 6000\ndither_bins = 64\nbackground = 0.02",
        "photons = 0.8\nppm = 20\n[[surface]]\nposition_bins = 70\nsignal = 0.5",
    );
    scratch.file("scene.toml", &text);
    let read = |out: &str, name| std::fs::read(scratch.path(out).join(name)).unwrap();
    let run = |threads: &str, out: &str| {
        let mut dtof = scratch.command(&format!("simulate --scene scene.toml --out {out}"));
        succeeded(dtof.env("RAYON_NUM_THREADS", threads).output().unwrap());
        ["events.csv", "events.aer", "summary.json"].map(|name| read(out, name))
    };
    let one = run("1", "a");
    assert!(one == run("2", "b") && one == run("7", "c"));
    let summary: serde_json::Value = serde_json::from_slice(&one[2]).unwrap();
    let settings = &summary["settings"];
    assert_eq!(
        [&settings["dither_bins"], &settings["dither_seed"]],
        [64, 1]
    );

    // Laser cycle by laser cycle, as a sensor records them.
    let mut photons: Vec<(u64, usize, u16)> = array(&text, 6000)
        .into_iter()
        .enumerate()
        .flat_map(|(pixel, photons)| {
            photons
                .into_iter()
                .map(move |(cycle, code)| (cycle, pixel, code))
        })
        .collect();
    photons.sort_by_key(|&(cycle, ..)| cycle);
    let rows = photons
        .iter()
        .map(|(cycle, pixel, code)| format!("{pixel},{cycle},{code}\n"));
    let recorded: String = std::iter::once("pixel,cycle,bin\n".to_owned())
        .chain(rows)
        .collect();
    scratch.file("photons.csv", recorded);
    scratch.file("empty.toml", "");
    let replay = "replay --input photons.csv --columns 4 --settings empty.toml --out replayed";
    scratch.printed(replay);
    let replayed = read("replayed", "events.csv");
    let lines = |bytes: &[u8]| String::from_utf8_lossy(bytes).lines().count();
    assert!(lines(&one[0]) > 100);
    assert!(
        one[0] == replayed,
        "{} and {} events",
        lines(&one[0]),
        lines(&replayed)
    );
}

#[test]
fn the_first_and_the_last_bin_have_as_many_of_its_photons_as_others() {
    // Its clock is so far off that its pulses come everywhere; without a pause between the histogram and the next
    // own pulse the late photons of the last bins are the first ones of the next laser cycle.
    for laser in ["laser_rate_mhz = 10", "laser_rate_mhz = 31.25"] {
        let text = format!("{laser}\nbackground = 0.0\n[other_lidar]\nphotons = 3\nppm = 3137\n");
        let cycles = 400_000;
        let photons = pixel(&text, cycles);
        let bins = histogram(&photons);
        let period = if laser.ends_with("10") { 400.0 } else { 128.0 };
        let expected = 3.0 * cycles as f64 / 1.003_137 / period;
        for bin in [0, 1, 2, 64, 125, 126, 127] {
            let off = f64::from(bins[bin]) / expected - 1.0;
            // Photons of a pulse come together: counts vary by twice Poisson's law.
            assert!(off.abs() < 0.08, "{laser}, {bin}: {off}");
        }
    }
}

#[test]
fn every_photon_of_a_pulse_near_the_end_of_a_laser_cycle_comes() {
    // A laser cycle of 128 bins has no place where photons are not seen.
    let text = "laser_rate_mhz = 31.25\nbackground = 0.0\n[other_lidar]\nphotons = 5\nppm = 900\n";
    near_count("photons", pixel(text, 20_000).len(), 100_000.0 / 1.0009);
}

#[test]
fn the_limit_of_the_photons_counts_those_of_a_faster_lidar_as_often_as_they_come() {
    let photons = |rows, ppm| {
        let text = format!(
            "background = 0.0\ncolumns = 30\nrows = {rows}\n[other_lidar]\nphotons = 10000\nppm = {ppm}"
        );
        let photons = Scene::parse(&text).and_then(|scene| scene.photons(1, 10).map(|_| ()));
        photons.map_err(|error| error.to_string())
    };
    // 6,000,000 photons a pulse, twice as often; and 14,700,000, in two of three laser cycles.
    let refused = photons(20, -500_000).unwrap_err();
    assert!(
        refused.contains("12000000 photons a laser cycle"),
        "{refused}"
    );
    assert_eq!(photons(20, 0), Ok(()));
    assert_eq!(photons(49, 500_000), Ok(()));
}

#[test]
fn a_simulation_writes_no_dither_of_its_scene_into_its_settings() {
    let scratch = Scratch::new();
    let sensor = |out: &str| {
        let text = scratch.read(&format!("{out}/dtof.toml"));
        let sensor = SettingsFile::parse(&text).unwrap().sensor;
        (sensor.dither_bins, sensor.dither_seed)
    };
    for (number, range) in [0, 64].into_iter().enumerate() {
        let surface = "[[surface]]\nposition_bins = 70\nsignal = 0.5";
        let text = scene(
            &format!("cycles = 2000\ndither_bins = {range}"),
            "photons = 0.5",
        );
        scratch.file("scene.toml", format!("{text}{surface}"));
        scratch.printed(&format!("simulate --scene scene.toml --out plain{number}"));
        assert_eq!(sensor(&format!("plain{number}")), (None, None));
        // What is asked for of a device stays, and the scene has its own.
        scratch.file("asked.toml", "[sensor]\ndither_bins = 8\ndither_seed = 9\n");
        let out = format!("asked{number}");
        scratch.printed(&format!(
            "simulate --scene scene.toml --settings asked.toml --out {out}"
        ));
        assert_eq!(sensor(&out), (Some(8), Some(9)));
        let summary = scratch.read(&format!("{out}/summary.json"));
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        let used = summary["settings"]["dither_bins"].as_u64();
        assert_eq!(used, Some(range).filter(|&range| range > 0));
    }
}

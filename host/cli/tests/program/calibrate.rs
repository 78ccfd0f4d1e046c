//! `dtof calibrate`, end to end: what it finds in a recording makes runs with a cover glass right,
//! and tells when the glass has become brighter.

use crate::common::{Scratch, assert_contains, npy};
use dtof_photons::source::PhotonSource;
use dtof_simulate::scene::Scene;

/// A wall and a smaller one before it, behind a cover glass of `glass` photons.
fn scene(background: f64, glass: f64) -> String {
    format!(
        "columns = 16\nrows = 8\ncycles = 8000\nbackground = {background}\n\
         [[surface]]\nrange_mm = 3000\nsignal = 0.5\n\
         [[surface]]\nrange_mm = 2000\nsignal = 0.5\n\
         rectangle = {{ columns = [4, 12], rows = [2, 6] }}\n\
         [cover_glass]\nsignal = {glass}\nposition_bins = 4.5\n"
    )
}

/// The histograms of a scene as NumPy writes them.
fn recording(text: &str) -> Vec<u8> {
    with_hot(text, None)
}

/// The same, so many photons more in each bin of a pixel.
fn with_hot(text: &str, hot: Option<(usize, u32)>) -> Vec<u8> {
    let scene = Scene::parse(text).unwrap();
    let mut photons = scene.photons(5, scene.cycles).unwrap();
    let mut counts = vec![0u32; 128 * 128];
    for _ in 0..32 {
        let slice = photons.next_slice(250).unwrap();
        for (pixel, photons) in slice.pixels.iter().enumerate() {
            for photon in &photons.photons {
                counts[128 * pixel + usize::from(photon.code)] += 1;
            }
        }
    }
    if let Some((pixel, photons)) = hot {
        let bins = &mut counts[128 * pixel..128 * (pixel + 1)];
        bins.iter_mut().for_each(|count| *count += photons);
    }
    let bytes: Vec<u8> = counts.into_iter().flat_map(u32::to_le_bytes).collect();
    npy("<u4", "(8, 16, 128)", &bytes)
}

#[test]
fn a_cover_glass_is_gated_and_its_dirt_is_flagged() {
    let scratch = Scratch::new();
    scratch.file("glass.npy", recording(&scene(0.02, 5.0)));
    let printed = scratch.printed(
        "calibrate --input glass.npy --recorded-cycles 8000 --target-mm 3000 --out dtof.toml",
    );
    assert_contains(&printed, "cover glass");
    let run = |name: &str, text: &str, options: &str| {
        let file = scratch.file(name, text);
        scratch.simulated(&file, options);
        scratch.summary()
    };
    let settings = "--settings dtof.toml --seed 9";
    let share_and_flags = |summary: &serde_json::Value| {
        let share = &summary["against_truth"]["false_alarm_share"];
        (share.as_f64().unwrap(), summary["cover_glass"].clone())
    };
    let clean = scene(0.02, 5.0);
    let (share, _) = share_and_flags(&run("clean.toml", &clean, "--rule window --sigma-bins 1"));
    assert!(share > 0.9, "{share}");
    let (share, flagged) = share_and_flags(&run("clean.toml", &clean, settings));
    assert!(share < 0.01 && flagged.is_null(), "{share} {flagged}");
    let (share, flagged) = share_and_flags(&run("dirty.toml", &scene(0.02, 6.5), settings));
    assert!(share < 0.01, "{share}");
    let times = flagged[0].as_f64().unwrap();
    assert!((1.25..1.35).contains(&times), "{flagged}");
    assert_contains(
        &scratch.read("out/report.html"),
        "times as bright as when it was calibrated",
    );
    // Sunlight alone is not taken for dirt.
    let (_, flagged) = share_and_flags(&run("sunny.toml", &scene(0.08, 5.0), settings));
    assert!(flagged.is_null(), "{flagged}");
    // Replay detects it, too.
    scratch.file("dirty.npy", recording(&scene(0.02, 6.5)));
    let line = "--settings dtof.toml --recorded-cycles 8000";
    let summary = scratch.replayed(&scratch.path("dirty.npy"), line);
    assert!(summary["cover_glass"][0].as_f64().unwrap() > 1.2);
    let summary = scratch.replayed(&scratch.path("glass.npy"), line);
    assert!(summary["cover_glass"].is_null());
}

/// The length is unknown, so it comes from the brightest pixel, which is the hot one.
#[test]
fn a_hot_pixel_changes_nothing_for_the_others() {
    let scratch = Scratch::new();
    let text = scene(0.02, 0.0);
    let [clean, hot] = [None, Some((5, 200_000))].map(|hot| {
        let name = format!("{}.npy", hot.is_some());
        scratch.file(&name, with_hot(&text, hot));
        scratch.printed(&format!(
            "calibrate --input {name} --glass no --out {name}.toml"
        ));
        scratch.printed(&format!(
            "replay --input {name} --settings {name}.toml --out out"
        ));
        scratch.summary()
    });
    assert_eq!(hot["settings"]["masked"], serde_json::json!([5]));
    assert!(hot["masked"].as_u64() > Some(1_000_000));
    for same in ["l1", "l2", "min_count"] {
        assert_eq!(hot["settings"][same], clean["settings"][same], "{same}");
    }
    let [clean, hot] = [clean, hot].map(|summary| summary["events"].as_f64().unwrap());
    assert!(
        clean > 1000.0 && (hot / clean - 1.0).abs() < 0.05,
        "{hot} {clean}"
    );
}

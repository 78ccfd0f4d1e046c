use dtof_light::scene::Scene;
use serde_json::Value;

use super::*;

/// The settings of `key=value` in 128 bins, and those of the summary.
fn summarised(options: &str) -> (Settings, Value) {
    let mut file = SettingsFile::default();
    for option in options.split_whitespace() {
        let (key, value) = option.split_once('=').unwrap();
        file.set(key, value).unwrap();
    }
    let settings = file.settings(128).unwrap();
    let scene = Scene::parse("[[surface]]\nrange_mm = 1000\nsignal = 1\n").unwrap();
    let source = scene.photons(1, 1).unwrap();
    let summary = Summary::new([Statistics::new(); 2], &source, 0, &settings);
    let json = serde_json::to_value(&summary).unwrap();
    (settings, json["settings"].clone())
}

/// Each row: options, and parts of the settings; those without a value are left out.
#[test]
fn settings_stand_by_their_keys_also_where_they_are_defaults() {
    for (options, parts) in [
        (
            "",
            "rule=\"paper\" estimator=\"centroid\" alpha=4.0 window z sigma_bins counter_bits=10 dead_time=0 dead_time_from",
        ),
        (
            "half_widths=1,4",
            "estimator=\"centred-window\" half_widths=[1.0,4.0]",
        ),
        ("rule=average alpha=6", "rule=\"average\" alpha=6.0"),
        (
            "rule=paper sigma_bins=1",
            "rule=\"paper\" sigma_bins=1.0 estimator=\"centred-window\"",
        ),
        (
            "rule=window sigma_bins=1",
            "rule=\"window\" window=3 sigma_bins=1.0 estimator=\"centred-window\" alpha",
        ),
        ("rule=window sigma_bins=1 window=5", "window=5"),
        ("rule=window window=5", "estimator=\"centroid\""),
        (
            "rule=window window=3 dead_time=20",
            "dead_time=20 dead_time_from=\"settings\"",
        ),
        ("dead_time=200", "dead_time=128 dead_time_from=\"settings\""),
        ("rule=window window=3 neighbours=8", "neighbours=8"),
        (
            "counter_bits=8 once_per_bin=true",
            "counter_bits=8 once_per_bin=true",
        ),
    ] {
        let (_, found) = summarised(options);
        for part in parts.split(' ') {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let text = found.get(key).map_or(String::new(), Value::to_string);
            assert_eq!(text, value, "{options}: {key}");
        }
    }
}

/// The numbers that follow from others are there, so that they need not be found again.
#[test]
fn the_summary_says_how_to_do_it_again() {
    for options in [
        "rule=window sigma_bins=0.7 false_alarm=0.003 l1=8",
        "rule=window window=4 z=3.1 l1=8",
        "sigma_bins=1.3 alpha=3.3 l1=8",
    ] {
        let (settings, found) = summarised(options);
        let mut again = format!("l1=8 rule={}", found["rule"].as_str().unwrap());
        for key in ["alpha", "window", "z", "sigma_bins"] {
            if let Some(value) = found.get(key) {
                again += &format!(" {key}={value}");
            }
        }
        assert_eq!(summarised(&again), (settings, found), "{again}");
    }
}

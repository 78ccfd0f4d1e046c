//! Settings that a page applies, and settings that are refused.

use crate::common::{Scratch, names};
use crate::view::Live;
use crate::view::device::{feed, plugged};
use crate::view::http::{Stream, post};

#[test]
fn settings_are_applied_or_refused_with_the_reason() {
    let scratch = Scratch::new();
    let out = scratch.path("out");
    let live = Live::of(feed(&plugged().name, "[detection]\nalpha = 4"), Some(&out));
    let mut page = Stream::open(live.port, 0);
    let is_alpha = |frame: &serde_json::Value, alpha: f64| {
        frame["source"]["settings"]["detection"]["alpha"].as_f64() == Some(alpha)
    };
    page.until("the first settings", |frame| is_alpha(frame, 4.0));
    let settings = "[sensor]\ngate = [8, 120]\n[detection]\nrule = \"paper\"\nalpha = 6\nl1 = 60\n";
    let answer = post(live.port, "/settings", settings);
    assert_eq!(answer.status, 200);
    assert!(answer.body.starts_with("The settings are applied."));
    let frame = page.until("new settings", |frame| is_alpha(frame, 6.0));
    assert_eq!(
        frame["source"]["settings"]["gate"],
        serde_json::json!([8, 120])
    );
    assert_eq!(frame["connection"]["state"], "live");
    page.until("events of them", |frame| {
        frame["drawn"]["events"].as_u64() > Some(0)
    });

    // Losses since the last report are told as well, which comes twice a second.
    let answer = post(
        live.port,
        "/settings",
        "[sensor]\ngate = [8, 40]\n[detection]\nalpha = 6\n",
    );
    assert_eq!(answer.status, 200, "{answer:?}");
    std::thread::sleep(std::time::Duration::from_millis(250));
    let answer = post(live.port, "/settings", settings).body;
    assert!(
        answer.starts_with("The settings are applied. Lost until then: "),
        "{answer}"
    );
    assert!(answer.contains("gated out "), "{answer}");

    // Wrong values, values that contradict each other, and values that the device refuses.
    for (text, reason) in [
        ("alpha = 4", "alpha belongs in [detection]"),
        (
            "[detection]\nalpha = 999",
            "alpha 999: must be a number from 0",
        ),
        (
            "[sensor]\nbins = 64",
            "only gate, masked, sigma_bins, dead_time",
        ),
        ("[rays]\ncalibration = \"/etc/passwd\"", "only gate, masked"),
        ("[sensor]\nmasked = [99]", "masked 99: there are 16 pixels"),
        (
            "[detection]\nestimator = \"window\"",
            "estimator window needs sigma_bins",
        ),
        (
            "[detection]\nl1 = 60\nl2 = 3",
            "the device refuses the configuration: ",
        ),
        (
            "[sensor]\ngate = [100, 90]",
            "the first bin must come before the last",
        ),
        (
            "[detection]\nrule = \"paper\"\ntracking = true",
            "tracking is for rule window",
        ),
        (
            "[detection]\nbinning = 3",
            "the device refuses the configuration: ",
        ),
    ] {
        let answer = post(live.port, "/settings", text);
        assert_eq!(answer.status, 422, "{text}: {answer:?}");
        assert!(answer.body.contains(reason), "{text}: {answer:?}");
        assert_eq!(answer.body.lines().count(), 1, "{answer:?}");
    }
    // The old settings still apply.
    let frame = page.until("events", |frame| {
        frame["drawn"]["events"].as_u64() > Some(0)
    });
    assert_eq!(frame["connection"]["state"], "live");

    for (number, name) in ["dtof.toml", "dtof-2.toml"].into_iter().enumerate() {
        let answer = post(live.port, "/save", "{}");
        assert!(answer.body.contains(name), "{answer:?}");
        assert_eq!(names(&out).len(), number + 1);
    }
    let saved = dtof_engine::settings::SettingsFile::read(&out.join("dtof.toml")).unwrap();
    assert_eq!(
        (saved.sensor.gate, saved.detection.l1),
        (Some((8, 120)), Some(60))
    );
    // Another program can start with the file.
    assert_eq!(saved.settings(128).unwrap().configuration.l1, 60);
}

#[test]
fn without_a_folder_nothing_is_written() {
    let live = Live::of(feed(&plugged().name, ""), None);
    Stream::open(live.port, 0).until("a device", |frame| frame["connection"]["state"] == "live");
    for (path, body) in [("/save", "{}"), ("/record", "{\"on\":true}")] {
        let answer = post(live.port, path, body);
        assert_eq!(answer.status, 422);
        assert_eq!(answer.body, "nothing is written: start with --out DIR\n");
    }
    let answer = post(live.port, "/play", "{\"on\":true}");
    assert_eq!(
        (answer.status, &answer.body[..]),
        (422, "a device cannot be paused\n")
    );
}

use super::*;

fn lines(settings: &Settings) -> Vec<String> {
    let rows = settings.rows().into_iter();
    rows.map(|(name, text)| format!("{name}: {text}")).collect()
}

#[test]
fn the_static_scene_has_a_row_for_each_setting() {
    assert_eq!(
        lines(&Settings::static_scene(9)),
        [
            "bins: 128 of 250 ps",
            "range offset: 0 mm",
            "range gate: none",
            "threshold: background + 8 × its square root (α), at least 5 photons",
            "depth: centroid of 3 bins",
            "decisions: every 10 laser cycles (X), in exposures longer than 100 (L1) and shorter than 2000 (L2)",
            "seed: 9",
        ]
    );
}

#[test]
fn what_is_switched_on_has_a_row_at_its_place() {
    assert_eq!(
        lines(&settings(ALL)),
        [
            "bins: 128 of 92.1 ps",
            "range offset: -179.5 mm",
            "offsets of pixels: from -78.0 to 1.5 mm, added to the range offset",
            "range gate: 12..119",
            "pixels left out: 3, 70",
            "dither: laser cycles are up to 32 bins longer or shorter, seed 9",
            "threshold: in a window of 3 bins: background + 4.5 standard deviations (z), at least 6 photons",
            "depth: centred window from −1.75 to +4 bins",
            "dead time: 20 bins after each photon, from the settings",
            "photons: those of one laser cycle in one bin count once",
            "counters: 8 bits; a full one ends an exposure",
            "tracking: half of the false alarms near the last event of a pixel",
            "echoes: up to 3 an exposure, which ends after 5 times the laser cycles of the last; ±6 bins left out",
            "decisions: every 2 laser cycles (X), in exposures longer than 8 (L1) and shorter than 1500 (L2)",
            "seed: 7",
        ]
    );
}

#[test]
fn what_frames_and_single_decisions_do_not_use_has_no_row() {
    let with = |keys| {
        lines(&settings(&format!(
            "rule = 'window'; window = 3; z = 4.5; {keys}"
        )))
    };
    assert_eq!(
        with("neighbours = 8; once_per_bin = true; counter_bits = 8; dead_time = 128; frame = 500"),
        [
            "bins: 128 of 250 ps",
            "range offset: 0 mm",
            "range gate: none",
            "frames: the highest bin of each 500 laser cycles",
            "depth: centroid of 3 bins",
            "seed: 1",
        ]
    );
    assert_eq!(
        with("tracking = true; echoes = 2; echo_wait = 5; counter_bits = 8; decide_once = true"),
        [
            "bins: 128 of 250 ps",
            "range offset: 0 mm",
            "range gate: none",
            "threshold: in a window of 3 bins: background + 4.5 standard deviations (z), at least 5 photons",
            "depth: centroid of 3 bins",
            "echoes: up to 2 an exposure; ±4 bins left out",
            "decisions: one a pixel, on all of its photons",
            "seed: 1",
        ]
    );
}

/// The rows that differ from those of other settings.
fn changed(settings: &Settings, from: &str) -> Vec<String> {
    let before = lines(&super::settings(from));
    let mut lines = lines(settings);
    lines.retain(|line| !before.contains(line));
    lines
}

#[test]
fn other_settings_have_other_rows() {
    for [keys, row] in table(
        "
        rule = 'average'; alpha = 6.3 | threshold: average of all bins + 6.3 × its square root (α), at least 5 photons
        half_widths = [2.5, 2.5]      | depth: centred window of ±2.5 bins
        binning = 1                   | adaptive binning: blocks of up to 2x2 pixels that have been silent for 64 laser cycles
        binning = 3; patience = 32    | adaptive binning: blocks of up to 8x8 pixels that have been silent for 32 laser cycles
        echoes = 4                    | echoes: up to 4 an exposure; ±4 bins left out
        dead_time = 128               | dead time: all bins after the first photon of a laser cycle, from the settings
        ",
    ) {
        assert_eq!(changed(&settings(keys), ""), [row], "{keys}");
    }
    let blind = SettingsFile {
        dead_time_of_sensor: Some(128),
        ..SettingsFile::default()
    };
    let row =
        "dead time: all bins after the first photon of a laser cycle, from the sensor or scene";
    assert_eq!(changed(&blind.settings(128).unwrap(), ""), [row]);
    let window = "rule = 'window'; window = 3";
    let confirmed = settings(&format!("{window}; neighbours = 4"));
    let row = "neighbours: 4 confirm; half of the false alarms of z for a pixel alone, half with neighbours";
    assert_eq!(changed(&confirmed, window), [row]);
}

#[test]
fn no_more_than_24_pixels_are_listed() {
    let listed = |pixels: u16| {
        let pixels: Vec<String> = (0..pixels).map(|pixel| pixel.to_string()).collect();
        pixels.join(", ")
    };
    for (pixels, more) in [(24, ""), (25, " and 1 more"), (40, " and 16 more")] {
        let settings = settings(&format!("masked = [{}]", listed(pixels)));
        let row = format!("pixels left out: {}{more}", listed(24));
        assert_eq!(changed(&settings, ""), [row]);
    }
}

#[test]
fn a_report_has_the_words_of_its_kind_of_sensor() {
    let (events, readings) = (["event", "events"], ["reading", "readings"]);
    for (keys, title, reports, first, longest) in [
        ("", "Asynchronous depth events", events, 44, 1500),
        (
            "frame = 500",
            "Frames, as a frame-based sensor reads them",
            readings,
            500,
            1500,
        ),
        (
            "decide_once = true",
            "Depth, decided once on all photons",
            events,
            1,
            u16::MAX,
        ),
    ] {
        let settings = settings(&format!("l2 = 1500; {keys}"));
        assert_eq!(settings.title(), title);
        assert_eq!(settings.reports(), reports);
        assert_eq!(settings.first_decision(), first, "{title}");
        assert_eq!(settings.longest_exposure(), longest, "{title}");
    }
}

#[test]
fn the_first_decision_is_at_the_first_look_after_l1() {
    for x in 1..=20 {
        for l1 in x..=60 {
            let settings = Settings::static_scene(0).configured(|array| {
                array.x = x;
                array.l1 = l1;
            });
            let mut looks = (1..).map(|look| look * u64::from(x));
            let first = looks.find(|&cycle| cycle > u64::from(l1));
            assert_eq!(Some(settings.first_decision()), first, "{x} {l1}");
        }
    }
}

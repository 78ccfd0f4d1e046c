use dtof_core::fixed::types::I24F8;
use dtof_core::rule::z_for_levels;
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, DepthEstimator, EchoNumber, Neighbours,
    PaperRule, RangeGate,
};
use dtof_link::{Configuration, Source};
use proptest::prelude::*;
use proptest::sample::subsequence;

use super::*;
use crate::settings::AdaptiveBinning;

fn paper(alpha: &str) -> AnyRule {
    PaperRule::new(alpha.parse().unwrap(), Count::saturating(5)).into()
}

#[test]
fn everything_has_a_default() {
    let defaults = Settings::static_scene(1).with_bins(64).configured(|array| {
        array.rule = paper("4");
        array.l1 = 40;
        array.l2 = 2000;
        array.x = 4;
    });
    assert_eq!(SettingsFile::default().settings(64).unwrap(), defaults);
}

#[test]
fn every_key_is_a_setting() {
    let sides = CentredWindow::with_sides("1.75".parse().unwrap(), "4".parse().unwrap());
    let expected = Settings {
        configuration: Configuration {
            rule: window_rule(6).into(),
            estimator: DepthEstimator::CentredWindow(sides.unwrap()),
            x: 2,
            l1: 8,
            l2: 1500,
            gate: (12, 119),
            dead_time: Some(20),
            once_per_bin: true,
            dither_bins: 64,
            dither_seed: 9,
            pixels: 0,
            columns: 0,
            binning: None,
            neighbours: None,
            tracking: true,
            echoes: EchoNumber::new(3).unwrap(),
            echo_guard_bins: 6,
            echo_wait: 5,
            bin_width_ps: "92.1".parse().unwrap(),
            offset_mm: I24F8::lit("-179.5"),
            source: Source::Link,
            dynamic_depth: None,
            host_timeout_ms: 3000,
        },
        bins: 128,
        offsets_mm: vec![I24F8::lit("1.5"), I24F8::lit("-78.04"), I24F8::ZERO],
        masked: vec![3, 70],
        sigma_bins: Some("1.3".parse().unwrap()),
        is_dead_time_of_sensor: false,
        counter_bits: 8,
        frame: None,
        decide_once: false,
        seed: 7,
    };
    assert_eq!(settings(ALL), expected);

    let blocks = |levels, patience| {
        let levels = BlockLevel::new(levels).unwrap();
        Some(AdaptiveBinning { levels, patience })
    };
    assert_eq!(settings("binning = 0").configuration.binning, None);
    assert_eq!(settings("binning = 1").configuration.binning, blocks(1, 64));
    let blocks_of_64 = settings("binning = 3; patience = 9").configuration.binning;
    assert_eq!(blocks_of_64, blocks(3, 9));
    for (number, expected) in [
        (0, None),
        (4, Some(Neighbours::Four)),
        (8, Some(Neighbours::Eight)),
    ] {
        let keys = format!("rule = 'window'; window = 3; neighbours = {number}");
        assert_eq!(settings(&keys).configuration.neighbours, expected);
    }
    assert_eq!(settings("frame = 500").frame, Some(500));
    assert!(settings("decide_once = true").decide_once);
    let centroid = settings("sigma_bins = 1; estimator = 'centroid'").configuration;
    assert_eq!(centroid.estimator, DepthEstimator::Centroid3);
}

#[test]
fn a_rule_has_the_numbers_asked_for_or_those_that_suit_the_pulse() {
    let window = |width| {
        let rule = WindowRule::new(width, "4.5".parse().unwrap(), Count::saturating(5));
        AnyRule::from(rule.unwrap())
    };
    let average = AverageRule::new("6.3".parse().unwrap(), Count::saturating(9)).into();
    for (keys, rule) in [
        ("rule = 'paper'; alpha = 8", paper("8")),
        ("rule = 'average'; alpha = 6.3; min_count = 9", average),
        // What is off is for every rule.
        ("neighbours = 0; tracking = false", paper("4")),
        ("rule = 'window'; z = 4.5; window = 3", window(3)),
        ("rule = 'window'; z = 4.5; sigma_bins = 0.5", window(2)),
        ("rule = 'window'; z = 4.5; sigma_bins = 1.5", window(5)),
        (
            "rule = 'window'; z = 4.5; sigma_bins = 1; window = 4",
            window(4),
        ),
    ] {
        assert_eq!(settings(keys).configuration.rule, rule, "{keys}");
    }
}

#[test]
fn z_has_the_false_alarms_asked_for_in_the_bins_of_the_gate() {
    let z_of = |bins, keys: &str| {
        let settings = file(&format!("rule = 'window'; window = 3; {keys}")).settings(bins);
        match settings.unwrap().configuration.rule {
            AnyRule::Window(rule) => rule.z(),
            _ => panic!("another rule"),
        }
    };
    let looks = (4, 40, 2000);
    // A single look.
    let once = (1, 0, 2);
    for (bins, keys, one_in, gate, (x, l1, l2), level) in [
        (128, "", 100, (0, 127), looks, 0),
        (8, "", 100, (0, 7), looks, 0),
        (1024, "", 100, (0, 1023), looks, 0),
        (128, "false_alarm = 1e-3", 1000, (0, 127), looks, 0),
        // A share that is not one in a whole number is rounded to the next rarer one.
        (128, "false_alarm = 0.03", 34, (0, 127), looks, 0),
        (128, "binning = 2", 100, (0, 127), looks, 2),
        (128, "gate = [20, 119]", 100, (20, 119), looks, 0),
        (
            128,
            "l1 = 8; x = 2; l2 = 900",
            100,
            (0, 127),
            (2, 8, 900),
            0,
        ),
        (128, "decide_once = true", 100, (0, 127), once, 0),
    ] {
        let (gate, level) = (
            RangeGate::<1024>::new(gate.0, gate.1),
            BlockLevel::new(level),
        );
        let z = z_for_levels(one_in, &gate.unwrap(), x, l1, l2, level.unwrap());
        assert_eq!(z_of(bins, keys), z, "{keys}");
    }
    // One in 100 of 128 bins: the normal distribution's for one in 12,800.
    let z = z_of(128, "decide_once = true").to_num::<f64>();
    assert!((z - 3.78).abs() < 0.02, "{z}");
}

#[test]
fn settings_that_contradict_each_other_are_refused_in_one_line() {
    for [keys, line] in table(
        "
        window = 3                               | window is for rule window
        z = 4                                    | z is for rule window
        false_alarm = 0.02                       | false_alarm is for rule window
        rule = 'average'; neighbours = 4         | neighbours is for rule window
        rule = 'paper'; tracking = true          | tracking is for rule window
        rule = 'window'; window = 3; alpha = 4   | alpha is for rule paper or average; rule window takes z or false_alarm
        rule = 'window'                          | rule window needs window or sigma_bins
        rule = 'window'; window = 3; false_alarm = 1e-9 | false_alarm 0.000000001: there is no z for so few; z may be up to 15.9998
        rule = 'window'; window = 3; gate = [0, 6] | gate 0..6: with 128 bins: the range gate leaves fewer than 8 bins
        patience = 8                             | patience is for binning
        rule = 'window'; window = 3; neighbours = 8; binning = 1 | neighbours cannot be used with binning
        rule = 'window'; window = 3; neighbours = 8; dead_time = 1 | neighbours cannot be used with a dead time; dead_time 0 leaves it out
        echo_wait = 8                            | echo_wait is for echoes of 2 or more
        estimator = 'window'                     | estimator window needs sigma_bins or half_widths
        estimator = 'centroid'; half_widths = [2, 3] | half_widths is for estimator window
        counter_bits = 8; min_count = 256        | min_count is more than counters of 8 bits hold
        counter_bits = 8; min_count = 766; rule = 'window'; window = 3 | min_count is more than counters of 8 bits hold
        decide_once = true; frame = 9            | decide_once cannot be used with frame
        dead_time = 127                          | dead_time 127: is for rule window, unless it is 128 bins or more
        dead_time = 1; rule = 'average'          | dead_time 1: is for rule window, unless it is 128 bins or more
        dead_time = 20; rule = 'window'; window = 3; binning = 1 | dead_time 20: cannot be used with binning, unless it is 128 bins or more
        dead_time = 20; rule = 'window'; window = 3; frame = 9 | dead_time 20: cannot be used with frame, unless it is 128 bins or more
        ",
    ) {
        let file = file(keys);
        let config = file.settings(128).and_then(|settings| settings.config::<128>());
        assert_eq!(config.unwrap_err().to_string(), line, "{keys}");
    }
    // A frame does not use these: a file with another rule is refused nevertheless.
    for keys in ["neighbours = 4", "tracking = true"] {
        let file = file(&format!("rule = 'average'; {keys}; frame = 9"));
        let error = file.settings(128).unwrap_err();
        let (key, _) = keys.split_once(' ').unwrap();
        assert_eq!(error.to_string(), format!("{key} is for rule window"));
    }
    let both = file("rule = 'window'; window = 3; neighbours = 8; binning = 1; frame = 9");
    let error = both.settings(128).unwrap_err();
    assert_eq!(error.to_string(), "neighbours cannot be used with binning");
    // What these are taken with.
    for [keys] in table(
        "
        min_count = 256
        counter_bits = 8; min_count = 255
        counter_bits = 8; min_count = 765; rule = 'window'; window = 3
        counter_bits = 8; min_count = 256; frame = 9
        estimator = 'window'; half_widths = [2, 3]
        estimator = 'window'; sigma_bins = 1
        rule = 'window'; window = 3; neighbours = 8; dead_time = 0
        rule = 'window'; window = 3; neighbours = 8; dead_time = 128; frame = 9
        ",
    ) {
        settings(keys);
    }
}

#[test]
fn neighbours_need_a_sensor_without_a_dead_time() {
    let mut blind = file("rule = 'window'; window = 3; neighbours = 8");
    blind.dead_time_of_sensor = Some(20);
    let line = "neighbours cannot be used with a dead time; dead_time 0 leaves it out";
    let config = blind.settings(128).unwrap().config::<128>();
    assert_eq!(config.unwrap_err().to_string(), line);
}

/// A file is told what a device would refuse, and a dead time of the sensor is taken where a device takes it.
#[test]
fn a_dead_time_is_used_as_a_device_uses_it() {
    for rule in ["paper", "average", "window"] {
        for binning in [0, 1] {
            for dead_time in [0, 1, 127, 128, 500] {
                let text = format!("rule = '{rule}'; binning = {binning}");
                let text = match rule {
                    "window" => text + "; window = 3",
                    _ => text,
                };
                let mut of_sensor = file(&text);
                of_sensor.dead_time_of_sensor = Some(dead_time);
                let settings = of_sensor.settings(128).unwrap();
                let asked = Configuration {
                    dead_time: None,
                    source: Source::Sensor,
                    ..settings.configuration
                };
                let in_force = asked.dead_time_in_force(dead_time.min(128), 128).unwrap();
                assert_eq!(settings.dead_time(), in_force, "{text}, {dead_time}");
                let given = Configuration {
                    dead_time: Some(dead_time.min(128)),
                    ..asked
                };
                let given = given.dead_time_in_force(0, 128).is_ok();
                let taken = file(&format!("{text}; dead_time = {dead_time}")).settings(128);
                assert_eq!(taken.is_ok(), given, "{text}, {dead_time}");
            }
        }
    }
}

#[test]
fn only_pixels_with_the_window_rule_weigh_a_short_dead_time() {
    for [keys, obstacle] in table(
        "
                                    | is for `rule` window
        rule = 'average'            | is for `rule` window
        rule = 'window'             | none
        rule = 'window'; binning = 0 | none
        rule = 'window'; binning = 1 | cannot be used with `binning`
        rule = 'window'; frame = 9  | cannot be used with `frame`
        ",
    ) {
        let found = file(keys).dead_time_obstacle();
        assert_eq!(found.unwrap_or("none"), obstacle, "{keys}");
    }
}

/// One that is written gives the same.
#[test]
fn a_dead_time_is_that_of_the_settings_or_of_the_sensor() {
    for (keys, of_sensor, dead_time, from_sensor) in [
        ("rule = 'window'; window = 3", None, 0, false),
        (
            "rule = 'window'; window = 3; dead_time = 20",
            None,
            20,
            false,
        ),
        (
            "rule = 'window'; window = 3; dead_time = 20",
            Some(7),
            20,
            false,
        ),
        (
            "rule = 'window'; window = 3; dead_time = 0",
            Some(7),
            0,
            false,
        ),
        ("rule = 'window'; window = 3", Some(7), 7, true),
        // All bins, as many as there are.
        ("rule = 'window'; window = 3", Some(u16::MAX), 128, true),
        ("dead_time = 500", None, 128, false),
        ("binning = 1", Some(128), 128, true),
        // One of the sensor that cannot be used is not.
        ("", Some(127), 0, false),
        (
            "rule = 'window'; window = 3; binning = 1",
            Some(7),
            0,
            false,
        ),
        ("rule = 'window'; window = 3; frame = 9", Some(7), 0, false),
    ] {
        let mut file = file(keys);
        file.dead_time_of_sensor = of_sensor;
        let settings = file.settings(128).unwrap();
        let found = (settings.dead_time(), settings.is_dead_time_of_sensor);
        assert_eq!(found, (dead_time, from_sensor), "{keys} {of_sensor:?}");
        let written = file.with_settings(&settings).to_toml().unwrap();
        let mut again = SettingsFile::parse(&written).unwrap();
        again.dead_time_of_sensor = of_sensor;
        assert_eq!(
            again.settings(128).unwrap().dead_time(),
            dead_time,
            "{keys}"
        );
    }
}

#[test]
fn the_dither_of_a_laser_is_used_and_only_what_was_asked_for_is_written() {
    for (keys, of_laser, used) in [
        ("", None, (0, 0)),
        ("", Some((128, 77)), (128, 77)),
        ("dither_bins = 64", None, (64, 0)),
        ("dither_bins = 64; dither_seed = 9", None, (64, 9)),
        // Those of a scene are not the ones of the file.
        ("dither_bins = 64; dither_seed = 9", Some((0, 1)), (0, 1)),
    ] {
        let mut options = file(keys);
        options.dither_of_laser = of_laser;
        let file = options.or(SettingsFile {
            dither_of_laser: Some((2, 2)).filter(|_| of_laser.is_some()),
            ..SettingsFile::default()
        });
        let settings = file.settings(128).unwrap();
        assert_eq!(
            (
                settings.configuration.dither_bins,
                settings.configuration.dither_seed
            ),
            used,
            "{keys}"
        );
        let written = file.with_settings(&settings);
        assert_eq!(written.dither_of_laser, of_laser);
        assert_eq!(written.settings(128).unwrap(), settings);
        let written = written.to_toml().unwrap();
        for key in ["dither_bins", "dither_seed"] {
            assert_eq!(written.contains(key), keys.contains(key), "{written}");
        }
    }
}

/// What is written of the defaults.
const DETECTION: &str = "rule = 'paper'; alpha = 4; min_count = 5; l1 = 40; l2 = 2000; x = 4";

#[test]
fn a_file_has_what_decisions_need_and_the_rest_of_the_one_before() {
    // The settings replace all of theirs.
    let defaults = SettingsFile::default().settings(64).unwrap();
    let before = file(&format!(
        "{ALL}; frame = 9; decide_once = true; columns = 2"
    ));
    let of_sensor = "bins = 64; bin_width_ps = 250; offset_mm = 0; columns = 2; dither_bins = 64; dither_seed = 9";
    let expected = file(&format!("{of_sensor}; {DETECTION}; seed = 1"));
    assert_eq!(before.with_settings(&defaults), expected);
    // The dither is that of a laser.
    let expected = ALL.replace("dither_bins = 64; dither_seed = 9", "bins = 128");
    let written = SettingsFile::default().with_settings(&settings(ALL));
    assert_eq!(written, file(&expected));
    // The rest stays.
    let rest = "field_of_view_degrees = [60, 40]; cycles = 9; rebin = 2";
    let written = file(rest).with_settings(&settings("frame = 500; seed = 3"));
    let of_sensor = "bins = 128; bin_width_ps = 250; offset_mm = 0";
    let expected = format!("{of_sensor}; {DETECTION}; {rest}; frame = 500; seed = 3");
    assert_eq!(written, file(&expected));
}

#[test]
fn a_choice_is_written_if_it_is_not_the_default() {
    for [keys, written] in table(
        "
        binning = 0; neighbours = 0; tracking = false; echoes = 1; counter_bits = 10 |
        binning = 2                            | binning = 2; patience = 64
        echoes = 2                             | echoes = 2
        half_widths = [1, 4]                   | half_widths = [1, 4]; estimator = 'window'
        sigma_bins = 1                         |
        sigma_bins = 1; estimator = 'window'   |
        sigma_bins = 1; estimator = 'centroid' | estimator = 'centroid'
        ",
    ) {
        let again = SettingsFile::default().with_settings(&settings(keys));
        let expected = file(&format!("{DETECTION}; {written}"));
        assert_eq!(again.detection, expected.detection, "{keys}");
    }
    for (of_rule, keys) in [
        ("rule = 'average'; alpha = 6.3; min_count = 9", ""),
        (
            "rule = 'window'; window = 3; z = 4.5; min_count = 5",
            "neighbours = 8",
        ),
    ] {
        let again = SettingsFile::default().with_settings(&settings(&format!("{of_rule}; {keys}")));
        let expected = file(&format!("{of_rule}; {keys}; l1 = 40; l2 = 2000; x = 4"));
        assert_eq!(again.detection, expected.detection, "{of_rule}");
    }
}

const CHOICES: [&str; 25] = [
    "rule = 'average'; alpha = 6.3",
    "rule = 'window'; window = 3; z = 4.5",
    "rule = 'window'; window = 5; false_alarm = 0.003",
    "neighbours = 8",
    "tracking = true",
    "half_widths = [1, 3.3]",
    "estimator = 'window'",
    "estimator = 'centroid'",
    "min_count = 9",
    "l1 = 16",
    "l2 = 900",
    "x = 2",
    "binning = 2; patience = 9",
    "echoes = 2",
    "once_per_bin = true",
    "counter_bits = 8",
    "bin_width_ps = 92.1",
    "offset_mm = -7.3",
    "offsets_mm = [1.1, 2.2]; masked = [1]",
    "gate = [9, 100]",
    "sigma_bins = 0.7",
    "dead_time = 20",
    "dither_bins = 64; dither_seed = 3",
    "frame = 100",
    "decide_once = true",
];

proptest! {
    /// So that a run can be repeated from its folder.
    #[test]
    fn what_is_written_gives_the_same_settings(chosen in subsequence(&CHOICES[..], 0..=7)) {
        let settings_of = |text: &str| {
            let file = SettingsFile::parse(text)?;
            anyhow::Ok((file.settings(128)?, file))
        };
        let made = settings_of(&toml(&chosen.join("; ")));
        prop_assume!(made.is_ok());
        let (settings, file) = made.unwrap();
        let written = file.with_settings(&settings).to_toml().unwrap();
        prop_assert_eq!(settings_of(&written).unwrap().0, settings);
    }
}

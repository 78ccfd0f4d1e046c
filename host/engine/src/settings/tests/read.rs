use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use dtof_core::Array;
use dtof_data::options::{flag, line};

use super::*;
use crate::settings::{MARK, RaySettings, SensorSettings};

/// Keys with a value as an option has it, and as it is written.
const VALUES: &str = r#"
    laser_hz              | 1e7               | 10000000
    columns               | 16                | 16
    bins                  | 128               | 128
    bin_width_ps          | 92.1              | 92.1
    offset_mm             | -179.5            | -179.5
    offsets_mm            | 1.5,-78           | [1.5, -78.0]
    gate                  | 20..119           | [20, 119]
    gate                  | 20,119            | [20, 119]
    gate                  | 20..20            | [20, 20]
    masked                | 3,70              | [3, 70]
    sigma_bins            | 0.8               | 0.8
    sigma_bins            | 1.75              | 1.75
    dead_time             | 20                | 20
    one_hit_tdc           | true              | 65535
    dither_bins           | 254               | 254
    dither_seed           | 9                 | 9
    background            | 0.05              | 0.05
    glass                 | 1e6               | 1000000.0
    glass_bins            | 0,0.25            | [0.0, 0.25]
    rule                  | window            | "window"
    rule                  | average           | "average"
    alpha                 | 6.3               | 6.3
    window                | 7                 | 7
    z                     | 4.45              | 4.45
    false_alarm           | 0.1               | 0.1
    estimator             | centroid          | "centroid"
    half_widths           | 1,3.5             | [1.0, 3.5]
    min_count             | 1023              | 1023
    l1                    | 0                 | 0
    l2                    | 65535             | 65535
    x                     | 4                 | 4
    binning               | 3                 | 3
    patience              | 64                | 64
    neighbours            | 0                 | 0
    neighbours            | 4                 | 4
    neighbours            | 8                 | 8
    tracking              | true              | true
    tracking              | false             | false
    echoes                | 4                 | 4
    echo_wait             | 254               | 254
    once_per_bin          | true              | true
    counter_bits          | 8                 | 8
    counter_bits          | 10                | 10
    field_of_view_degrees | 60x32.2           | [60.0, 32.2]
    calibration           | rays.toml         | "rays.toml"
    cycles                | 1e4               | 10000
    seed                  | 7                 | 7
    photons_per_cycle     | 0.5               | 0.5
    recorded_cycles       | 9                 | 9
    frame                 | 500               | 500
    decide_once           | true              | true
    axes                  | rows,columns,bins | "rows,columns,bins"
    array                 | counts            | "counts"
    capture               | 0                 | 0
    rebin                 | 512               | 512
"#;

#[test]
fn every_key_takes_an_option_and_is_written_as_toml() {
    let mut tried = BTreeSet::new();
    for [key, text, written] in table(VALUES) {
        let mut file = SettingsFile::default();
        file.set(key, text).unwrap();
        let toml = file.to_toml().unwrap();
        let key = if key == ONE_HIT { "dead_time" } else { key };
        let (section, comment) = section_of(key);
        let [header, line] = [format!("[{section}]"), format!("{key} = {written}")];
        let expected = format!("{MARK}: {HINT}\n\n{header}\n{line:<28} # {comment}\n");
        assert_eq!(toml, expected);
        assert_eq!(SettingsFile::parse(&toml).unwrap(), file, "{key} {text}");
        assert_eq!(file.keys().unwrap(), [key.to_owned()].into());
        tried.insert(key);
    }
    let keys = SECTIONS.iter().flat_map(|(_, keys)| keys.iter());
    assert_eq!(tried, keys.map(|key| key.name).collect());
}

/// A key of older files: a TDC of the first photon of a laser cycle.
const ONE_HIT: &str = "one_hit_tdc";
const HINT: &str = "`--settings FILE` takes them, options override them.";

/// The section of a key, and its comment.
fn section_of(key: &str) -> (&'static str, &'static str) {
    let (section, key) = key_of(key).unwrap();
    (section, key.comment)
}

#[test]
fn keys_are_written_by_section_in_one_order() {
    let file = file("seed = 3; l1 = 8; rule = 'paper'; gate = [9, 100]; bins = 128");
    let expected = "\
[sensor]
bins = 128                   # of a histogram
gate = [9, 100]              # first and last bin that may hold a peak

[detection]
rule = \"paper\"               # paper, average or window
l1 = 8                       # laser cycles that a decision must exceed

[run]
seed = 3                     # of every random number
";
    let expected = format!("{MARK}: {HINT}\n\n{expected}");
    assert_eq!(file.to_toml().unwrap(), expected);
    let empty = SettingsFile::default().to_toml().unwrap();
    assert_eq!(empty, format!("{MARK}: {HINT}\n"));
}

#[test]
fn a_value_that_cannot_be_is_refused_with_what_it_must_be() {
    // Several values of a key stand side by side.
    for [key, texts, reason] in table(
        "
        bins          | 0 4 100 2048 x   | must be a power of two from 8 to 1024
        gate          | 20 20..x ..20 2..3..4 | must be FIRST..LAST, as 20..119; in a file [20, 119]
        gate          | 119..20          | the first bin must come before the last
        masked        | -1 65536 x       | must be a whole number from 0 to 65535
        masked        | 1,70000,3        | 70000 must be a whole number from 0 to 65535
        offsets_mm    | 8388608 x        | must be a number from -8388608 to 8388607.996
        sigma_bins    | 0 -1 nan x       | must be a number above 0, at most 1.75
        sigma_bins    | 1.751 2 1e9      | must be a number above 0, at most 1.75; `rebin` 2 halves the pulse in bins, as does a TDC with wider bins
        sigma_bins    | 0.001            | is less than half of 0.004, the smallest step
        dither_bins   | 63               | the range of the dither must be an even number of bins, at most 254
        dither_bins   | 256 -2           | must be a whole number from 0 to 254
        background    | -0.1 1000001 x   | must be a number from 0 to 1000000
        glass_bins    | -0.1             | must be a number from 0 to 1000000
        one_hit_tdc   | 1 yes            | must be true or false
        rule          | best             | must be paper, average or window
        z             | -1 16 x          | must be a number from 0 to 15.9998
        false_alarm   | 0 -0.1 0.11 x    | must be a number above 0, at most 0.1
        estimator     | mean             | must be centroid or window
        half_widths   | 2 2,4.01 4.01,2 0.99,4 4,0.99 2,3,4 x,2 | must be BEFORE,AFTER, each 1 to 4 bins, as 2,3.5; in a file [2, 3.5]
        neighbours    | 1 5 9 -4 x       | must be 0, 4 or 8
        counter_bits  | 0 9 16 x         | must be 8 or 10
        field_of_view_degrees | 60 0x40 60x180 x | must be HORIZONTALxVERTICAL in degrees, as 60x32.2, each from 0.01 to 179; in a file [60, 32.2]
        photons_per_cycle | 0 -1 inf     | must be a number above 0
        axes          | rows             | one axis must be the bins
        l_1           | 4                | is not an option here
        ",
    ) {
        for text in texts.split(' ') {
            let error = SettingsFile::default().set(key, text);
            assert_eq!(error, Err(reason.to_owned()), "{key} {text}");
        }
    }
}

#[test]
fn every_key_of_a_whole_number_says_its_range() {
    for [key, _, written] in table(VALUES) {
        if written.parse::<u64>().is_ok() && key != ONE_HIT {
            let error = SettingsFile::default().set(key, "3.5").unwrap_err();
            assert!(error.starts_with("must be "), "{key} {error}");
            assert!(
                error.contains(" from ") || error.contains(" or "),
                "{key} {error}"
            );
        }
    }
}

#[test]
fn a_toml_value_is_one_value_a_list_or_in_quotes_as_its_key_needs() {
    for [keys, line] in table(
        "
        l1 = []            | l1 : must be one value
        bins = [8]         | bins 8: must be one value
        gate = 3           | gate 3: must be a list
        gate = []          | gate : must be FIRST..LAST, as 20..119; in a file [20, 119]
        gate = [3]         | gate 3: must be FIRST..LAST, as 20..119; in a file [20, 119]
        gate = [[3], [9]]  | gate [3],[9]: must be FIRST..LAST, as 20..119; in a file [20, 119]
        masked = 3         | masked 3: must be a list
        offsets_mm = 1     | offsets_mm 1: must be a list
        masked = ['']      | masked : must be a whole number from 0 to 65535
        masked = ['3']     | masked 3: must not be in quotes
        l1 = '40'          | l1 40: must not be in quotes
        bins = 'x'         | bins x: must be a power of two from 8 to 1024
        alpha = nan        | alpha NaN: must be a number from 0 to 255.996
        glass = -1.0       | glass -1: must be a number from 0 to 1000000
        rule = true        | rule true: must be paper, average or window
        array = 5          | array 5: must be in quotes
        array = ''         | array needs a value
        calibration = ''   | calibration needs a value
        ",
    ) {
        let error = SettingsFile::parse(&toml(keys)).unwrap_err();
        assert_eq!(error.to_string(), line);
    }
    // An empty list of these sets nothing.
    let empty = file("masked = []; glass_bins = []; offsets_mm = []");
    assert_eq!(empty, SettingsFile::default());
}

#[test]
fn keys_that_exclude_each_other_are_refused() {
    let exclude = |keys: &str| SettingsFile::parse(&toml(keys)).unwrap_err().to_string();
    for [keys, line] in table(
        "
        z = 4; false_alarm = 0.01 | z cannot be used with false_alarm
        field_of_view_degrees = [60, 40]; calibration = 'rays.toml' | field_of_view_degrees cannot be used with calibration
        recorded_cycles = 9; photons_per_cycle = 1 | photons_per_cycle cannot be used with recorded_cycles
        ",
    ) {
        assert_eq!(exclude(keys), line);
    }
}

#[test]
fn a_key_of_older_files_is_a_dead_time_of_all_bins() {
    let parse = |keys| SettingsFile::parse(&format!("[sensor]\n{keys}"));
    for (value, dead_time) in [("true", Some(u16::MAX)), ("false", None)] {
        let old = parse(format!("{ONE_HIT} = {value}")).unwrap();
        assert_eq!(old.sensor.dead_time, dead_time);
    }
    let both = parse(format!("{ONE_HIT} = true\ndead_time = 20")).unwrap_err();
    assert_eq!(
        both.to_string(),
        "one_hit_tdc cannot be used with dead_time"
    );
}

/// The names of other keys are those of the file as well, whether it has them or not.
#[test]
fn an_error_in_a_file_names_it_and_the_key_or_the_line() {
    for (text, expected) in [
        (
            "[detection]\nwindow = 9",
            "window 9: must be a whole number from 1 to 7",
        ),
        (
            "[run]\nrecorded_cycles = 9\nphotons_per_cycle = 1",
            "photons_per_cycle cannot be used with recorded_cycles",
        ),
        (
            "[detection]\nalfa = 4",
            "alfa is unknown in [detection]; is it alpha?",
        ),
        (
            "[detections]\nl1 = 4",
            "detections is unknown; is it detection?",
        ),
        ("l1 = 4", "l1 belongs in [detection]"),
        (
            "[detection]\none_hit_tdc = true",
            "one_hit_tdc belongs in [sensor]",
        ),
        ("sensor = 4", "sensor is a section: [sensor]"),
        ("[sensor", "line 1: "),
        ("[sensor]\nbins = 8\n\nbins = 8", "line 4: "),
    ] {
        let error = SettingsFile::parse_as(Path::new("my.toml"), text).unwrap_err();
        let error = line(&error, &flag);
        let found = error.strip_prefix("my.toml: ").unwrap();
        match expected.ends_with(": ") {
            true => assert!(
                found.starts_with(expected) && !found.contains('\n'),
                "{found}"
            ),
            false => assert_eq!(found, expected),
        }
    }
}

#[test]
fn the_offsets_of_pixels_are_millimetres() {
    let none = SensorSettings::default().pixel_offsets_mm();
    assert!(none.is_empty());
    let two = file("offsets_mm = [1.5, -78]").sensor;
    assert_eq!(two.pixel_offsets_mm(), [1.5, -78.0]);
}

#[test]
fn settings_are_for_the_bins_of_a_device() {
    for keys in ["", "bins = 128"] {
        assert!(file(keys).check_bins(128).is_ok());
    }
    let error = file("bins = 64").check_bins(128).unwrap_err();
    let line = "the settings are for 64 bins, the device has 128";
    assert_eq!(error.to_string(), line);
}

/// Whether there are two numbers, and those.
fn are_near(values: &[f64], expected: [f64; 2]) -> bool {
    let mut pairs = values.iter().zip(expected);
    values.len() == 2 && pairs.all(|(value, expected)| (value - expected).abs() < 1e-9)
}

/// The slant of a ray is 1 / z of its unit vector.
#[test]
fn pixels_look_where_the_field_of_view_says() {
    let array = Array::new(2, 1).unwrap();
    let none = RaySettings::default();
    assert_eq!(none.slants(array).unwrap(), None);
    // Square pixels: 2·atan(tan(30°) / 2) across the shorter side.
    assert_eq!(none.rays(array).unwrap().1, "60x32.2 degrees");
    let view = file("field_of_view_degrees = [90, 40]").rays;
    assert_eq!(view.rays(array).unwrap().1, "90x40 degrees");
    let [slants, biases] = view.slants(array).unwrap().unwrap();
    // The middle of a pixel is half as far to the side as tan(45°).
    assert!(are_near(&slants, [1.25_f64.sqrt(); 2]), "{slants:?}");
    assert_eq!(biases, [0.0; 2]);
}

/// A relative path starts at the folder of the file.
#[test]
fn a_file_names_another_with_the_rays() {
    let array = Array::new(2, 1).unwrap();
    let folder = std::env::temp_dir().join(format!("dtof-engine-{}", std::process::id()));
    let [path, rays, none] = ["dtof.toml", "rays.toml", "none.toml"].map(|name| folder.join(name));
    let pixels = "columns = 2\nrows = 1\npixels = [[0.0, 0.0, 1.0, -5.0], [3.0, 0.0, 4.0, 12.5]]";
    fs::create_dir_all(&folder).unwrap();
    fs::write(&rays, pixels).unwrap();
    fs::write(&path, toml("calibration = 'rays.toml'")).unwrap();
    let [read, missing] = [&path, &none].map(|path| SettingsFile::read(path));
    let read = read.map(|file| file.rays);
    let slants = read.as_ref().map(|rays| rays.slants(array));
    let source = read.as_ref().map(|rays| rays.rays(array));
    fs::remove_dir_all(&folder).unwrap();

    let [slants, biases] = slants.unwrap().unwrap().unwrap();
    // Straight ahead, and 5 / 4.
    assert!(are_near(&slants, [1.0, 1.25]), "{slants:?}");
    assert_eq!(biases, [-5.0, 12.5]);
    assert_eq!(source.unwrap().unwrap().1, rays.display().to_string());
    assert_eq!(read.unwrap().calibration, Some(rays));
    let missing = missing.unwrap_err().to_string();
    assert!(missing.contains("none.toml"), "{missing}");
}

use std::path::Path;

use dtof_data::options::{flag, line};

use super::*;

#[test]
fn an_option_replaces_what_it_excludes_in_the_file() {
    for [options, in_file, merged] in table(
        "
        bins = 64; l1 = 8      | bins = 128; l1 = 40; x = 2       | bins = 64; l1 = 8; x = 2
        rule = 'window'        | rule = 'window'; z = 4           | rule = 'window'; z = 4
                               | rule = 'window'; z = 4           | rule = 'window'; z = 4
        rule = 'paper'         | rule = 'window'; z = 4; l1 = 8   | rule = 'paper'; l1 = 8
        rule = 'paper'         | rule = 'window'; window = 3      | rule = 'paper'
        rule = 'paper'         | rule = 'window'; neighbours = 8  | rule = 'paper'
        rule = 'paper'         | rule = 'window'; tracking = true | rule = 'paper'
        rule = 'paper'         | rule = 'window'; false_alarm = 0.02 | rule = 'paper'
        rule = 'window'        | rule = 'paper'; alpha = 6        | rule = 'window'
        rule = 'average'       | rule = 'paper'; alpha = 6        | rule = 'average'
        rule = 'window'        | window = 3; z = 4; neighbours = 8; alpha = 6 | rule = 'window'; window = 3; z = 4; neighbours = 8
        rule = 'paper'         | window = 3; z = 4; neighbours = 8; alpha = 6 | rule = 'paper'; alpha = 6
        rule = 'average'       | tracking = true; false_alarm = 0.02; alpha = 6 | rule = 'average'; alpha = 6
        z = 4                  | false_alarm = 0.02               | z = 4
        false_alarm = 0.02     | z = 4                            | false_alarm = 0.02
        l1 = 8                 | z = 4                            | z = 4; l1 = 8
        decide_once = true     | z = 4                            | decide_once = true
        decide_once = true     | z = 4; decide_once = false       | decide_once = true
        decide_once = true     | z = 4; decide_once = true        | decide_once = true; z = 4
        decide_once = true; z = 5 | z = 4                         | decide_once = true; z = 5
        decide_once = false    | z = 4; decide_once = true        | decide_once = false
        decide_once = false    | z = 4                            | decide_once = false; z = 4
                               | z = 4; decide_once = true        | decide_once = true; z = 4
        estimator = 'centroid' | half_widths = [1, 4]             | estimator = 'centroid'
        estimator = 'window'   | half_widths = [1, 4]             | estimator = 'window'; half_widths = [1, 4]
        sigma_bins = 0.9       | sigma_bins = 0.8; half_widths = [1, 4] | sigma_bins = 0.9
        sigma_bins = 0.8       | sigma_bins = 0.8; half_widths = [1, 4] | sigma_bins = 0.8; half_widths = [1, 4]
                               | sigma_bins = 0.8; half_widths = [1, 4] | sigma_bins = 0.8; half_widths = [1, 4]
        binning = 0            | binning = 2; patience = 32       | binning = 0
        binning = 1            | binning = 2; patience = 32       | binning = 1; patience = 32
        echoes = 1             | echoes = 2; echo_wait = 4        | echoes = 1
        echoes = 3             | echoes = 2; echo_wait = 4        | echoes = 3; echo_wait = 4
        photons_per_cycle = 2  | recorded_cycles = 9; seed = 3    | photons_per_cycle = 2; seed = 3
        recorded_cycles = 9    | photons_per_cycle = 2            | recorded_cycles = 9
        seed = 4               | photons_per_cycle = 2; seed = 3  | photons_per_cycle = 2; seed = 4
        calibration = 'a'      | field_of_view_degrees = [60, 40] | calibration = 'a'
        field_of_view_degrees = [60, 40] | calibration = 'a'      | field_of_view_degrees = [60, 40]
                               | calibration = 'a'                | calibration = 'a'
        ",
    ) {
        let result = file(options).or(file(in_file));
        assert_eq!(result, file(merged), "{options} over {in_file}");
    }
}

/// The z of a single decision is not that of looks.
#[test]
fn pixels_with_looks_do_not_decide_once() {
    let rest = "rule = 'window'; window = 3";
    let once = file(&format!("{rest}; z = 4; decide_once = true"));
    assert_eq!(once.with_looks(), file(rest));
    let looks = file(&format!("{rest}; z = 4"));
    assert_eq!(looks.clone().with_looks(), looks);
}

/// Likewise the other way round, if the z is of a file. An option was given for this run, map and all.
#[test]
fn a_single_decision_has_no_blocks_and_no_z_of_looks() {
    let rest = "rule = 'window'; window = 3; decide_once = true";
    for [options, in_file, once] in table(
        "
        z = 4; binning = 2; patience = 32 |                                           | z = 4
        z = 4                             | x = 3                                     | z = 4; x = 3
                                          | z = 4; x = 3                              | x = 3
                                          | z = 4; decide_once = true; binning = 0    | z = 4
        decide_once = false               | z = 4; binning = 2; patience = 32         |
        ",
    ) {
        let given = file(&format!("{options}; rule = 'window'; window = 3"));
        let mut found = given.or(named("my.toml", in_file)).deciding_once();
        found.file = None;
        assert_eq!(
            found,
            file(&format!("{once}; {rest}")),
            "{options} over {in_file}"
        );
    }
}

#[test]
fn another_recording_has_other_axes_and_another_length() {
    let of_recording = "axes = 'rows,bins'; array = 'counts'; capture = 1; cycles = 9";
    let rest = "bins = 64; seed = 3; rebin = 2";
    let all = file(&format!("{of_recording}; {rest}"));
    assert_eq!(all.without_recording(), file(rest));
}

/// The file that set some keys.
fn named(name: &str, keys: &str) -> SettingsFile {
    SettingsFile::parse_as(Path::new(name), &toml(keys)).unwrap()
}

/// Keys that a file sets have their names in the file, others those of options.
#[test]
fn an_error_names_the_file_that_set_the_key() {
    let error = |settings: &SettingsFile| {
        let error = settings.settings(128).unwrap_err();
        line(&error, &flag)
    };
    for [options, in_file, expected] in table(
        "
                      | patience = 8              | my.toml: patience is for --binning
                      | patience = 8; binning = 0 | my.toml: patience is for binning
        patience = 8  | l1 = 8                    | --patience is for --binning
        patience = 8  | patience = 9              | --patience is for --binning
        patience = 8  | binning = 0               | my.toml: --patience is for binning
        ",
    ) {
        let merged = file(options).or(named("my.toml", in_file));
        assert_eq!(error(&merged), expected, "{options} over {in_file}");
    }
    // A program has set the key itself.
    let mut overridden = named("my.toml", "patience = 8; binning = 0");
    overridden.override_key("patience");
    assert_eq!(error(&overridden), "my.toml: --patience is for binning");
    // Of two files the first is named.
    let first = named("my.toml", "patience = 8");
    let both = first.clone().or(named("other.toml", "echo_wait = 3"));
    assert_eq!(both.file, first.file);
}

#[test]
fn a_file_sets_the_keys_that_no_option_sets_or_drops() {
    let in_file = named(
        "my.toml",
        "rule = 'window'; window = 3; z = 4; l1 = 8; seed = 3",
    );
    for [options, keys] in table(
        "
                           | l1 rule seed window z
        l1 = 9             | rule seed window z
        l2 = 900           | l1 rule seed window z
        rule = 'paper'     | l1 seed
        false_alarm = 0.02 | l1 rule seed window
        ",
    ) {
        let kept = file(options).or(in_file.clone()).file.unwrap();
        assert_eq!(kept.path, Path::new("my.toml"));
        let kept: Vec<&str> = kept.keys.iter().map(String::as_str).collect();
        assert_eq!(kept.join(" "), keys, "{options}");
    }
}

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::neighbours::NeighbourRule;
use dtof_core::{
    AnyRule, Array, BlockLevel, CentredWindow, DepthEstimator, EchoNumber, Neighbours, PixelConfig,
    RangeGate,
};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::recorded::{RecordedHistograms, RecordingLength};

use super::*;

#[test]
fn pixels_get_every_setting() {
    let rule: AnyRule = window_rule(6).into();
    let gate = RangeGate::<128>::new(12, 119).unwrap();
    let [before, after] = ["1.75", "4"].map(|bins| bins.parse().unwrap());
    let window = CentredWindow::with_sides(before, after).unwrap();
    let expected = PixelConfig::with_rule(rule)
        .x(2)
        .l1(8)
        .l2(1500)
        .gate(gate)
        .estimator(DepthEstimator::CentredWindow(window))
        .dead_time(20)
        .tracking(rule.tracking(&gate))
        .echoes(EchoNumber::new(3).unwrap(), 6)
        .echo_wait(5)
        .build();
    assert_eq!(settings(ALL).config().unwrap(), expected.unwrap());
    // An exposure with an echo goes on until L2 if there is no wait.
    let echoes = settings("echoes = 2").config::<128>().unwrap();
    assert_eq!(echoes.echo_wait(), u8::MAX);
}

#[test]
fn the_rule_of_a_pixel_depends_on_its_neighbours_and_that_of_a_block_on_its_level() {
    let rule = window_rule(5);
    let with = |keys| settings(&format!("rule = 'window'; window = 3; z = 4.5; {keys}"));
    assert_eq!(with("").config::<128>().unwrap().rule(), &rule.into());
    let own = *NeighbourRule::new(&rule).own();
    let confirmed = with("neighbours = 8");
    assert_ne!(own, rule);
    assert_eq!(confirmed.config::<128>().unwrap().rule(), &own.into());
    let of_blocks = rule.of_blocks(BlockLevel::new(2).unwrap());
    let blocks = with("binning = 2");
    assert_eq!(blocks.config::<128>().unwrap().rule(), &rule.into());
    let blocks = blocks.block_config::<128>().unwrap();
    assert_eq!(blocks.rule(), &of_blocks.into());
}

#[test]
fn what_pixels_cannot_have_is_refused_in_one_line() {
    for [keys, line] in table(
        "
        x = 41            | x 41: must not be greater than l1 40
        l1 = 3            | x 4: must not be greater than l1 3; 4 is the default of x
        l2 = 30           | l2 30: must be greater than l1 40; 40 is the default of l1
        l1 = 2000         | l2 2000: must be greater than l1 2000; 2000 is the default of l2
        l1 = 50; l2 = 50  | l2 50: must be greater than l1 50
        x = 30; l2 = 60   | x 30: no multiple of it lies strictly between l1 40 and l2 60
        gate = [100, 128] | gate 100..128: with 128 bins: the range gate ends past the last bin of the histogram
        gate = [100, 106] | gate 100..106: with 128 bins: the range gate leaves fewer than 8 bins
        ",
    ) {
        let error = settings(keys).config::<128>().unwrap_err();
        assert_eq!(error.to_string(), line, "{keys}");
    }
    // A file says these of its keys itself.
    let scene = || Settings::static_scene(1);
    for (settings, line) in [
        (
            scene().configured(|array| array.tracking = true),
            "tracking is for rule window",
        ),
        (
            scene().configured(|array| array.dead_time = Some(20)),
            "dead_time is for rule window, without binning",
        ),
        (
            scene().configured(|array| array.neighbours = Neighbours::new(8)),
            "neighbours is for rule window",
        ),
    ] {
        let error = settings.config::<128>().unwrap_err();
        assert_eq!(error.to_string(), line);
    }
}

#[test]
fn a_gate_of_all_bins_is_written_if_the_file_has_it() {
    for (keys, gate) in [("", None), ("gate = [0, 127]", Some((0, 127)))] {
        let file = file(keys);
        let written = file.with_settings(&file.settings(128).unwrap());
        assert_eq!(written.sensor.gate, gate);
    }
    assert_eq!(Settings::static_scene(1).with_bins(256).gate(), None);
    assert!(
        Settings::static_scene(1)
            .with_bins(256)
            .config::<256>()
            .is_ok()
    );
}

#[test]
fn the_gate_is_that_of_the_settings_or_all_bins() {
    let gate = |keys| settings(keys).range_gate::<128>().unwrap();
    assert_eq!(gate(""), RangeGate::full());
    let eight = RangeGate::new(100, 107).unwrap();
    assert_eq!(gate("gate = [100, 107]"), eight);
}

#[test]
fn only_the_window_rule_of_pixels_weighs_a_dead_time() {
    for (keys, is_weighed) in [
        ("rule = 'window'; window = 3", false),
        ("rule = 'window'; window = 3; dead_time = 1", true),
        ("dead_time = 128", false),
        (
            "rule = 'window'; window = 3; dead_time = 128; frame = 9",
            false,
        ),
    ] {
        assert_eq!(settings(keys).weighs_dead_time(), is_weighed, "{keys}");
    }
}

#[test]
fn frames_count_all_photons_of_a_bin() {
    for (keys, once) in [
        ("", false),
        ("frame = 9", false),
        ("once_per_bin = true", true),
        ("once_per_bin = true; frame = 9", false),
    ] {
        assert_eq!(settings(keys).counts_once_per_bin(), once, "{keys}");
    }
}

#[test]
fn the_bins_around_an_echo_are_four_standard_deviations_of_the_pulse() {
    // Without a pulse 4 bins.
    assert_eq!(settings("").configuration.echo_guard_bins, 4);
    for (sigma, bins) in [("0.25", 1), ("0.8", 4), ("1", 4), ("1.3", 6), ("1.75", 7)] {
        let settings = settings(&format!("sigma_bins = {sigma}"));
        assert_eq!(settings.configuration.echo_guard_bins, bins, "{sigma}");
    }
}

#[test]
fn the_depth_window_is_the_one_asked_for_or_suits_the_pulse() {
    let window = |before: &str, after: &str| {
        let [before, after] = [before, after].map(|bins| bins.parse().unwrap());
        DepthEstimator::CentredWindow(CentredWindow::with_sides(before, after).unwrap())
    };
    let centroid = DepthEstimator::Centroid3;
    for (text, estimator) in [
        ("", centroid),
        // 2 × 0.75 + ½.
        ("sigma_bins = 0.75", window("2", "2")),
        ("sigma_bins = 0.75; half_widths = [1, 4]", window("1", "4")),
        ("sigma_bins = 0.75; estimator = 'centroid'", centroid),
    ] {
        assert_eq!(settings(text).configuration.estimator, estimator, "{text}");
    }
}

const OFFSETS: &str = "offset_mm = -7.5; offsets_mm = [1, 2, 3, 4, 5, 6]";

/// Offsets in millimetres.
fn own_offsets(mm: [Option<i16>; 6]) -> Vec<Option<I24F8>> {
    mm.map(|mm| mm.map(I24F8::from)).to_vec()
}

#[test]
fn pixels_that_are_left_out_have_no_offset() {
    let all = [1, 2, 3, 4, 5, 6].map(Some);
    assert_eq!(settings(OFFSETS).pixel_offsets(), own_offsets(all));
    // There is no pixel 6.
    let masked = settings(&format!("{OFFSETS}; masked = [1, 5, 6]"));
    let with_masked = own_offsets([Some(1), None, Some(3), Some(4), Some(5), None]);
    assert_eq!(masked.pixel_offsets(), with_masked);
    assert_eq!(settings("masked = [1]").pixel_offsets(), []);
    let array = Array::new(2, 3).unwrap();
    let ranges = Ranges::new(
        array,
        U16F16::lit("250"),
        "-7.5".parse().unwrap(),
        with_masked,
    );
    assert_eq!(masked.ranges(array).unwrap(), ranges.unwrap());
}

#[test]
fn ranges_that_cannot_be_are_refused_in_one_line() {
    for [keys, line] in table(
        "
        bin_width_ps = 0       | bin_width_ps 0: too narrow: a bin would be 0 mm; give picoseconds, such as 250
        offset_mm = 8388600    | bin_width_ps 250: with offset_mm 8388600: 1024 bins of this width and the offset reach beyond 8388 m
        offsets_mm = [1, 2, 3] | offsets_mm has 3 numbers, but there are 2 pixels
        offsets_mm = [1, 8388600] | offsets_mm that of pixel 1 and the offset of all reach beyond 8388 m
        ",
    ) {
        let error = settings(keys).ranges(Array::new(2, 1).unwrap());
        assert_eq!(error.unwrap_err().to_string(), line, "{keys}");
    }
}

#[test]
fn the_offsets_of_one_capture_hold_for_each() {
    let array = Array::new(2, 3).unwrap();
    let captures = Histograms::of(vec![vec![1; 8]; 3 * 6]).unwrap();
    let length = RecordingLength::Cycles(1);
    let source = RecordedHistograms::new(array, &captures, length, 1, 1).unwrap();
    let one = settings(OFFSETS).for_source(&source).unwrap();
    let mm: Vec<u32> = one.offsets_mm.iter().map(|mm| mm.to_num()).collect();
    assert_eq!(mm, [1, 2, 3, 4, 5, 6].repeat(3));
    // Those of all pixels stay, as do none.
    assert_eq!(one.clone().for_source(&source).unwrap(), one);
    assert_eq!(settings("").for_source(&source).unwrap(), settings(""));
    let other = settings("offsets_mm = [1, 2, 3, 4, 5]");
    assert_eq!(
        other.for_source(&source).unwrap_err().to_string(),
        "offsets_mm has 5 numbers, but there are 18 pixels"
    );
}

//! Scene files that cannot be simulated.

use crate::common::{Scratch, table};

/// A scene file that is not one.
#[track_caller]
fn refused(text: &str, parts: &[impl AsRef<str>]) {
    let scratch = Scratch::new();
    let output = scratch.simulate(&scratch.file("scene.toml", text), "");
    scratch.refused(&output, &["scene.toml: "]);
    scratch.refused(&output, parts);
}

/// Each row: a scene file, and parts of the expected error.
#[track_caller]
fn all_refused(rows: &str) {
    for row in table(rows) {
        refused(&row[0], &row[1..]);
    }
}

#[test]
fn scene_files_that_are_not_toml_or_have_other_keys_are_named_by_line() {
    all_refused(
        r#"
        columns = 2\nrows = \n | line 2: 
        columns = 2\ncolumns = 3\n | line 2:  | duplicate key
        columns = 2\nbackgrond = 0.1\n | line 2: unknown field `backgrond` | `background`
        [tail]\nshare = 0.1\ndecay = 5\n | line 3: unknown field `decay` | `decay_bins`
        [tail]\nshare = 0.1\n | line 1: missing field `decay_bins`
        [deadtime]\nduration_ps = 1\n | line 1: unknown field `deadtime` | `dead_time`
        [[surface]]\nrange_mm = 1000\nreflectivity = 1\nball = { centre = [1, 2], radius = 3, size = 4 }\n | line 4: unknown field `size` | `radius_mm`
        columns = "two"\n | line 1:  | expected u16
        columns = 2.5\n | line 1:  | expected u16
        columns = -1\n | line 1:  | expected u16
        \n\nbackground = true\n | line 3:  | expected f64
        [[surface]]\nfan = { centre = [1] }\n | line 2:  | array of length 2
        surface = 1\n | line 1: 
    "#,
    );
}

#[test]
fn numbers_that_cannot_be_are_named_by_key() {
    all_refused(
        r#"
        columns = 0 | columns 0: must be from 1 to 65535
        rows = 0 | rows 0
        columns = 257\nrows = 256 | 65792 pixels: more than 65,536
        cycles = 0 | cycles 0
        bins = 100 | bins 100: must be a power of two from 8 to 1024
        bin_width_ps = 0 | bin_width_ps 0: must be from 1 to 10000
        bin_width_ps = nan | bin_width_ps NaN
        laser_rate_mhz = 0 | laser_rate_mhz 0
        laser_rate_mhz = 50 | laser_rate_mhz 50: the next laser pulse comes after 80.0 bins
        background = -0.1 | background -0.1: must be from 0 to 100
        background = inf | background inf
        background = 100\ncolumns = 50\nrows = 50 | photons a laser cycle: more than 10000000
        pulse_sigma_bins = -1 | pulse_sigma_bins -1
        dither_bins = 127 | : dither_bins 127: the range of the dither must be an even number of bins
        dither_bins = 256 | : dither_bins 256: the range of the dither must be
        [other_lidar]\nphotons = -1 | [other_lidar]: photons -1
        [other_lidar]\nphotons = 1\nppm = 600_000 | [other_lidar]: ppm 600000
        field_of_view_degrees = [60, 180] | field_of_view_degrees: must be HORIZONTALxVERTICAL in degrees
        signal_at_one_metre = -1 | signal_at_one_metre -1
        [tail]\nshare = 1.5\ndecay_bins = 5 | [tail]: share 1.5: must be from 0 to 1
        [tail]\nshare = 0.5\ndecay_bins = 0 | [tail]: decay_bins 0
        [second_echo]\nshare = -1\nbehind_mm = 0 | [second_echo]: share -1
        [second_echo]\nshare = 1\nbehind_mm = nan | [second_echo]: behind_mm NaN
        [cover_glass]\nsignal = -1\nposition_bins = 0 | [cover_glass]: signal -1
        [cover_glass]\nsignal = 1\nposition_bins = -1 | [cover_glass]: position_bins -1
        [hot_pixels]\nmultiple = 0.5\nshare = 1 | [hot_pixels]: multiple 0.5
        [hot_pixels]\nmultiple = 2\nshare = 2 | [hot_pixels]: share 2
        [hot_pixels]\nmultiple = 2 | [hot_pixels]: share or pixels must say
        [hot_pixels]\nmultiple = 2\npixels = [1] | [hot_pixels]: pixel 1
        [dead_time]\nduration_ps = -1 | [dead_time]: duration_ps -1
        [afterpulsing]\nprobability = 1\ndecay_ps = 5 | [afterpulsing]: probability 1
        [afterpulsing]\nprobability = 0\ndecay_ps = 0 | [afterpulsing]: decay_ps 0
        [jitter]\nsigma_ps = inf | [jitter]: sigma_ps inf
        [tdc]\nhits_per_cycle = 0 | [tdc]: hits_per_cycle 0
        [tdc]\ndead_time_bins = 0 | [tdc]: dead_time_bins 0
        [tdc] | [tdc]: needs hits_per_cycle or dead_time_bins, and not both
        [tdc]\nhits_per_cycle = 1\ndead_time_bins = 5 | [tdc]: needs hits_per_cycle or
    "#,
    );
}

#[test]
fn surfaces_that_cannot_be_are_named() {
    for row in table(
        r#"
        reflectivity = 1 | needs range_mm or position_bins, and not both
        range_mm = 1000\nposition_bins = 5\nsignal = 1 | needs range_mm or
        range_mm = 1000 | needs reflectivity or signal, and not both
        range_mm = 1000\nsignal = 1\nreflectivity = 1 | needs reflectivity or
        range_mm = 0\nsignal = 1 | range_mm 0
        range_mm = nan\nsignal = 1 | range_mm NaN
        range_mm = 1000\nrange_right_mm = -1\nsignal = 1 | range_right_mm -1
        position_bins = 0\nsignal = 1 | position_bins 0
        range_mm = 1000\nreflectivity = -1 | reflectivity -1
        range_mm = 1000\nsignal = -1 | signal -1
        range_mm = 10\nreflectivity = 1 | 40000 signal photons a laser cycle from 10.0 mm
        range_mm = 1000\nsignal = 1\nvelocity_m_per_s = nan | velocity_m_per_s NaN
        range_mm = 1000\nsignal = 1\nvelocity_m_per_s = -1000 | comes as near as 0.0 mm
        range_mm = 1000\nsignal = 1\ncolumns_per_s = inf | columns_per_s inf
        range_mm = 1000\nsignal = 1\nrows_per_s = inf | rows_per_s inf
        range_mm = 1000\nsignal = 1\nrectangle = { columns = [2, 2], rows = [0, 1] } | rectangle columns [2, 2]: the second must be greater
        range_mm = 1000\nsignal = 1\nrectangle = { columns = [0, 2], rows = [nan, 1] } | rectangle rows NaN
        range_mm = 1000\nsignal = 1\nball = { centre = [0, 2], radius = 0, radius_mm = 1 } | ball radius 0
        range_mm = 1000\nsignal = 1\nball = { centre = [0, 2], radius = 1, radius_mm = 1000 } | comes as near as 0.0 mm
        range_mm = 1000\nsignal = 1\nfan = { centre = [0, 2], radius = 1, blades = 0, blade_share = 0.5, rpm = 1 } | fan blades 0
        range_mm = 1000\nsignal = 1\nfan = { centre = [0, 2], radius = 1, blades = 3, blade_share = 1.5, rpm = 1 } | fan blade_share 1.5
        range_mm = 1000\nsignal = 1\nplane = { normal = [1, 0, 0] } | plane normal [1, 0, 0]: its z is too small
        range_mm = 1000\nsignal = 1\nplane = { normal = [0, nan, 1] } | plane normal NaN
        range_mm = 1000\nsignal = 1\ncolumns_per_s = 1\nplane = { normal = [0, 0, 1] } | a plane has no range_right_mm, columns_per_s or rows_per_s
        range_mm = 2\nsignal = 1\nplane = { normal = [2, 0, 1] } | comes as near as 0.9 mm
        range_mm = 1000\nsignal = 1\nrectangle = { columns = [0, 2], rows = [0, 1] }\nball = { centre = [0, 2], radius = 1, radius_mm = 1 } | is more than one of rectangle, ball, fan and plane
    "#,
    ) {
        let (keys, part) = (&row[0], row[1].as_str());
        refused(&format!("[[surface]]\n{keys}\n"), &["surface 1: ", part]);
        let named = format!("[[surface]]\nname = \"target\"\n{keys}\n");
        refused(&named, &["target: ", part]);
    }
}

#[test]
fn scenes_that_are_not_there_and_options_that_cannot_be_are_refused() {
    let scratch = Scratch::new();
    scratch.file("binary.toml", [0xff, 0xfe, 0]);
    scratch.file("scene.toml", "columns = 2\n");
    scratch.all_refused(
        "simulate --out out",
        "
             | --scene
            --scene none.toml | none.toml | No such file
            --scene binary.toml | binary.toml | UTF-8
            --scene scene.toml --cycles 0 | --cycles
            --scene scene.toml --array 0x5 | --array
            --scene scene.toml --array 65535x2 | 131070 pixels: more than 65,536
            --scene scene.toml --x 50 | --x 50: must not be greater than --l1 40
            --scene scene.toml --gate 0..128 | past the last bin
            --scene scene.toml --scen x | --scen
        ",
    );
}

//! Options: what is assumed, warned of and refused.

use super::*;

#[test]
fn options_without_a_use_are_refused() {
    let one_per_pixel = Options {
        one_per_pixel: true,
        ..options()
    };
    let echo = Options {
        echo: Echo::First,
        ..options()
    };
    let [depths, changes] = [[depth(0, 1, 9)], [dynamic(0, 0, 1, 9, 1)]];
    for (events, format, options, expected) in [
        (
            changes,
            Format::Csv,
            &one_per_pixel,
            "one_per_pixel is only for depth events",
        ),
        (changes, Format::Csv, &echo, "echo is only for depth events"),
        (
            depths,
            Format::Mcap,
            &one_per_pixel,
            "one_per_pixel is only for csv, pcd and ply",
        ),
        (
            depths,
            Format::Ros2,
            &one_per_pixel,
            "one_per_pixel is only for csv, pcd and ply",
        ),
        (
            depths,
            Format::Evt2,
            &one_per_pixel,
            "one_per_pixel is only for csv, pcd and ply",
        ),
    ] {
        assert_eq!(refused(&file(&events), format, options), expected);
    }
}

#[test]
fn what_points_and_times_rest_on_is_said() {
    let view = Options {
        rays: RaySettings {
            field_of_view_degrees: Some([45.0, 24.5]),
            ..RaySettings::default()
        },
        slice_ns: Some(5500),
        ..Options::default()
    };
    let slow = Options {
        clock: Some(LaserClock::new(12_500).unwrap()),
        ..options()
    };
    let differs = "the file has a laser of 10 MHz; times are for 12.5 kHz";
    for (format, options, assumptions, warning) in [
        (Format::Csv, &view, "45x24.5 degrees, 10 MHz", None),
        (Format::Ply, &options(), "rays.toml, 10 MHz", None),
        (Format::Pcd, &slow, "rays.toml, 12.5 kHz", Some(differs)),
        (
            Format::Mcap,
            &view,
            "45x24.5 degrees, 10 MHz, clouds every 5.5 µs",
            None,
        ),
        (
            Format::Ros2,
            &options(),
            "rays.toml, 10 MHz, clouds every 10 µs",
            None,
        ),
        (Format::Evt2, &slow, "12.5 kHz", Some(differs)),
    ] {
        let (summary, _) = exported(&file(&[depth(0, 9, 60)]), format, options);
        assert_eq!(summary.assumptions, assumptions);
        assert_eq!(summary.warnings.first().map(String::as_str), warning);
    }
}

#[test]
fn options_come_before_those_of_a_settings_file() {
    let file = "[sensor]\nlaser_hz = 5000\n[rays]\nfield_of_view_degrees = [50, 40]\n";
    let with_file = |given: &[(&str, &str)], file: &str| {
        let given: ProjectionOptions = dtof_data::options::read(given.iter().copied()).unwrap();
        let file = SettingsFile::parse_as(Path::new("own.toml"), file).unwrap();
        let options = given.options(file).unwrap();
        assert_eq!(options.settings.as_deref(), Some(Path::new("own.toml")));
        let millihertz = options.clock.map(|clock| clock.millihertz());
        (
            options.rays,
            millihertz,
            options.echo,
            options.one_per_pixel,
        )
    };
    let view = |degrees| RaySettings {
        field_of_view_degrees: Some(degrees),
        calibration: None,
    };
    let calibration = RaySettings {
        calibration: Some("rays.toml".into()),
        ..RaySettings::default()
    };
    let nothing = (RaySettings::default(), None, Echo::All, false);
    assert_eq!(with_file(&[], ""), nothing);
    let of_file = (view([50.0, 40.0]), Some(5_000_000), Echo::All, false);
    assert_eq!(with_file(&[], file), of_file);
    let given = [
        ("calibration", "rays.toml"),
        ("laser_hz", "7"),
        ("echo", "last"),
    ];
    let expected = (calibration, Some(7000), Echo::Last, false);
    assert_eq!(with_file(&given, file), expected);
    // The depth map is that of a run, of the strongest echo.
    let given = [("fov", "60x30"), ("one_per_pixel", "true")];
    let expected = (view([60.0, 30.0]), Some(5_000_000), Echo::Strongest, true);
    assert_eq!(with_file(&given, file), expected);
    let given = [("one_per_pixel", "true"), ("echo", "first")];
    assert_eq!(with_file(&given, "").2, Echo::First);
}

#[test]
fn options_that_cannot_be_are_refused() {
    for (given, expected) in [
        (
            &[("echo", "second")][..],
            "echo second: must be first, last, strongest or all",
        ),
        (
            &[("one_per_pixel", "maybe")],
            "one_per_pixel maybe: must be true or false",
        ),
        (
            &[("calibration", "-")],
            "calibration -: standard input and output are not supported here; give a name",
        ),
        (
            &[("fov", "60x40"), ("calibration", "x.toml")],
            "field_of_view_degrees cannot be used with calibration",
        ),
    ] {
        let read: Result<ProjectionOptions, Refused> =
            dtof_data::options::read(given.iter().copied());
        assert_eq!(read.unwrap_err().to_string(), expected);
    }
}

//! CSV, PCD and PLY.

use dtof_core::{Count, EchoNumber};

use super::*;

/// A record: x, y, z, value; pixel; flags, level, echo; nanoseconds.
fn record(point: [f32; 4], pixel: u32, small: [u8; 3], t_ns: f64) -> Vec<u8> {
    let point = point.map(f32::to_le_bytes).concat();
    [
        &point,
        &pixel.to_le_bytes()[..],
        &small,
        &t_ns.to_le_bytes(),
    ]
    .concat()
}

/// One along each kind of ray, and the block of pixels 2 and 5, whose mean ray is straight ahead.
fn events() -> [Event; 4] {
    [
        depth(0, 3, 60),
        depth_with(1, 12_345, 60, |event| {
            event.peak_count = Count::saturating(1 << 23);
            event.flags = Flags::DEFERRED;
            event.echo = EchoNumber::new(2).unwrap();
        }),
        depth(2, 1 << 20, 60),
        block(2, 10, 40),
    ]
}

/// The records of these events.
fn records() -> Vec<u8> {
    [
        record([0.0, 0.0, 2.5, 9.0], 0, [0, 0, 1], 300.0),
        record([1.5, 0.0, 2.0, 8_388_608.0], 1, [4, 0, 2], 1_234_500.0),
        record([0.0, -1.2, 1.6, 9.0], 2, [0, 0, 1], 104_857_600.0),
        record([0.0, 0.0, 1.2, 9.0], 2, [0, 1, 1], 1000.0),
    ]
    .concat()
}

#[test]
fn csv_has_the_time_and_the_point_before_the_columns_of_an_event() {
    let (summary, out) = exported(&file(&events()), Format::Csv, &options());
    let expected = "\
time_us,x_m,y_m,z_m,cycle,pixel,exposure,peak_bin,depth_bins,range_mm,peak_count,background,flags,level,echo
0.300,0,0,2.5,3,0,40,60,60.5000,2500.000,9,1,0,0,1
1234.500,1.5,0,2,12345,1,40,60,60.5000,2500.000,8388608,1,4,0,2
104857.600,0,-1.2,1.6,1048576,2,40,60,60.5000,2500.000,9,1,0,0,1
1.000,0,0,1.2,10,2,40,40,40.5000,1700.000,9,1,0,1,1
";
    assert_eq!(String::from_utf8(out).unwrap(), expected);
    assert_eq!((summary.written, summary.late), (4, 0));
    assert_eq!((summary.damage, summary.warnings), (None, Vec::new()));
}

#[test]
fn a_point_behind_the_lens_has_no_negative_zeros() {
    let header = Header {
        offset_mm: I24F8::lit("-3420"),
        ..header()
    };
    let rows = rows(&file_with(&header, &[depth(0, 0, 60)]), &options());
    assert_eq!(rows, ["0.000,0,0,-1,0,0,40,60,60.5000,-1000.000,9,1,0,0,1"]);
}

#[test]
fn pcd_and_ply_are_a_header_and_the_same_records() {
    let pcd = "\
# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z intensity pixel flags level echo t_ns
SIZE 4 4 4 4 4 1 1 1 8
TYPE F F F F U U U U F
COUNT 1 1 1 1 1 1 1 1 1
WIDTH 4
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 4
DATA binary
";
    let ply = "\
ply
format binary_little_endian 1.0
comment metres, x to the right, y down, z forward
element vertex 4
property float x
property float y
property float z
property float intensity
property uint pixel
property uchar flags
property uchar level
property uchar echo
property double t_ns
end_header
";
    for (format, header) in [(Format::Pcd, pcd), (Format::Ply, ply)] {
        let (summary, out) = exported(&file(&events()), format, &options());
        assert_eq!(summary.written, 4);
        let found = out.strip_prefix(header.as_bytes());
        assert_eq!(
            found,
            Some(&records()[..]),
            "{}",
            String::from_utf8_lossy(&out)
        );
    }
}

#[test]
fn changes_of_depth_are_points_at_the_mean_after_the_change() {
    let bytes = file(&[dynamic(1, 0, 3, 60, -3), dynamic(2, 1, 9, 40, 2)]);
    let (_, out) = exported(&bytes, Format::Csv, &options());
    let expected = "\
time_us,x_m,y_m,z_m,cycle,pixel,polarity,range_mm,change_mm,flags,level
0.300,1.5,0,2,3,1,-1,2500.000,-120.000,0,0
0.900,0,0,1.2,9,2,1,1700.000,80.000,0,1
";
    assert_eq!(String::from_utf8(out).unwrap(), expected);

    let records = [
        record([1.5, 0.0, 2.0, -0.12], 1, [0, 0, 1], 300.0),
        record([0.0, 0.0, 1.2, 0.08], 2, [0, 1, 1], 900.0),
    ];
    let (summary, out) = exported(&bytes, Format::Pcd, &options());
    assert_eq!(summary.written, 2);
    assert!(out.ends_with(&records.concat()));
    let header = String::from_utf8_lossy(&out);
    let fields = "FIELDS x y z change pixel flags level echo t_ns\n";
    assert!(
        header.contains(fields) && header.contains("\nPOINTS 2\n"),
        "{header}"
    );
}

/// `points` of events in memory needs no file.
#[test]
fn events_in_memory_are_the_same_records() {
    let folder = TempDir::new().unwrap();
    let mut options = options();
    options.rays.calibration = Some(rays(&folder));
    assert_eq!(points(&events(), &header(), &options).unwrap(), records());

    // Two events of a pixel are one point of it, the newest at the mean range.
    options.one_per_pixel = true;
    let events = [depth(1, 3, 59), dynamic(0, 0, 4, 9, 9), depth(1, 7, 61)];
    let one = record([1.5, 0.0, 2.0, 9.0], 1, [0, 0, 1], 700.0);
    assert_eq!(points(&events, &header(), &options).unwrap(), one);
}

#[test]
fn one_kind_of_event_is_written() {
    let [depths, dynamics] = [
        [depth(0, 1, 9), depth(1, 3, 9)],
        [dynamic(0, 0, 2, 9, 1); 2],
    ];
    let both = [depths[0], dynamics[0], depths[1]];
    let of_kind = |events: &[Event], kind| {
        let options = Options { kind, ..options() };
        try_export(&file(events), Format::Ply, &options).map(|(summary, out)| {
            let is_change = String::from_utf8_lossy(&out).contains("property float change\n");
            (summary.written, is_change)
        })
    };
    let refused = |text: &str| Err(format!("events.aer: {text}"));
    let [depth, dynamic] = [EventKind::Depth, EventKind::DynamicDepth].map(Some);
    for (events, kind, expected) in [
        (&both[..], depth, Ok((2, false))),
        (&both, dynamic, Ok((1, true))),
        (
            &both,
            None,
            refused(
                "2 depth events and 1 dynamic depth events: events says which, depth or dynamic-depth",
            ),
        ),
        (&depths, None, Ok((2, false))),
        (
            &depths,
            dynamic,
            refused("2 events, none of them a dynamic depth event"),
        ),
        (&dynamics, None, Ok((2, true))),
        (
            &dynamics,
            depth,
            refused("2 events, none of them a depth event"),
        ),
        (&[], None, Ok((0, false))),
        (&[], depth, Ok((0, false))),
        (&[], dynamic, Ok((0, true))),
    ] {
        assert_eq!(of_kind(events, kind), expected, "{events:?} {kind:?}");
    }
}

/// Two exposures of a pixel, and one of another that never reports again.
#[test]
fn one_echo_of_each_exposure_is_written_in_the_order_of_the_file() {
    let echo = |pixel, cycle, exposure, number, bin, peak| {
        depth_with(pixel, cycle, bin, |event| {
            event.exposure = exposure;
            event.echo = EchoNumber::new(number).unwrap();
            event.peak_count = Count::saturating(peak);
        })
    };
    let bytes = file(&[
        echo(0, 43, 44, 1, 50, 11),    // 10 / 44 above the background
        echo(1, 47, 48, 1, 70, 11),    // 10 / 48
        echo(0, 99, 100, 2, 20, 16),   // 15 / 100
        echo(1, 147, 148, 2, 80, 101), // 100 / 148
        echo(0, 199, 200, 3, 60, 21),  // 20 / 200
        echo(0, 400, 60, 1, 30, 11),
    ]);
    let bins = |bytes: &[u8], echo| -> Vec<u16> {
        let rows = rows(bytes, &Options { echo, ..options() });
        let bins = rows.iter().map(|row| row.split(',').nth(7).unwrap());
        bins.map(|bin| bin.parse().unwrap()).collect()
    };
    for (echo, expected) in [
        (Echo::All, &[50, 70, 20, 80, 60, 30][..]),
        (Echo::First, &[70, 20, 30]),
        (Echo::Last, &[80, 60, 30]),
        (Echo::Strongest, &[50, 80, 30]),
    ] {
        assert_eq!(bins(&bytes, echo), expected, "{echo:?}");
        // The number in a header is that of the selected echoes.
        let (_, out) = exported(&bytes, Format::Ply, &Options { echo, ..options() });
        let number = format!("\nelement vertex {}\n", expected.len());
        assert!(String::from_utf8_lossy(&out).contains(&number));
    }
    // A file that ends after three events has those of these.
    assert_eq!(bins(&bytes[..64 + 4 * 16], Echo::Last), [50, 70]);
}

#[test]
fn one_point_a_pixel_is_the_newest_event_on_the_surface_at_the_mean_range() {
    let events = [
        block(0, 50, 60),
        dynamic(0, 0, 51, 9, 1),
        depth(4, 60, 40),
        depth(5, 70, 59),
        depth(5, 80, 61),
        depth(5, 90, 20),
    ];
    let options = Options {
        kind: Some(EventKind::Depth),
        one_per_pixel: true,
        ..options()
    };
    // Pixels 0, 1 and 3 have the event of the block alone, pixel 2 has none.
    assert_eq!(
        rows(&file(&events), &options),
        [
            "5.000,0,0,2.5,50,0,40,60,60.5000,2500.000,9,1,0,0,1",
            "5.000,1.5,0,2,50,1,40,60,60.5000,2500.000,9,1,0,0,1",
            "5.000,0,0,2.5,50,3,40,60,60.5000,2500.000,9,1,0,0,1",
            "6.000,0,0,1.7,60,4,40,40,40.5000,1700.000,9,1,0,0,1",
            "8.000,0,1.2,1.6,80,5,40,61,61.5000,2500.000,9,1,0,0,1",
        ]
    );
    let (summary, out) = exported(&file(&events), Format::Pcd, &options);
    assert_eq!(summary.written, 5);
    assert!(String::from_utf8_lossy(&out).contains("\nPOINTS 5\n"));
}

//! AER files that are damaged, or that a format cannot hold.

use super::*;

const FORMATS: [Format; 6] = [
    Format::Csv,
    Format::Pcd,
    Format::Ply,
    Format::Mcap,
    Format::Ros2,
    Format::Evt2,
];

/// The words of a file of them begin at bytes 64 (time), 80, 96, 112 (time), 128 and 144 (end).
fn events() -> [[Event; 3]; 2] {
    let cycles = [3, 4, 1 << 17];
    [
        cycles.map(|cycle| depth(0, cycle, 60)),
        cycles.map(|cycle| dynamic(0, 0, cycle, 60, 1)),
    ]
}

/// The export has the damage and is that of a file of these events alone.
#[track_caller]
fn assert_damaged(bytes: &[u8], format: Format, damage: &str, before: &[Event]) {
    let (of_whole, expected) = exported(&file(before), format, &options());
    let kind = match before {
        [] => None,
        [event, ..] => Some(event.kind()),
    };
    let options = Options { kind, ..options() };
    let (summary, out) = exported(bytes, format, &options);
    assert_eq!(summary.damage.as_deref(), Some(damage), "{format:?}");
    assert_eq!(summary.written, of_whole.written, "{format:?}");
    assert!(out == expected, "{format:?}: {damage}");
}

#[test]
fn what_comes_before_the_damage_is_exported_as_if_it_were_all() {
    for (events, format) in events()
        .iter()
        .flat_map(|events| FORMATS.map(|format| (events, format)))
    {
        let whole = file(events);
        for (length, before, damage) in [
            (80, 0, "byte 80: the file ends without an end word"),
            (100, 1, "byte 96: the file ends inside a word"),
            (112, 2, "byte 112: the file ends without an end word"),
            (159, 3, "byte 144: the file ends inside a word"),
        ] {
            assert_damaged(&whole[..length], format, damage, &events[..before]);
        }
        // Kinds 1 and 2 become 3.
        let kind = [0x80, 0x40][events[0].kind() as usize];
        let checksum = "byte 144: the checksum does not match: a word before this one is damaged";
        for (at, flipped, before, damage) in [
            (96 + 7, kind, 1, "byte 96: unknown kind of word"),
            (144, 1, 3, checksum),
        ] {
            let mut damaged = whole.clone();
            damaged[at] ^= flipped;
            assert_damaged(&damaged, format, damage, &events[..before]);
        }
    }
}

/// In a damaged file a time that the format cannot hold is damage, too. It begins with the time word before the event.
#[test]
fn what_comes_before_a_time_that_is_damaged_is_exported() {
    for [first, second, third] in events() {
        let mut bytes = file(&[first, second, third, second]);
        // Bits 40 to 47 of the upper bits of the time: 2^60 laser cycles more.
        bytes[112 + 13] = 0x10;
        for (format, name, seconds) in [
            (Format::Pcd, "PCD", 9_007_199),
            (Format::Ply, "PLY", 9_007_199),
            (Format::Mcap, "MCAP", 9_007_199),
            (Format::Ros2, "ROS2", 9_007_199),
            (Format::Evt2, "EVT2", 17_179),
        ] {
            let damage = format!(
                "byte 112: laser cycle 1152921504606978048 lies beyond, 115292150460 s after the start: \
                 {name} holds {seconds} s of time (laser_hz 10000000)"
            );
            for bytes in [&bytes[..], &bytes[..150]] {
                assert_damaged(bytes, format, &damage, &[first, second]);
            }
        }
        // CSV has any time, so only the checksum detects this.
        let (summary, _) = exported(&bytes, Format::Csv, &options());
        let checksum = "byte 176: the checksum does not match: a word before this one is damaged";
        assert_eq!(
            (summary.written, summary.damage.as_deref()),
            (4, Some(checksum))
        );
    }
}

#[test]
fn a_time_that_the_format_cannot_hold_is_refused_in_an_intact_file() {
    let last = [(1 << 53) / 100, (1 << 34) * 10 - 1];
    for (format, name, seconds, last) in [
        (Format::Pcd, "PCD", 9_007_199, last[0]),
        (Format::Ply, "PLY", 9_007_199, last[0]),
        (Format::Mcap, "MCAP", 9_007_199, last[0]),
        (Format::Ros2, "ROS2", 9_007_199, last[0]),
        (Format::Evt2, "EVT2", 17_179, last[1]),
    ] {
        let late = last + 1;
        let expected = format!(
            "events.aer: laser cycle {late} lies beyond, {seconds} s after the start: {name} holds {seconds} s \
             of time (laser_hz 10000000)"
        );
        let event = |cycle| file(&[dynamic(0, 0, cycle, 60, 1), dynamic(0, 0, 4, 60, 1)]);
        assert_eq!(refused(&event(late), format, &options()), expected);
        assert_eq!(exported(&event(last), format, &options()).0.written, 2);
    }
    let (summary, _) = exported(&file(&[depth(0, u64::MAX, 60)]), Format::Csv, &options());
    assert_eq!(summary.written, 1);
}

/// MCAP counts seconds since 1970 in 32 bits, ROS 2 in 31.
#[test]
fn a_start_that_the_format_cannot_hold_is_refused() {
    // The only event ends a microsecond after the start.
    let last = [31, 32].map(|bits| (1 << bits) * 1_000_000 - 2);
    for (start_us, ros2, mcap) in [
        (0, None, None),
        (last[0], None, None),
        (last[0] + 1, Some([2_147_483_647, 2_147_483_648]), None),
        (last[1], Some([4_294_967_295; 2]), None),
        (
            last[1] + 1,
            Some([4_294_967_295, 4_294_967_296]),
            Some([4_294_967_295, 4_294_967_296]),
        ),
        (-2_000_000, Some([-2, -1]), Some([-2, -1])),
    ] {
        let header = Header {
            start_us,
            ..header()
        };
        let bytes = file_with(&header, &[depth(0, 9, 60)]);
        for (format, name, most, refused) in [
            (Format::Ros2, "ROS2", 1i64 << 31, ros2),
            (Format::Mcap, "MCAP", 1 << 32, mcap),
            (Format::Csv, "", 0, None),
        ] {
            let expected = refused.map(|[begin, end]: [i64; 2]| {
                format!(
                    "events.aer: its events are {begin} s to {end} s after 1970: {name} holds those of less than \
                     {most} s"
                )
            });
            let error = try_export(&bytes, format, &options()).err();
            assert_eq!(error, expected, "{start_us}");
        }
    }
}

#[test]
fn what_is_no_aer_file_is_refused() {
    let no_bin_width = Header {
        bin_width_ps: U16F16::ZERO,
        ..header()
    };
    for (bytes, expected) in [
        (
            &b"cycle,pixel\n"[..],
            "not an AER file: shorter than its header",
        ),
        (&[0; 200], "not an AER file"),
        (&file_with(&no_bin_width, &[]), "the bin width is zero"),
    ] {
        let error = refused(bytes, Format::Pcd, &options());
        assert_eq!(error, format!("events.aer: {expected}"));
    }
}

//! `dtof export`: the laser rate and its warning.

use crate::common::Scratch;
use crate::common::aer::{HEADER, depth, file};
use dtof_data::events::aer_file::Header;

const EXPORT: &str = "export events.aer --format csv --out x.csv";

/// Standard error of an export of a file with this laser rate, and the time of its event in laser
/// cycle 10,000,000.
fn warning_and_end(laser_millihertz: u64, options: &str) -> (String, f64) {
    let scratch = Scratch::new();
    let header = Header {
        laser_millihertz,
        ..HEADER
    };
    scratch.file("events.aer", file(&header, &[depth(0, 10_000_000, 40)]));
    scratch.file("set.toml", "[sensor]\nlaser_hz = 2000000\n");
    let output = scratch.run(&format!("{EXPORT} {options}"));
    assert!(output.status.success());
    let csv = scratch.read("x.csv");
    let time_us = csv.lines().nth(1).unwrap().split(',').next().unwrap();
    let seconds = time_us.parse::<f64>().unwrap() / 1e6;
    (String::from_utf8(output.stderr).unwrap(), seconds)
}

#[test]
fn a_rate_that_nobody_knows_is_said_to_be_assumed() {
    let warning = "warning: events.aer: the laser rate is not known; times are for 10 MHz, unless \
                   --laser-hz says another\n";
    assert_eq!(warning_and_end(0, ""), (warning.to_owned(), 1.0));
    assert_eq!(warning_and_end(0, "--quiet"), (String::new(), 1.0));
    assert_eq!(
        warning_and_end(0, "--laser-hz 10000000"),
        (String::new(), 1.0)
    );
    assert_eq!(
        warning_and_end(0, "--settings set.toml"),
        (String::new(), 5.0)
    );
}

#[test]
fn what_is_said_comes_before_the_rate_of_the_file_and_a_line_says_so() {
    let of_file = 5_000_000_499;
    let (nothing, seconds) = warning_and_end(of_file, "");
    assert!(nothing.is_empty() && (seconds - 2.0).abs() < 1e-6);
    // A rate that is equal when rounded to whole hertz is that of the file.
    assert_eq!(
        warning_and_end(of_file, "--laser-hz 5000000"),
        (nothing, seconds)
    );
    let warning = |taken| {
        format!(
            "warning: events.aer: the file has a laser of 5.000000499 MHz; times are for {taken} \
             MHz\n"
        )
    };
    assert_eq!(
        warning_and_end(of_file, "--laser-hz 1000000"),
        (warning(1), 10.0)
    );
    assert_eq!(
        warning_and_end(of_file, "--settings set.toml"),
        (warning(2), 5.0)
    );
}

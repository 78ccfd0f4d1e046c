//! Numbers as text, read the same way for every option.
//!
//! A number is decimal, with or without an exponent: `0.5`, `10e6`. A whole number may have an
//! exponent, too: `1e5`.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use dtof_core::fixed::traits::Fixed;

/// Larger exponents are refused. Those of any `f64` are smaller.
const MOST_EXPONENT: u32 = 400;

/// The highest seed or number of laser cycles, as TOML has no larger integers.
pub const MAX_INTEGER: u64 = i64::MAX as u64;

/// Reads a whole number in `range`.
pub fn integer<T>(
    range: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: Clone + Display + FromStr + PartialOrd + Send + Sync + 'static,
{
    move |text| {
        let number = plain(text).and_then(|plain| plain.parse().ok());
        number
            .filter(|number| range.contains(number))
            .ok_or_else(|| {
                let (first, last) = (range.start(), range.end());
                format!("must be a whole number from {first} to {last}")
            })
    }
}

/// The most laser cycles a second: 64 bits hold the rate in millihertz.
pub const MAX_LASER_HZ: u64 = 1_000_000_000_000;

/// `1 / share`, rounded up and saturating: the argument of [`z_for_levels`](dtof_core::rule::z_for_levels).
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub fn one_in(share: f64) -> u32 {
    (1.0 / share).ceil() as u32
}

/// Reads laser cycles a second, up to [`MAX_LASER_HZ`].
///
/// # Errors
/// Fails if it is not a whole number in that range.
pub fn laser_hz(text: &str) -> Result<u64, String> {
    integer(1..=MAX_LASER_HZ)(text)
}

/// Reads a number of bins.
///
/// # Errors
/// Fails if a histogram cannot have so many bins.
pub fn bins(text: &str) -> Result<u16, String> {
    // Text that is not a number is refused like 0.
    bins_of(integer(0..=u16::MAX)(text).unwrap_or(0))
}

/// Checks a number of bins.
///
/// # Errors
/// Fails if a histogram cannot have so many bins.
pub fn bins_of(bins: u16) -> Result<u16, String> {
    let is_valid = (8..=1024).contains(&bins) && bins.is_power_of_two();
    is_valid
        .then_some(bins)
        .ok_or("must be a power of two from 8 to 1024".to_owned())
}

/// Reads a fixed-point number, rounded to the nearest.
///
/// # Errors
/// Fails if it is not a number, is out of range, or is not 0 but rounds to 0.
pub fn fixed<T: Fixed + FromStr>(text: &str) -> Result<T, String> {
    let range = || format!("must be a number from {} to {}", T::MIN, T::MAX);
    let plain = plain(text).ok_or_else(range)?;
    let number: T = plain.parse().map_err(|_| range())?;
    if number == T::ZERO && plain.contains(|digit| matches!(digit, '1'..='9')) {
        return Err(format!(
            "is less than half of {}, the smallest step",
            T::DELTA
        ));
    }
    Ok(number)
}

/// Writes a fixed-point number of up to 53 bits with the fewest decimals from which [`fixed`] reads
/// it back.
#[must_use]
pub fn shortest<T: Fixed + FromStr>(number: T) -> String {
    // The number's own format may write decimals that read as its neighbour.
    let exact: f64 = number.to_num();
    let all = T::FRAC_NBITS as usize;
    let texts = (0..all).map(|decimals| format!("{exact:.decimals$}"));
    let mut texts = texts.filter(|text| fixed(text) == Ok(number));
    texts.next().unwrap_or_else(|| format!("{exact:.all$}"))
}

/// Reads a finite number.
#[must_use]
pub fn real(text: &str) -> Option<f64> {
    let number: f64 = plain(text)?.parse().ok()?;
    number.is_finite().then_some(number)
}

/// Reads `true` or `false`.
///
/// # Errors
/// Fails if it is neither.
pub fn boolean(text: &str) -> Result<bool, String> {
    text.parse().map_err(|_| "must be true or false".to_owned())
}

/// Reads numbers separated by `separators`.
///
/// # Errors
/// Returns the first error and names the number.
pub fn list<T>(
    text: &str,
    separators: &[char],
    number: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, String> {
    let is_list = text.contains(separators);
    let read = |element: &str| {
        if is_list && element.trim().is_empty() {
            return Err("a number is missing between separators or at an end".to_owned());
        }
        number(element.trim()).map_err(|reason| match is_list {
            true => format!("{element} {reason}"),
            false => reason,
        })
    };
    text.split(separators).map(read).collect()
}

/// A number without exponent and without superfluous zeros: `2.50e3` becomes `2500`.
fn plain(text: &str) -> Option<String> {
    let (number, exponent) = match text.split_once(['e', 'E']) {
        Some((number, exponent)) => (number, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (sign, number) = match number.strip_prefix('-') {
        Some(number) => ("-", number),
        None => ("", number.strip_prefix('+').unwrap_or(number)),
    };
    let (before, after) = number.split_once('.').unwrap_or((number, ""));
    let mut digits = format!("{before}{after}");
    let is_number = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    let zeros = exponent.unsigned_abs();
    if !is_number || zeros > MOST_EXPONENT {
        return None;
    }
    // Enough zeros for any place of the point.
    let zeros = "0".repeat(zeros as usize);
    let mut point = before.len();
    if exponent < 0 {
        digits.insert_str(0, &zeros);
    } else {
        digits.push_str(&zeros);
        point += zeros.len();
    }
    let (integer, fraction) = digits.split_at(point);
    let integer = integer.trim_start_matches('0');
    let integer = if integer.is_empty() { "0" } else { integer };
    let fraction = fraction.trim_end_matches('0');
    let point = if fraction.is_empty() { "" } else { "." };
    Some(format!("{sign}{integer}{point}{fraction}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::keys::{self, POSITIVE, above_zero};
    use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};

    #[test]
    fn numbers_are_what_they_say_however_written() {
        for (text, expected) in [
            ("250", "250"),
            ("0250.0", "250"),
            ("1e5", "100000"),
            ("10E6", "10000000"),
            ("+2.5e+3", "2500"),
            ("2.5e0", "2.5"),
            (".5", "0.5"),
            ("5.", "5"),
            ("125e-3", "0.125"),
            ("-1.5e-2", "-0.015"),
            ("1200e-2", "12"),
            ("0e400", "0"),
        ] {
            assert_eq!(plain(text).as_deref(), Some(expected), "{text}");
        }
        let none = "|-|.|e5|1e|1e5.5|0x10|1_000|1,000| 1|--1|1-|NaN|inf|1e401|1e-401|1e99999999999|1.2.3|１";
        for text in none.split('|') {
            assert_eq!(plain(text), None, "{text}");
        }
    }

    #[test]
    fn a_whole_number_is_exact_and_in_its_range() {
        let cycles = integer(1..=u64::MAX);
        assert_eq!(cycles("1e5"), Ok(100_000));
        assert_eq!(cycles("18446744073709551615"), Ok(u64::MAX));
        let refused = format!("must be a whole number from 1 to {}", u64::MAX);
        for text in "0 -1 1.5 1e-1 18446744073709551616 1e20 x".split(' ') {
            assert_eq!(cycles(text).unwrap_err(), refused);
        }
        assert_eq!(bins("1.28e2"), Ok(128));
        for text in ["4", "100", "2048", "many"] {
            let error = bins(text).unwrap_err();
            assert_eq!(error, "must be a power of two from 8 to 1024");
        }
    }

    #[test]
    fn a_list_names_the_number_that_is_wrong_or_missing() {
        let masked = |text| list(text, &[','], integer(0..=9u16));
        assert_eq!(masked("3, 4"), Ok(vec![3, 4]));
        assert!(masked("3,40").unwrap_err().starts_with("40 must be"));
        assert!(masked("x").unwrap_err().starts_with("must be"));
        for text in ["3,", ",3", "3,,4", "3, ,4", ","] {
            let error = masked(text).unwrap_err();
            assert_eq!(error, "a number is missing between separators or at an end");
        }
    }

    #[test]
    fn a_number_is_written_as_short_as_it_reads() {
        for bits in 0..=u16::MAX {
            let number = U8F8::from_bits(bits);
            let text = shortest(number);
            assert_eq!(fixed(&text), Ok(number), "{bits} {text}");
            let (shorter, _) = text.split_at(text.len() - 1);
            assert!(
                !text.contains('.') || fixed::<U8F8>(shorter) != Ok(number),
                "{text}"
            );
            let number = U4F12::from_bits(bits);
            assert_eq!(fixed(&shortest(number)), Ok(number));
        }
        assert_eq!(shortest(U8F8::from_bits(1076)), "4.203");
        assert_eq!(shortest(U8F8::lit("0.8")), "0.8");
        assert_eq!(shortest(I24F8::lit("-179.5")), "-179.5");
        assert_eq!(shortest(U16F16::lit("92.1")), "92.1");
        assert_eq!(
            shortest(U16F16::from_bits(1)).parse(),
            Ok(U16F16::from_bits(1))
        );
    }

    #[test]
    fn other_numbers_take_exponents_too() {
        assert_eq!(fixed::<U8F8>("4e0"), Ok(U8F8::lit("4")));
        assert_eq!(fixed::<I24F8>("-1795e-1"), Ok(I24F8::lit("-179.5")));
        let refused = |text| fixed::<U8F8>(text).unwrap_err();
        assert!(refused("256").starts_with("must be a number from 0"));
        assert!(refused("1e-3").contains("less than half"));
        assert_eq!(real("-2.5e-3"), Some(-2.5e-3));
        assert_eq!(POSITIVE.read("1e-300"), Ok(1e-300));
        for text in ["0", "-1", "inf", "1e-350", "1e309"] {
            assert_eq!(POSITIVE.read(text).unwrap_err(), "must be a number above 0");
        }
        let share = above_zero(0.1);
        assert_eq!(share.read("0.1"), Ok(0.1));
        assert_eq!(
            share.read("0.11").unwrap_err(),
            "must be a number above 0, at most 0.1"
        );
        let rate = keys::real(0.0, 1e6);
        assert_eq!([rate.read("0"), rate.read("1e6")], [Ok(0.0), Ok(1e6)]);
        for text in ["-1e-9", "1000001", "x"] {
            assert_eq!(
                rate.read(text).unwrap_err(),
                "must be a number from 0 to 1000000"
            );
        }
    }
}

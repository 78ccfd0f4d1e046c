//! Tables of names and values for people.

/// A name and a value.
pub type Row = (String, String);

/// A number with a comma between thousands: 12,345.
#[must_use]
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// One bin, or bins from the first to the last: bin 21, bins 3 to 7.
#[must_use]
pub fn bins(first: usize, last: usize) -> String {
    if first == last {
        format!("bin {first}")
    } else {
        format!("bins {first} to {last}")
    }
}

/// A number other than 0 with at least `digits` significant digits and at most 12 decimals.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "0 to 12"
)]
pub fn significant(value: f64, digits: u8) -> String {
    let decimals = f64::from(digits) - 1.0 - value.abs().log10().floor();
    let decimals = decimals.clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}")
}

/// A number that is not known to more than two digits, with commas.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates"
)]
#[must_use]
pub fn two_digits(number: f64) -> String {
    let number = number.round() as u64;
    let unit = 10u64.pow(number.max(1).ilog10().saturating_sub(1));
    grouped(number.saturating_add(unit / 2) / unit * unit)
}

/// A share other than 0 in percent, with at most two decimals unless it is below 0.01 %.
#[must_use]
pub fn percent(share: f64) -> String {
    if share < 1e-4 {
        return significant(100.0 * share, 2);
    }
    ((1e4 * share).round() / 100.0).to_string()
}

/// Replaces control characters, so that a name in a file cannot move the terminal's cursor.
#[must_use]
pub fn printable(text: &str) -> String {
    // Unicode does not count its direction marks, which reverse the text that follows, as control
    // characters.
    let turns = |character: char| {
        let marks = [
            '\u{200e}'..='\u{200f}',
            '\u{202a}'..='\u{202e}',
            '\u{2066}'..='\u{2069}',
        ];
        marks.iter().any(|marks| marks.contains(&character))
    };
    text.replace(
        |character: char| character.is_control() || turns(character),
        "\u{fffd}",
    )
}

/// Rows as lines of text: names to the left, values aligned, all [`printable`].
#[must_use]
pub fn aligned(rows: &[Row]) -> String {
    let width = rows
        .iter()
        .map(|(name, _)| name.chars().count())
        .max()
        .unwrap_or(0);
    rows.iter()
        .map(|row| (printable(&row.0), printable(&row.1)))
        .map(|(name, value)| format!("  {name:width$}  {value}\n"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_neither_move_the_cursor_nor_turn_the_line() {
        let name = "a\u{1b}[2J\u{202e}b\u{2067}\u{200f}\n é 漢 ש";
        assert_eq!(
            printable(name),
            "a\u{fffd}[2J\u{fffd}b\u{fffd}\u{fffd}\u{fffd} é 漢 ש"
        );
    }

    #[test]
    fn a_range_of_one_bin_is_that_bin() {
        assert_eq!([bins(21, 21), bins(3, 7)], ["bin 21", "bins 3 to 7"]);
    }

    #[test]
    fn two_digits_are_rounded() {
        let texts = [0.0, 7.4, 99.6, 124.0, 136_500.0, 1e30].map(two_digits);
        let whole = [
            "0",
            "7",
            "100",
            "120",
            "140,000",
            "18,000,000,000,000,000,000",
        ];
        assert_eq!(texts, whole);
    }

    #[test]
    fn a_percentage_has_at_most_two_decimals_unless_it_would_be_0() {
        let texts = [0.07, 0.01, 0.001_234, 0.15, 1.0, 1.2e-6].map(percent);
        assert_eq!(texts, ["7", "1", "0.12", "15", "100", "0.00012"]);
    }

    #[test]
    fn digits_count_from_the_first_that_is_not_0() {
        for (value, digits, text) in [
            (1234.5, 3, "1234"),
            (123.45, 3, "123"),
            (1.0, 3, "1.00"),
            (-0.012_345, 3, "-0.0123"),
            (0.999_9, 3, "1.000"),
            (0.012_344, 4, "0.01234"),
            (1e-11, 3, "0.000000000010"),
            (1e-30, 3, "0.000000000000"),
        ] {
            assert_eq!(significant(value, digits), text);
        }
    }
}

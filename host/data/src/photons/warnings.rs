//! Warnings about recordings that can be read but look wrong.

use std::collections::BTreeMap;

use dtof_core::fixed::types::U16F16;

use crate::options::numbers::shortest;
use crate::options::rows::grouped;

use crate::photons::bins::{FEWEST, MOST_BINS};
use crate::photons::histograms::Histograms;

/// No SPAD resolves a picosecond, so a narrower bin was probably given in nanoseconds.
#[must_use]
pub fn narrow_bins(width_ps: U16F16) -> Option<String> {
    (width_ps < U16F16::ONE && width_ps > U16F16::ZERO).then(|| {
        let given = shortest(width_ps);
        let ns = width_ps.to_num::<f64>() * 1000.0;
        let hint = match ns >= 1.0 {
            true => format!("{given} ns are {ns:.0}"),
            // A nanosecond in seconds or milliseconds, perhaps.
            false => "no TDC has such bins".to_owned(),
        };
        format!("bins of {given} ps: --bin-width-ps takes picoseconds; {hint}")
    })
}

/// Warns if all histograms are empty.
#[must_use]
pub fn empty_histograms(is_empty: impl Iterator<Item = bool>) -> Option<String> {
    let (mut all, mut empty) = (0u32, 0);
    for is_empty in is_empty {
        all += 1;
        empty += u32::from(is_empty);
    }
    (empty == all).then(|| format!("no photons: all {all} histograms are empty"))
}

/// Warns if half of the histograms have a bin with more than a photon a laser cycle. `highest` are their highest bins, each
/// the sum of `rebin`.
#[must_use]
pub fn few_cycles(mut highest: Vec<u64>, cycles: u64, rebin: u16) -> Option<String> {
    highest.sort_unstable();
    let median = highest.get(highest.len() / 2).copied().unwrap_or(0);
    (median > cycles.saturating_mul(rebin.into())).then(|| {
        let (cycles, median) = (grouped(cycles), grouped(median));
        format!(
            "--recorded-cycles {cycles}: half of the histograms have a bin of {median} photons or more; it is the number of \
             laser cycles that each histogram counted"
        )
    })
}

/// Warns if the first photon of a list comes after the `cycles` laser cycles that are read.
#[must_use]
pub fn late_photons(first_cycle: u64, cycles: u64) -> Option<String> {
    (first_cycle >= cycles).then(|| {
        let (first, cycles) = (grouped(first_cycle), grouped(cycles));
        let times = match first_cycle {
            1_000_000_000.. => "; if these are times, turn them into laser cycles counted from 0",
            _ => "; --cycles takes more, or count laser cycles from 0",
        };
        format!("no photon in the first {cycles} laser cycles: the first comes in laser cycle {first}{times}")
    })
}

/// The greatest number that divides both; the other one if one is 0.
#[must_use]
pub const fn greatest_divisor(mut one: u64, mut other: u64) -> u64 {
    while other > 0 {
        (one, other) = (other, one % other);
    }
    one
}

/// Warns if the photons of a list are all in the laser cycle `first`, or if their laser cycles, of which so many are
/// `different`, lie multiples of `divisor` apart, as times do.
#[must_use]
pub fn times_as_cycles(photons: u64, first: u64, different: u64, divisor: u64) -> Option<String> {
    /// Fewer photons or laser cycles may be so by chance.
    const FEWEST: u64 = 30;
    if photons >= FEWEST && different == 1 {
        return Some(format!(
            "all {} photons come in laser cycle {}: count the laser pulses, or save histograms",
            grouped(photons),
            grouped(first)
        ));
    }
    (different >= FEWEST && divisor > 1).then(|| {
        format!(
            "all laser cycles are multiples of {divisor} apart: if they are times, rates are {divisor} times too low; save \
             `cycle // {divisor}`, the number of the laser pulse"
        )
    })
}

/// Warns if `columns` do not divide the `pixels` of a list, or if they are missing and the pixels would make a square.
#[must_use]
pub fn list_shape(pixels: usize, columns: Option<u32>) -> Option<String> {
    let side = pixels.isqrt();
    let square = (side >= 4 && side * side == pixels).then_some(side);
    match (columns, square) {
        (None, Some(side)) => Some(format!(
            "{pixels} pixels are taken as one row; --columns {side} makes {side}x{side}"
        )),
        (Some(columns), _) if !pixels.is_multiple_of(columns as usize) => Some(format!(
            "{pixels} pixels do not fill rows of {columns} columns, or the last pixels have no photon"
        )),
        _ => None,
    }
}

/// From here on, an axis looks like the bins.
const LOOKS_LIKE_BINS: f64 = 4.0;
/// And if it is so many times as concentrated as the last axis.
const MORE_THAN_LAST: f64 = 1.5;
/// And so many times as much as the photons of all bins of its pixels, if the last looks like bins in some.
const MORE_THAN_PLACES: f64 = 2.0;

/// Of larger arrays some lines tell, with about so many counts.
const MOST_COUNTS: usize = 1 << 20;

/// How much more often two photons of a line fall into one place than if they were spread evenly, of all lines along an
/// axis. 1 for an even line whatever its noise, and its length if all are in one place.
#[derive(Clone, Default)]
struct Concentration {
    /// Lines with at least two photons, and the sum of their numbers, by a number's logarithm.
    classes: BTreeMap<i32, (f64, f64)>,
    /// Lines with fewer.
    empty: f64,
}

impl Concentration {
    fn along_last(pixels: &Histograms) -> Self {
        let mut all = Self::default();
        pixels
            .iter()
            .for_each(|bins| all.add(bins.into_iter(), 1.0));
        all
    }

    /// Adds a line, whose places are so much concentrated themselves.
    fn add(&mut self, line: impl Iterator<Item = u64>, places_are: f64) {
        let (mut places, mut sum, mut same) = (0.0, 0.0, 0.0);
        for count in line {
            let count = count as f64;
            places += 1.0;
            sum += count;
            same += count * (count - 1.0);
        }
        if sum < 2.0 {
            self.empty += 1.0;
            return;
        }
        let value: f64 = same * places / (sum * (sum - 1.0)) / places_are;
        // In steps of a sixteenth of an octave. Zero is the lowest.
        #[allow(clippy::cast_possible_truncation, reason = "saturates")]
        let class = self.classes.entry((value.log2() * 16.0) as i32);
        let (lines, total) = class.or_default();
        *lines += 1.0;
        *total += value;
    }

    /// The mean of the lines with two photons or more; 0 if there are none.
    fn mean(&self) -> f64 {
        let lines: f64 = self.classes.values().map(|(lines, _)| lines).sum();
        let total: f64 = self.classes.values().map(|(_, total)| total).sum();
        total / lines.max(1.0)
    }

    /// The mean of the less concentrated half of the lines, so that hot pixels do not speak for all. A line with fewer than
    /// two photons is even.
    fn of_lower_half(&self) -> f64 {
        let lines: f64 = self.classes.values().map(|(lines, _)| lines).sum();
        let half = (lines + self.empty) / 2.0;
        let (mut taken, mut sum) = (self.empty.min(half), self.empty.min(half));
        for (lines, total) in self.classes.values() {
            let part = lines.min(half - taken);
            taken += part;
            sum += total * part / lines;
        }
        sum / half.max(f64::MIN_POSITIVE)
    }
}

/// Warns if another axis than the last looks like the bins although the last was read as such. `axes` are the lengths of the
/// others, and their product is the number of `pixels`. Photons concentrate in a pulse along the bins: in most lines, while a
/// hot pixel is in few.
///
/// # Panics
/// Panics if an axis has no length, or if there are fewer pixels.
#[must_use]
pub fn swapped_axes(axes: &[usize], pixels: &Histograms) -> Option<String> {
    let (mut along_last, mut totals) = (Concentration::default(), Vec::new());
    for bins in pixels.iter() {
        totals.push(bins.iter().fold(0, |sum: u64, &n| sum.saturating_add(n)));
        along_last.add(bins.into_iter(), 1.0);
    }
    // If the last axis looks like bins in some pixels, bright ones among them make the others look so.
    let has_peaks = along_last.mean() >= LOOKS_LIKE_BINS;
    // Pixels without photons tell nothing.
    along_last.empty = 0.0;
    let of_last = along_last.of_lower_half();
    let brightest = (0..pixels.len()).max_by_key(|&pixel| totals[pixel]);
    let bins = pixels.bins();
    // Odd, so that all are seen of a regular pattern.
    let step = (pixels.len() * bins / MOST_COUNTS) | 1;
    let mut apart = pixels.len();
    let mut found = (LOOKS_LIKE_BINS.max(MORE_THAN_LAST * of_last), None);
    for (number, &length) in axes.iter().enumerate() {
        let whole = apart;
        apart /= length;
        if length < FEWEST {
            continue;
        }
        // If all lines pass one pixel, it may be hot, and a pulse is wider.
        let left_out = brightest.filter(|_| length == pixels.len());
        let (mut along, mut beyond_places) = (Concentration::default(), Concentration::default());
        for start in (0..pixels.len()).filter(|start| start % whole < apart) {
            let line = (start..).step_by(apart).take(length);
            let line = line.filter(|&pixel| Some(pixel) != left_out);
            let line: Vec<usize> = line.collect();
            let mut places = Concentration::default();
            places.add(line.iter().map(|&pixel| totals[pixel]), 1.0);
            let places_are = places.mean().max(1.0);
            for bin in (start % step..bins).step_by(step) {
                let line = || line.iter().map(|&pixel| pixels.count(pixel, bin));
                along.add(line(), 1.0);
                beyond_places.add(line(), places_are);
            }
        }
        let value = along.of_lower_half();
        let is_brightness = has_peaks && beyond_places.of_lower_half() < MORE_THAN_PLACES;
        if value > found.0 && !is_brightness {
            found = (value, Some(number));
        }
    }
    let number = found.1?;
    let which = match number {
        0 => "the first axis".to_owned(),
        number => format!("axis {} of {}", number + 1, axes.len() + 1),
    };
    let names = ["captures", "rows", "columns"];
    let says = match names.len().checked_sub(axes.len()) {
        Some(unused) => {
            let mut names = names[unused..].to_vec();
            names.insert(number, "bins");
            format!("if so: --axes {}", names.join(","))
        }
        None => "--axes says which is which".to_owned(),
    };
    Some(format!(
        "{which} looks like the bins, and the last like pixels; {says}"
    ))
}

/// Warns of three axes of which the last two are equal and the first is longer, unless the last looks like the bins: perhaps
/// bins, rows and columns. They were read as rows, columns and bins. `axes` are the lengths of the first two.
#[must_use]
pub fn bins_may_be_first(axes: &[usize], pixels: &Histograms) -> Option<String> {
    let bins = pixels.bins();
    let [rows, columns] = *axes else { return None };
    let may_be = columns == bins && bins >= FEWEST && rows > bins && rows <= MOST_BINS;
    (may_be && Concentration::along_last(pixels).mean() < LOOKS_LIKE_BINS).then(|| {
        format!(
            "{rows}x{columns}x{bins}: read as {rows} rows of {columns} columns with {bins} bins; if the first axis is the bins: \
             --axes bins,rows,columns, else --axes rows,columns,bins"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, Poisson, Uniform};
    use rand_pcg::Pcg64;

    fn swapped(axes: &[usize], pixels: &[Vec<u64>]) -> Option<String> {
        swapped_axes(axes, &Histograms::of(pixels.to_vec()).unwrap())
    }

    fn first(axes: &[usize], pixels: &[Vec<u64>]) -> Option<String> {
        bins_may_be_first(axes, &Histograms::of(pixels.to_vec()).unwrap())
    }

    #[test]
    fn bins_below_a_picosecond_are_probably_in_nanoseconds() {
        let warning = |ps: &str| narrow_bins(ps.parse().unwrap());
        for (ps, hint) in [
            ("0.9999", "0.9999 ns are 1000"),
            ("0.25", "0.25 ns are 250"),
            ("0.001", "0.001 ns are 1"),
            ("0.00099", "no TDC has such bins"),
        ] {
            let whole = format!("bins of {ps} ps: --bin-width-ps takes picoseconds; {hint}");
            assert_eq!(warning(ps), Some(whole));
        }
        for ps in ["0", "1", "1.5", "250"] {
            assert_eq!(warning(ps), None, "{ps}");
        }
    }

    #[test]
    fn only_a_recording_without_photons_is_empty() {
        let warning = |empty: [bool; 3]| empty_histograms(empty.into_iter());
        let whole = "no photons: all 3 histograms are empty";
        assert_eq!(warning([true; 3]).as_deref(), Some(whole));
        assert_eq!(warning([true, false, true]), None);
        assert_eq!(warning([false; 3]), None);
    }

    #[test]
    fn half_of_the_histograms_cannot_have_more_photons_in_a_bin_than_laser_cycles() {
        for (highest, cycles, rebin, median) in [
            (&[2001, 1, 2000, 1][..], 1999, 1, Some("2,000")),
            (&[1, 2000, 1, 1], 1999, 1, None),
            (&[2000, 1, 2000], 1999, 1, Some("2,000")),
            (&[1, 2000, 1], 1999, 1, None),
            (&[2000], 2000, 1, None),
            (&[4000], 1999, 2, Some("4,000")),
            (&[4000], 2000, 2, None),
            (&[], 1, 1, None),
        ] {
            let whole = median.map(|median| {
                format!(
                    "--recorded-cycles 1,999: half of the histograms have a bin of {median} photons or more; it is \
                     the number of laser cycles that each histogram counted"
                )
            });
            let warning = few_cycles(highest.to_vec(), cycles, rebin);
            assert_eq!(warning, whole, "{highest:?} {cycles} {rebin}");
        }
    }

    #[test]
    fn photons_after_the_last_laser_cycle_may_have_times() {
        let more = "--cycles takes more, or count laser cycles from 0";
        let times = "if these are times, turn them into laser cycles counted from 0";
        for (first, number, hint) in [
            (2_000, "2,000", more),
            (999_999_999, "999,999,999", more),
            (1_000_000_000, "1,000,000,000", times),
        ] {
            let whole = format!(
                "no photon in the first 2,000 laser cycles: the first comes in laser cycle {number}; {hint}"
            );
            assert_eq!(late_photons(first, 2_000), Some(whole));
        }
        assert_eq!(late_photons(1_999, 2_000), None);
    }

    #[test]
    fn the_greatest_divisor_divides_both() {
        for one in 0..60 {
            for other in 0..60 {
                let found = greatest_divisor(one, other);
                let divides = |number: &u64| one % number == 0 && other % number == 0;
                let expected = (1..=one.max(other)).rev().find(divides);
                assert_eq!(found, expected.unwrap_or(0), "{one} {other}");
            }
        }
    }

    #[test]
    fn laser_cycles_with_a_common_divisor_may_be_times() {
        let times = "all laser cycles are multiples of 100 apart: if they are times, rates are 100 times too low; save `cycle // \
                     100`, the number of the laser pulse";
        let one =
            "all 1,000 photons come in laser cycle 7: count the laser pulses, or save histograms";
        for (photons, different, divisor, warning) in [
            (1000, 900, 100, Some(times)),
            (30, 30, 100, Some(times)),
            (1000, 29, 100, None),
            (1000, 900, 1, None),
            (1000, 1, 0, Some(one)),
            (29, 1, 0, None),
        ] {
            let found = times_as_cycles(photons, 7, different, divisor);
            assert_eq!(found.as_deref(), warning, "{photons} {different} {divisor}");
        }
    }

    #[test]
    fn pixels_of_a_list_fill_their_rows() {
        let one_row = |pixels, side| {
            format!("{pixels} pixels are taken as one row; --columns {side} makes {side}x{side}")
        };
        let rest = |pixels, columns| {
            format!(
                "{pixels} pixels do not fill rows of {columns} columns, or the last pixels have no photon"
            )
        };
        for (pixels, columns, warning) in [
            (16, None, Some(one_row(16, 4))),
            (1024, None, Some(one_row(1024, 32))),
            // Too small for an array, or no square.
            (9, None, None),
            (15, None, None),
            (17, None, None),
            (16, Some(16), None),
            (16, Some(4), None),
            (15, Some(4), Some(rest(15, 4))),
            (16, Some(32), Some(rest(16, 32))),
        ] {
            assert_eq!(list_shape(pixels, columns), warning, "{pixels} {columns:?}");
        }
    }

    /// Two of n photons are in one place with the probability of pairs in one place ÷ pairs, and with 1 ÷ places if spread
    /// evenly.
    #[test]
    fn concentration_is_of_all_lines_or_of_their_less_concentrated_half() {
        let all_in_one = [2, 0, 0, 0]; // 4
        let most_in_one = [0, 3, 1, 0]; // 3 of 6 pairs: 2
        let a_little_more = [4, 0, 0, 1]; // 6 of 10 pairs: 2.4
        let apart = [1, 0, 1, 0]; // 0
        let even = [5; 4]; // 40 of 190 pairs: 16/19
        let one = [0, 0, 0, 1];
        let dark = [0; 4];
        for (lines, mean, lower) in [
            (&[all_in_one][..], 4.0, 4.0),
            (&[most_in_one], 2.0, 2.0),
            (&[apart], 0.0, 0.0),
            (&[even], 16.0 / 19.0, 16.0 / 19.0),
            // Without a pair a line is even, or left out of the mean.
            (&[one, dark], 0.0, 1.0),
            (&[one, dark, all_in_one, most_in_one], 3.0, 1.0),
            (&[one, apart, all_in_one], 2.0, 2.0 / 3.0),
            // Half of them are not always whole lines.
            (&[apart, most_in_one, all_in_one], 2.0, 2.0 / 3.0),
            (
                &[most_in_one, most_in_one, most_in_one, all_in_one],
                2.5,
                2.0,
            ),
            (&[most_in_one, all_in_one, all_in_one, all_in_one], 3.5, 3.0),
            (&[a_little_more, most_in_one], 2.2, 2.0),
        ] {
            let mut all = Concentration::default();
            lines
                .iter()
                .for_each(|line| all.add(line.iter().copied(), 1.0));
            let is_near = |value: f64, expected: f64| (value - expected).abs() < 1e-9;
            assert!(is_near(all.mean(), mean), "{lines:?} {}", all.mean());
            let half = all.of_lower_half();
            assert!(is_near(half, lower), "{lines:?} {half}");
        }
    }

    #[test]
    fn a_square_behind_a_longer_axis_may_be_rows_and_columns() {
        let even = |axes: &[usize], bins| first(axes, &lit(axes, 0, axes[0], &vec![100; bins]));
        let line = "17x16x16: read as 17 rows of 16 columns with 16 bins; if the first axis is the bins: \
                    --axes bins,rows,columns, else --axes rows,columns,bins";
        assert_eq!(even(&[17, 16], 16).unwrap(), line);
        assert!(even(&[4096, 8], 8).is_some());
        for (axes, bins) in [
            (&[16, 16][..], 16),
            (&[17, 16], 15),
            (&[17, 7], 7),
            (&[17, 16], 17),
            (&[17], 16),
            (&[2, 17, 16], 16),
            (&[4097, 8], 8),
        ] {
            assert_eq!(even(axes, bins), None, "{axes:?} {bins}");
        }
        // The last axis looks like the bins.
        let mut sharp = [0; 16];
        sharp[3] = 100;
        assert_eq!(first(&[17, 16], &vec![sharp.to_vec(); 17 * 16]), None);
    }

    /// Pixels of which those in the first `places` along an axis have such histograms, and the others no photon.
    fn lit(axes: &[usize], axis: usize, places: usize, bins: &[u64]) -> Vec<Vec<u64>> {
        let next: usize = axes[axis + 1..].iter().product();
        let is_lit = |pixel: usize| pixel / next % axes[axis] < places;
        let pixel = |pixel| {
            if is_lit(pixel) {
                bins.to_vec()
            } else {
                vec![0; bins.len()]
            }
        };
        (0..axes.iter().product()).map(pixel).collect()
    }

    #[test]
    fn the_axis_with_the_most_concentrated_lines_looks_like_the_bins() {
        let even = [100; 8];
        // The last axis has 3.83, so another needs 5.75.
        let uneven = [1500, 100, 100, 100, 100, 100, 100, 100];
        for (axes, axis, places, bins, which) in [
            (
                &[8, 3][..],
                0,
                1,
                even,
                Some(["the first axis", "bins,rows,columns"]),
            ),
            (
                &[3, 8],
                1,
                1,
                even,
                Some(["axis 2 of 3", "rows,bins,columns"]),
            ),
            (
                &[2, 8, 3],
                1,
                1,
                even,
                Some(["axis 2 of 4", "captures,bins,rows,columns"]),
            ),
            (
                &[2, 3, 8],
                2,
                1,
                even,
                Some(["axis 3 of 4", "captures,rows,bins,columns"]),
            ),
            // Too short for a histogram.
            (&[7, 3], 0, 1, even, None),
            // 99 of 199 pairs, and so 3.98 and 4.48.
            (&[8, 3], 0, 2, even, None),
            (
                &[9, 3],
                0,
                2,
                even,
                Some(["the first axis", "bins,rows,columns"]),
            ),
            // 5.5 and 6.
            (&[11, 3], 0, 2, uneven, None),
            (
                &[12, 3],
                0,
                2,
                uneven,
                Some(["the first axis", "bins,rows,columns"]),
            ),
            // The last axis has 8.
            (&[32, 3], 0, 1, [500, 0, 0, 0, 0, 0, 0, 0], None),
            // One pixel of a row may be hot.
            (&[16], 0, 1, even, None),
            (&[16], 0, 2, even, Some(["the first axis", "bins,columns"])),
        ] {
            let warning = swapped(axes, &lit(axes, axis, places, &bins));
            let whole = which.map(|[which, names]| {
                format!(
                    "{which} looks like the bins, and the last like pixels; if so: --axes {names}"
                )
            });
            assert_eq!(warning, whole, "{axes:?} {axis} {places} {bins:?}");
        }
    }

    /// A diagonal is as concentrated along rows as along columns.
    #[test]
    fn the_first_of_two_axes_that_look_alike_is_named() {
        let pixel = |pixel| vec![if pixel % 9 == 0 { 100 } else { 0 }; 8];
        let diagonal: Vec<_> = (0..64).map(pixel).collect();
        let warning = swapped(&[8, 8], &diagonal).unwrap();
        assert!(warning.starts_with("the first axis "), "{warning}");
    }

    /// Histograms of 16 bins for an array of these rows and columns, with so many photons of the background in a bin, and
    /// of the pulse in bin 9. Pixel 5 is hot.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "numbers of photons"
    )]
    fn counts(pixels: usize, background: f64, pulse: f64, hot: f64) -> Vec<Vec<u64>> {
        let mut rng = Pcg64::new(1, 1);
        let mut photons =
            |mean: f64| Poisson::new(mean).map_or(0.0, |law| law.sample(&mut rng)) as u64;
        let mut pixel = |number: usize| {
            let own = if number == 5 { hot } else { 0.0 };
            let mean = |bin: usize| background + own + if bin == 9 { pulse } else { 0.0 };
            (0..16).map(|bin| photons(mean(bin))).collect()
        };
        (0..pixels).map(&mut pixel).collect()
    }

    /// The same numbers with the bins as the first axis, in rows of `columns`.
    fn bins_first(pixels: &[Vec<u64>], columns: usize) -> Vec<Vec<u64>> {
        let flat = (0..16).flat_map(|bin| pixels.iter().map(move |bins| bins[bin]));
        let flat: Vec<u64> = flat.collect();
        flat.chunks(columns).map(<[u64]>::to_vec).collect()
    }

    #[test]
    fn a_hot_pixel_does_not_look_like_the_bins() {
        for (background, pulse) in [(2.0, 0.0), (50.0, 0.0), (2.0, 10.0), (50.0, 100.0)] {
            for hot in [0.0, 1e2, 1e4, 1e6] {
                for axes in [&[8, 16][..], &[16, 8], &[16], &[128]] {
                    let pixels = counts(axes.iter().product(), background, pulse, hot);
                    let warning = swapped(axes, &pixels);
                    assert_eq!(warning, None, "{axes:?} {background} {pulse} {hot}");
                }
            }
        }
    }

    /// A line of light, or a part of the array that is read.
    #[test]
    fn a_few_lit_rows_do_not_look_like_the_bins() {
        let wall = wall(64, 1.0, false);
        for lit in [1, 2, 4] {
            let dark = vec![0; 64];
            let pixel = |pixel: usize| {
                if pixel / 16 < lit {
                    wall[pixel % 256].clone()
                } else {
                    dark.clone()
                }
            };
            let pixels: Vec<Vec<u64>> = (0..32 * 16).map(pixel).collect();
            assert_eq!(swapped(&[32, 16], &pixels), None, "{lit}");
        }
        // More concentrated along the rows than along the bins.
        let mut bins = vec![5; 64];
        bins[40..42].fill(300);
        let pixels: Vec<Vec<u64>> = (0..128 * 16)
            .map(|pixel| {
                if pixel / 16 == 3 {
                    bins.clone()
                } else {
                    vec![0; 64]
                }
            })
            .collect();
        assert_eq!(swapped(&[128, 16], &pixels), None);
    }

    #[test]
    fn few_photons_do_not_look_like_the_bins() {
        for photons in [0.0, 0.001, 0.01, 0.03, 0.1, 0.3] {
            let warning = swapped(&[16, 16], &counts(256, photons, 0.0, 0.0));
            assert_eq!(warning, None, "{photons}");
        }
    }

    #[test]
    fn swapped_axes_are_warned_of() {
        let turned = bins_first(&counts(128, 5.0, 100.0, 0.0), 16);
        let warning = swapped(&[16, 8], &turned).unwrap();
        assert!(warning.starts_with("the first axis looks like the bins"));
    }

    /// Histograms of 16x16 pixels: a pulse of 60 photons at its peak, and one of the background in a bin. The wall stands at the
    /// middle, or slopes over a quarter of the bins.
    fn wall(bins: usize, sigma: f64, slopes: bool) -> Vec<Vec<u64>> {
        let mut rng = Pcg64::new(2, 2);
        let mut photons = |mean: f64| Poisson::new(mean).unwrap().sample(&mut rng);
        let mut pixel = |number: usize| {
            let slope = if slopes { 0.25 } else { 0.0 };
            let centre = bins as f64 * (0.4 + slope * (number % 16) as f64 / 16.0);
            let mut mean = |bin: usize| {
                let away = (bin as f64 - centre) / sigma;
                photons(1.0 + 60.0 * (-0.5 * away * away).exp())
            };
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "numbers of photons"
            )]
            (0..bins).map(|bin| mean(bin) as u64).collect()
        };
        (0..256).map(&mut pixel).collect()
    }

    #[test]
    fn a_narrow_pulse_in_many_bins_is_seen_along_the_right_axis() {
        for bins in [64, 128, 256, 512] {
            for (sigma, slopes) in [(0.5, false), (0.5, true), (1.0, false), (1.0, true)] {
                let pixels = wall(bins, sigma, slopes);
                let right = swapped(&[16, 16], &pixels);
                assert_eq!(right, None, "{bins} {sigma} {slopes}");
                let flat = (0..bins).flat_map(|bin| pixels.iter().map(move |bins| bins[bin]));
                let flat: Vec<u64> = flat.collect();
                let turned: Vec<Vec<u64>> = flat.chunks(16).map(<[u64]>::to_vec).collect();
                let warning = swapped(&[bins, 16], &turned);
                assert!(warning.is_some(), "{bins} {sigma} {slopes}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Pixels of any brightness, each with a target at another range or with none.
        #[test]
        fn scattered_targets_show_the_axis_of_the_bins(
            (rows, columns) in (8_usize..40, 8_usize..40),
            signal in 20.0..1000.0_f64,
            background in 0.01..1.0_f64,
            sigma in 0.4..1.5_f64,
            targets in 0.0..1.0_f64,
            seed: u64,
        ) {
            const BINS: usize = 128;
            let mut rng = Pcg64::seed_from_u64(seed);
            let mut uniform = |from: f64, to: f64| Uniform::new(from, to).unwrap().sample(&mut rng);
            let pixels = |share: f64, uniform: &mut dyn FnMut(f64, f64) -> f64| -> Vec<Vec<f64>> {
                (0..rows * columns)
                    .map(|_| {
                        let (at, bright) = (uniform(20.0, 110.0), uniform(-0.7, 0.7).exp());
                        let photons = if uniform(0.0, 1.0) < share { signal } else { 0.0 };
                        let peak = |bin: usize| {
                            let away = (bin as f64 + 0.5 - at) / sigma;
                            (-0.5 * away * away).exp() / (2.5066 * sigma)
                        };
                        (0..BINS)
                            .map(|bin| bright * (photons * peak(bin) + signal * background / BINS as f64))
                            .collect()
                    })
                    .collect()
            };
            let some = pixels(targets, &mut uniform);
            let all = pixels(1.0, &mut uniform);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "photons")]
            let mut counts = |pixels: Vec<Vec<f64>>| -> Vec<Vec<u64>> {
                let count = |mean: f64| Poisson::new(mean.max(1e-9)).unwrap().sample(&mut rng) as u64;
                let mut count = count;
                pixels.into_iter().map(|pixel| pixel.into_iter().map(&mut count).collect()).collect()
            };
            prop_assert_eq!(swapped(&[rows, columns], &counts(some)), None);
            let right = counts(all);
            prop_assert_eq!(swapped(&[rows, columns], &right), None);
            let flat = (0..BINS).flat_map(|bin| right.iter().map(move |bins| bins[bin]));
            let flat: Vec<u64> = flat.collect();
            let turned: Vec<Vec<u64>> = flat.chunks(columns).map(<[u64]>::to_vec).collect();
            let warning = swapped(&[BINS, rows], &turned);
            prop_assert!(warning.is_some_and(|text| text.starts_with("the first axis looks like the bins")));
        }
    }
}

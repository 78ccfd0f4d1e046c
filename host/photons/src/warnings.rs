//! Warnings about recordings that can be read but look wrong.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use dtof_core::fixed::types::U16F16;

use dtof_options::numbers::shortest;
use dtof_options::rows::grouped;

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

/// Warns if `columns` do not divide the `pixels` of a list, or if they are missing and the pixels would make a square.
#[must_use]
pub fn list_shape(pixels: usize, columns: Option<u32>) -> Option<String> {
    let side = pixels.isqrt();
    let square = (side >= 4 && side * side == pixels).then_some(side);
    match (columns, square) {
        (None, Some(side)) => Some(format!(
            "{pixels} pixels are taken as one row; --columns {side} makes {side}x{side}"
        )),
        (Some(columns), _) if columns > 0 && !pixels.is_multiple_of(columns as usize) => {
            Some(format!(
                "{pixels} pixels do not fill rows of {columns} columns, or the last pixels have no photon"
            ))
        }
        _ => None,
    }
}

/// One in so many pixels may be hot.
const HOT_ONE_IN: usize = 100;
/// With fewer photons that would meet by chance in one place, the number that does says little.
const FEWEST_BY_CHANCE: f64 = 5.0;
/// From here on, the last axis looks like the bins.
const LOOKS_LIKE_BINS: f64 = 1.5;
/// From here on, another axis does.
const MUST_BE_BINS: f64 = 4.0;

/// How much more often two photons of a line fall into one place than if they were spread evenly. 1
/// for an even line whatever its noise, and its length if all are in one place.
///
/// Lines weigh as much as they have pairs of photons, but none more than the median one. So a few bright lines, such as
/// those through a hot pixel, do not speak for all.
#[derive(Clone, Default)]
struct Concentration {
    /// Lines by the binary logarithm of their pairs.
    classes: BTreeMap<i32, Lines>,
    /// Pairs of photons that would meet by chance.
    by_chance: f64,
}

/// Sums over lines with about the same number of pairs.
#[derive(Clone, Copy, Default)]
struct Lines {
    lines: f64,
    meet: f64,
    pairs: f64,
}

impl Concentration {
    fn add(&mut self, line: impl Iterator<Item = u64>) {
        let (mut places, mut sum, mut same) = (0.0, 0.0, 0.0);
        for count in line {
            let count = count as f64;
            places += 1.0;
            sum += count;
            same += count * (count - 1.0);
        }
        let pairs: f64 = sum * (sum - 1.0) / 2.0;
        if pairs > 0.0 {
            #[allow(clippy::cast_possible_truncation, reason = "at most 128")]
            let class = self.classes.entry(pairs.log2() as i32).or_default();
            class.lines += 1.0;
            class.meet += same * places / 2.0;
            class.pairs += pairs;
            self.by_chance += pairs / places;
        }
    }

    fn value(&self) -> f64 {
        if self.by_chance < FEWEST_BY_CHANCE {
            return 1.0;
        }
        let all: f64 = self.classes.values().map(|class| class.lines).sum();
        let (mut lines, mut most) = (0.0, f64::INFINITY);
        let (mut meet, mut pairs) = (0.0, 0.0);
        for class in self.classes.values() {
            let of_line = class.pairs / class.lines;
            let weight = (most / of_line).min(1.0);
            meet += weight * class.meet;
            pairs += weight * class.pairs;
            lines += class.lines;
            if 2.0 * lines >= all {
                most = most.min(of_line);
            }
        }
        meet / pairs
    }
}

/// Warns if another axis than the last looks like the bins although the last was read as such. `axes` are
/// the lengths of the others. Photons concentrate in a pulse along the bins, and hardly along pixels, if hot ones are
/// left out.
#[must_use]
pub fn swapped_axes(axes: &[usize], pixels: &[Vec<u64>]) -> Option<String> {
    let mut along_last = Concentration::default();
    pixels
        .iter()
        .for_each(|bins| along_last.add(bins.iter().copied()));
    if along_last.value() >= LOOKS_LIKE_BINS {
        return None;
    }
    let total = |bins: &[u64]| bins.iter().fold(0u64, |sum, &n| sum.saturating_add(n));
    let mut brightest: Vec<usize> = (0..pixels.len()).collect();
    brightest.sort_by_key(|&pixel| Reverse(total(&pixels[pixel])));
    let mut is_left_out = vec![false; pixels.len()];
    for &pixel in &brightest[..pixels.len().div_ceil(HOT_ONE_IN)] {
        is_left_out[pixel] = true;
    }
    let mut apart = pixels.len();
    let mut found = (MUST_BE_BINS, None);
    for (number, &length) in axes.iter().enumerate() {
        let whole = apart;
        apart /= length.max(1);
        // A histogram has at least 8 bins.
        if length < 8 || apart * length != whole {
            continue;
        }
        let mut along = Concentration::default();
        for start in (0..pixels.len()).filter(|start| start % whole < apart) {
            let line = (start..).step_by(apart).take(length);
            let line = line.filter(|&pixel| !is_left_out[pixel]);
            let line: Vec<&[u64]> = line.map(|pixel| &pixels[pixel][..]).collect();
            let bins = line.first().map_or(0, |bins| bins.len());
            for bin in 0..bins {
                along.add(line.iter().map(|bins| bins[bin]));
            }
        }
        if along.value() > found.0 {
            found = (along.value(), Some(number));
        }
    }
    let which = match found.1? {
        0 => "the first axis".to_owned(),
        number => format!("axis {} of {}", number + 1, axes.len() + 1),
    };
    Some(format!(
        "{which} looks like the bins, and the last like pixels; --axes says which is which"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

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
                    let warning = swapped_axes(axes, &pixels);
                    assert_eq!(warning, None, "{axes:?} {background} {pulse} {hot}");
                }
            }
        }
    }

    #[test]
    fn few_photons_do_not_look_like_the_bins() {
        for photons in [0.0, 0.001, 0.01, 0.03, 0.1, 0.3] {
            let warning = swapped_axes(&[16, 16], &counts(256, photons, 0.0, 0.0));
            assert_eq!(warning, None, "{photons}");
        }
    }

    #[test]
    fn swapped_axes_are_warned_of() {
        let turned = bins_first(&counts(128, 5.0, 100.0, 0.0), 16);
        let warning = swapped_axes(&[16, 8], &turned).unwrap();
        assert!(warning.starts_with("the first axis looks like the bins"));
    }
}

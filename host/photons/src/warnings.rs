//! Warnings about recordings that can be read but look wrong.

use dtof_core::fixed::types::U16F16;

use dtof_options::rows::grouped;

/// No SPAD resolves a picosecond, so a narrower bin was probably given in nanoseconds.
#[must_use]
pub fn narrow_bins(width_ps: U16F16) -> Option<String> {
    (width_ps < U16F16::ONE && width_ps > U16F16::ZERO).then(|| {
        let (given, ns) = (width_ps.to_num::<f64>(), width_ps.to_num::<f64>() * 1000.0);
        format!(
            "bins of {given:.3} ps: --bin-width-ps takes picoseconds; {given:.3} ns are {ns:.0}"
        )
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

/// How much more often two photons of a line fall into one place than if they were spread evenly. 1
/// for an even line whatever its noise, and its length if all are in one place.
#[derive(Clone, Copy, Default)]
struct Concentration {
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
        self.meet += same * places;
        self.pairs += sum * (sum - 1.0);
    }

    fn value(self) -> f64 {
        if self.pairs > 0.0 {
            self.meet / self.pairs
        } else {
            1.0
        }
    }
}

/// Warns if another axis than the last looks like the bins although the last was read as such. `axes` are
/// the lengths of the others. Photons concentrate in a pulse along the bins, and hardly along pixels.
#[must_use]
pub fn swapped_axes(axes: &[usize], pixels: &[Vec<u64>]) -> Option<String> {
    let mut along_last = Concentration::default();
    pixels
        .iter()
        .for_each(|bins| along_last.add(bins.iter().copied()));
    if along_last.value() >= 2.0 {
        return None;
    }
    let mut apart = pixels.len();
    let mut found = (4.0, None);
    for (number, &length) in axes.iter().enumerate() {
        let whole = apart;
        apart /= length.max(1);
        // A histogram has at least 8 bins.
        if length < 8 || apart * length != whole {
            continue;
        }
        let mut along = Concentration::default();
        for start in (0..pixels.len()).filter(|start| start % whole < apart) {
            for bin in 0..pixels[start].len() {
                let line = pixels[start..].iter().step_by(apart).take(length);
                along.add(line.map(|bins| bins[bin]));
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

//! What is surely wrong with a recording that can be read all the same.

use dtof_core::fixed::types::U16F16;

/// No SPAD resolves a picosecond: a narrower bin was said in another unit.
#[must_use]
pub fn of_bin_width(width_ps: U16F16) -> Option<String> {
    (width_ps < U16F16::ONE && width_ps > U16F16::ZERO).then(|| {
        let (given, ns) = (width_ps.to_num::<f64>(), width_ps.to_num::<f64>() * 1000.0);
        format!(
            "bins of {given:.3} ps: --bin-width-ps takes picoseconds; {given:.3} ns are {ns:.0}"
        )
    })
}

/// Histograms without a photon, if each `is_empty`.
#[must_use]
pub fn of_photons(is_empty: impl Iterator<Item = bool>) -> Option<String> {
    let (mut all, mut empty) = (0u32, 0);
    for is_empty in is_empty {
        all += 1;
        empty += u32::from(is_empty);
    }
    (empty == all).then(|| format!("no photons: all {all} histograms are empty"))
}

/// How much more often two photons of a line meet in one place than if they were spread
/// evenly: 1 for an even line whatever its noise, its length if all are in one place.
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

/// An array whose first axis, of `first`, is the bins, and that was read as if its last were.
/// Along the bins there is a pulse, along pixels there is none: photons gather along the first
/// axis, and hardly along the last.
#[must_use]
pub fn of_axes(first: usize, pixels: &[Vec<u64>]) -> Option<String> {
    // Fewer are no histogram.
    if first < 8 || !pixels.len().is_multiple_of(first) {
        return None;
    }
    let mut along_last = Concentration::default();
    pixels
        .iter()
        .for_each(|bins| along_last.add(bins.iter().copied()));
    let apart = pixels.len() / first;
    let mut along_first = Concentration::default();
    for start in 0..apart {
        for bin in 0..pixels[start].len() {
            let line = pixels[start..].iter().step_by(apart);
            along_first.add(line.map(|bins| bins[bin]));
        }
    }
    (along_first.value() > 4.0 && along_last.value() < 2.0).then(|| {
        "the first axis looks like the bins, and the last like pixels; --axes says which is which"
            .to_owned()
    })
}

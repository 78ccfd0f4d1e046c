//! Whether targets are too bright for photons that count once per bin.

use dtof_core::PixelAddress;
use dtof_data::photons::pixel_counts::PixelCounts;

/// Photons a bin and laser cycle above which the depth of a pulse suffers: a fifth of them is lost in its
/// middle, and less at its sides.
const MOST: f64 = 0.5;

/// Names the brightest pixel if it has more than half a photon a laser cycle in a bin, on average over the run.
/// `addresses` are those of the pixels.
pub(crate) fn bright_bins(counts: &PixelCounts, addresses: &[PixelAddress]) -> Option<String> {
    let highest = (0..counts.pixels()).map(|place| {
        let highest = counts.histogram(place).iter().zip(0..).max()?;
        let cycles = counts.cycles(place).max(1) as f64;
        Some((f64::from(*highest.0) / cycles, highest.1))
    });
    let bright = highest.zip(addresses);
    let bright: Vec<(f64, usize, u16)> = bright
        .filter_map(|(highest, address)| highest.map(|(rate, bin)| (rate, bin, address.raw())))
        .filter(|&(rate, ..)| rate > MOST)
        .collect();
    let (rate, bin, pixel) = bright
        .iter()
        .max_by(|one, other| one.0.total_cmp(&other.0))?;
    let number = bright.len();
    Some(format!(
        "{number} of {} pixels have more than half a photon a laser cycle in a bin, pixel {pixel} {rate:.2} in \
         bin {bin}: counted once per bin they lose a fifth or more of their light, and depth suffers",
        counts.pixels()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_data::photons::source::{Photon, PixelPhotons, Slice};

    /// Pixels with so many photons in bin 5 in ten laser cycles, two slices each.
    fn warning(photons: [usize; 2]) -> Option<String> {
        let mut counts = PixelCounts::new(2, 8);
        let pixel = |number| PixelPhotons {
            cycles: 5,
            photons: vec![Photon { cycle: 0, code: 5 }; number],
        };
        for first_cycle in [0, 5] {
            counts.add(&Slice {
                first_cycle,
                pixels: photons.map(|number| pixel(number / 2)).into(),
            });
        }
        bright_bins(&counts, &[3, 9].map(PixelAddress::new))
    }

    #[test]
    fn more_than_half_a_photon_in_a_bin_is_warned_of() {
        assert_eq!(warning([4, 4]), None);
        let text = warning([4, 6]).unwrap();
        assert!(text.starts_with("1 of 2 pixels have"), "{text}");
        assert!(text.contains("pixel 9 0.60 in bin 5:"), "{text}");
        let text = warning([20, 8]).unwrap();
        assert!(text.starts_with("2 of 2 pixels have"), "{text}");
        assert!(text.contains("pixel 3 2.00 in bin 5:"), "{text}");
    }
}

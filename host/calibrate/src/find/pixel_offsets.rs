//! The offset of each pixel, where pixels differ by more than their noise.
//!
//! An F test over the pixels decides, as their variance is estimated from the scatter between captures; with one capture
//! the noise of the photons is all that is known, and it is a chi-square test. With pixels that do not differ it says in
//! at most one of a thousand recordings that they do. The offset of a pixel is then drawn towards the median by the share of its variance
//! that is noise.

use super::significance::median;

/// The standard deviation of the bias that the estimator has within a bin, in bins.
const FLOOR_BINS: f64 = 0.02;
/// Farther off, a pixel sees something else than the target.
pub const LARGEST_MM: f64 = 120.0;
/// The quantile of a normal value for one false alarm in a thousand.
const ONE_IN_THOUSAND: f64 = 3.090_232;

/// A histogram before a surface at a known range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The pixel, counted from 0 in each capture.
    pub pixel: usize,
    /// The true range less the measured one, in millimetres.
    pub error_mm: f64,
    /// Its standard deviation by the noise of the photons.
    pub noise_mm: f64,
}

/// By how much the pixels differ.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelOffsets {
    /// Millimetres to add to the range offset, for each pixel of a capture. Empty if the pixels do not differ, except by
    /// the offsets that they have.
    pub mm: Vec<f64>,
    /// The standard deviation of the differences without their noise.
    pub spread_mm: f64,
    /// Millimetres to add to the range offset.
    pub median_mm: f64,
    /// Pixels that see nothing where the target is: their offset is 0, or as it was.
    pub without: Vec<usize>,
    /// Whether the pixels have no offsets although they differ: a flat target is farther away at the edges of the
    /// array, and the field of view is not known.
    pub needs_field_of_view: bool,
}

/// Mean and variance of a pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: usize,
    weight: f64,
    first: f64,
    second: f64,
}

/// Finds the offsets of an array of `pixels` pixels, the `good` of which are neither hot nor dead; `None` if fewer
/// than two pixels see the target.
#[must_use]
pub fn pixel_offsets(
    measured: &[Measured],
    pixels: usize,
    good: impl Fn(usize) -> bool,
    mm_per_bin: f64,
) -> Option<PixelOffsets> {
    let floor = (FLOOR_BINS * mm_per_bin).powi(2);
    let limit = LARGEST_MM.max(mm_per_bin);
    let mut sums = vec![Sums::default(); pixels];
    for one in measured.iter().filter(|one| one.error_mm.abs() <= limit) {
        let weight = 1.0 / (one.noise_mm.powi(2) + floor);
        let sums = &mut sums[one.pixel];
        sums.count += 1;
        sums.weight += weight;
        sums.first += weight * one.error_mm;
        sums.second += weight * one.error_mm.powi(2);
    }
    let seen = |pixel: &usize| sums[*pixel].count > 0;
    let (with, without): (Vec<usize>, Vec<usize>) =
        (0..pixels).filter(|&pixel| good(pixel)).partition(seen);
    if with.len() < 2 {
        return None;
    }
    let mean = |pixel: usize| sums[pixel].first / sums[pixel].weight;
    // More scatter from capture to capture than noise explains is no property of pixels.
    let scatter = with.iter().map(|&pixel| {
        let of = sums[pixel];
        (of.second - of.first.powi(2) / of.weight).max(0.0)
    });
    let repeats: usize = with.iter().map(|&pixel| sums[pixel].count - 1).sum();
    let excess = (scatter.sum::<f64>() / repeats.max(1) as f64).max(1.0);
    let variance = |pixel: usize| (excess / sums[pixel].weight).max(floor);
    let weight: f64 = with.iter().map(|&pixel| 1.0 / variance(pixel)).sum();
    let centre = with.iter().map(|&pixel| mean(pixel) / variance(pixel));
    let centre = centre.sum::<f64>() / weight;
    let statistic = with
        .iter()
        .map(|&pixel| (mean(pixel) - centre).powi(2) / variance(pixel));
    let (statistic, freedom) = (statistic.sum::<f64>(), (with.len() - 1) as f64);
    let differ = exceeds_one_in_thousand(statistic / freedom, freedom, repeats);
    // The variance of the differences (DerSimonian and Laird).
    let squares = with.iter().map(|&pixel| variance(pixel).powi(-2));
    let spread = (statistic - freedom) / (weight - squares.sum::<f64>() / weight);
    let spread = spread.max(0.0);
    let median_mm = median(with.iter().map(|&pixel| mean(pixel)));
    let mut mm = Vec::new();
    if differ {
        mm = vec![0.0; pixels];
        for &pixel in &with {
            mm[pixel] = (mean(pixel) - median_mm) * spread / (spread + variance(pixel));
        }
    }
    Some(PixelOffsets {
        median_mm: if differ { median_mm } else { 0.0 },
        mm,
        spread_mm: spread.sqrt(),
        without,
        needs_field_of_view: false,
    })
}

impl PixelOffsets {
    /// The same if the field of view is not known.
    #[must_use]
    pub fn without_field_of_view(self) -> Self {
        Self {
            needs_field_of_view: !self.mm.is_empty(),
            mm: Vec::new(),
            median_mm: 0.0,
            ..self
        }
    }
}

/// Whether at most one of a thousand values of an F distribution exceeds `ratio`, by Paulson's approximation. With as
/// many repeats as there may be, and without any, this is the chi-square distribution. Fewer than three repeats show
/// nothing.
fn exceeds_one_in_thousand(ratio: f64, freedom: f64, repeats: usize) -> bool {
    let ninth = |freedom: f64| 2.0 / (9.0 * freedom);
    let own = ninth(freedom);
    let of_repeats = if repeats == 0 {
        0.0
    } else {
        ninth(repeats as f64)
    };
    let root = ratio.cbrt();
    let deviation = (of_repeats * root * root + own).sqrt();
    (1.0 - of_repeats) * root - (1.0 - own) > ONE_IN_THOUSAND * deviation
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, Normal};

    fn measured(offsets: &[f64], noise_mm: f64, captures: usize, seed: u64) -> Vec<Measured> {
        let mut rng = dtof_data::random::pixel_rng(seed, dtof_core::PixelAddress::new(0));
        let noise = Normal::new(0.0, noise_mm).unwrap();
        let of_capture = |_| {
            let all = offsets.iter().enumerate();
            let all = all.map(|(pixel, offset)| Measured {
                pixel,
                error_mm: offset + noise.sample(&mut rng),
                noise_mm,
            });
            all.collect::<Vec<_>>()
        };
        (0..captures).flat_map(of_capture).collect()
    }

    #[test]
    fn the_limit_is_that_of_the_tables_or_a_little_above() {
        for (freedom, repeats, exact) in [
            (1.0, 0, 10.828),
            (10.0, 0, 2.9588),
            (63.0, 0, 1.641_94),
            (1000.0, 0, 1.143_917),
            (8.0, 8, 12.046),
            (8.0, 18, 5.763),
            (63.0, 64, 2.193),
            (63.0, 640, 1.696),
        ] {
            let exceeds = |ratio| exceeds_one_in_thousand(ratio, freedom, repeats);
            assert!(!exceeds(exact), "{freedom} {repeats}");
            assert!(exceeds(exact * 1.1), "{freedom} {repeats}");
        }
        // Two repeats tell nothing of a variance.
        assert!(!exceeds_one_in_thousand(1e9, 8.0, 2));
    }

    /// The noise of the photons is not all: captures differ ten times as much.
    #[test]
    fn of_a_thousand_recordings_of_equal_pixels_at_most_one_gets_offsets() {
        for (pixels, captures) in [(9, 2), (64, 2)] {
            let has_offsets = |seed: &u64| {
                let mut all = measured(&vec![0.0; pixels], 20.0, captures, *seed);
                for one in &mut all {
                    one.noise_mm = 2.0;
                }
                let found = pixel_offsets(&all, pixels, |_| true, 50.0).unwrap();
                !found.mm.is_empty()
            };
            let wrong = (0..4000).filter(has_offsets).count();
            assert!(wrong <= 4, "{pixels} {captures}: {wrong} of 4000");
        }
    }

    #[test]
    fn offsets_are_found_with_a_median_of_zero_and_drawn_in_where_noise_is_large() {
        let truth: Vec<f64> = (0..64)
            .map(|pixel| f64::from(pixel % 8) * 20.0 - 60.0)
            .collect();
        let mut all = measured(&truth, 2.0, 1, 1);
        all[5].noise_mm = 300.0;
        all[9].error_mm = 900.0; // sees something else
        let found = pixel_offsets(&all, 64, |pixel| pixel != 20, 50.0).unwrap();
        assert_eq!((found.without, found.mm[9]), (vec![9], 0.0));
        assert!((found.median_mm - 0.0).abs() < 3.0, "{}", found.median_mm);
        assert!((found.spread_mm - 46.0).abs() < 3.0, "{}", found.spread_mm);
        for pixel in (0..64).filter(|pixel| ![5, 9, 20].contains(pixel)) {
            let off = found.mm[pixel] + found.median_mm - truth[pixel];
            assert!(off.abs() < 8.0, "{pixel}: {off}");
        }
        assert!(found.mm[5].abs() < 3.0, "{}", found.mm[5]);
    }

    #[test]
    fn scatter_from_capture_to_capture_is_no_property_of_pixels() {
        // Ten times the noise that photons explain.
        let mut all = measured(&[0.0; 64], 20.0, 4, 2);
        for one in &mut all {
            one.noise_mm = 2.0;
        }
        let found = pixel_offsets(&all, 64, |_| true, 50.0).unwrap();
        assert!(found.mm.is_empty(), "{found:?}");
        let truth: Vec<f64> = (0..64).map(|pixel| f64::from(pixel % 2) * 80.0).collect();
        let mut all = measured(&truth, 20.0, 4, 2);
        for one in &mut all {
            one.noise_mm = 2.0;
        }
        assert_eq!(
            pixel_offsets(&all, 64, |_| true, 50.0).unwrap().mm.len(),
            64
        );
    }

    #[test]
    fn a_single_pixel_has_no_offset() {
        assert_eq!(
            pixel_offsets(&measured(&[3.0], 1.0, 5, 3), 1, |_| true, 50.0),
            None
        );
        assert_eq!(pixel_offsets(&[], 9, |_| true, 50.0), None);
    }
}

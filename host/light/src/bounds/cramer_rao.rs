//! The Cramér-Rao bound of a pulse's position in a histogram: no unbiased estimate
//! has a smaller variance.
//!
//! The pulse's shape is known; position µ, amplitude S and background b are not.
//! Bin i holds a Poisson number of mean `m_i = S·h_i(µ) + b`, so the Fisher
//! information of two parameters is `Σ ∂m_i·∂m_i / m_i`, and the bound is the
//! element of position of the inverse of that 3×3 matrix.

use crate::rates::{bin_share, pulse_density};

/// A pulse over background, in mean counts of a whole exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Signal photons, above 0.
    pub signal: f64,
    /// Background photons a bin, above 0.
    pub background: f64,
    /// Standard deviation in bins, above 0.
    pub sigma: f64,
}

impl Pulse {
    /// The smallest variance of the position, in bins², for a pulse at `position` in a
    /// histogram of `bins` bins.
    #[must_use]
    pub fn position_variance(&self, bins: u32, position: f64) -> f64 {
        // The Fisher information of each pair of position, amplitude and background.
        let [mut pp, mut pa, mut pb, mut aa, mut ab, mut bb] = [0.0; 6];
        for bin in 0..bins {
            let share = bin_share(bin, position, self.sigma);
            let density = |edge: u32| pulse_density(edge.into(), position, self.sigma);
            let slope = self.signal * (density(bin) - density(bin + 1));
            let mean = self.signal * share + self.background;
            pp += slope * slope / mean;
            pa += slope * share / mean;
            pb += slope / mean;
            aa += share * share / mean;
            ab += share / mean;
            bb += 1.0 / mean;
        }
        // The information that is lost because amplitude and background are unknown.
        let lost = (pa * pa * bb - 2.0 * pa * pb * ab + pb * pb * aa) / (aa * bb - ab * ab);
        1.0 / (pp - lost)
    }

    /// The smallest root mean square error, in bins, averaged over the position of the
    /// pulse within a bin, in the middle of 128 bins.
    #[must_use]
    pub fn position_error(&self) -> f64 {
        const POSITIONS: u32 = 64;
        let variance = |index: u32| {
            let within = f64::from(index) / f64::from(POSITIONS);
            self.position_variance(128, 64.0 + within)
        };
        let mean = (0..POSITIONS).map(variance).sum::<f64>() / f64::from(POSITIONS);
        mean.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_background_and_with_fine_bins_it_is_the_error_of_a_mean() {
        // σ²/S for photons with exact times. A bin adds a variance of 1/12.
        let pulse = Pulse {
            signal: 50.0,
            background: 1e-9,
            sigma: 8.0,
        };
        let expected = (64.0 + 1.0 / 12.0) / 50.0;
        let found = pulse.position_error().powi(2);
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn it_equals_gauss_jordan_on_numerical_derivatives() {
        // The end of the histogram cuts the second pulse.
        for (bins, position) in [(32, 15.3), (8, 0.4)] {
            check_position_variance(bins, position);
        }
    }

    fn check_position_variance(bins: u32, position: f64) {
        let pulse = Pulse {
            signal: 60.0,
            background: 2.0,
            sigma: 0.7,
        };
        let means = |position: f64, signal: f64, background: f64| {
            let mean = move |bin| signal * bin_share(bin, position, 0.7) + background;
            (0..bins).map(mean).collect::<Vec<f64>>()
        };
        let step = 1e-5;
        let slope = |by: [f64; 3]| {
            let at = |sign: f64| {
                means(
                    position + sign * by[0],
                    60.0 + sign * by[1],
                    2.0 + sign * by[2],
                )
            };
            let pairs = at(1.0).into_iter().zip(at(-1.0));
            pairs.map(|(up, down)| (up - down) / (2.0 * step)).collect()
        };
        let slopes: [Vec<f64>; 3] =
            [[step, 0.0, 0.0], [0.0, step, 0.0], [0.0, 0.0, step]].map(slope);
        let mean = means(position, 60.0, 2.0);
        let mut rows: Vec<Vec<f64>> = (0..3)
            .map(|row| {
                let information = |column: usize| {
                    let pairs = slopes[row].iter().zip(&slopes[column]).zip(&mean);
                    pairs.map(|((row, column), mean)| row * column / mean).sum()
                };
                let mut row_of: Vec<f64> = (0..3).map(information).collect();
                // The right side: the unit vector of position.
                row_of.push(f64::from(u8::from(row == 0)));
                row_of
            })
            .collect();
        for pivot in 0..3 {
            let of: Vec<f64> = rows[pivot]
                .iter()
                .map(|value| value / rows[pivot][pivot])
                .collect();
            for (index, row) in rows.iter_mut().enumerate() {
                let factor = row[pivot];
                for (value, of) in row.iter_mut().zip(&of) {
                    *value = if index == pivot {
                        *of
                    } else {
                        *value - factor * of
                    };
                }
            }
        }
        let found = pulse.position_variance(bins, position);
        assert!(
            (found / rows[0][3] - 1.0).abs() < 1e-6,
            "{found} {}",
            rows[0][3]
        );
    }

    #[test]
    fn the_error_falls_with_the_root_of_the_counts() {
        let of = |factor: f64| Pulse {
            signal: 40.0 * factor,
            background: 1.5 * factor,
            sigma: 1.1,
        };
        let ratio = of(1.0).position_error() / of(9.0).position_error();
        assert!((ratio - 3.0).abs() < 1e-12);
    }
}

//! Pile-up: a TDC that records one photon a laser cycle misses all photons after the first.
//!
//! Of `N` laser cycles, `N_i` have no photon before bin `i`. With `h_i` photons in the bin, Coates'
//! estimator of the photons that arrived is `N·ln(N_i / (N_i - h_i))`. With such a TDC the background of a
//! bin is proportional to `N_i`; with any other it is constant. So it is proportional to a power of `N_i`,
//! which is 1 or 0. A straight line through the counts of background bins over `ln N_i` decides.

use super::background::Level;
use super::observed::Trace;

/// Standard deviations between the power and 1/2 that decide.
const DECIDES: f64 = 4.0;

/// The kind of TDC, as histograms show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tdc {
    /// One photon a laser cycle. This share of the arriving photons is lost.
    OneHit(f64),
    /// More than one, or so little light that it makes no difference.
    SeveralHits,
    /// Not decided. With one photon a laser cycle this share would be lost.
    Unclear(f64),
}

/// The TDC that recorded `traces`, whose laser cycles are known.
#[must_use]
pub fn tdc(traces: &[Trace]) -> Tdc {
    let (mut covariance, mut information) = (0.0, 0.0);
    let (mut counted, mut arrived) = (0.0, 0.0);
    for trace in traces {
        let total: f64 = trace.counts.iter().sum();
        if total > trace.cycles {
            return Tdc::SeveralHits;
        }
        let (corrected, left) = coates(&trace.counts, trace.cycles);
        counted += total;
        arrived += corrected.iter().sum::<f64>();
        // Only bins that are background under both hypotheses, so that neither is favoured.
        let [plain, other] = [&trace.counts, &corrected].map(|counts| Level::of(counts).clear);
        let clear: Vec<(f64, f64)> = (0..left.len())
            .filter(|&bin| plain[bin] && other[bin] && left[bin] > 0.0)
            .map(|bin| (left[bin].ln(), trace.counts[bin]))
            .collect();
        let bins = clear.len().max(1) as f64;
        let middle = clear.iter().map(|bin| bin.0).sum::<f64>() / bins;
        let mean = clear.iter().map(|bin| bin.1).sum::<f64>() / bins;
        for (log, count) in clear {
            covariance += (log - middle) * count;
            information += (log - middle).powi(2) * mean;
        }
    }
    let lost = if arrived > 0.0 {
        1.0 - counted / arrived
    } else {
        0.0
    };
    let from_half = (covariance - 0.5 * information) / information.max(1e-12).sqrt();
    if from_half > DECIDES {
        Tdc::OneHit(lost)
    } else if from_half < -DECIDES {
        Tdc::SeveralHits
    } else {
        Tdc::Unclear(lost)
    }
}

/// For each bin the photons that arrived, and the laser cycles without a photon before it.
#[must_use]
pub fn coates(counts: &[f64], cycles: f64) -> (Vec<f64>, Vec<f64>) {
    let mut left = cycles;
    let bins = counts.iter().map(|&count| {
        let before = left;
        left = (left - count).max(0.0);
        // If no laser cycle is left, half of one bounds the logarithm.
        let arrived = if before > 0.0 {
            cycles * (before / left.max(0.5)).ln().max(0.0)
        } else {
            0.0
        };
        (arrived, before)
    });
    bins.unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coates_estimator_inverts_pile_up() {
        let rates = [0.1, 0.4, 0.05, 0.0, 0.9];
        let cycles = 1e6;
        let mut left = cycles;
        let counts = rates.map(|rate: f64| {
            let count = left * -(-rate).exp_m1();
            left -= count;
            count
        });
        let (came, _) = coates(&counts, cycles);
        for (came, rate) in came.iter().zip(rates) {
            assert!((came / cycles - rate).abs() < 1e-9);
        }
    }
}

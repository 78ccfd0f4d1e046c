//! Counts of a detector that is blind for some bins after each photon.
//!
//! Of `N` laser cycles, bin `b` was live in `live(b) = N - Σ counts of the D bins before b`. A live bin
//! has a photon or none, so that `-N·ln(1 - count/live)` estimates the photons that arrived. If D is the
//! whole histogram, only the first photon of a laser cycle counts, and this is the estimator of P. B. Coates,
//! "The correction for photon 'pile-up' in the measurement of radiative lifetimes", J. Phys. E 1 (1968) 878.

/// For each bin the laser cycles in which it was live; less than 0 if the counts contradict the dead time.
#[must_use]
pub fn live(counts: &[f64], cycles: f64, dead_time: usize) -> Vec<f64> {
    let mut live = cycles;
    let bins = counts.iter().enumerate().map(|(bin, &count)| {
        let here = live;
        let ended = bin.checked_sub(dead_time).and_then(|bin| counts.get(bin));
        live += ended.copied().unwrap_or(0.0) - count;
        here
    });
    bins.collect()
}

/// For each bin the photons that arrived in all laser cycles. If none of its live laser cycles is without a
/// photon, half of one bounds the logarithm; a bin that was never live has 0.
#[must_use]
pub fn arrived(counts: &[f64], cycles: f64, dead_time: usize) -> Vec<f64> {
    let live = live(counts, cycles, dead_time).into_iter();
    let bins = live.zip(counts).map(|(live, count)| {
        if live > 0.0 {
            cycles * (live / (live - count).max(0.5)).ln().max(0.0)
        } else {
            0.0
        }
    });
    bins.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimate_inverts_the_dead_time() {
        let rates: [f64; 5] = [0.1, 0.4, 0.05, 0.0, 0.9];
        let cycles = 1e6;
        for dead_time in 1..=5 {
            let mut counts: Vec<f64> = Vec::new();
            for (bin, rate) in rates.into_iter().enumerate() {
                let blind: f64 = counts[bin.saturating_sub(dead_time)..].iter().sum();
                counts.push((cycles - blind) * -(-rate).exp_m1());
            }
            let found = arrived(&counts, cycles, dead_time);
            assert_eq!(found.len(), rates.len());
            for (arrived, rate) in found.iter().zip(rates) {
                assert!((arrived / cycles - rate).abs() < 1e-9);
            }
        }
        assert_eq!(live(&[3.0, 2.0, 1.0, 1.0], 10.0, 2), [10.0, 7.0, 5.0, 7.0]);
        assert_eq!(live(&[8.0, 4.0, 0.0], 10.0, 3), [10.0, 2.0, -2.0]);
    }
}

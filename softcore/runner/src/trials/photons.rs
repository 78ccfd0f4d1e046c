//! Simulated photons for the FIFO.

use anyhow::Result;
use dtof_light::SimulatedPixel;
use dtof_light::rates::Rates;
use dtof_softcore::stream::BINS;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;

/// Rates are counted in so many photons a laser cycle, [`PER_PHOTON`] make one.
pub const UNIT: f64 = 1e-5;
pub const PER_PHOTON: u32 = 100_000;

/// A photon that is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photon {
    pub cycle: u32,
    pub pixel: u8,
    pub code: u16,
}

/// In the order of their laser cycles.
pub type Photons = Vec<Photon>;

/// Photons of so many `pixels` over so many laser cycles. The `rate` is that of all pixels
/// in [`UNIT`]; `signal` is a share of it.
pub fn photons(pixels: u8, rate: u32, signal: f64, length: u32) -> Result<Photons> {
    let bins = u16::try_from(BINS)?;
    let each = f64::from(rate) * UNIT / f64::from(pixels);
    let mut simulated = Vec::new();
    for pixel in 0..pixels {
        let rates = Rates {
            background: each * (1.0 - signal) / f64::from(bins),
            signal: each * signal,
            // Targets at four ranges.
            position: 20.5 + 25.0 * f64::from(pixel % 4),
            sigma: 0.5,
        };
        let random = Pcg64::seed_from_u64(pixel.into());
        simulated.push(SimulatedPixel::new(&rates, bins, random)?);
    }
    let mut photons = Vec::new();
    for cycle in 0..length {
        for (pixel, simulated) in (0..).zip(&mut simulated) {
            simulated.next_cycle(|code| photons.push(Photon { cycle, pixel, code }));
        }
    }
    Ok(photons)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_come_in_order_and_as_many_as_asked() {
        let photons = photons(4, PER_PHOTON / 10, 0.5, 500_000).unwrap();
        let mut last = 0;
        for photon in &photons {
            assert!(photon.cycle >= last && photon.cycle < 500_000);
            last = photon.cycle;
        }
        // A Poisson count of mean 50,000; five standard deviations.
        assert!(photons.len().abs_diff(50_000) < 5 * 224);
    }
}

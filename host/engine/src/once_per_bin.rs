//! Photons of one laser cycle in one bin count once: [`dtof_core::OncePerBin`], for an engine.

use anyhow::Result;
use dtof_core::{DepthEvent, OncePerBin, PixelAddress, Statistics};
use rayon::prelude::*;

use super::Engine;
use super::decisions::Decision;
use dtof_data::photons::source::{PixelPhotons, Slice};

/// Those of the widest histogram.
type Bins = OncePerBin<{ OncePerBin::words(1024) }>;

/// An engine that does not receive the other photons of a bin.
pub struct OncePerBinEngine {
    engine: Box<dyn Engine>,
    bins: usize,
    repeated: u64,
}

impl OncePerBinEngine {
    /// Wraps an engine whose histograms have so many bins.
    #[must_use]
    pub fn new(engine: Box<dyn Engine>, bins: usize) -> Self {
        Self {
            engine,
            bins,
            repeated: 0,
        }
    }
}

/// The first photon of each bin and laser cycle, and all past the last bin. A slice has whole laser
/// cycles.
fn first(received: &PixelPhotons, bins: usize) -> PixelPhotons {
    let mut seen = Bins::new();
    let mut cycle = 0;
    let photons = received.photons.iter().filter(|photon| {
        if photon.cycle != cycle {
            seen.end_laser_cycle();
            cycle = photon.cycle;
        }
        usize::from(photon.code) >= bins || seen.is_first(photon.code)
    });
    PixelPhotons {
        cycles: received.cycles,
        photons: photons.copied().collect(),
    }
}

/// The photons of a slice that count, for histograms with so many bins.
#[must_use]
pub fn once_per_bin(slice: &Slice, bins: usize) -> Slice {
    let pixels = slice.pixels.par_iter();
    Slice {
        first_cycle: slice.first_cycle,
        pixels: pixels.map(|pixel| first(pixel, bins)).collect(),
    }
}

impl Engine for OncePerBinEngine {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let once = once_per_bin(slice, self.bins);
        let photons = |slice: &Slice| -> usize {
            let pixels = slice.pixels.iter();
            pixels.map(|pixel| pixel.photons.len()).sum()
        };
        self.repeated += (photons(slice) - photons(&once)) as u64;
        self.engine.run(&once)
    }

    fn finish(&mut self) -> Vec<DepthEvent> {
        self.engine.finish()
    }

    fn statistics(&self) -> [Statistics; 2] {
        let [mut pixels, blocks] = self.engine.statistics();
        pixels.repeated += self.repeated;
        [pixels, blocks]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        self.engine.keep_decisions(is_kept);
    }

    fn decisions(&self) -> Vec<Decision> {
        self.engine.decisions()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use dtof_core::Array;
    use dtof_data::photons::source::Photon;

    use super::*;
    use crate::host::host_engine;
    use crate::settings::Settings;

    /// Photons of two pixels: six a laser cycle in bins 0 to 15, and two past the last bin.
    fn slices(once: bool) -> Vec<Slice> {
        let mut number = 0u32;
        let mut pixel = || {
            let mut photons = Vec::new();
            for cycle in 0..500 {
                let mut code = || {
                    number += 1;
                    // Spread evenly, and repeated.
                    (number.wrapping_mul(number).wrapping_mul(2_654_435_761) >> 28) as u16
                };
                let codes: Vec<u16> = (0..6).map(|_| code()).collect();
                let kept: BTreeSet<u16> = codes.iter().copied().collect();
                let codes = if once {
                    kept.into_iter().collect()
                } else {
                    codes
                };
                photons.extend(
                    codes
                        .into_iter()
                        .chain([200, 200])
                        .map(|code| Photon { cycle, code }),
                );
            }
            PixelPhotons {
                cycles: 500,
                photons,
            }
        };
        let mut slice = |number: u8| Slice {
            first_cycle: 500 * u64::from(number),
            pixels: vec![pixel(), pixel()],
        };
        (0..4).map(&mut slice).collect()
    }

    #[test]
    fn an_engine_decides_as_if_the_others_were_not_there() {
        let array = Array::new(2, 1).unwrap();
        let addresses = [0, 1].map(PixelAddress::new);
        let run = |once_per_bin, slices: &[Slice]| {
            let settings = Settings::static_scene(1).configured(|array| {
                array.once_per_bin = once_per_bin;
                array.l1 = 40;
            });
            let mut engine = host_engine(&settings, array, &addresses).unwrap();
            let events = slices.iter().flat_map(|slice| engine.run(slice).unwrap());
            (events.collect::<Vec<_>>(), engine.statistics()[0])
        };
        let (events, mut statistics) = run(true, &slices(false));
        let (expected, without) = run(false, &slices(true));
        assert!(events.len() > 10);
        assert!(events == expected);
        assert!(events != run(false, &slices(false)).0);
        // Every photon is one of the statistics.
        assert_eq!(statistics.photons(), 2 * 4 * 500 * 8);
        assert!(statistics.repeated > 2_000);
        statistics.repeated = 0;
        assert_eq!(statistics, without);
    }
}

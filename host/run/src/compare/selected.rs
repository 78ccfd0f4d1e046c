//! A part of a large array: blocks of 8×8 pixels, evenly spread.

use std::collections::BTreeSet;

use anyhow::Result;
use dtof_core::{Array, PixelAddress};

use dtof_data::photons::source::{PhotonSource, Slice};

/// A source with fewer pixels and fewer laser cycles.
pub struct Selected {
    source: Box<dyn PhotonSource>,
    addresses: Vec<PixelAddress>,
    /// Their indices in a slice of the source.
    indices: Vec<usize>,
    cycles: u64,
    photons_per_cycle: f64,
}

impl Selected {
    /// Every `nth` block of `source`, for at most `cycles` laser cycles.
    #[must_use]
    pub fn new(mut source: Box<dyn PhotonSource>, nth: u32, cycles: u64) -> Self {
        let columns = source.array().columns();
        let blocks_across = columns.div_ceil(8);
        let block = |address: PixelAddress| {
            let (row, column) = (
                u32::from(address.raw()) / columns,
                u32::from(address.raw()) % columns,
            );
            // The row shifts the choice, so that chosen blocks are not all in the same columns.
            (row / 8 * blocks_across + column / 8, row / 8)
        };
        let mut blocks: Vec<_> = source.addresses().into_iter().map(block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let numbered = blocks.into_iter().zip(0u32..);
        let chosen: BTreeSet<_> = numbered
            .filter(|((_, row), number)| *number == 0 || (number + row).is_multiple_of(nth))
            .map(|(block, _)| block)
            .collect();
        let is_in = |address| chosen.contains(&block(address));
        source.limit_to(&is_in);
        let all = source.addresses();
        let all_pixels = all.len();
        let all = all.into_iter().enumerate();
        let (indices, addresses) = all.filter(|(_, address)| is_in(*address)).unzip();
        let addresses: Vec<PixelAddress> = addresses;
        let share = addresses.len() as f64 / all_pixels.max(1) as f64;
        Self {
            cycles: source.cycles().min(cycles),
            photons_per_cycle: source.photons_per_cycle() * share,
            source,
            addresses,
            indices,
        }
    }
}

impl PhotonSource for Selected {
    fn inner(&self) -> Option<&dyn PhotonSource> {
        Some(&*self.source)
    }

    fn array(&self) -> Array {
        self.source.array()
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        self.addresses.clone()
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn photons_per_cycle(&self) -> f64 {
        self.photons_per_cycle
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let mut slice = self.source.next_slice(cycles)?;
        let pixels = self
            .indices
            .iter()
            .map(|&index| std::mem::take(&mut slice.pixels[index]));
        Ok(Slice {
            first_cycle: slice.first_cycle,
            pixels: pixels.collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_data::photons::masked::Masked;
    use dtof_light::demo;

    #[test]
    fn laser_rate_and_masked_photons_are_those_of_the_source() {
        let source = demo::photons(Array::new(32, 16).unwrap(), 1, 100).unwrap();
        let masked = Masked::new(Box::new(source), &[3]).unwrap();
        let mut part = Selected::new(Box::new(masked.with_laser_hz(Some(20_000))), 2, 50);
        part.next_slice(50).unwrap();
        assert_eq!(part.laser_hz(), Some(20_000));
        assert!(part.masked() > 0);
        assert_eq!((part.cycles(), part.addresses().len()), (50, 256));
    }
}

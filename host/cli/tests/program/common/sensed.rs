//! The photons of a simulated sensor, for engines on this computer.

use dtof_core::PixelAddress;
use dtof_data::photons::source::{Photon, PixelPhotons, Slice};
use dtof_sensors::PhotonSink;

/// The photons of each pixel, from laser cycle 0 of a slice on.
pub struct Photons(Vec<PixelPhotons>);

impl Photons {
    /// No photons of so many pixels.
    pub fn new(pixels: u16) -> Self {
        Self(vec![PixelPhotons::default(); pixels.into()])
    }

    /// A slice whose first laser cycle is this one.
    pub fn slice(self, first_cycle: u64) -> Slice {
        let pixels = self.0;
        Slice {
            first_cycle,
            pixels,
        }
    }
}

impl PhotonSink for Photons {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        let pixel = &mut self.0[usize::from(pixel.raw())];
        let cycle = pixel.cycles;
        pixel.photons.push(Photon { cycle, code });
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        self.0.iter_mut().for_each(|pixel| pixel.cycles += cycles);
    }
    fn begin_frame(&mut self, _: u32) {
        panic!("a frame");
    }
    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {
        panic!("a histogram");
    }
}

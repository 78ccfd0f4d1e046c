//! An event and ranges for tests of several modules.

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    Array, BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
    SubBinOffset,
};
use dtof_photons::ranges::Ranges;

/// An event in the middle of a bin.
#[must_use]
pub fn event(pixel: u16, cycle: u64, bin: u16) -> DepthEvent {
    DepthEvent {
        pixel: PixelAddress::new(pixel),
        level: BlockLevel::PIXEL,
        echo: EchoNumber::FIRST,
        cycle: LaserCycle::new(cycle),
        exposure: 40,
        peak_bin: BinIndex::saturating(bin),
        offset: SubBinOffset::CENTRE,
        peak_count: Count::saturating(9),
        background: Count::saturating(1),
        flags: Flags::NONE,
    }
}

/// Of bins of 250 ps, without an offset.
///
/// # Panics
/// Never panics: the numbers are valid.
#[must_use]
pub fn ranges() -> Ranges {
    let array = Array::new(1, 1).unwrap();
    Ranges::new(array, U16F16::lit("250"), I24F8::ZERO, Vec::new()).unwrap()
}

//! An event and a scale for tests of several modules.

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
    RangeScale, SubBinOffset,
};

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

/// Bins of 250 ps.
///
/// # Panics
/// Never panics: the numbers are valid.
#[must_use]
pub fn scale() -> RangeScale {
    RangeScale::new(U16F16::lit("250"), I24F8::ZERO).unwrap()
}

//! An event, a file and ranges for tests of several packages.

use crate::photons::ranges::Ranges;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    Array, BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
    SubBinOffset,
};

use crate::events::aer_file::{Event, Header, Writer};

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

/// The bytes of a complete AER file.
///
/// # Panics
/// Panics if an event is not one of the header's array and bins.
#[must_use]
pub fn aer_file(header: &Header, settings: &str, events: &[Event]) -> Vec<u8> {
    let mut writer = Writer::with_settings(Vec::new(), header, settings).unwrap();
    for event in events {
        writer.write(event).unwrap();
    }
    writer.finish().unwrap()
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

//! AER files to export.

use dtof_core::events::DynamicDepthEvent;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    Array, BinIndex, BinPosition, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle,
    PixelAddress, SubBinOffset,
};
use dtof_data::events::aer_file::{Event, Header};
use dtof_data::events::fixtures::aer_file;

/// 64 columns, 32 rows, 128 bins of 250 ps.
pub const HEADER: Header = Header {
    bins: 128,
    array: Array::new(64, 32).unwrap(),
    bin_width_ps: U16F16::lit("250"),
    offset_mm: I24F8::lit("-12.5"),
    offsets_mm: Vec::new(),
    laser_millihertz: 0,
    start_us: 0,
};

/// An event in a pixel and laser cycle, its peak in a bin.
pub fn depth(pixel: u16, cycle: u64, bin: u16) -> Event {
    Event::Depth(depth_event(pixel, cycle, bin))
}

/// The event alone.
pub fn depth_event(pixel: u16, cycle: u64, bin: u16) -> DepthEvent {
    DepthEvent {
        pixel: PixelAddress::new(pixel),
        level: BlockLevel::PIXEL,
        echo: EchoNumber::FIRST,
        cycle: LaserCycle::new(cycle),
        exposure: 44,
        peak_bin: BinIndex::saturating(bin),
        offset: SubBinOffset::new(100).unwrap(),
        peak_count: Count::saturating(37),
        background: Count::saturating(4),
        flags: Flags::from_bits(4).unwrap(),
    }
}

/// A change of depth of so many bins, to a bin.
pub fn dynamic(pixel: u16, cycle: u64, bin: i32, change: i32) -> Event {
    Event::DynamicDepth(
        DynamicDepthEvent::new(
            PixelAddress::new(pixel),
            BlockLevel::PIXEL,
            LaserCycle::new(cycle),
            BinPosition::new(bin * 256).unwrap(),
            change * 256,
            Flags::NONE,
        )
        .unwrap(),
    )
}

/// The bytes of a complete file.
pub fn file(header: &Header, events: &[Event]) -> Vec<u8> {
    aer_file(header, "", events)
}

/// Twelve events, one of them in the laser cycle of another time word.
pub fn events() -> Vec<Event> {
    let near = (0..11).map(|index| depth(index * 150, u64::from(index) * 13, 20 + index));
    near.chain([depth(2047, 1 << 20, 60)]).collect()
}

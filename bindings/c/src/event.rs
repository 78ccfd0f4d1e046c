//! The depth event as a plain value.

use dtof_core::{
    BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
    SubBinOffset,
};

use crate::status::dtof_status_t;
use crate::status::dtof_status_t::DTOF_ERROR_EVENT;

/// The peak's counter is full: the peak may lie in another full bin.
pub const DTOF_FLAG_SATURATED: u8 = 1;
/// The depth window reaches past the range gate or into excluded bins.
pub const DTOF_FLAG_CLIPPED: u8 = 2;
/// A decision was deferred while the slot was full.
pub const DTOF_FLAG_DEFERRED: u8 = 4;
/// Early photons hid late ones. With the window rule and a dead time: bins were left out, because
/// the TDC was hardly ever live there. With other rules: it takes the first photon of a laser cycle,
/// and took one in more than half of the cycles.
pub const DTOF_FLAG_PILE_UP: u8 = 8;
/// The peak lies on the tail of an echo that was reported before.
pub const DTOF_FLAG_TAIL: u8 = 16;
/// Neighbouring pixels confirmed what was not enough by itself.
pub const DTOF_FLAG_CONFIRMED: u8 = 32;

/// A depth event: a peak exceeded the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct dtof_event_t {
    /// The laser cycle at whose end the event was decided.
    pub cycle: u64,
    /// Photons in the highest bin, background included: up to 16,777,215. Of a confirmed event those of the pixel
    /// in the window of the rule.
    pub peak_count: u32,
    /// The background per bin, in photons: up to 16,777,215. Of a confirmed event that of the window.
    pub background: u32,
    /// The position of the pulse from the start of bin 0, in 1/256 bin: -512 to 262,399.
    /// dtof_range converts it to millimetres. dtof_aer_encode ignores it.
    pub position_q8: i32,
    /// The address of the pixel.
    pub pixel: u16,
    /// The laser cycles that the histogram had integrated.
    pub exposure: u16,
    /// The highest bin: up to 1023.
    pub peak_bin: u16,
    /// The position of the pulse from the start of the peak bin, in 1/256 bin: -512 to 511.
    pub offset_q8: i16,
    /// 0: one pixel; 1 to 3: a block of 2, 4 or 8 pixels a side.
    pub level: u8,
    /// The number of the echo in its exposure: 1 to 4.
    pub echo: u8,
    /// DTOF_FLAG_..., added up: below 64.
    pub flags: u8,
}

impl From<&DepthEvent> for dtof_event_t {
    #[inline(always)]
    fn from(event: &DepthEvent) -> Self {
        Self {
            cycle: event.cycle.raw(),
            peak_count: event.peak_count.raw(),
            background: event.background.raw(),
            position_q8: event.position().raw(),
            pixel: event.pixel.raw(),
            exposure: event.exposure,
            peak_bin: event.peak_bin.raw(),
            offset_q8: event.offset.raw(),
            level: event.level.raw(),
            echo: event.echo.raw(),
            flags: event.flags.bits(),
        }
    }
}

/// Converts plain values to an event. Fails if one is out of range.
pub(crate) fn depth_event(event: &dtof_event_t) -> Result<DepthEvent, dtof_status_t> {
    let of = || {
        Some(DepthEvent {
            pixel: PixelAddress::new(event.pixel),
            level: BlockLevel::new(event.level)?,
            echo: EchoNumber::new(event.echo)?,
            cycle: LaserCycle::new(event.cycle),
            exposure: event.exposure,
            peak_bin: BinIndex::new(event.peak_bin)?,
            offset: SubBinOffset::new(event.offset_q8)?,
            peak_count: Count::new(event.peak_count)?,
            background: Count::new(event.background)?,
            flags: Flags::from_bits(event.flags)?,
        })
    };
    of().ok_or(DTOF_ERROR_EVENT)
}

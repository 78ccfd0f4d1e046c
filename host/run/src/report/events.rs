//! The events of the report, packed for its script.

use dtof_core::{BlockLevel, EchoNumber, Flags};

use super::packed::Packed;
use dtof_data::events::sample::Sample;

/// Flags, level and echo as one number, which is small for most events.
pub(super) fn kind(level: BlockLevel, echo: EchoNumber, flags: Flags) -> u64 {
    let [flags, level] = [flags.bits(), level.raw()].map(u64::from);
    flags << 4 | level << 2 | u64::from(echo.raw() - 1)
}

/// For each event: laser cycles since the one before, pixel, kind, exposure, range, photons of the peak.
pub(super) fn packed(sample: &Sample) -> Packed {
    let mut packed = Packed::default();
    let mut before = 0;
    for event in sample.events() {
        packed.push(event.cycle.saturating_sub(before));
        before = event.cycle;
        packed.push(event.pixel.raw());
        packed.push(kind(event.level, event.echo, event.flags));
        packed.push(event.exposure);
        packed.push_range(event.range_mm);
        packed.push(event.peak_count);
    }
    packed
}

//! Events as CSV, one a line.

use std::io::{self, Write};

use dtof_core::DepthEvent;
use dtof_core::events::{DynamicDepthEvent, Polarity};

use crate::events::aer_file::{Event, EventKind};
use crate::photons::ranges::Ranges;

/// The columns of depth events.
///
/// `depth_bins` is measured from the start of bin 0. `flags` is the sum of the flag bits of
/// `docs/aer-format.md`. A `level` above 0 is a block of pixels, the first of which is `pixel`.
/// `echo` counts from 1.
pub const HEADER: &str =
    "cycle,pixel,exposure,peak_bin,depth_bins,range_mm,peak_count,background,flags,level,echo";

/// The columns of dynamic depth events.
///
/// `polarity` is 1 if the depth has grown and -1 if it has shrunk. `range_mm` is the mean after the
/// change, `change_mm` the change.
pub const DYNAMIC_DEPTH_HEADER: &str = "cycle,pixel,polarity,range_mm,change_mm,flags,level";

/// The columns for events of `kind`.
#[must_use]
pub fn header(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Depth => HEADER,
        EventKind::DynamicDepth => DYNAMIC_DEPTH_HEADER,
    }
}

/// Writes one event of either kind.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_event(
    out: &mut (impl Write + ?Sized),
    event: &Event,
    ranges: &Ranges,
) -> io::Result<()> {
    match event {
        Event::Depth(event) => write(out, event, ranges),
        Event::DynamicDepth(event) => write_dynamic_depth(out, event, ranges),
    }
}

/// The range of an event in millimetres, exact: a multiple of 1/256 mm.
#[must_use]
pub fn range_mm(event: &DepthEvent, ranges: &Ranges) -> f64 {
    let range = ranges.of(event.pixel, event.level, event.position());
    range.to_num()
}

/// Writes one event.
///
/// # Errors
/// Fails if the writer fails.
pub fn write(
    out: &mut (impl Write + ?Sized),
    event: &DepthEvent,
    ranges: &Ranges,
) -> io::Result<()> {
    write_at(out, event, range_mm(event, ranges))
}

/// Writes one event at another range.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_at(
    out: &mut (impl Write + ?Sized),
    event: &DepthEvent,
    range_mm: f64,
) -> io::Result<()> {
    let depth_bins = f64::from(event.position().raw()) / 256.0;
    writeln!(
        out,
        "{},{},{},{},{depth_bins:.4},{:.3},{},{},{},{},{}",
        event.cycle.raw(),
        event.pixel.raw(),
        event.exposure,
        event.peak_bin,
        range_mm,
        event.peak_count,
        event.background,
        event.flags,
        event.level,
        event.echo,
    )
}

/// Writes one dynamic depth event.
///
/// # Errors
/// Fails if the writer fails.
pub fn write_dynamic_depth(
    out: &mut (impl Write + ?Sized),
    event: &DynamicDepthEvent,
    ranges: &Ranges,
) -> io::Result<()> {
    let polarity = match event.polarity() {
        Polarity::Nearer => -1,
        Polarity::Farther => 1,
    };
    writeln!(
        out,
        "{},{},{polarity},{:.3},{:.3},{},{}",
        event.cycle.raw(),
        event.pixel.raw(),
        ranges
            .of(event.pixel, event.level, event.position)
            .to_num::<f64>(),
        ranges.scale().distance(event.change()).to_num::<f64>(),
        event.flags,
        event.level,
    )
}

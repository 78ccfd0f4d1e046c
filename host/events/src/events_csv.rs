//! Events as CSV, one a line.

use std::io::{self, Write};

use dtof_core::events::{DynamicDepthEvent, Polarity};
use dtof_core::{DepthEvent, RangeScale};

use crate::aer_file::{Event, EventKind};

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
    scale: &RangeScale,
) -> io::Result<()> {
    match event {
        Event::Depth(event) => write(out, event, scale),
        Event::DynamicDepth(event) => write_dynamic_depth(out, event, scale),
    }
}

/// The range of an event in millimetres, exact: a multiple of 1/256 mm.
#[must_use]
pub fn range_mm(event: &DepthEvent, scale: &RangeScale) -> f64 {
    scale.range(event.position()).to_num()
}

/// Writes one event.
///
/// # Errors
/// Fails if the writer fails.
pub fn write(
    out: &mut (impl Write + ?Sized),
    event: &DepthEvent,
    scale: &RangeScale,
) -> io::Result<()> {
    let depth_bins = f64::from(event.position().raw()) / 256.0;
    writeln!(
        out,
        "{},{},{},{},{depth_bins:.4},{:.3},{},{},{},{},{}",
        event.cycle.raw(),
        event.pixel.raw(),
        event.exposure,
        event.peak_bin,
        range_mm(event, scale),
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
    scale: &RangeScale,
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
        scale.range(event.position).to_num::<f64>(),
        scale.distance(event.change()).to_num::<f64>(),
        event.flags,
        event.level,
    )
}

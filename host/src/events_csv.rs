//! Depth events as CSV, one a line.

use std::io::{self, Write};

use dtof_core::{DepthEvent, RangeScale};

/// The columns.
///
/// `depth_bins` is measured from the start of bin 0, `flags` is the sum of the
/// flag bits of `docs/aer-format.md`.
pub const HEADER: &str =
    "cycle,pixel,exposure,peak_bin,depth_bins,range_mm,peak_count,background,flags";

/// The range of an event in millimetres, exact: a multiple of 1/256 mm.
#[must_use]
pub fn range_mm(event: &DepthEvent, scale: &RangeScale) -> f64 {
    scale.range(event.position()).to_num()
}

/// Writes one event.
///
/// # Errors
/// Those of the writer.
pub fn write(out: &mut impl Write, event: &DepthEvent, scale: &RangeScale) -> io::Result<()> {
    let depth_bins = f64::from(event.position().raw()) / 256.0;
    writeln!(
        out,
        "{},{},{},{},{depth_bins:.4},{:.3},{},{},{}",
        event.cycle.0,
        event.pixel.0,
        event.exposure,
        event.peak_bin,
        range_mm(event, scale),
        event.peak_count,
        event.background,
        event.flags,
    )
}

//! CSV: time and point, then the columns of `events.csv`.

use std::io::Write;

use anyhow::Result;

use super::Out;
use super::points::Points;
use super::projection::Projection;
use dtof_data::events::aer_file::{Event, EventKind};
use dtof_data::events::events_csv;

/// The columns before those of `events.csv`.
pub(super) const COLUMNS: &str = "time_us,x_m,y_m,z_m";

/// Begins a file.
pub fn begin(out: Out, projection: Projection, kind: EventKind) -> Result<Points> {
    let header = format!("{COLUMNS},{}\n", events_csv::header(kind));
    Points::new(out, projection, &header, write)
}

fn write(out: &mut Out, event: &Event, projection: &Projection) -> Result<()> {
    let time = projection.nanoseconds(event);
    let (us, ns) = (time / 1000, time % 1000);
    // Writes the fewest digits that give the same f32.
    let [x, y, z] = projection.point(event)?;
    write!(out, "{us}.{ns:03},{x},{y},{z},")?;
    match event {
        Event::Depth(depth) => events_csv::write_at(out, depth, projection.range_mm(event))?,
        Event::DynamicDepth(_) => events_csv::write_event(out, event, &projection.ranges)?,
    }
    Ok(())
}

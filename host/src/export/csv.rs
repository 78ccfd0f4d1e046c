//! CSV: time and point, then the columns of `events.csv`.

use std::io::Write;

use anyhow::Result;

use super::projection::Projection;
use super::{Finished, Out, Sink};
use crate::events::aer_file::{Event, EventKind};
use crate::events::events_csv;

/// The columns before those of `events.csv`.
const COLUMNS: &str = "time_us,x_m,y_m,z_m";

pub struct Csv {
    out: Out,
    projection: Projection,
    written: u64,
}

impl Csv {
    pub fn new(mut out: Out, projection: Projection, kind: EventKind) -> Result<Self> {
        writeln!(out, "{COLUMNS},{}", events_csv::header(kind))?;
        Ok(Self {
            out,
            projection,
            written: 0,
        })
    }
}

impl Sink for Csv {
    fn write(&mut self, event: &Event) -> Result<()> {
        let time = self.projection.nanoseconds(event);
        let (us, ns) = (time / 1000, time % 1000);
        // The fewest digits that give the same f32 back.
        let [x, y, z] = self.projection.point(event)?;
        write!(self.out, "{us}.{ns:03},{x},{y},{z},")?;
        events_csv::write_event(&mut self.out, event, &self.projection.scale)?;
        self.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Finished> {
        Ok(Finished {
            out: self.out,
            written: self.written,
            late: 0,
        })
    }
}

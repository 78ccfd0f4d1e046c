//! EVT2, the RAW format of Prophesee: changes of depth as an event camera's changes of
//! brightness. ON is farther, OFF nearer.
//!
//! Words of 32 bits, least significant byte first, follow a header in ASCII. Bits 28-31 are the
//! type of a word:
//!
//! | word | bits 28-31 | bits 22-27 | bits 11-21 | bits 0-10 |
//! |---|---|---|---|---|
//! | OFF | 0 | time, bits 0-5 | column | row |
//! | ON | 1 | time, bits 0-5 | column | row |
//! | time | 8 | bits 0-27: time, bits 6-33 | | |
//!
//! Time is in microseconds. A time word precedes the first event, and each event whose upper bits
//! of time have changed.

use std::io::{self, Write};

use anyhow::{Result, ensure};
use dtof_core::Array;
use dtof_core::events::{DynamicDepthConfig, DynamicDepthEvent, Polarity};

use super::reorder::{Reorder, WAITING};
use super::{Finished, Out, Sink};
use dtof_data::events::aer_file::Event;
use dtof_data::events::clock::LaserClock;
use dtof_data::events::dynamic::DepthChanges;
use dtof_data::events::echoes::Echo;

/// Columns and rows are sent in 11 bits.
const MOST_SIDE: u32 = 1 << 11;

const OFF: u32 = 0;
const ON: u32 = 1;
const TIME_HIGH: u32 = 8;

/// A change of depth with its time in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Change {
    time: u64,
    column: u32,
    row: u32,
    polarity: Polarity,
}

/// Writes words.
struct Encoder<W> {
    out: W,
    time_high: Option<u32>,
}

impl<W: Write> Encoder<W> {
    /// Writes the header.
    fn new(mut out: W, [columns, rows]: [u32; 2]) -> io::Result<Self> {
        write!(
            out,
            "% evt 2.0\n\
             % format EVT2;height={rows};width={columns}\n\
             % geometry {columns}x{rows}\n\
             % end\n"
        )?;
        Ok(Self {
            out,
            time_high: None,
        })
    }

    /// Times have 34 bits (`span::EVT2_BITS`) and do not decrease.
    #[allow(clippy::cast_possible_truncation, reason = "28 and 6 bits")]
    fn write(&mut self, change: &Change) -> io::Result<()> {
        let high = (change.time >> 6) as u32 & ((1 << 28) - 1);
        if self.time_high != Some(high) {
            self.time_high = Some(high);
            self.put(TIME_HIGH << 28 | high)?;
        }
        let kind = match change.polarity {
            Polarity::Nearer => OFF,
            Polarity::Farther => ON,
        };
        let low = change.time as u32 & 0x3f;
        self.put(kind << 28 | low << 22 | change.column << 11 | change.row)
    }

    fn put(&mut self, word: u32) -> io::Result<()> {
        self.out.write_all(&word.to_le_bytes())
    }
}

/// Writes changes of depth in order of time. Computes them from depth events, or takes dynamic
/// depth events.
pub struct Evt2 {
    encoder: Encoder<Out>,
    order: Reorder<Change>,
    clock: LaserClock,
    array: Array,
    changes: DepthChanges,
    written: u64,
}

impl Evt2 {
    pub fn new(
        out: Out,
        array: Array,
        clock: LaserClock,
        config: DynamicDepthConfig,
        echo: Echo,
    ) -> Result<Self> {
        let (columns, rows) = (array.columns(), array.rows());
        ensure!(
            columns <= MOST_SIDE && rows <= MOST_SIDE,
            "an array of {columns}x{rows}: EVT2 holds at most {MOST_SIDE}x{MOST_SIDE}"
        );
        Ok(Self {
            encoder: Encoder::new(out, [columns, rows])?,
            order: Reorder::new(WAITING),
            clock,
            array,
            changes: DepthChanges::new(config, echo),
            written: 0,
        })
    }

    fn change(&mut self, event: &Event) -> Option<DynamicDepthEvent> {
        match event {
            Event::DynamicDepth(event) => Some(*event),
            Event::Depth(event) => self.changes.observe(event),
        }
    }

    fn put(&mut self, change: Option<Change>) -> Result<()> {
        if let Some(change) = change {
            self.encoder.write(&change)?;
            self.written += 1;
        }
        Ok(())
    }
}

impl Sink for Evt2 {
    fn write(&mut self, event: &Event) -> Result<()> {
        let Some(change) = self.change(event) else {
            return Ok(());
        };
        let time = u64::try_from(self.clock.microseconds(change.cycle.raw()))?;
        // The change of a block is written for each of its pixels.
        for pixel in self.array.pixels_of(change.pixel, change.level) {
            let pixel = u32::from(pixel.raw());
            let change = Change {
                time,
                column: pixel % self.array.columns(),
                row: pixel / self.array.columns(),
                polarity: change.polarity(),
            };
            let next = self.order.push(time, change);
            self.put(next)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<Finished> {
        while let Some(change) = self.order.pop() {
            self.put(Some(change))?;
        }
        Ok(Finished {
            out: self.encoder.out,
            written: self.written,
            late: self.order.late(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &[u8] =
        b"% evt 2.0\n% format EVT2;height=720;width=1280\n% geometry 1280x720\n% end\n";

    fn words(changes: &[Change]) -> Vec<u32> {
        let mut encoder = Encoder::new(Vec::new(), [1280, 720]).unwrap();
        for change in changes {
            encoder.write(change).unwrap();
        }
        let words = encoder.out.strip_prefix(HEADER).unwrap();
        let word = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
        words.chunks(4).map(word).collect()
    }

    #[test]
    fn words_are_those_of_the_format() {
        let change = |time, column, row, polarity| Change {
            time,
            column,
            row,
            polarity,
        };
        assert_eq!(
            words(&[
                change(0, 0, 0, Polarity::Nearer),
                change(63, 2047, 1, Polarity::Farther),
                change(64, 1, 2047, Polarity::Nearer),
                change((1 << 34) - 1, 640, 360, Polarity::Farther),
            ]),
            [
                0x8000_0000,
                0x0000_0000,
                0x1fff_f801,
                0x8000_0001,
                0x0000_0fff,
                0x8fff_ffff,
                0x1fd4_0168,
            ]
        );
    }
}

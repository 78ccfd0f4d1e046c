//! A device with a sensor: its events as they come, and a line of statistics a second.

mod event_file;
pub mod losses;

use std::io::{self, ErrorKind, Write};
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use dtof_core::Array;
use dtof_link::endpoint::LinkCounters;
use dtof_link::{Report, Source};

use crate::{Client, Stopped, Task};
use dtof_data::events::aer_file::Event;
use dtof_data::events::events_csv;
use dtof_data::options::Refused;
use dtof_data::photons::ranges::Ranges;
use dtof_engine::settings::Settings;
pub use event_file::EventFile;
use losses::{Losses, since};

/// Interval of the statistics.
const EVERY: Duration = Duration::from_secs(1);

/// The array of `pixels`, for files: with `columns`, or else square or as little wider
/// than high as possible. `None` if there are no pixels, or if the array has more than 65,536.
#[must_use]
pub fn array(pixels: u16, columns: Option<u32>) -> Option<Array> {
    let pixels = u32::from(pixels);
    let squarest = || {
        let rows = (1..=pixels).take_while(|rows| rows * rows <= pixels);
        let rows = rows.filter(|rows| pixels.is_multiple_of(*rows)).last();
        pixels / rows.unwrap_or(1)
    };
    let columns = columns.unwrap_or_else(squarest).max(1);
    Array::new(columns, pixels.div_ceil(columns))
}

/// Checks that no masked pixel counts in a block or confirms a neighbour.
///
/// # Errors
/// Fails if there are both masked pixels and one of these.
pub fn check_masked(settings: &Settings) -> Result<()> {
    ensure!(
        settings.masked.is_empty() || settings.configuration.binning.is_none(),
        Refused::input(
            "the blocks of a device count masked pixels, too; leave out `masked` or `binning`"
        )
    );
    ensure!(
        settings.masked.is_empty() || settings.configuration.neighbours.is_none(),
        Refused::input(
            "on a device masked pixels confirm their neighbours, too; leave out `masked` or `neighbours`"
        )
    );
    Ok(())
}

/// Removes the events of masked pixels and returns their number.
pub fn leave_out_masked(events: &mut Vec<Event>, settings: &Settings) -> u64 {
    let all = events.len();
    events.retain(|event| !settings.masked.contains(&event.pixel().raw()));
    (all - events.len()) as u64
}

/// Where events and statistics are written.
pub struct Outputs<'a> {
    /// Events as CSV, as they come.
    pub events: &'a mut dyn Write,
    /// A line a second: rates, and each loss and error counted since the start.
    pub statistics: &'a mut dyn Write,
    /// All events as an AER file.
    pub recording: Option<&'a mut EventFile>,
    /// Events of masked pixels so far, which are not written.
    pub masked: u64,
}

impl Outputs<'_> {
    /// Writes a line of statistics.
    fn show(&mut self, line: &str, readers: &mut Readers) -> Result<()> {
        if readers.statistics {
            readers.statistics = still_open(writeln!(self.statistics, "{line}"))?;
        }
        Ok(())
    }

    /// Writes events, except those of masked pixels. They are recorded even if the other outputs
    /// are closed.
    fn write(
        &mut self,
        mut events: Vec<Event>,
        (task, ranges): (&Task, &Ranges),
        readers: &mut Readers,
    ) -> Result<()> {
        self.masked += leave_out_masked(&mut events, task.settings);
        let events = &events[..];
        if let Some(recording) = &mut self.recording {
            recording.write(events)?;
        }
        if readers.events {
            readers.events = still_open(write(self.events, events, ranges))?;
        }
        Ok(())
    }
}

/// Which outputs still have a reader.
struct Readers {
    events: bool,
    statistics: bool,
}

/// Has the device take photons from its sensor, and writes its events and statistics to `outputs`.
///
/// Ends when `done`, called again and again with the time since the start, returns true. Also ends
/// when the reader of an output has closed it, unless there is a recording: then only that output
/// ends. At the end the sensor is stopped. Every event that has arrived is written, also if the
/// device is gone.
///
/// While an output blocks, the device hears nothing from this program. It stops its sensor after the
/// host timeout, and this function then fails once the output goes on.
///
/// # Errors
/// Fails if the device refuses the settings, disconnects or stops its sensor, or if an output cannot
/// be written.
pub fn monitor(
    client: &mut Client,
    task: &Task,
    done: impl Fn(Duration) -> bool,
    outputs: &mut Outputs,
) -> Result<()> {
    let mut readers = Readers {
        events: true,
        statistics: true,
    };
    let ranges = &task.ranges()?;
    let watched = watch(client, (task, ranges), done, outputs, &mut readers);
    let written = outputs.write(client.take_events(), (task, ranges), &mut readers);
    watched.and(written)
}

/// [`monitor`] except for the events that have arrived and are not written yet.
fn watch(
    client: &mut Client,
    (task, ranges): (&Task, &Ranges),
    done: impl Fn(Duration) -> bool,
    outputs: &mut Outputs,
    readers: &mut Readers,
) -> Result<()> {
    check_masked(task.settings)?;
    client.configure(&task.configuration(Source::Sensor)?)?;
    // Events may arrive from now on. They are written even if the device fails at once.
    let columns = match task.dynamic_depth {
        None => events_csv::HEADER,
        Some(_) => events_csv::DYNAMIC_DEPTH_HEADER,
    };
    readers.events = still_open(write_header(outputs.events, columns))?;
    let started = Instant::now();
    let mut rates = Rates {
        here: *client.counters(),
        first: client.report()?,
        before: (started, [0; 2]),
        last: (started, [0; 2]),
    };
    Stopped::check(&rates.first, task.host_timeout)?;
    let mut requested = false;
    loop {
        let is_read = outputs.recording.is_some() || (readers.events && readers.statistics);
        let ends = !is_read || done(started.elapsed());
        // The last line has the losses up to the end.
        let is_due = ends || rates.last.0.elapsed() >= EVERY;
        if !requested && is_read && is_due {
            client.request_report()?;
            requested = true;
        }
        if ends && !requested {
            break;
        }
        let report = client.poll_report()?;
        outputs.write(client.take_events(), (task, ranges), readers)?;
        if let Some(report) = report {
            let line = rates.line(client, &report, outputs.masked);
            outputs.show(&line, readers)?;
            Stopped::check(&report, task.host_timeout)?;
            requested = false;
            if ends {
                break;
            }
        }
    }
    // The device sends no events after its answer.
    client.configure(&task.configuration(Source::Link)?)
}

fn write_header(out: &mut dyn Write, columns: &str) -> io::Result<()> {
    writeln!(out, "{columns}")?;
    out.flush()
}

fn write(out: &mut dyn Write, events: &[Event], ranges: &Ranges) -> io::Result<()> {
    for event in events {
        events_csv::write_event(&mut *out, event, ranges)?;
    }
    out.flush()
}

/// Whether the output still has a reader.
fn still_open(written: io::Result<()>) -> io::Result<bool> {
    match written {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}

/// Makes the lines of statistics.
struct Rates {
    /// The host's counts at the start.
    here: LinkCounters,
    /// The device's counts at the start.
    first: Report,
    /// Time, events and photons of the line before the last.
    before: (Instant, [u64; 2]),
    /// Time, events and photons of the last line.
    last: (Instant, [u64; 2]),
}

impl Rates {
    /// Rates since the last line, losses since the start, and `masked` events.
    fn line(&mut self, client: &Client, report: &Report, masked: u64) -> String {
        // Soon after a line, at the end, the rates are those since the line before.
        let (began, before) = if self.last.0.elapsed() < EVERY / 2 {
            self.before
        } else {
            self.last
        };
        let seconds = began.elapsed().as_secs_f64();
        let rate = |now: u64, before: u64| now.saturating_sub(before) as f64 / seconds;
        // Blocks count the photons of pixels again.
        let (pixels, blocks) = (&report.statistics, &report.blocks);
        let now = [pixels.events + blocks.events, pixels.photons()];
        let mut line = format!(
            "events/s {:.0}, photons/s {:.0}",
            rate(now[0], before[0]),
            rate(now[1], before[1]),
        );
        let losses = Losses {
            first: &self.first,
            here: &since(client.counters(), &self.here),
        };
        line += &losses.line(report);
        if masked > 0 {
            line += &format!(", events left out {masked}");
        }
        self.before = self.last;
        self.last = (Instant::now(), now);
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_as_square_as_possible() {
        let array = |pixels, columns| {
            let array = array(pixels, columns)?;
            Some((array.columns(), array.rows()))
        };
        let pixels = [1, 2, 4, 9, 64, 128, 2048, 7];
        let columns = [1, 2, 2, 3, 8, 16, 64, 7];
        let rows = [1, 1, 2, 3, 8, 8, 32, 1];
        for (pixels, sides) in pixels.into_iter().zip(columns.into_iter().zip(rows)) {
            assert_eq!(array(pixels, None), Some(sides));
        }
        assert_eq!(array(64, Some(10)), Some((10, 7)));
        assert_eq!(array(0, None), None);
        assert_eq!(array(u16::MAX, Some(60_000)), None);
    }
}

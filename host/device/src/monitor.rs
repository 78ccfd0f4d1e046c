//! A device with a sensor: its events as they come, and once a second what it
//! does.

mod event_file;
pub mod losses;
pub mod map;

use std::io::{self, ErrorKind, Write};
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use dtof_core::{Array, RangeScale};
use dtof_link::endpoint::LinkCounters;
use dtof_link::{DynamicDepth, Report, Source};

use crate::{Client, HostTimeout, Stopped, configuration};
use dtof_engine::settings::Settings;
use dtof_events::aer_file::Event;
use dtof_events::events_csv;
use dtof_options::Refused;
pub use event_file::EventFile;
use losses::{Losses, since};
use map::LiveMap;

/// How often there are statistics.
const EVERY: Duration = Duration::from_secs(1);

/// The task of the device.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// How its pixels operate.
    pub settings: &'a Settings,
    /// How many, addresses 0 up.
    pub pixels: u16,
    /// How many of them are a row.
    pub columns: u32,
    /// It is to send changes of depth in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
    /// It stops its sensor once this program has been silent for so long.
    pub host_timeout: HostTimeout,
}

/// The array of so many `pixels`, to draw and to record: in so many `columns`, or else as
/// high as wide, or the least bit wider. None without pixels, or with rows of more than there are
/// addresses.
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

/// Checks that no pixel is left out whose photons count all the same.
///
/// # Errors
/// If there are blocks of pixels.
pub fn check_masked(settings: &Settings) -> Result<()> {
    ensure!(
        settings.masked.is_empty() || settings.binning.is_none(),
        Refused::input(
            "the blocks of a device count masked pixels, too; leave out `masked` or `binning`"
        )
    );
    Ok(())
}

/// Takes the events of masked pixels out, and says how many there were.
pub fn leave_out_masked(events: &mut Vec<Event>, settings: &Settings) -> u64 {
    let all = events.len();
    events.retain(|event| !settings.masked.contains(&event.pixel().0));
    (all - events.len()) as u64
}

/// Where what it does is written.
pub struct Outputs<'a> {
    /// Its events as CSV, as they come.
    pub events: &'a mut dyn Write,
    /// A line a second: rates, and of what was lost or went wrong all that did, counted
    /// from the beginning.
    pub statistics: &'a mut dyn Write,
    /// The ranges as a picture, and then the lines of statistics below it.
    pub map: Option<&'a mut LiveMap>,
    /// All events once more.
    pub recording: Option<&'a mut EventFile>,
    /// Events of pixels that are left out, which are written nowhere.
    pub masked: u64,
}

impl Outputs<'_> {
    /// A line of statistics.
    fn tell(&mut self, line: String, readers: &mut Readers) -> Result<()> {
        if !readers.statistics {
            return Ok(());
        }
        readers.statistics = still_open(match &mut self.map {
            None => writeln!(self.statistics, "{line}"),
            Some(map) => {
                map.tell(line);
                map.draw()
            }
        })?;
        Ok(())
    }

    /// Events, but for those of pixels left out. They are recorded whether or not somebody reads
    /// them.
    fn write(
        &mut self,
        mut events: Vec<Event>,
        settings: &Settings,
        readers: &mut Readers,
    ) -> Result<()> {
        let scale = &settings.range_scale()?;
        self.masked += leave_out_masked(&mut events, settings);
        let events = &events[..];
        if let Some(recording) = &mut self.recording {
            recording.write(events)?;
        }
        if readers.events {
            readers.events = still_open(write(self.events, events, scale))?;
        }
        if let Some(map) = &mut self.map
            && readers.statistics
        {
            map.add(events, scale);
            readers.statistics = still_open(map.draw_when_due())?;
        }
        Ok(())
    }

    /// The picture as it is at the end.
    fn finish(&mut self, readers: &Readers) -> Result<()> {
        if let Some(map) = &mut self.map
            && readers.statistics
        {
            still_open(map.draw())?;
        }
        Ok(())
    }
}

/// Which outputs somebody still reads.
struct Readers {
    events: bool,
    /// Or the map in their place.
    statistics: bool,
}

/// Has the device take photons from its sensor, and writes what it does to `outputs`.
///
/// Ends when `done`, asked again and again, says so of the time it has taken, or
/// when the reader of an output is gone, unless there is a recording: it goes on, and
/// what is read by nobody ends alone. The device takes no photons from its sensor then.
/// Every event that has arrived is written, also if the device is gone.
///
/// An output that blocks keeps this from being heard: the device stops its sensor after the host
/// timeout, and this ends with the reason once the output goes on.
///
/// # Errors
/// If the device refuses the settings, is gone or has stopped its sensor, or what is written
/// cannot be.
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
    let watched = watch(client, task, done, outputs, &mut readers);
    let written = outputs.write(client.take_events(), task.settings, &mut readers);
    watched.and(written).and(outputs.finish(&readers))
}

/// [`monitor`] but for the events that have arrived and are not yet written.
fn watch(
    client: &mut Client,
    task: &Task,
    done: impl Fn(Duration) -> bool,
    outputs: &mut Outputs,
    readers: &mut Readers,
) -> Result<()> {
    let configuration = |source| {
        configuration(
            task.settings,
            task.pixels,
            task.columns,
            source,
            task.dynamic_depth,
            task.host_timeout,
        )
    };
    check_masked(task.settings)?;
    client.configure(&configuration(Source::Sensor)?)?;
    // From now on there may be events, which are written also if nothing else comes.
    let columns = match task.dynamic_depth {
        None => events_csv::HEADER,
        Some(_) => events_csv::DYNAMIC_DEPTH_HEADER,
    };
    readers.events = still_open(write_header(outputs.events, columns))?;
    let started = Instant::now();
    let mut figures = Figures {
        since: started,
        here: *client.counters(),
        first: client.report()?,
        last: [0; 2],
    };
    let is_running = |report: &Report| Stopped::check(report, task.host_timeout);
    is_running(&figures.first)?;
    let recorded = outputs.recording.is_some();
    let goes_on = |readers: &Readers| recorded || (readers.events && readers.statistics);
    let mut asked = false;
    while goes_on(readers) && !done(started.elapsed()) {
        if !asked && figures.since.elapsed() >= EVERY {
            client.request_report()?;
            asked = true;
        }
        let report = client.poll_report()?;
        outputs.write(client.take_events(), task.settings, readers)?;
        if let Some(report) = report {
            let line = figures.line(client, &report, outputs.masked);
            outputs.tell(line, readers)?;
            is_running(&report)?;
            asked = false;
        }
    }
    // The last second, unless it has only just begun.
    if asked || (goes_on(readers) && figures.since.elapsed() >= EVERY / 2) {
        if !asked {
            client.request_report()?;
        }
        let report = loop {
            let report = client.poll_report()?;
            outputs.write(client.take_events(), task.settings, readers)?;
            if let Some(report) = report {
                break report;
            }
        };
        let line = figures.line(client, &report, outputs.masked);
        outputs.tell(line, readers)?;
        is_running(&report)?;
    }
    // After the answer there are no more events.
    client.configure(&configuration(Source::Link)?)
}

fn write_header(out: &mut dyn Write, columns: &str) -> io::Result<()> {
    writeln!(out, "{columns}")?;
    out.flush()
}

fn write(out: &mut dyn Write, events: &[Event], scale: &RangeScale) -> io::Result<()> {
    for event in events {
        events_csv::write_event(&mut *out, event, scale)?;
    }
    if events.is_empty() {
        return Ok(());
    }
    out.flush()
}

/// Whether somebody still reads what was written.
fn still_open(written: io::Result<()>) -> io::Result<bool> {
    match written {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}

/// The basis of the lines of statistics.
struct Figures {
    /// When the last line was.
    since: Instant,
    /// The counts of this end at the beginning.
    here: LinkCounters,
    /// The counts of the device at the beginning.
    first: Report,
    /// Events and photons at the last line.
    last: [u64; 2],
}

impl Figures {
    /// Rates since the last line; so many events were left out.
    fn line(&mut self, client: &Client, report: &Report, masked: u64) -> String {
        let seconds = self.since.elapsed().as_secs_f64();
        let rate = |now: u64, before: u64| now.saturating_sub(before) as f64 / seconds;
        // Photons of blocks are those of pixels.
        let (pixels, blocks) = (&report.statistics, &report.blocks);
        let now = [pixels.events + blocks.events, pixels.photons()];
        let mut line = format!(
            "events/s {:.0}, photons/s {:.0}",
            rate(now[0], self.last[0]),
            rate(now[1], self.last[1]),
        );
        let losses = Losses {
            first: &self.first,
            here: &since(client.counters(), &self.here),
        };
        line += &losses.line(report);
        if masked > 0 {
            line += &format!(", events left out {masked}");
        }
        self.since = Instant::now();
        self.last = now;
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_as_high_as_wide_if_they_can_be() {
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

//! A device with a sensor: its events as they come, and once a second what it
//! does.

use std::io::{self, ErrorKind, Write};
use std::time::{Duration, Instant};

use anyhow::Result;
use dtof_core::{DepthEvent, RangeScale};
use dtof_firmware::link::message::Report;

use crate::device::{Client, configuration};
use crate::events_csv;
use crate::settings::Settings;

/// How often there are statistics.
const EVERY: Duration = Duration::from_secs(1);

/// Has the device take photons from its sensor for `length`, or without end, and
/// writes its events as CSV to `events` as they come, and a line of statistics a
/// second to `statistics`. Ends early when nobody reads them any more. The
/// device's sensor is switched off then.
///
/// # Errors
/// If the device refuses the settings or is gone, or what is written cannot be.
pub fn monitor(
    client: &mut Client,
    settings: &Settings,
    pixels: u16,
    length: Option<Duration>,
    events: &mut impl Write,
    statistics: &mut impl Write,
) -> Result<()> {
    let scale = settings.range_scale()?;
    client.configure(&configuration(settings, pixels, 1)?)?;
    let started = Instant::now();
    let mut figures = Figures {
        since: started,
        retransmitted: client.counters().retransmitted,
        first: client.report()?,
        last: Report::default(),
    };
    let done = || length.is_some_and(|length| started.elapsed() >= length);
    let mut open = still_open(header(events))?;
    let mut asked = false;
    while open && !done() {
        if !asked && figures.since.elapsed() >= EVERY {
            client.request_report()?;
            asked = true;
        }
        let report = client.poll_report()?;
        open = still_open(write(events, &client.take_events(), &scale))?;
        if let Some(report) = report {
            open &= still_open(writeln!(statistics, "{}", figures.line(client, report)))?;
            asked = false;
        }
    }
    // The last second, unless it has only just begun.
    if asked || (open && figures.since.elapsed() >= EVERY / 2) {
        if !asked {
            client.request_report()?;
        }
        let report = loop {
            if let Some(report) = client.poll_report()? {
                break report;
            }
        };
        open &= still_open(writeln!(statistics, "{}", figures.line(client, report)))?;
    }
    // After the answer there are no more events.
    client.configure(&configuration(settings, pixels, 0)?)?;
    if open {
        still_open(write(events, &client.take_events(), &scale))?;
    }
    Ok(())
}

fn header(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", events_csv::HEADER)?;
    out.flush()
}

fn write(out: &mut impl Write, events: &[DepthEvent], scale: &RangeScale) -> io::Result<()> {
    for event in events {
        events_csv::write(out, event, scale)?;
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

/// What the lines of statistics are worked out from.
struct Figures {
    /// When the last line was.
    since: Instant,
    /// What this end had sent again at the beginning.
    retransmitted: u32,
    /// What the device had counted at the beginning.
    first: Report,
    /// What the device had counted at the last line.
    last: Report,
}

impl Figures {
    /// Rates since the last line, counts since the beginning.
    #[allow(clippy::cast_precision_loss, reason = "rates to look at")]
    fn line(&mut self, client: &Client, report: Report) -> String {
        let seconds = self.since.elapsed().as_secs_f64();
        let rate = |now: u64, before: u64| now.saturating_sub(before) as f64 / seconds;
        let (now, last, first) = (&report.statistics, &self.last.statistics, &self.first);
        let line = format!(
            "events/s {:.0}, photons/s {:.0}, deferred {}, lost bytes {}, retransmissions {}, sensor errors {}",
            rate(now.events, last.events),
            rate(now.photons(), last.photons()),
            now.deferred,
            report.overrun.wrapping_sub(first.overrun),
            (client.counters().retransmitted - self.retransmitted).wrapping_add(
                report
                    .link
                    .retransmitted
                    .wrapping_sub(first.link.retransmitted)
            ),
            report.sensor_errors.wrapping_sub(first.sensor_errors),
        );
        self.since = Instant::now();
        self.last = report;
        line
    }
}

//! The events of an AER file, up to its end or to where it is damaged.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Result, bail, ensure};
use dtof_core::EchoNumber;

use super::Format;
use dtof_events::aer_file::{Event, EventKind, Header, Reader};
use dtof_events::clock::LaserClock;
use dtof_events::echoes::{Echo, Selection};
use dtof_options::Refused;
use dtof_options::progress::Progress;

/// The events of a file.
pub fn open(path: &Path) -> Result<Reader<BufReader<File>>> {
    Reader::new(BufReader::new(File::open(path)?))
}

/// What chooses the echo of each exposure: a file does not say how long one may last, or how
/// many echoes it may have.
pub fn chosen(echo: Echo) -> Selection {
    Selection::new(echo, EchoNumber::LAST, u16::MAX)
}

/// The contents of a file.
pub struct Survey {
    pub header: Header,
    /// Depth events and dynamic depth events.
    counts: [u64; 2],
    /// Depth events of the echo that is wanted.
    chosen: u64,
    /// How long a laser cycle is.
    pub clock: LaserClock,
    /// What is to be said of it.
    pub warning: Option<String>,
    /// The laser cycle of the latest event.
    pub latest: u64,
    /// Damage that ends the file too early: the byte, and what is wrong there.
    pub damage: Option<String>,
}

impl Survey {
    /// Reads all of a file. In a damaged file, an event at a time that `format` cannot hold
    /// is where the damage begins.
    ///
    /// # Errors
    /// Of a file that is not damaged, such an event is an error.
    pub fn of(
        path: &Path,
        format: Format,
        clock: Option<LaserClock>,
        echo: Echo,
        progress: &mut dyn Progress,
    ) -> Result<Self> {
        let file = path.metadata()?;
        ensure!(file.is_file(), "not a file that can be read twice");
        let mut reader = open(path)?;
        let header = *reader.header();
        let (clock, warning) = LaserClock::choose(clock, &header);
        let mut survey = Self {
            header,
            clock,
            warning,
            counts: [0; 2],
            chosen: 0,
            latest: 0,
            damage: None,
        };
        progress.begin(file.len(), "bytes counted");
        let mut selection = chosen(echo);
        let mut beyond = None;
        loop {
            let begin = reader.offset();
            let event = match reader.next_event() {
                Ok(Some(event)) => event,
                Ok(None) => match beyond {
                    None => break,
                    Some((_, time)) => return Err(time),
                },
                Err(error) => {
                    survey.damage = Some(match beyond {
                        None => format!("{error:#}"),
                        Some((byte, time)) => format!("byte {byte}: {time}"),
                    });
                    break;
                }
            };
            if beyond.is_some() {
                continue;
            }
            if let Err(time) = format.check(&clock, event.cycle().0) {
                // The byte of the time word, if there is one before the event.
                beyond = Some((begin, time));
                continue;
            }
            survey.counts[event.kind() as usize] += 1;
            if let Event::Depth(event) = event {
                selection.push(event);
                survey.chosen += selection.by_ref().count() as u64;
            }
            survey.latest = survey.latest.max(event.cycle().0);
            if survey.all().is_multiple_of(4096) {
                progress.at(reader.offset())?;
            }
        }
        selection.finish();
        survey.chosen += selection.count() as u64;
        progress.end();
        Ok(survey)
    }

    /// Events of either kind.
    pub fn all(&self) -> u64 {
        self.counts.iter().sum()
    }

    pub fn events(&self, kind: EventKind) -> u64 {
        self.counts[kind as usize]
    }

    /// How many events of a kind are written, if depth events are of one echo.
    pub fn chosen(&self, kind: EventKind) -> u64 {
        match kind {
            EventKind::Depth => self.chosen,
            EventKind::DynamicDepth => self.events(kind),
        }
    }

    /// The one kind there is, unless one is wanted.
    pub fn kind(&self, wanted: Option<EventKind>) -> Result<EventKind> {
        if let Some(wanted) = wanted {
            let name = match wanted {
                EventKind::Depth => "depth",
                EventKind::DynamicDepth => "dynamic depth",
            };
            ensure!(
                self.events(wanted) > 0 || self.all() == 0 || self.damage.is_some(),
                "{} events, none of them a {name} event",
                self.all()
            );
            return Ok(wanted);
        }
        match self.counts {
            [_, 0] => Ok(EventKind::Depth),
            [0, _] => Ok(EventKind::DynamicDepth),
            [depth, dynamic_depth] => bail!(Refused::input(format!(
                "{depth} depth events and {dynamic_depth} dynamic depth events: `events` says \
                 which, depth or dynamic-depth"
            ))),
        }
    }
}

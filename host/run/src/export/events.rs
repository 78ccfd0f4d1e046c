//! The events of an AER file, up to its end or to where it is damaged.

use std::path::Path;

use anyhow::{Result, bail, ensure};
use dtof_core::EchoNumber;

use super::Format;
use dtof_data::events::aer_file::{self, Event, EventKind, Header};
use dtof_data::events::clock::LaserClock;
use dtof_data::events::echoes::{Echo, EchoSelection};
use dtof_data::options::Refused;
use dtof_data::options::progress::Progress;

/// Selects `echo` of each exposure. A file does not give the length of exposures or the number of
/// echoes, so the limits are the largest.
pub fn selection(echo: Echo) -> EchoSelection {
    EchoSelection::new(echo, EchoNumber::LAST, u16::MAX)
}

/// The result of a first pass over a file.
pub struct Survey {
    pub header: Header,
    /// Numbers of depth events and of dynamic depth events.
    counts: [u64; 2],
    /// Depth events that are selected.
    chosen: u64,
    /// The rate of the laser.
    pub clock: LaserClock,
    /// A warning about the laser rate.
    pub warning: Option<String>,
    /// The laser cycle of the latest event.
    pub latest: u64,
    /// Where the file is damaged, if it is: the byte and what is wrong there.
    pub damage: Option<String>,
}

impl Survey {
    /// Reads all of a file. In a damaged file, the damage begins at the first event with a time
    /// that `format` cannot hold.
    ///
    /// # Errors
    /// Fails if an intact file has such an event.
    pub fn read(
        path: &Path,
        format: Format,
        clock: Option<LaserClock>,
        echo: Echo,
        progress: &mut dyn Progress,
    ) -> Result<Self> {
        let mut reader = aer_file::open(path)?;
        let header = reader.header().clone();
        let (clock, warning) = LaserClock::for_file(clock, &header);
        let mut survey = Self {
            header,
            clock,
            warning,
            counts: [0; 2],
            chosen: 0,
            latest: 0,
            damage: None,
        };
        progress.begin(path.metadata()?.len(), "bytes counted");
        let mut selection = selection(echo);
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
            if let Err(time) = format.check(&clock, event.cycle().raw()) {
                // The offset of the time word, if there is one before the event.
                beyond = Some((begin, time));
                continue;
            }
            survey.counts[event.kind() as usize] += 1;
            if let Event::Depth(event) = event {
                selection.push(event);
                survey.chosen += selection.by_ref().count() as u64;
            }
            survey.latest = survey.latest.max(event.cycle().raw());
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

    /// How many events of a kind will be written.
    pub fn chosen(&self, kind: EventKind) -> u64 {
        match kind {
            EventKind::Depth => self.chosen,
            EventKind::DynamicDepth => self.events(kind),
        }
    }

    /// The kind to write: `requested`, or the only one in the file.
    pub fn kind(&self, requested: Option<EventKind>) -> Result<EventKind> {
        if let Some(requested) = requested {
            let name = match requested {
                EventKind::Depth => "depth",
                EventKind::DynamicDepth => "dynamic depth",
            };
            ensure!(
                self.events(requested) > 0 || self.all() == 0 || self.damage.is_some(),
                "{} events, none of them a {name} event",
                self.all()
            );
            return Ok(requested);
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

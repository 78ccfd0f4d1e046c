//! The events of an AER file, up to its end or to where it is damaged.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Result, bail, ensure};

use crate::aer_file::{Event, EventKind, Header, Reader};
use crate::progress::Progress;

/// Reads events, and takes those of pixels that are not there for damage.
pub struct Events {
    reader: Reader<BufReader<File>>,
    addresses: u64,
}

impl Events {
    pub fn open(path: &Path) -> Result<Self> {
        let reader = Reader::new(BufReader::new(File::open(path)?))?;
        let array = reader.header().geometry;
        let addresses = u64::from(array.columns) * u64::from(array.rows);
        ensure!(
            (1..=1 << 16).contains(&addresses),
            "the header says {}x{} pixels: must be 1 to 65,536",
            array.columns,
            array.rows
        );
        Ok(Self { reader, addresses })
    }

    /// The next event, or `None` at the end. What is wrong begins with the byte.
    pub fn next(&mut self) -> Result<Option<Event>> {
        let event = self.reader.next_event()?;
        if let Some(event) = event
            && u64::from(event.pixel().0) >= self.addresses
        {
            // The word before the one that comes next.
            let byte = self.reader.offset() - 16;
            bail!(
                "byte {byte}: pixel {} of {}",
                event.pixel().0,
                self.addresses
            );
        }
        Ok(event)
    }
}

/// What a file holds.
pub struct Survey {
    pub header: Header,
    depth: u64,
    dynamic_depth: u64,
    /// The laser cycle of the latest event.
    pub latest: u64,
    /// What ends the file too early: the byte, and what is wrong there.
    pub damage: Option<String>,
}

impl Survey {
    /// Reads all of a file.
    pub fn of(path: &Path, quiet: bool) -> Result<Self> {
        let file = path.metadata()?;
        ensure!(file.is_file(), "not a file that can be read twice");
        let mut events = Events::open(path)?;
        let mut survey = Self {
            header: *events.reader.header(),
            depth: 0,
            dynamic_depth: 0,
            latest: 0,
            damage: None,
        };
        let progress = Progress::new(file.len(), "bytes counted", quiet);
        loop {
            let event = match events.next() {
                Ok(Some(event)) => event,
                Ok(None) => break,
                Err(error) => {
                    survey.damage = Some(format!("{error:#}"));
                    break;
                }
            };
            *match event.kind() {
                EventKind::Depth => &mut survey.depth,
                EventKind::DynamicDepth => &mut survey.dynamic_depth,
            } += 1;
            survey.latest = survey.latest.max(event.cycle().0);
            if survey.all().is_multiple_of(4096) {
                progress.at(events.reader.offset());
            }
        }
        progress.finish();
        Ok(survey)
    }

    /// Events of either kind.
    pub fn all(&self) -> u64 {
        self.depth + self.dynamic_depth
    }

    pub fn events(&self, kind: EventKind) -> u64 {
        match kind {
            EventKind::Depth => self.depth,
            EventKind::DynamicDepth => self.dynamic_depth,
        }
    }

    /// The one kind there is, unless one is wanted.
    pub fn kind(&self, wanted: Option<EventKind>) -> Result<EventKind> {
        if let Some(wanted) = wanted {
            return Ok(wanted);
        }
        match (self.depth, self.dynamic_depth) {
            (_, 0) => Ok(EventKind::Depth),
            (0, _) => Ok(EventKind::DynamicDepth),
            (depth, dynamic_depth) => bail!(
                "{depth} depth events and {dynamic_depth} dynamic depth events: --events says \
                 which, depth or dynamic-depth"
            ),
        }
    }
}

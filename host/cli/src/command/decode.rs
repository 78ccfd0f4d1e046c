//! `dtof decode`: the events of an AER file as CSV.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof_data::events::{aer_file, events_csv};

#[derive(Args)]
pub struct Decode {
    /// AER file; `-` for standard input
    file: PathBuf,
}

impl Decode {
    pub fn run(&self) -> Result<()> {
        let mut out = BufWriter::new(io::stdout().lock());
        let printed = self.print(&mut out);
        // Events before damage are printed before the error.
        let flushed = out.flush().map_err(anyhow::Error::from);
        printed.and(flushed)
    }

    fn print(&self, out: &mut impl Write) -> Result<()> {
        let is_standard_input = self.file.as_os_str() == "-";
        let name = || match is_standard_input {
            true => "standard input".to_owned(),
            false => self.file.display().to_string(),
        };
        let input: Box<dyn Read> = if is_standard_input {
            Box::new(io::stdin())
        } else {
            Box::new(File::open(&self.file).with_context(name)?)
        };
        let mut reader = aer_file::Reader::new(BufReader::new(input)).with_context(name)?;
        let ranges = reader.header().ranges().with_context(name)?;
        let first = reader.next_event();
        // The first event decides on the columns.
        let header = match &first {
            Ok(Some(event)) => events_csv::header(event.kind()),
            _ => events_csv::HEADER,
        };
        writeln!(out, "{header}")?;
        let mut next = first.with_context(name)?;
        while let Some(event) = next {
            ensure!(
                events_csv::header(event.kind()) == header,
                "{}: depth events and dynamic depth events in one file have no columns in common",
                name()
            );
            events_csv::write_event(out, &event, &ranges)?;
            next = reader.next_event().with_context(name)?;
        }
        Ok(())
    }
}

//! JSON logs of sensors that send histograms. The first character tells the format. A log may be
//! compressed with gzip.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use anyhow::{Context, Result};
use flate2::bufread::MultiGzDecoder;

use crate::tmf8820::{self, Tmf8820Log};
use crate::tmf8829::{self, Tmf8829Log};

/// The log of a sensor.
pub enum CaptureLog {
    /// A list of captures.
    Tmf8820(Tmf8820Log),
    /// An object with frames.
    Tmf8829(Tmf8829Log),
}

/// Reads `path`.
///
/// # Errors
/// Returns what is wrong with the file, after its name and the line if there is one.
pub fn read(path: &Path) -> Result<CaptureLog> {
    let name = path.display().to_string();
    let mut file = BufReader::new(File::open(path).with_context(|| name.clone())?);
    let start = file.fill_buf().with_context(|| name.clone())?;
    if start.starts_with(&[0x1f, 0x8b]) {
        parse(&name, BufReader::new(MultiGzDecoder::new(file)))
    } else {
        parse(&name, file)
    }
}

fn parse(name: &str, mut text: impl BufRead) -> Result<CaptureLog> {
    let start = text.fill_buf().with_context(|| name.to_owned())?;
    // Some editors begin a file with a byte order mark.
    if start.starts_with(b"\xef\xbb\xbf") {
        text.consume(3);
    }
    let start = text.fill_buf().with_context(|| name.to_owned())?;
    let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
    let is_object = first == Some(&b'{');
    Ok(if is_object {
        CaptureLog::Tmf8829(tmf8829::read(name, text)?)
    } else {
        CaptureLog::Tmf8820(tmf8820::read(name, text)?)
    })
}

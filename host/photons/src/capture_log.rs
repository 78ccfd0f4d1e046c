//! JSON logs of sensors that send histograms. The first character tells the format. A log may be
//! compressed with gzip.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
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
        let unpacked = Unpacked {
            file: MultiGzDecoder::new(file),
            left: MOST_UNPACKED,
        };
        parse(&name, BufReader::new(unpacked))
    } else {
        parse(&name, file)
    }
}

/// The most bytes of a compressed log. A small file may unpack to more than any memory holds.
const MOST_UNPACKED: usize = 256 << 20;

/// The text of a compressed log. Fails where it has more than [`MOST_UNPACKED`] bytes.
struct Unpacked<R> {
    file: R,
    left: usize,
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(bytes);
        let read = read.map_err(|error| {
            io::Error::new(
                error.kind(),
                format!("the compressed file is damaged: {error}"),
            )
        })?;
        let left = self.left.checked_sub(read);
        self.left = left.ok_or_else(|| {
            io::Error::other("more than 256 MiB when unpacked; unpack it, as with gunzip")
        })?;
        Ok(read)
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

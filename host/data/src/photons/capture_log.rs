//! JSON logs of sensors that send histograms. The first character tells the format. A log may be
//! compressed with gzip.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use anyhow::{Context, Result, ensure};
use flate2::bufread::MultiGzDecoder;

use crate::photons::tmf8820::{self, Tmf8820Log};
use crate::photons::tmf8829::{self, Tmf8829Log};

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
    ensure!(!start.is_empty(), "{name}: the file is empty");
    let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
    let is_object = first == Some(&b'{');
    Ok(if is_object {
        CaptureLog::Tmf8829(tmf8829::read(name, text)?)
    } else {
        CaptureLog::Tmf8820(tmf8820::read(name, text)?)
    })
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    /// A log of a TMF8829 and one of a TMF8820, with so many photons in each bin.
    fn logs(count: u64) -> [String; 2] {
        let pixel = format!("{{\"bin\": {:?}}}", [count; tmf8829::BINS]);
        let zones = vec![vec![count; tmf8820::BINS]; 9];
        [
            format!("{{\"Result_Set\": [{{\"mp_histo\": [[{pixel}]]}}]}}"),
            format!("[{{\"hists\": {zones:?}}}]"),
        ]
    }

    /// The type of a log, and the photons of its first bin.
    fn is_tmf8829(log: &CaptureLog) -> (bool, u64) {
        match log {
            CaptureLog::Tmf8829(log) => (true, log.histograms.count(0, 0)),
            CaptureLog::Tmf8820(log) => (false, log.histograms.count(0, 0)),
        }
    }

    fn packed(text: &str) -> Vec<u8> {
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        packed.finish().unwrap()
    }

    /// Whatever the file is called. Some programs pack a file in parts.
    #[test]
    fn the_first_character_tells_the_sensor_and_the_first_bytes_whether_it_is_packed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        for (log, expected) in logs(7).iter().zip([true, false]) {
            let (start, end) = log.split_at(99);
            let in_parts = [packed(start), packed(end)].concat();
            for bytes in [
                log.clone().into(),
                format!("\u{feff}\r\n {log}\n").into(),
                packed(log),
                packed(&format!("\u{feff}{log}")),
                in_parts,
            ] {
                std::fs::write(&path, bytes).unwrap();
                let read = read(&path).unwrap();
                assert_eq!(is_tmf8829(&read), (expected, 7));
            }
        }
    }

    #[test]
    fn files_that_are_damaged_or_no_logs_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let refused = || {
            let error = format!("{:#}", read(&path).err().unwrap());
            error.replace(&path.display().to_string(), "NAME")
        };
        assert!(refused().starts_with("NAME: "), "{}", refused());
        let whole = packed(&logs(7)[0]);
        let damaged = "NAME: the compressed file is damaged: ";
        for (bytes, expected) in [
            (whole[..5].to_vec(), damaged),
            (whole[..whole.len() / 2].to_vec(), damaged),
            ([&whole[..], b"garbage garbage"].concat(), damaged),
            (vec![], "NAME: the file is empty"),
            (b" {".to_vec(), "NAME:1: not a TMF8829 log: "),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = refused();
            assert!(error.starts_with(expected), "{error}");
        }
    }

    /// A small file may unpack to more than any memory holds.
    #[test]
    fn a_packed_log_that_is_too_large_is_refused() {
        let read = |left| {
            let file = &[b' '; 1000][..];
            let mut text = String::new();
            let unpacked = Unpacked { file, left }.read_to_string(&mut text);
            unpacked.map_err(|error| error.to_string())
        };
        assert_eq!(read(1000), Ok(1000));
        let expected = "more than 256 MiB when unpacked; unpack it, as with gunzip";
        assert_eq!(read(999), Err(expected.to_owned()));
        assert_eq!(MOST_UNPACKED, 256 * 1024 * 1024);
        let text = BufReader::new(Unpacked {
            file: io::repeat(b' '),
            left: 1 << 20,
        });
        let error = parse("a.json", text).err().unwrap().to_string();
        assert_eq!(error, format!("a.json: {expected}"));
    }
}

//! AER files: a header, words, and an end word with their number and checksum.
//! The format is `docs/aer-format.md`, section "Files".

mod header;

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use dtof_core::events::DynamicDepthEvent;
use dtof_core::{
    AerDecoder, AerEncoder, AerRecord, AerWord, BinPosition, BlockLevel, DepthEvent, EchoNumber,
    Flags, LaserCycle, PixelAddress,
};

pub use header::Header;
pub use header::MAGIC;
use header::{HEADER_BYTES, header_length, offset_bytes, offsets_from_bytes, offsets_to_bytes};

use crate::named_values;
use crate::options::files::{fill, is_file};

/// Processes 16 bytes at a time, the size of a word.
type Checksum = Table<16>;
static CRC_32: Crc<u32, Checksum> = Crc::<u32, Checksum>::new(&CRC_32_ISO_HDLC);

/// An event of either kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A peak stood clear.
    Depth(DepthEvent),
    /// The mean depth has changed.
    DynamicDepth(DynamicDepthEvent),
}

named_values! {
    /// The kind of an event.
    #[derive(Debug, PartialEq, Eq)]
    pub enum EventKind {
        /// Depth events
        Depth = "depth",
        /// Dynamic depth events
        DynamicDepth = "dynamic-depth",
    }
}

impl Event {
    /// The kind.
    #[must_use]
    pub fn kind(&self) -> EventKind {
        match self {
            Self::Depth(_) => EventKind::Depth,
            Self::DynamicDepth(_) => EventKind::DynamicDepth,
        }
    }

    /// The macropixel, or the first of the block.
    #[must_use]
    pub fn pixel(&self) -> PixelAddress {
        match self {
            Self::Depth(event) => event.pixel,
            Self::DynamicDepth(event) => event.pixel,
        }
    }

    /// [`BlockLevel::PIXEL`], or the level of the block.
    #[must_use]
    pub fn level(&self) -> BlockLevel {
        match self {
            Self::Depth(event) => event.level,
            Self::DynamicDepth(event) => event.level,
        }
    }

    /// The number of the echo in its exposure; the first for a dynamic depth event.
    #[must_use]
    pub fn echo(&self) -> EchoNumber {
        match self {
            Self::Depth(event) => event.echo,
            Self::DynamicDepth(_) => EchoNumber::FIRST,
        }
    }

    /// The laser cycle.
    #[must_use]
    pub fn cycle(&self) -> LaserCycle {
        match self {
            Self::Depth(event) => event.cycle,
            Self::DynamicDepth(event) => event.cycle,
        }
    }

    /// The position of the pulse, or the mean after the change.
    #[must_use]
    pub fn position(&self) -> BinPosition {
        match self {
            Self::Depth(event) => event.position(),
            Self::DynamicDepth(event) => event.position,
        }
    }

    /// Its flags.
    #[must_use]
    pub fn flags(&self) -> Flags {
        match self {
            Self::Depth(event) => event.flags,
            Self::DynamicDepth(event) => event.flags,
        }
    }
}

/// Writes a file, which is complete once [`Writer::finish`] has returned.
pub struct Writer<W: Write> {
    out: W,
    digest: Digest<'static, u32, Checksum>,
    encoder: AerEncoder,
    events: u64,
}

impl<W: Write> Writer<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// Fails if the writer fails, or if `header` has offsets for another number of pixels.
    pub fn new(out: W, header: &Header) -> io::Result<Self> {
        Self::with_settings(out, header, "")
    }

    /// The same with the settings in the header. Settings of more than 65,456 bytes are left out.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_settings(out: W, header: &Header, settings: &str) -> io::Result<Self> {
        let (offsets, pixels) = (header.offsets_mm.len(), header.array.pixels());
        if offsets > 0 && offsets != pixels as usize {
            let text = format!("{offsets} offsets for {pixels} pixels");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
        }
        let mut writer = Self {
            out,
            digest: CRC_32.digest(),
            encoder: AerEncoder::new(),
            events: 0,
        };
        let most = usize::from(u16::MAX - 15 - HEADER_BYTES);
        let settings = Some(settings).filter(|text| text.len() <= most);
        let mut settings = settings.unwrap_or_default().as_bytes().to_vec();
        settings.resize(settings.len().next_multiple_of(AerWord::BYTES), b'\n');
        let length = u16::try_from(settings.len()).unwrap_or(0);
        writer.put(&header.to_bytes(HEADER_BYTES + length))?;
        writer.put(&settings)?;
        writer.put(&offsets_to_bytes(&header.offsets_mm))?;
        Ok(writer)
    }

    /// Writes one event, and the time word before it if one is due.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn write(&mut self, event: &Event) -> io::Result<()> {
        let (time, word) = match event {
            Event::Depth(event) => self.encoder.encode(event),
            Event::DynamicDepth(event) => self.encoder.encode_dynamic_depth(event),
        };
        if let Some(time) = time {
            self.put(&time.to_le_bytes())?;
        }
        self.events += 1;
        self.put(&word.to_le_bytes())
    }

    /// Flushes the writer.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Ends the file and returns the writer.
    ///
    /// # Errors
    /// Fails if the writer fails.
    pub fn finish(mut self) -> io::Result<W> {
        let end = AerWord::end(self.events, self.digest.finalize());
        self.out.write_all(&end.to_le_bytes())?;
        Ok(self.out)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.digest.update(bytes);
        self.out.write_all(bytes)
    }
}

/// Opens the file at `path`.
///
/// # Errors
/// Fails if it is no file, such as a pipe, and like [`Reader::new`].
pub fn open(path: &Path) -> Result<Reader<BufReader<File>>> {
    is_file(path)?;
    Reader::new(BufReader::new(File::open(path)?))
}

/// Reads a file, event by event.
pub struct Reader<R: Read> {
    input: R,
    digest: Digest<'static, u32, Checksum>,
    decoder: AerDecoder,
    header: Header,
    settings: String,
    offset: u64,
    events: u64,
    ended: bool,
}

impl<R: Read> Reader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// Fails if there is no header, or one of another format.
    pub fn new(mut input: R) -> Result<Self> {
        let mut bytes = [0; HEADER_BYTES as usize];
        fill(
            &mut input,
            &mut bytes,
            "not an AER file: shorter than its header",
        )?;
        let mut digest = CRC_32.digest();
        digest.update(&bytes);
        let mut header = Header::from_bytes(&bytes)?;
        let length = header_length(&bytes).unwrap_or(HEADER_BYTES);
        let settings = usize::from(length - HEADER_BYTES);
        let offsets = offset_bytes(&bytes, header.array);
        let mut rest = vec![0; settings + offsets];
        fill(&mut input, &mut rest, "the file ends inside its header")?;
        digest.update(&rest);
        header.offsets_mm = offsets_from_bytes(&rest[settings..], header.array.pixels())?;
        Ok(Self {
            input,
            digest,
            decoder: AerDecoder::new(),
            header,
            settings: String::from_utf8_lossy(&rest[..settings])
                .trim_end()
                .to_owned(),
            offset: u64::from(length) + offsets as u64,
            events: 0,
            ended: false,
        })
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The settings of the run in TOML; empty if the file has none.
    pub fn settings(&self) -> &str {
        &self.settings
    }

    /// The offset in the file of the next word.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// The next event, or `None` after the end word.
    ///
    /// # Errors
    /// Returns what is wrong and at which byte of the file.
    pub fn next_event(&mut self) -> Result<Option<Event>> {
        while !self.ended {
            let word = self.next_word();
            // The offset still points at the wrong word.
            if let Some(event) = word.with_context(|| format!("byte {}", self.offset))? {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    /// Reads one word. Returns its event, if it has one.
    fn next_word(&mut self) -> Result<Option<Event>> {
        let Some(bytes) = self.read_word()? else {
            bail!("the file ends without an end word");
        };
        match self.decoder.decode(AerWord::from_le_bytes(bytes))? {
            AerRecord::Event(event) => self.counted(&bytes, Event::Depth(event)).map(Some),
            AerRecord::DynamicDepth(event) => {
                self.counted(&bytes, Event::DynamicDepth(event)).map(Some)
            }
            AerRecord::Time(_) => {
                self.accept(&bytes);
                Ok(None)
            }
            AerRecord::End { events, checksum } => {
                self.ended = true;
                ensure!(
                    events == self.events,
                    "the end word counts {events} events, the file holds {}",
                    self.events
                );
                ensure!(
                    checksum == self.digest.clone().finalize(),
                    "the checksum does not match: a word before this one is damaged"
                );
                self.offset += AerWord::BYTES as u64;
                ensure!(self.input.read(&mut [0])? == 0, "bytes follow the end word");
                Ok(None)
            }
            other => bail!("this program cannot read {other:?}"),
        }
    }

    /// The bytes of the next word, or `None` at the end of the file.
    fn read_word(&mut self) -> Result<Option<[u8; AerWord::BYTES]>> {
        let mut bytes = Vec::with_capacity(AerWord::BYTES);
        self.input
            .by_ref()
            .take(AerWord::BYTES as u64)
            .read_to_end(&mut bytes)?;
        if bytes.is_empty() {
            return Ok(None);
        }
        let word = <[u8; AerWord::BYTES]>::try_from(bytes);
        word.map(Some)
            .map_err(|_| anyhow!("the file ends inside a word"))
    }

    fn counted(&mut self, bytes: &[u8; AerWord::BYTES], event: Event) -> Result<Event> {
        self.header.check(&event)?;
        self.accept(bytes);
        self.events += 1;
        Ok(event)
    }

    fn accept(&mut self, bytes: &[u8; AerWord::BYTES]) {
        self.digest.update(bytes);
        self.offset += AerWord::BYTES as u64;
    }
}

#[cfg(test)]
mod tests;

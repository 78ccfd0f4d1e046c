//! AER files: a header, words, and an end word with their number and checksum.
//! The format is `docs/aer-format.md`, section "Files".

use std::io::{self, Read, Write};

use anyhow::{Context, Result, anyhow, bail, ensure};
use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    AER_VERSION, AerDecoder, AerEncoder, AerRecord, AerWord, BinPosition, BlockLevel, DepthEvent,
    DynamicDepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
};

use crate::input::source::Geometry;

pub(crate) const MAGIC: &str = "DTOF-AER";
/// The header without the settings that may follow it.
const HEADER_BYTES: u16 = 64;
/// Of 16 bytes at a time, as long as a word.
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

/// Which kind of event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum EventKind {
    /// Depth events.
    Depth,
    /// Dynamic depth events.
    DynamicDepth,
}

impl Event {
    /// Which kind it is.
    #[must_use]
    pub fn kind(&self) -> EventKind {
        match self {
            Self::Depth(_) => EventKind::Depth,
            Self::DynamicDepth(_) => EventKind::DynamicDepth,
        }
    }

    /// Which macropixel.
    #[must_use]
    pub fn pixel(&self) -> PixelAddress {
        match self {
            Self::Depth(event) => event.pixel,
            Self::DynamicDepth(event) => event.pixel,
        }
    }

    /// Whether it is one macropixel, or a block.
    #[must_use]
    pub fn level(&self) -> BlockLevel {
        match self {
            Self::Depth(event) => event.level,
            Self::DynamicDepth(event) => event.level,
        }
    }

    /// Which echo of its exposure; the first of a change of depth.
    #[must_use]
    pub fn echo(&self) -> EchoNumber {
        match self {
            Self::Depth(event) => event.echo,
            Self::DynamicDepth(_) => EchoNumber::FIRST,
        }
    }

    /// When.
    #[must_use]
    pub fn cycle(&self) -> LaserCycle {
        match self {
            Self::Depth(event) => event.cycle,
            Self::DynamicDepth(event) => event.cycle,
        }
    }

    /// Where: the pulse, or the mean after the change.
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

/// Everything a reader needs to turn words into ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// Bins of a histogram.
    pub bins: u32,
    /// The array.
    pub geometry: Geometry,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    pub offset_mm: I24F8,
    /// Laser cycles in a thousand seconds; 0 if that is not known.
    pub laser_millihertz: u64,
    /// Microseconds from 1970-01-01 UTC to laser cycle 0; 0 if that is not known.
    pub start_us: i64,
}

impl Header {
    fn to_bytes(self) -> [u8; HEADER_BYTES as usize] {
        let mut bytes = [0; HEADER_BYTES as usize];
        let fields = [
            MAGIC.as_bytes(),
            &AER_VERSION.to_le_bytes(),
            &HEADER_BYTES.to_le_bytes(),
            &self.bins.to_le_bytes(),
            &self.geometry.columns.to_le_bytes(),
            &self.geometry.rows.to_le_bytes(),
            &self.bin_width_ps.to_le_bytes(),
            &self.offset_mm.to_le_bytes(),
            &self.laser_millihertz.to_le_bytes(),
            &self.start_us.to_le_bytes(),
        ]
        .concat();
        bytes[..fields.len()].copy_from_slice(&fields);
        bytes
    }

    fn from_bytes(bytes: &[u8; HEADER_BYTES as usize]) -> Result<Self> {
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let four_at = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let u32_at = |at: usize| u32::from_le_bytes(four_at(at));
        let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
        ensure!(bytes[..8] == *MAGIC.as_bytes(), "not an AER file");
        let version = u16_at(8);
        ensure!(
            version == AER_VERSION,
            "AER version {version}; this program reads {AER_VERSION}"
        );
        ensure!(
            header_length(bytes).is_some() && bytes[48..].iter().all(|&byte| byte == 0),
            "the header is damaged"
        );
        let geometry = Geometry::new(u32_at(16), u32_at(20));
        ensure!(
            (1..=1 << 16).contains(&addresses(geometry)),
            "the header says {}x{} pixels: must be 1 to 65,536",
            geometry.columns,
            geometry.rows
        );
        Ok(Self {
            bins: u32_at(12),
            geometry,
            bin_width_ps: U16F16::from_le_bytes(four_at(24)),
            offset_mm: I24F8::from_le_bytes(four_at(28)),
            laser_millihertz: u64_at(32),
            start_us: u64_at(40).cast_signed(),
        })
    }

    /// Can an array with this header have sent the event?
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, event: &Event) -> Result<()> {
        let (pixel, pixels) = (event.pixel().0, addresses(self.geometry));
        ensure!(u64::from(pixel) < pixels, "pixel {pixel} of {pixels}");
        let mut block = self.geometry.block(event.pixel(), event.level());
        ensure!(
            block.next().is_some(),
            "pixel {pixel} is not the first of a block of level {}",
            event.level()
        );
        let (bin, beyond) = match event {
            Event::Depth(event) => (event.peak_bin.raw().into(), self.bins.into()),
            // A position lies up to one bin beyond that of the peak.
            Event::DynamicDepth(event) => (
                i64::from(event.position.raw() >> BinPosition::FRACTIONAL_BITS),
                i64::from(self.bins) + 1,
            ),
        };
        ensure!(bin < beyond, "bin {bin} of {}", self.bins);
        Ok(())
    }
}

/// Bytes of a header that begins so, with its settings; `None` if it cannot be.
fn header_length(bytes: &[u8; HEADER_BYTES as usize]) -> Option<u16> {
    let length = u16::from_le_bytes([bytes[10], bytes[11]]);
    (length >= HEADER_BYTES && length.is_multiple_of(16)).then_some(length)
}

/// Pixels of an array of any size.
fn addresses(array: Geometry) -> u64 {
    u64::from(array.columns) * u64::from(array.rows)
}

/// Writes a file; it is complete once [`Writer::finish`] has returned.
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
    /// Those of the writer.
    pub fn new(out: W, header: &Header) -> io::Result<Self> {
        let mut writer = Self {
            out,
            digest: CRC_32.digest(),
            encoder: AerEncoder::new(),
            events: 0,
        };
        writer.put(&header.to_bytes())?;
        Ok(writer)
    }

    /// Writes one event, and the time word before it if one is due.
    ///
    /// # Errors
    /// Those of the writer.
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

    /// What was written goes as far as it can.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Ends the file and gives the writer back.
    ///
    /// # Errors
    /// Those of the writer.
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

/// Reads a file, event by event.
pub struct Reader<R: Read> {
    input: R,
    digest: Digest<'static, u32, Checksum>,
    decoder: AerDecoder,
    header: Header,
    offset: u64,
    events: u64,
    ended: bool,
}

impl<R: Read> Reader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// If there is none, or one of another format.
    pub fn new(mut input: R) -> Result<Self> {
        let mut bytes = [0; HEADER_BYTES as usize];
        input
            .read_exact(&mut bytes)
            .map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => anyhow!("not an AER file: shorter than its header"),
                _ => error.into(),
            })?;
        let mut digest = CRC_32.digest();
        digest.update(&bytes);
        let header = Header::from_bytes(&bytes)?;
        // The settings of the run, which no event needs.
        let length = header_length(&bytes).unwrap_or(HEADER_BYTES);
        let mut settings = vec![0; usize::from(length - HEADER_BYTES)];
        input
            .read_exact(&mut settings)
            .context("the file ends inside its header")?;
        digest.update(&settings);
        Ok(Self {
            input,
            digest,
            decoder: AerDecoder::new(),
            header,
            offset: length.into(),
            events: 0,
            ended: false,
        })
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The byte of the file at which the next word begins.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// The next event, or `None` after the end word.
    ///
    /// # Errors
    /// What is wrong and at which byte of the file.
    pub fn next_event(&mut self) -> Result<Option<Event>> {
        while !self.ended {
            let word = self.next_word();
            // Nothing that is wrong has been passed.
            if let Some(event) = word.with_context(|| format!("byte {}", self.offset))? {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    /// Reads one word; gives the event if it is one.
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

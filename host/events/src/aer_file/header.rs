//! The header of AER files.

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{AER_VERSION, Array, BinPosition};
use dtof_photons::ranges::{Ranges, RangesError};

use super::Event;

/// The first bytes of an AER file.
pub const MAGIC: &str = "DTOF-AER";
/// The version whose words lack the flag of confirmed events.
const WITHOUT_CONFIRMED: u16 = 4;
/// The version of files with offsets of pixels, which follow the header. The words are those of version 5.
const WITH_OFFSETS: u16 = 6;
/// The offset of a pixel that is left out.
const LEFT_OUT: I24F8 = I24F8::MIN;
/// The header without the settings that may follow.
pub(super) const HEADER_BYTES: u16 = 64;

/// What a reader needs to turn words into ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Bins of a histogram.
    pub bins: u32,
    /// The array.
    pub array: Array,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    pub offset_mm: I24F8,
    /// Millimetres added to that, for each pixel in the order of the addresses; `None` if the pixel is left out.
    /// Empty if they are 0.
    pub offsets_mm: Vec<Option<I24F8>>,
    /// Laser cycles in a thousand seconds; 0 if unknown.
    pub laser_millihertz: u64,
    /// Microseconds from 1970-01-01 UTC to laser cycle 0; 0 if unknown.
    pub start_us: i64,
}

impl Header {
    /// From events to millimetres.
    ///
    /// # Errors
    /// Fails if the bin width or an offset is out of range, or if there is not one offset for each pixel.
    pub fn ranges(&self) -> Result<Ranges, RangesError> {
        let offsets = self.offsets_mm.clone();
        Ranges::new(self.array, self.bin_width_ps, self.offset_mm, offsets)
    }

    /// `length` is that of the header with its settings.
    pub(super) fn to_bytes(&self, length: u16) -> [u8; HEADER_BYTES as usize] {
        let mut bytes = [0; HEADER_BYTES as usize];
        let version = match self.offsets_mm.is_empty() {
            true => AER_VERSION,
            false => WITH_OFFSETS,
        };
        let fields = [
            MAGIC.as_bytes(),
            &version.to_le_bytes(),
            &length.to_le_bytes(),
            &self.bins.to_le_bytes(),
            &self.array.columns().to_le_bytes(),
            &self.array.rows().to_le_bytes(),
            &self.bin_width_ps.to_le_bytes(),
            &self.offset_mm.to_le_bytes(),
            &self.laser_millihertz.to_le_bytes(),
            &self.start_us.to_le_bytes(),
        ]
        .concat();
        bytes[..fields.len()].copy_from_slice(&fields);
        bytes
    }

    pub(super) fn from_bytes(bytes: &[u8; HEADER_BYTES as usize]) -> Result<Self> {
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let four_at = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let u32_at = |at: usize| u32::from_le_bytes(four_at(at));
        let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
        ensure!(bytes[..8] == *MAGIC.as_bytes(), "not an AER file");
        let version = u16_at(8);
        ensure!(
            (WITHOUT_CONFIRMED..=WITH_OFFSETS).contains(&version),
            "AER version {version}; this program reads {WITHOUT_CONFIRMED} to {WITH_OFFSETS}"
        );
        ensure!(
            header_length(bytes).is_some() && bytes[48..].iter().all(|&byte| byte == 0),
            "the header is damaged"
        );
        let (columns, rows) = (u32_at(16), u32_at(20));
        let array = Array::new(columns, rows).with_context(|| {
            format!("the header says {columns}x{rows} pixels: must be 1 to 65,536")
        })?;
        Ok(Self {
            bins: u32_at(12),
            array,
            bin_width_ps: U16F16::from_le_bytes(four_at(24)),
            offset_mm: I24F8::from_le_bytes(four_at(28)),
            // They follow the settings.
            offsets_mm: Vec::new(),
            laser_millihertz: u64_at(32),
            start_us: u64_at(40).cast_signed(),
        })
    }

    /// Checks that the event can come from an array with this header.
    ///
    /// # Errors
    /// Says why not.
    pub fn check(&self, event: &Event) -> Result<()> {
        let (pixel, pixels) = (event.pixel().raw(), self.array.pixels());
        ensure!(u32::from(pixel) < pixels, "pixel {pixel} of {pixels}");
        let mut block = self.array.pixels_of(event.pixel(), event.level());
        ensure!(
            block.next().is_some(),
            "pixel {pixel} is not the first of a block of level {}",
            event.level()
        );
        let (bin, beyond) = match event {
            Event::Depth(event) => (event.peak_bin.raw().into(), self.bins.into()),
            // A position is at most one bin beyond that of the peak.
            Event::DynamicDepth(event) => (
                i64::from(event.position.raw() >> BinPosition::FRACTIONAL_BITS),
                i64::from(self.bins) + 1,
            ),
        };
        ensure!(bin < beyond, "bin {bin} of {}", self.bins);
        Ok(())
    }
}

/// The bytes of the offsets after the header and its settings: whole words.
pub(super) fn offset_bytes(bytes: &[u8; HEADER_BYTES as usize], array: Array) -> usize {
    match u16::from_le_bytes([bytes[8], bytes[9]]) {
        WITH_OFFSETS => (4 * array.pixels() as usize).next_multiple_of(16),
        _ => 0,
    }
}

/// The offsets as bytes, padded with zeros.
pub(super) fn offsets_to_bytes(offsets: &[Option<I24F8>]) -> Vec<u8> {
    let numbers = offsets.iter().map(|offset| offset.unwrap_or(LEFT_OUT));
    let mut bytes: Vec<u8> = numbers.flat_map(I24F8::to_le_bytes).collect();
    bytes.resize(bytes.len().next_multiple_of(16), 0);
    bytes
}

/// The offsets of `pixels` pixels, if there are any.
///
/// # Errors
/// Fails if the bytes after them are not 0.
pub(super) fn offsets_from_bytes(bytes: &[u8], pixels: u32) -> Result<Vec<Option<I24F8>>> {
    let length = bytes.len().min(4 * pixels as usize);
    let (offsets, padding) = bytes.split_at(length);
    ensure!(
        padding.iter().all(|&byte| byte == 0),
        "the header is damaged"
    );
    let (offsets, _) = offsets.as_chunks::<4>();
    let offsets = offsets.iter().map(|&bytes| I24F8::from_le_bytes(bytes));
    Ok(offsets
        .map(|offset| Some(offset).filter(|&offset| offset != LEFT_OUT))
        .collect())
}

/// The bytes of a header with its settings; `None` if they are not valid.
pub(super) fn header_length(bytes: &[u8; HEADER_BYTES as usize]) -> Option<u16> {
    let length = u16::from_le_bytes([bytes[10], bytes[11]]);
    (length >= HEADER_BYTES && length.is_multiple_of(16)).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_of_each_version_that_is_known_reads_the_same() {
        let header = Header {
            bins: 128,
            array: Array::new(64, 32).unwrap(),
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::lit("-12.5"),
            offsets_mm: Vec::new(),
            laser_millihertz: 7,
            start_us: 9,
        };
        for version in 0..=u8::MAX {
            let mut bytes = header.to_bytes(HEADER_BYTES);
            bytes[8] = version;
            let read = Header::from_bytes(&bytes).ok();
            let known = [4, 5, 6].contains(&version);
            assert_eq!(read, known.then(|| header.clone()), "{version}");
        }
    }
}

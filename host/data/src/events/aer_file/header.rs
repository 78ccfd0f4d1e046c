//! The header of AER files.

use crate::photons::ranges::{Ranges, RangesError};
use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{AER_VERSION, Array, BinPosition};

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
    use crate::events::fixtures;
    use dtof_core::events::DynamicDepthEvent;
    use dtof_core::{BinIndex, BlockLevel, DepthEvent, Flags, LaserCycle, PixelAddress};

    /// 5×3 pixels, 128 bins of 250 ps.
    fn header() -> Header {
        Header {
            bins: 128,
            array: Array::new(5, 3).unwrap(),
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::lit("-12.5"),
            offsets_mm: Vec::new(),
            laser_millihertz: 7,
            start_us: -9,
        }
    }

    #[test]
    fn a_header_of_each_version_that_is_known_reads_the_same() {
        for version in 0..=u8::MAX {
            let mut bytes = header().to_bytes(HEADER_BYTES);
            bytes[8] = version;
            let read = Header::from_bytes(&bytes).map_err(|error| error.to_string());
            let expected = match version {
                4..=6 => Ok(header()),
                _ => Err(format!("AER version {version}; this program reads 4 to 6")),
            };
            assert_eq!(read, expected);
        }
    }

    #[test]
    fn a_header_that_cannot_be_is_refused() {
        let pixels = |size| format!("the header says {size} pixels: must be 1 to 65,536");
        let damaged = || "the header is damaged".to_owned();
        for (bytes, to, expected) in [
            (0..1, 0, "not an AER file".to_owned()),
            // The length of the header: not of whole words, or less than 64.
            (10..11, 65, damaged()),
            (10..11, 48, damaged()),
            (48..49, 1, damaged()),
            (63..64, 1, damaged()),
            (16..20, 0, pixels("0x3")),
            (16..24, 255, pixels("4294967295x4294967295")),
        ] {
            let mut header = header().to_bytes(HEADER_BYTES);
            header[bytes].fill(to);
            let error = Header::from_bytes(&header).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
    }

    #[test]
    fn an_event_outside_the_array_or_the_bins_is_refused() {
        let depth = |pixel, level, bin| {
            Event::Depth(DepthEvent {
                level: BlockLevel::new(level).unwrap(),
                peak_bin: BinIndex::new(bin).unwrap(),
                ..fixtures::event(pixel, 1, 0)
            })
        };
        // Its position in 1/256 bins.
        let dynamic = |pixel, level, position| {
            let (pixel, level) = (PixelAddress::new(pixel), BlockLevel::new(level).unwrap());
            let position = BinPosition::new(position).unwrap();
            let cycle = LaserCycle::new(1);
            let event = DynamicDepthEvent::new(pixel, level, cycle, position, 5, Flags::NONE);
            Event::DynamicDepth(event.unwrap())
        };
        for (event, reason) in [
            (depth(14, 0, 127), ""),
            (depth(15, 0, 127), "pixel 15 of 15"),
            (depth(0, 0, 128), "bin 128 of 128"),
            // Columns 4 and 5, rows 2 and 3: only column 4 and row 2 are there.
            (depth(14, 1, 0), ""),
            (
                depth(9, 1, 0),
                "pixel 9 is not the first of a block of level 1",
            ),
            (dynamic(14, 0, 128 * 256 + 255), ""),
            (dynamic(14, 0, -512), ""),
            (dynamic(14, 0, 129 * 256), "bin 129 of 128"),
            (dynamic(15, 0, 0), "pixel 15 of 15"),
            (
                dynamic(3, 2, 0),
                "pixel 3 is not the first of a block of level 2",
            ),
        ] {
            let checked = header().check(&event).map_err(|error| error.to_string());
            let expected = match reason {
                "" => Ok(()),
                reason => Err(reason.to_owned()),
            };
            assert_eq!(checked, expected, "{event:?}");
        }
    }
}

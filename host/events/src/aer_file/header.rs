//! The header of AER files.

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{AER_VERSION, Array, BinPosition};

use super::Event;

/// The first bytes of an AER file.
pub const MAGIC: &str = "DTOF-AER";
/// The version whose words lack the flag of confirmed events.
const WITHOUT_CONFIRMED: u16 = 4;
/// The header without the settings that may follow.
pub(super) const HEADER_BYTES: u16 = 64;

/// What a reader needs to turn words into ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// Bins of a histogram.
    pub bins: u32,
    /// The array.
    pub array: Array,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    pub offset_mm: I24F8,
    /// Laser cycles in a thousand seconds; 0 if unknown.
    pub laser_millihertz: u64,
    /// Microseconds from 1970-01-01 UTC to laser cycle 0; 0 if unknown.
    pub start_us: i64,
}

impl Header {
    pub(super) fn to_bytes(self) -> [u8; HEADER_BYTES as usize] {
        let mut bytes = [0; HEADER_BYTES as usize];
        let fields = [
            MAGIC.as_bytes(),
            &AER_VERSION.to_le_bytes(),
            &HEADER_BYTES.to_le_bytes(),
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
            (WITHOUT_CONFIRMED..=AER_VERSION).contains(&version),
            "AER version {version}; this program reads {WITHOUT_CONFIRMED} to {AER_VERSION}"
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

/// The bytes of a header with its settings; `None` if they are not valid.
pub(super) fn header_length(bytes: &[u8; HEADER_BYTES as usize]) -> Option<u16> {
    let length = u16::from_le_bytes([bytes[10], bytes[11]]);
    (length >= HEADER_BYTES && length.is_multiple_of(16)).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_of_version_4_reads_as_one_of_version_5() {
        let header = Header {
            bins: 128,
            array: Array::new(64, 32).unwrap(),
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::lit("-12.5"),
            laser_millihertz: 7,
            start_us: 9,
        };
        for version in 0..=u8::MAX {
            let mut bytes = header.to_bytes();
            bytes[8] = version;
            let read = Header::from_bytes(&bytes).ok();
            assert_eq!(read, [4, 5].contains(&version).then_some(header));
        }
    }
}

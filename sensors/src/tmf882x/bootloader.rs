//! The messages of the bootloader.
//!
//! A command is written to `CMD_STAT`: command, length of the data, data, and a
//! checksum, the ones' complement of the sum of all before it. The same register
//! then reads as status, length and checksum; while the bootloader is busy the
//! status is the command itself.
//!
//! The vendor's example is the beginning of a download:
//!
//! ```text
//! write 08  14 01 29 C1        (14 + 01 + 29 = 3E; its complement is C1)
//! read  08  00 00 FF           done
//! ```

use super::registers::{BootCommand, CMD_STAT, FIRST_COMMAND};

/// Data bytes that fit one command.
pub(super) const MAX_DATA: usize = 128;
/// The seed of `DOWNLOAD_INIT`, as the vendor's drivers give it.
pub(super) const SEED: u8 = 0x29;

/// A command as it goes to the bus, register address first.
pub(super) struct Message {
    bytes: [u8; 3 + MAX_DATA + 1],
    length: usize,
}

impl Message {
    /// `data` beyond [`MAX_DATA`] bytes is left out.
    pub(super) fn new(command: BootCommand, data: &[u8]) -> Self {
        let mut bytes = [0; 3 + MAX_DATA + 1];
        // At most 128, which fits a byte.
        let size = data.len().min(MAX_DATA);
        let head = [CMD_STAT, command as u8, u8::try_from(size).unwrap_or(0)];
        let mut sum = 0u8;
        let mut length = 0;
        for (byte, &value) in bytes.iter_mut().zip(head.iter().chain(data).take(3 + size)) {
            // The register address is not part of the sum.
            if length > 0 {
                sum = sum.wrapping_add(value);
            }
            *byte = value;
            length += 1;
        }
        if let Some(byte) = bytes.get_mut(length) {
            *byte = !sum;
            length += 1;
        }
        Self { bytes, length }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

/// The answer of the bootloader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    Done,
    Busy,
    /// An error, or no answer at all.
    Wrong,
}

impl Answer {
    pub(super) const fn of(bytes: [u8; 3], command: BootCommand) -> Self {
        match bytes {
            [0x00, 0x00, 0xFF] => Self::Done,
            [status, ..] if status >= FIRST_COMMAND && status == command as u8 => Self::Busy,
            _ => Self::Wrong,
        }
    }
}

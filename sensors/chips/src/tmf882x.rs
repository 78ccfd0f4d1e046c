//! The TMF8820, as its published headers and drivers have it.

use crate::Chip;

/// Bytes of a packet, and of its header.
const PACKET: usize = 135;
const HEADER: usize = 7;

/// After a reset its bootloader runs. While it measures it always has the next packet.
#[derive(Clone, Debug)]
pub struct Tmf882x {
    /// The 24-bit count of a channel and a bin.
    count: fn(u8, u32) -> u32,
    is_loaded: bool,
    status: u8,
    packet: u8,
}

impl Tmf882x {
    /// A sensor that was just switched on, with these counts of channels and bins.
    #[must_use]
    pub const fn new(count: fn(u8, u32) -> u32) -> Self {
        Self {
            count,
            is_loaded: false,
            status: 0,
            packet: 0,
        }
    }
}

/// 1000 in bin 40 and 10 in all others.
impl Default for Tmf882x {
    fn default() -> Self {
        Self::new(|_, bin| if bin == 40 { 1000 } else { 10 })
    }
}

impl Chip for Tmf882x {
    fn write(&mut self, bytes: &[u8]) {
        let &[0x08, command, ..] = bytes else {
            return;
        };
        if !self.is_loaded {
            // RAM_REMAP_RESET starts the application.
            self.is_loaded = command == 0x11;
            return;
        }
        // STAT_OK, or STAT_ACCEPTED while it measures.
        self.status = u8::from(command == 0x10);
        self.packet = 0;
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) {
        match (register, bytes) {
            (0x00, [application]) => *application = if self.is_loaded { 0x03 } else { 0x80 },
            (0x08, [status]) => *status = self.status,
            (0x08, [status, length, checksum]) => {
                [*status, *length, *checksum] = [0x00, 0x00, 0xff];
            }
            (0x10, [mode]) => *mode = 0x00,
            (0x20, [page]) => *page = 0x16,
            (0xe0, [enable]) => *enable = 0x41,
            (0xe1, [interrupt]) => *interrupt = if self.interrupts() { 0x08 } else { 0x00 },
            (0xe3, [id]) => *id = 0x08,
            (0x20..0xa7, bytes) => {
                let from = usize::from(register - 0x20);
                bytes.copy_from_slice(&self.packet()[from..from + bytes.len()]);
                if from + bytes.len() == PACKET {
                    self.packet = (self.packet + 1) % 30;
                }
            }
            (register, bytes) => panic!("{} bytes of {register:#04x}", bytes.len()),
        }
    }

    fn interrupts(&self) -> bool {
        self.status == 1
    }

    fn reset(&mut self) {
        *self = Self::new(self.count);
    }
}

impl Tmf882x {
    fn packet(&self) -> [u8; PACKET] {
        let mut bytes = [0; PACKET];
        bytes[..HEADER].copy_from_slice(&[0x81, self.packet, 0, 0, self.packet, 128, 0]);
        let (plane, channel) = (usize::from(self.packet / 10), self.packet % 10);
        for (bin, byte) in (0..).zip(&mut bytes[HEADER..]) {
            *byte = (self.count)(channel, bin).to_le_bytes()[plane];
        }
        bytes
    }
}

//! The TDC7200, as section 8 of its data sheet (SNAS647D) has it.

use crate::Chip;

/// Each measurement is over at once, with all of its stops.
#[derive(Clone, Debug, Default)]
pub struct Tdc7200 {
    written: [u8; 10],
    is_awake: bool,
}

impl Tdc7200 {
    /// Of its result registers, with an even parity bit.
    fn result(&self, register: u8) -> u32 {
        let value = match register {
            0x1b => 2110,
            0x1c => 21121,
            // Clock counts stand between the times.
            odd if odd % 2 == 1 => 2,
            _ => 4175u32,
        };
        let has_parity = self.written[0] >> 6 & 1 == 1;
        value
            | if has_parity {
                (value.count_ones() & 1) << 23
            } else {
                0
            }
    }
}

impl Chip for Tdc7200 {
    fn write(&mut self, bytes: &[u8]) {
        let &[command, value] = bytes else {
            panic!("{bytes:02x?} is no write");
        };
        assert_eq!(command & 0xc0, 0x40, "one register a write");
        self.is_awake = true;
        self.written[usize::from(command & 0x3f)] = value;
    }

    fn read(&mut self, command: u8, bytes: &mut [u8]) {
        match (command & 0x3f, bytes) {
            (0x02, [status]) => *status = 0x19,
            // As after a reset.
            (0x01, [config2]) if !self.is_awake => *config2 = 0x40,
            (0x03, [mask]) if !self.is_awake => *mask = 0x07,
            (register @ 0..10, [value]) => *value = self.written[usize::from(register)],
            (first @ 0x10..=0x1c, bytes) => {
                assert_eq!(bytes.len() % 3, 0);
                for (register, bytes) in (first..=0x1c).zip(bytes.chunks_mut(3)) {
                    bytes.copy_from_slice(&self.result(register).to_be_bytes()[1..]);
                }
            }
            (register, bytes) => panic!("{} bytes of {register:#04x}", bytes.len()),
        }
    }

    fn interrupts(&self) -> bool {
        // START_MEAS
        self.written[0] & 1 == 1
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

//! A TMF8820 that runs its application. While it measures it always has the next packet
//! of histograms with a peak in bin 40.

use core::convert::Infallible;

use embedded_hal::i2c::{ErrorType, I2c, Operation};

#[derive(Clone, Default)]
pub struct Chip {
    status: u8,
    packet: u8,
}

impl Chip {
    /// Answers one transaction. Whether INT is low after it.
    pub fn answer(&mut self, operations: &mut [Operation<'_>]) -> bool {
        match operations {
            [Operation::Write([0x08, command])] => {
                self.status = u8::from(*command == 0x10);
                self.packet = 0;
            }
            [Operation::Write([register]), Operation::Read(bytes)] => {
                match (*register, &mut **bytes) {
                    (0x00, [application]) => *application = 0x03,
                    (0x08, [status]) => *status = self.status,
                    (0x10, [mode]) => *mode = 0x00,
                    (0x20, [page]) => *page = 0x16,
                    (0xE0, [enable]) => *enable = 0x41,
                    (0xE1, [interrupt]) => *interrupt = 0x08,
                    (0xE3, [id]) => *id = 0x08,
                    (0x20, bytes) => self.give(bytes),
                    (register, _) => panic!("register {register:#04x}"),
                }
            }
            _ => {}
        }
        self.status == 1
    }

    /// One byte of each count of a channel: 1000 in bin 40 and 10 in all others.
    fn give(&mut self, bytes: &mut [u8]) {
        let (header, data) = bytes.split_at_mut(7);
        let [left_l, left_h] = (3840 - 128 * u16::from(self.packet)).to_le_bytes();
        header.copy_from_slice(&[0x81, self.packet, left_l, left_h, self.packet, 128, 0]);
        for (bin, byte) in data.iter_mut().enumerate() {
            let count: u32 = if bin == 40 { 1000 } else { 10 };
            *byte = count.to_le_bytes()[usize::from(self.packet / 10)];
        }
        self.packet = (self.packet + 1) % 30;
    }
}

impl ErrorType for Chip {
    type Error = Infallible;
}

impl I2c for Chip {
    fn transaction(&mut self, _: u8, operations: &mut [Operation<'_>]) -> Result<(), Infallible> {
        self.answer(operations);
        Ok(())
    }
}

//! A simulated TMF8829 that runs its application. While it measures it always has the next frame of
//! 8×8 zones: a histogram with a peak in bin 10, and a measured distance, of each.

use core::convert::Infallible;

use embedded_hal::i2c::{ErrorType, I2c, Operation};

/// Bytes of frames of histograms and of results.
const HISTOGRAMS: usize = 21 + 3 * (4 * 64 + 32 * 256) + 12;
const RESULTS: usize = 21 + 64 * 6 + 12;

#[derive(Clone, Default)]
pub struct Chip {
    status: u8,
    /// Frames that were sent, and bytes of the present frame that were sent.
    frame: u32,
    at: usize,
}

impl Chip {
    /// Answers one transaction. Returns whether INT is low afterwards.
    pub fn answer(&mut self, operations: &mut [Operation<'_>]) -> bool {
        match operations {
            [Operation::Write([0x08, command])] => {
                self.status = u8::from(*command == 0x10);
                (self.frame, self.at) = (0, 0);
            }
            [Operation::Write([register]), Operation::Read(bytes)] => {
                match (*register, &mut **bytes) {
                    (0x00, [application]) => *application = 0x01,
                    (0x08, [status]) => *status = self.status,
                    (0x20, [page]) => *page = 0x40,
                    (0xE1, [interrupt]) => *interrupt = 0x09,
                    (0xE3, [id]) => *id = 0x9E,
                    (0xF8, [enable]) => *enable = 0xA4,
                    (0xFA | 0xFF, bytes) => bytes.iter_mut().for_each(|byte| *byte = self.next()),
                    (register, _) => panic!("register {register:#04x}"),
                }
            }
            _ => {}
        }
        self.status == 1
    }

    /// The next byte of a frame: histograms of two time slots, then results.
    fn next(&mut self) -> u8 {
        let slot = self.frame % 3;
        let (length, id, part) = match slot {
            2 => (RESULTS, 0x10, 2),
            slot => (HISTOGRAMS, 0x20, slot.to_le_bytes()[0]),
        };
        let [size_l, size_h, ..] = (length - 9).to_le_bytes();
        let byte = match (self.at, length - self.at) {
            (5, _) => id,
            (6, _) => part,
            (7, _) => size_l,
            (8, _) => size_h,
            (at @ 9..13, _) => self.frame.to_le_bytes()[at - 9],
            (..21, _) => 0,
            (_, 4) => 1,
            (_, 2) => 0xF7,
            (_, 1) => 0xE0,
            (_, ..12) => 0,
            (at, _) if slot == 2 => Self::target(at - 21),
            (at, _) => Self::count(at - 21),
        };
        self.at += 1;
        if self.at == length {
            (self.frame, self.at) = (self.frame.wrapping_add(1), 0);
        }
        byte
    }

    /// One byte of a count: 1000 in bin 10 and 10 in all others.
    fn count(at: usize) -> u8 {
        let bin = at.saturating_sub(3 * 4 * 64) / 3 % 256;
        let count: u32 = if bin == 10 { 1000 } else { 10 };
        count.to_le_bytes()[at % 3]
    }

    /// One byte of two targets: 842 mm in quarters with a ratio of 40, and none.
    fn target(at: usize) -> u8 {
        let [low, high] = (842u16 * 4).to_le_bytes();
        [low, high, 40, 0, 0, 0][at % 6]
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

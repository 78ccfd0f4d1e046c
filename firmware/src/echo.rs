//! Sends back every byte it receives: what an image does to show that a board's
//! serial port works.

use embedded_io::{Read, ReadReady, Write, WriteReady};

/// Bytes on their way back.
#[derive(Debug)]
pub struct Echo {
    bytes: [u8; 64],
    /// Those of `bytes` not yet written.
    start: usize,
    end: usize,
}

impl Echo {
    /// Nothing on its way.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; 64],
            start: 0,
            end: 0,
        }
    }

    /// Moves what can be moved without waiting. Has no use for the time.
    ///
    /// # Errors
    /// Those of `serial`.
    pub fn poll<S: Read + ReadReady + Write + WriteReady>(
        &mut self,
        serial: &mut S,
        _now_ms: u32,
    ) -> Result<(), S::Error> {
        loop {
            if self.start == self.end {
                if !serial.read_ready()? {
                    return Ok(());
                }
                self.end = serial.read(&mut self.bytes)?;
                self.start = 0;
            }
            while let Some(rest @ [_, ..]) = self.bytes.get(self.start..self.end) {
                if !serial.write_ready()? {
                    return Ok(());
                }
                self.start += serial.write(rest)?;
            }
        }
    }
}

impl Default for Echo {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::serial::Buffers;

    #[test]
    fn sends_back_every_byte_and_never_waits() {
        let mut buffers = Buffers::<256, 8>::new();
        let (mut interrupt, mut serial) = buffers.split(|| ());
        let mut echo = Echo::new();
        let mut back = Vec::new();
        for byte in 0..200 {
            interrupt.on_receive(byte);
            echo.poll(&mut serial, 0).unwrap();
            // The line is slower than what comes in.
            if byte % 2 == 0 {
                back.extend(interrupt.next_to_send());
            }
        }
        while back.len() < 200 {
            echo.poll(&mut serial, 0).unwrap();
            back.extend(interrupt.next_to_send());
        }
        assert!(back.iter().copied().eq(0..200));
        assert_eq!((interrupt.next_to_send(), serial.lost()), (None, 0));
    }
}

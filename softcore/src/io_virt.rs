//! QEMU's machine `virt` in the place of the testbench: a serial port and a device that
//! ends it. Cycles are not counted; there are no photons and there is no link.

use core::fmt;

use dtof_core::AerWord;

use crate::word::Word;

const UART: *mut u8 = 0x1000_0000 as *mut u8;
const TEST: *mut u32 = 0x0010_0000 as *mut u32;
const TEST_PASS: u32 = 0x5555;
const TEST_FAIL: u32 = 0x3333;

/// Does nothing.
pub fn mark(_: u32) {}

/// Ends QEMU; 0 is success.
pub fn exit(code: u32) -> ! {
    let word = if code == 0 {
        TEST_PASS
    } else {
        code << 16 | TEST_FAIL
    };
    #[allow(unsafe_code, reason = "a register is an address")]
    // SAFETY: the register that ends QEMU.
    unsafe {
        TEST.write_volatile(word);
    }
    #[allow(clippy::empty_loop, reason = "the run has ended")]
    loop {}
}

/// The end of the photons.
#[must_use]
pub fn take() -> Word {
    Word::End
}

/// None wait, none are lost.
#[must_use]
pub fn photon_status() -> (u32, bool) {
    (0, false)
}

/// The word goes nowhere.
pub fn request(_: AerWord) {}

/// It always is.
#[must_use]
pub fn is_acknowledged() -> bool {
    true
}

/// Prints the text written to it.
pub struct Printer;

impl fmt::Write for Printer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            #[allow(unsafe_code, reason = "a register is an address")]
            // SAFETY: the transmit register of the serial port, which QEMU never fills.
            unsafe {
                UART.write_volatile(byte);
            }
        }
        Ok(())
    }
}

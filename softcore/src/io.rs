//! The registers of the testbench, from `0xF000_0000` on: see `docs/softcore.md`.

use core::fmt;

use dtof_core::AerWord;

use crate::word::Word;

const PRINT: *mut u32 = 0xf000_0000 as *mut u32;
const MARK: *mut u32 = 0xf000_0004 as *mut u32;
const EXIT: *mut u32 = 0xf000_0008 as *mut u32;
const PHOTON_STATUS: *mut u32 = 0xf000_0010 as *mut u32;
const PHOTON: *mut u32 = 0xf000_0014 as *mut u32;
const EVENT_DATA: *mut u32 = 0xf000_0018 as *mut u32;
const EVENT_REQ: *mut u32 = 0xf000_001c as *mut u32;

#[allow(unsafe_code, reason = "a register is an address")]
#[inline(always)]
fn write(register: *mut u32, value: u32) {
    // SAFETY: called with the registers above alone; behind them is no memory.
    unsafe { register.write_volatile(value) }
}

#[allow(unsafe_code, reason = "a register is an address")]
#[inline(always)]
fn read(register: *mut u32) -> u32 {
    // SAFETY: called with the registers above alone; behind them is no memory.
    unsafe { register.read_volatile() }
}

/// Notes the cycle, under a number.
#[inline(always)]
pub fn mark(number: u32) {
    write(MARK, number);
}

/// Ends the run; 0 is success.
pub fn exit(code: u32) -> ! {
    write(EXIT, code);
    // Instructions that are under way may still be carried out.
    #[allow(clippy::empty_loop, reason = "the run has ended")]
    loop {}
}

/// The next word of the photon FIFO.
#[inline(always)]
#[must_use]
pub fn take() -> Word {
    Word::from_raw(read(PHOTON))
}

/// How many words wait in the photon FIFO, and whether it has lost any since this was
/// last asked.
#[inline(always)]
#[must_use]
pub fn photon_status() -> (u32, bool) {
    let status = read(PHOTON_STATUS);
    (status >> 16, status & 2 != 0)
}

/// REQ: hands a word to the link, which must not have another.
pub fn request(word: AerWord) {
    for part in word.to_le_bytes().as_chunks::<4>().0 {
        write(EVENT_DATA, u32::from_le_bytes(*part));
    }
    write(EVENT_REQ, 1);
}

/// Takes REQ back if the link has answered with ACK; whether it has.
#[must_use]
pub fn is_acknowledged() -> bool {
    let acknowledged = read(EVENT_REQ) & 1 != 0;
    if acknowledged {
        write(EVENT_REQ, 0);
    }
    acknowledged
}

/// Prints the text written to it.
pub struct Printer;

impl fmt::Write for Printer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            write(PRINT, byte.into());
        }
        Ok(())
    }
}

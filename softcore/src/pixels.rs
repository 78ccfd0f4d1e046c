//! The pixel processor (`rtl/pixels`) on the processor's bus, from `0xE000_0000` on.
//!
//! Its events leave packed by the hardware, or the program takes them, makes their AER words
//! and hands those to the link. The program can do what the hardware cannot: average events,
//! leave some out, send them elsewhere.

use dtof_core::AerEncoder;
use dtof_core::pixel_processor::{ProcessorEvent, ProcessorSettings};

use crate::{io, stream};

const CONTROL: usize = 0x00;
const RUN: u32 = 1;
const RUNNING: u32 = 1 << 2;
const LOOK: usize = 0x01;
const WAITING: usize = 0x08;
const EVENT: usize = 0x09;

/// Whether hardware or program packs the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packer {
    /// The pixel processor.
    Hardware,
    /// The program.
    Program,
}

/// The mark of the clock from which on photons count.
pub const READY: u32 = 1;

#[allow(unsafe_code, reason = "a register is an address")]
#[inline(always)]
fn write(register: usize, value: u32) {
    let registers = 0xe000_0000 as *mut u32;
    // SAFETY: called with the registers above alone; behind them is no memory.
    unsafe { registers.add(register).write_volatile(value) }
}

#[allow(unsafe_code, reason = "a register is an address")]
#[inline(always)]
fn read(register: usize) -> u32 {
    let registers = 0xe000_0000 as *const u32;
    // SAFETY: called with the registers above alone; behind them is no memory.
    unsafe { registers.add(register).read_volatile() }
}

/// Configures the pixel processor with [`stream::config`] and starts it. The program's
/// part never ends; `false` if the configuration is refused.
#[must_use]
pub fn run(packer: Packer) -> bool {
    let settings = stream::config().ok();
    let settings = settings.and_then(|config| ProcessorSettings::of(&config).ok());
    let Some(settings) = settings else {
        return false;
    };
    // Settings are taken while it stands still.
    write(CONTROL, 0);
    for (register, value) in (LOOK..).zip(settings.registers()) {
        write(register, value);
    }
    write(CONTROL, RUN | u32::from(packer == Packer::Hardware) << 1);
    while read(CONTROL) & RUNNING == 0 {}
    io::mark(READY);
    let mut encoder = AerEncoder::new();
    loop {
        if packer == Packer::Program && read(WAITING) & 1 != 0 {
            let event = take();
            let (time, word) = event.encode(&mut encoder);
            for word in time.into_iter().chain([word]) {
                io::request(word);
                while !io::is_acknowledged() {}
            }
        }
    }
}

/// Takes the event that waits.
#[inline(always)]
fn take() -> ProcessorEvent {
    let mut words = [0; 7];
    for (register, word) in (EVENT..).zip(&mut words) {
        *word = read(register);
    }
    write(WAITING, 1);
    ProcessorEvent::from_registers(words)
}

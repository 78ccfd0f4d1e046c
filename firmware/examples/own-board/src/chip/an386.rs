//! Arm's MPS2 board with the FPGA image AN386, as QEMU emulates it: in place of a crate for your chip.
//!
//! The clock has 25 MHz, LED0 stands for the laser, the port is UART0, a CMSDK UART (DDI 0479). QEMU never loses a
//! byte of it.

use core::convert::Infallible;
use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use dtof_firmware::board::reset_reason::ResetReason;
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

const LED: *mut u32 = ptr::without_provenance_mut(0x4002_8000);
const DATA: *mut u32 = ptr::without_provenance_mut(0x4000_4000);
const STATE: *mut u32 = ptr::without_provenance_mut(0x4000_4004);
const CTRL: *mut u32 = ptr::without_provenance_mut(0x4000_4008);
const BAUDDIV: *mut u32 = ptr::without_provenance_mut(0x4000_4010);
const IS_FULL: u32 = 1 << 0;
const HAS_RECEIVED: u32 = 1 << 1;

static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

fn write(register: *mut u32, value: u32) {
    // SAFETY: the registers of this board touch no memory.
    unsafe { ptr::write_volatile(register, value) }
}

fn state() -> u32 {
    // SAFETY: as above.
    unsafe { ptr::read_volatile(STATE) }
}

pub fn set_laser(on: bool) {
    write(LED, on.into());
}

pub fn now_ms() -> u32 {
    MILLISECONDS.load(Ordering::Relaxed)
}

#[cortex_m_rt::exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

pub fn end() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// It is not used: QEMU ends with the image.
pub struct Watchdog;

impl Watchdog {
    pub fn feed(&mut self) {}
}

pub struct Port;

/// # Panics
/// If called twice.
pub fn start() -> (Port, Watchdog, ResetReason) {
    let mut timer = cortex_m::Peripherals::take().expect("the first start").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(25_000 - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
    write(BAUDDIV, 25);
    write(CTRL, 0b11);
    (Port, Watchdog, ResetReason::PowerOn)
}

impl ErrorType for Port {
    type Error = Infallible;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(state() & HAS_RECEIVED != 0)
    }
}

impl Read for Port {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        while state() & HAS_RECEIVED == 0 {}
        let Some(byte) = bytes.first_mut() else {
            return Ok(0);
        };
        // SAFETY: as above.
        [*byte, ..] = unsafe { ptr::read_volatile(DATA) }.to_le_bytes();
        Ok(1)
    }
}

impl WriteReady for Port {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(state() & IS_FULL == 0)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        while state() & IS_FULL != 0 {}
        let Some(&byte) = bytes.first() else {
            return Ok(0);
        };
        write(DATA, byte.into());
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

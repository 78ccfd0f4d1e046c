//! Arm's MPS2 board with the FPGA image AN386, a Cortex-M4 with FPU, as QEMU
//! emulates it (`-machine mps2-an386`): for everyone without hardware.
//!
//! The serial port is UART0 at 1 Mbaud, a CMSDK UART; QEMU puts it on whatever
//! `-serial` names and passes bytes as fast as they are fetched. Arm's
//! Application Note 386 has the memory map, the interrupt numbers and the clock
//! of 25 MHz; the registers are those of the APB UART of the Cortex-M System
//! Design Kit (DDI 0479).

use core::cell::RefCell;
use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use critical_section::Mutex;
use defmt_semihosting as _;
use semihosting::experimental::env;
use semihosting::process::ExitCode;
use static_cell::ConstStaticCell;

use super::reset_reason::{self, ResetReason};
use super::{Board, LaserOff, Transmitter, transmit};
use crate::serial::{BoardBuffers, Buffers, Serial, SerialInterrupt};

/// The clock of processor and UART.
const CLOCK_HZ: u32 = 25_000_000;
const BAUD: u32 = 1_000_000;

static BUFFERS: ConstStaticCell<BoardBuffers> = ConstStaticCell::new(Buffers::new());
static PORT: Mutex<RefCell<Option<SerialInterrupt<'static>>>> = Mutex::new(RefCell::new(None));
static MILLISECONDS: AtomicU32 = AtomicU32::new(0);

/// The board, once started.
pub struct Mps2An386(());

impl Mps2An386 {
    /// Starts the timer and the serial port.
    ///
    /// # Panics
    /// If called twice.
    #[must_use]
    pub fn start() -> (Self, Serial<'static>) {
        let Some(core) = cortex_m::Peripherals::take() else {
            panic!("the board is started twice");
        };
        let (interrupt, serial) = BUFFERS.take().split(Self::start_sending);
        critical_section::with(|cs| PORT.replace(cs, Some(interrupt)));

        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(CLOCK_HZ / 1000 - 1);
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();

        uart::start();
        for interrupt in [Interrupt::Uart0Receive, Interrupt::Uart0Transmit] {
            // SAFETY: the handlers share data with the main loop through queues,
            // atomics and a mutex only, and nothing relies on their being masked.
            #[allow(unsafe_code, reason = "there is no other way to unmask")]
            unsafe {
                NVIC::unmask(interrupt);
            }
        }
        (Self(()), serial)
    }

    /// Executes the words after the image's name on the emulator's command line
    /// (`-semihosting-config arg=…`). `exit`, `panic`, `fault` and `overflow` test each way to
    /// end; all but the first switch the laser on first. Returns the N of `unpaced=N`: the
    /// simulated sensor makes this many laser cycles as fast as they are processed, and then stops.
    ///
    /// # Panics
    /// On request.
    // Part of a large function, its branches would become a jump that hides where it goes.
    #[inline(never)]
    #[must_use]
    pub fn obey_command_line(&self) -> Option<u64> {
        let mut unpaced = None;
        for word in env::args::<128>().ok()?.skip(1).flatten() {
            let cycles = word.strip_prefix("unpaced=");
            if ["panic", "fault", "overflow"].contains(&word) {
                Self::set_laser(true);
                // A debugger can stop here and see it.
                defmt::warn!("the laser is on: {=str}", word);
            }
            match (word, cycles.and_then(|cycles| cycles.parse().ok())) {
                ("exit", _) => Self::exit(ExitCode::SUCCESS),
                ("panic", _) => panic!("requested on the command line"),
                ("fault", _) => cortex_m::asm::udf(),
                ("overflow", _) => overflow(),
                (_, cycles @ Some(_)) => unpaced = cycles,
                _ => defmt::warn!("unknown word `{=str}`", word),
            }
        }
        unpaced
    }

    /// Ends the emulator.
    pub fn exit(code: ExitCode) -> ! {
        code.exit_process()
    }

    /// Lights LED0, which stands for a laser, or switches it off.
    pub fn set_laser(on: bool) {
        /// User LEDs of the FPGA's I/O: LED0 is bit 0 (Application Note 386, "FPGA system
        /// control and I/O").
        const LED: *mut u32 = ptr::without_provenance_mut(0x4002_8000);
        // SAFETY: the address is that of a register of this board, which touches no memory.
        #[allow(unsafe_code, reason = "registers are reached by address")]
        unsafe {
            ptr::write_volatile(LED, on.into());
        }
    }

    /// Why the board has started: an emulator is always switched on.
    #[must_use]
    pub fn reset_reason(&self) -> ResetReason {
        reset_reason::take().unwrap_or(ResetReason::PowerOn)
    }
}

/// Pushes return addresses, again and again, as recursion without end does: a word at a time, so that
/// every word of the stack is taken wherever it begins. It is a loop in assembly: `cargo xtask sizes`
/// refuses an image with a function that calls itself.
#[unsafe(naked)]
#[allow(unsafe_code, reason = "it takes all of the stack")]
extern "C" fn overflow() -> ! {
    core::arch::naked_asm!("nop", "0: push {{lr}}", "b 0b")
}

impl LaserOff for Mps2An386 {
    /// Switches LED0 off, which stands for a laser.
    fn laser_off() {
        Self::set_laser(false);
    }

    /// Ends the emulator with a failure.
    fn end() -> ! {
        Self::exit(ExitCode::FAILURE)
    }
}

impl Board for Mps2An386 {
    fn now_ms(&self) -> u32 {
        MILLISECONDS.load(Ordering::Relaxed)
    }

    fn start_sending() {
        NVIC::pend(Interrupt::Uart0Transmit);
    }

    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
        cortex_m::interrupt::free(|_| work(self));
    }

    fn sleep(&mut self) {
        // A pending interrupt ends it even while interrupts are masked.
        cortex_m::asm::wfi();
    }
}

/// Interrupts in use, numbered as in the application note.
#[derive(Clone, Copy)]
enum Interrupt {
    Uart0Receive = 0,
    Uart0Transmit = 1,
}

// SAFETY: the numbers are those of the board and do not change.
#[allow(unsafe_code, reason = "the trait is unsafe to implement")]
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

#[exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

/// Every interrupt: there is no crate that names those of this board.
#[allow(unsafe_code, reason = "the attribute asks for it")]
#[exception]
unsafe fn DefaultHandler(number: i16) {
    critical_section::with(|cs| {
        let mut port = PORT.borrow_ref_mut(cs);
        let Some(port) = port.as_mut() else {
            return;
        };
        match number {
            0 => uart::on_receive(port),
            1 => transmit(port, &mut uart::Uart),
            _ => panic!("interrupt {number} has no handler"),
        }
    });
}

/// UART0.
mod uart {
    use super::*;

    const BASE: usize = 0x4000_4000;

    /// Registers, by offset.
    #[derive(Clone, Copy)]
    enum Register {
        /// Received byte when read, byte to send when written.
        Data = 0x00,
        State = 0x04,
        Ctrl = 0x08,
        /// INTSTATUS when read; a 1 written clears.
        IntClear = 0x0C,
        /// Clock cycles a bit, at least 16.
        BaudDiv = 0x10,
    }

    // STATE
    const TX_FULL: u32 = 1 << 0;
    const RX_FULL: u32 = 1 << 1;
    /// A byte came while one waited; a 1 written clears.
    const RX_OVERRUN: u32 = 1 << 3;
    // CTRL
    const TX_ENABLE: u32 = 1 << 0;
    const RX_ENABLE: u32 = 1 << 1;
    const TX_INTERRUPT_ENABLE: u32 = 1 << 2;
    const RX_INTERRUPT_ENABLE: u32 = 1 << 3;
    // INTCLEAR
    const TX_INTERRUPT: u32 = 1 << 0;
    const RX_INTERRUPT: u32 = 1 << 1;

    fn read(register: Register) -> u32 {
        // SAFETY: the address is that of a register of this board.
        #[allow(unsafe_code, reason = "registers are reached by address")]
        unsafe {
            ptr::read_volatile((BASE + register as usize) as *const u32)
        }
    }

    fn write(register: Register, value: u32) {
        // SAFETY: as above; no register makes the UART touch memory.
        #[allow(unsafe_code, reason = "registers are reached by address")]
        unsafe {
            ptr::write_volatile((BASE + register as usize) as *mut u32, value);
        }
    }

    pub fn start() {
        write(Register::BaudDiv, CLOCK_HZ / BAUD);
        write(
            Register::Ctrl,
            TX_ENABLE | RX_ENABLE | TX_INTERRUPT_ENABLE | RX_INTERRUPT_ENABLE,
        );
    }

    // Every access costs the emulator much more than the rest of the handler.

    pub fn on_receive(port: &mut SerialInterrupt<'_>) {
        // First, so that a byte that comes from now on interrupts again.
        write(Register::IntClear, RX_INTERRUPT);
        let state = read(Register::State);
        if state & RX_FULL != 0 {
            let [byte, ..] = read(Register::Data).to_le_bytes();
            port.on_receive(byte);
        }
        if state & RX_OVERRUN != 0 {
            write(Register::State, RX_OVERRUN);
            port.on_loss();
        }
    }

    pub struct Uart;

    impl Transmitter for Uart {
        fn acknowledge(&mut self) {
            write(Register::IntClear, TX_INTERRUPT);
        }

        fn has_room(&mut self) -> bool {
            read(Register::State) & TX_FULL == 0
        }

        fn send(&mut self, byte: u8) {
            write(Register::Data, byte.into());
        }

        // It interrupts whenever a byte leaves it.
        fn wake(&mut self) {}

        fn rest(&mut self) {}
    }
}

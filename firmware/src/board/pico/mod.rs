//! Raspberry Pi Pico, and Pico 2: RP2040 with a flash of 2 MiB, RP2350 with one of 4 MiB. Both have a crystal
//! of 12 MHz and the same pins. The images of the Pico 2 have never run: see `rp2350.rs`.
//!
//! | | |
//! |---|---|
//! | clock | 125 MHz from the crystal |
//! | serial port | UART0, 1 Mbaud, 8 data bits, no parity, 1 stop bit |
//! | USB | the same link as a serial port (CDC ACM): the answer goes where the last byte came from |
//! | GP0 | sends; pin 1, to RX of a USB adapter of 3.3 V |
//! | GP1 | receives; pin 2, to TX of the adapter |
//! | GP15 | leave it free: the USB of an older chip takes it for moments, see `usb.rs` |
//! | watchdog | resets after about a second |
//! | log | defmt over RTT, which a debug probe reads |
//!
//! | GP2, GP3 | with the photon timer: the laser's pulse, the SPAD's pulses; pins 4 and 5 |
//!
//! One of the two cores runs. The image calls no function of the boot ROM once it has started.

#[cfg(feature = "sensor-photon-timer")]
mod photon_timer;
#[cfg(feature = "pico")]
mod rp2040;
#[cfg(feature = "pico2")]
mod rp2350;
#[cfg(feature = "sensor-photon-timer")]
mod sample_rings;
mod usb;

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use critical_section::Mutex;
use defmt_rtt as _;
use embedded_io::WriteReady;
use static_cell::ConstStaticCell;

use self::chip::hal::fugit::{ExtU32, RateExtU32};
use self::chip::hal::gpio::bank0::{Gpio0, Gpio1};
use self::chip::hal::gpio::{FunctionUart, Pin, Pins, PullDown, PullUp};
use self::chip::hal::pac::{self, Interrupt, UART0, interrupt};
use self::chip::hal::uart::{DataBits, Reader, StopBits, UartConfig, UartPeripheral, Writer};
use self::chip::hal::watchdog::{ScratchRegister, Watchdog};
use self::chip::hal::{Clock, Sio};
use self::chip::init_clocks_and_plls;
#[cfg(feature = "pico")]
use self::rp2040 as chip;
#[cfg(feature = "pico2")]
use self::rp2350 as chip;
use self::usb::Usb;
use super::reset_reason::{self, ResetReason};
use super::{Board, DRIVES_SENSOR, LaserOff, LastFed, Transmitter, systick, transmit};
use crate::serial::{BoardBuffers, Buffers, Serial, SerialInterrupt};

const BAUD: u32 = 1_000_000;
const CRYSTAL_HZ: u32 = 12_000_000;
/// In a scratch register of the watchdog, which a reset by it leaves as it is: the image has
/// started the watchdog.
const WATCHED: u32 = 0xd70f_0d06;

type UartPins = (
    Pin<Gpio0, FunctionUart, PullDown>,
    // Silent while nothing is connected: a low line is a break.
    Pin<Gpio1, FunctionUart, PullUp>,
);

/// The port and its end of the queues.
struct Port {
    interrupt: SerialInterrupt<'static>,
    tx: Writer<UART0, UartPins>,
    rx: Reader<UART0, UartPins>,
    usb: Usb,
    /// The last byte came over USB, so answers go there.
    over_usb: bool,
    usb_was_open: bool,
}

static BUFFERS: ConstStaticCell<BoardBuffers> = ConstStaticCell::new(Buffers::new());
static PORT: Mutex<RefCell<Option<Port>>> = Mutex::new(RefCell::new(None));
static MILLISECONDS: AtomicU32 = AtomicU32::new(0);
/// The interrupt of the USB is masked until the next millisecond.
static USB_WAITS: AtomicBool = AtomicBool::new(false);

/// The parts of the chip that a sensor takes.
pub struct SensorPort {
    #[cfg(feature = "sensor-photon-timer")]
    pins: photon_timer::Pins,
    #[cfg(feature = "sensor-photon-timer")]
    pio: pac::PIO0,
    #[cfg(feature = "sensor-photon-timer")]
    dma: pac::DMA,
    #[cfg(feature = "sensor-photon-timer")]
    resets: pac::RESETS,
}

/// The board, once started.
pub struct Pico {
    watchdog: Watchdog,
    last_fed: LastFed,
    reset_reason: ResetReason,
}

impl Pico {
    /// Starts clock, timer, serial port and watchdog. Waits for the crystal: a board
    /// without one stays here.
    ///
    /// # Panics
    /// If called twice.
    #[must_use]
    pub fn start() -> (Self, Serial<'static>, SensorPort) {
        let (Some(core), Some(device)) = (cortex_m::Peripherals::take(), pac::Peripherals::take())
        else {
            panic!("the board is started twice");
        };
        let watched = device.WATCHDOG.scratch0().read().bits() == WATCHED;
        let reset_reason =
            reset_reason::take().unwrap_or_else(|| chip::reset_reason(&device, watched));
        let mut resets = device.RESETS;
        // A debugger may have reset the processor alone: what an image had started goes on.
        let reset = resets.reset();
        reset.modify(|_, w| w.pio0().set_bit().dma().set_bit());
        let mut watchdog = Watchdog::new(device.WATCHDOG);
        let Ok(clocks) = init_clocks_and_plls(
            CRYSTAL_HZ,
            device.XOSC,
            device.CLOCKS,
            device.PLL_SYS,
            device.PLL_USB,
            &mut resets,
            &mut watchdog,
        ) else {
            panic!("this crystal does not give 125 MHz");
        };

        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(systick::reload(clocks.system_clock.freq().to_Hz()));
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();

        let sio = Sio::new(device.SIO);
        let pins = Pins::new(
            device.IO_BANK0,
            device.PADS_BANK0,
            sio.gpio_bank0,
            &mut resets,
        );
        let uart = (pins.gpio0.into_function(), pins.gpio1.reconfigure());
        let config = UartConfig::new(BAUD.Hz(), DataBits::Eight, None, StopBits::One);
        let uart = UartPeripheral::new(device.UART0, uart, &mut resets);
        let Ok(uart) = uart.enable(config, clocks.peripheral_clock.freq()) else {
            panic!("this clock does not give {BAUD} baud");
        };
        let (mut rx, tx) = uart.split();
        rx.enable_rx_interrupt();
        let (interrupt, serial) = BUFFERS.take().split(Self::start_sending);
        #[cfg(feature = "pico")]
        let (registers, memory) = (device.USBCTRL_REGS, device.USBCTRL_DPRAM);
        #[cfg(feature = "pico2")]
        let (registers, memory) = (device.USB, device.USB_DPRAM);
        let usb = Usb::start(registers, memory, clocks.usb_clock, &mut resets);
        let port = Port {
            interrupt,
            tx,
            rx,
            usb,
            over_usb: false,
            usb_was_open: false,
        };
        critical_section::with(|cs| PORT.replace(cs, Some(port)));

        // SAFETY: the handlers share data with the main loop through queues,
        // atomics and mutexes only, and nothing relies on their being masked.
        #[allow(unsafe_code, reason = "there is no other way to unmask")]
        unsafe {
            NVIC::unmask(Interrupt::UART0_IRQ);
            NVIC::unmask(Interrupt::USBCTRL_IRQ);
        }

        watchdog.write_scratch(ScratchRegister::Scratch0, WATCHED);
        watchdog.start(1.secs());
        pause_watchdog_on_debug(!DRIVES_SENSOR);
        let sensor = SensorPort {
            #[cfg(feature = "sensor-photon-timer")]
            pins: (pins.gpio2.into_function(), pins.gpio3.into_function()),
            #[cfg(feature = "sensor-photon-timer")]
            pio: device.PIO0,
            #[cfg(feature = "sensor-photon-timer")]
            dma: device.DMA,
            #[cfg(feature = "sensor-photon-timer")]
            resets,
        };
        let board = Self {
            watchdog,
            last_fed: LastFed::default(),
            reset_reason,
        };
        (board, serial, sensor)
    }

    /// Why the board has started.
    #[must_use]
    pub const fn reset_reason(&self) -> ResetReason {
        self.reset_reason
    }
}

impl LaserOff for Pico {
    /// Holds the pin of the laser low, if the image drives one.
    fn laser_off() {
        #[cfg(feature = "sensor-photon-timer")]
        photon_timer::laser_off();
    }

    /// Resets all of the chip: its processor can reset itself alone, and the PIO would go on.
    fn end() -> ! {
        chip::hal::reset()
    }
}

/// Whether the watchdog waits while a debugger halts the processor. Only once it has started:
/// the chip's crate overwrites the register when it starts the watchdog, and its own function would stop
/// it.
fn pause_watchdog_on_debug(pause: bool) {
    // SAFETY: the watchdog goes on, and nothing else writes the register meanwhile.
    #[allow(unsafe_code, reason = "the chip's crate keeps the register")]
    let control = unsafe { &*pac::WATCHDOG::PTR }.ctrl();
    control.modify(|_, w| {
        w.pause_dbg0().bit(pause);
        w.pause_dbg1().bit(pause);
        w.pause_jtag().bit(pause)
    });
}

impl Board for Pico {
    fn now_ms(&self) -> u32 {
        MILLISECONDS.load(Ordering::Relaxed)
    }

    fn feed_watchdog(&mut self) {
        let now_ms = self.now_ms();
        self.last_fed.at(now_ms, || self.watchdog.feed());
    }

    fn start_sending() {
        NVIC::pend(Interrupt::UART0_IRQ);
    }

    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
        cortex_m::interrupt::free(|_| work(self));
    }

    fn sleep(&mut self) {
        // Laser cycles come without interrupts.
        #[cfg(feature = "sensor-photon-timer")]
        if photon_timer::RUNS.load(Ordering::Relaxed) {
            return;
        }
        // A pending interrupt ends it even while interrupts are masked.
        cortex_m::asm::wfi();
    }
}

#[exception]
fn SysTick() {
    // Nothing else writes it, and this processor has no atomic addition.
    let now = MILLISECONDS.load(Ordering::Relaxed);
    MILLISECONDS.store(now.wrapping_add(1), Ordering::Relaxed);
    if USB_WAITS.load(Ordering::Relaxed) {
        USB_WAITS.store(false, Ordering::Relaxed);
        // SAFETY: it was unmasked before.
        #[allow(unsafe_code, reason = "there is no other way to unmask")]
        unsafe {
            NVIC::unmask(Interrupt::USBCTRL_IRQ);
        }
    }
}

#[interrupt]
fn UART0_IRQ() {
    critical_section::with(|cs| {
        if let Some(port) = PORT.borrow_ref_mut(cs).as_mut() {
            port.serve_uart();
        }
    });
}

#[interrupt]
fn USBCTRL_IRQ() {
    critical_section::with(|cs| {
        if let Some(port) = PORT.borrow_ref_mut(cs).as_mut() {
            port.serve_usb();
        }
    });
}

impl Port {
    /// Fetches what has been received and hands over what there is to send. Runs
    /// when either is possible, and when sending is to start.
    fn serve_uart(&mut self) {
        let mut byte = [0];
        loop {
            match self.rx.read_raw(&mut byte) {
                Ok(_) => {
                    self.interrupt.on_receive(byte[0]);
                    if self.over_usb {
                        self.over_usb = false;
                        self.look_at_line();
                    }
                }
                Err(nb::Error::Other(_)) => self.interrupt.on_loss(),
                Err(nb::Error::WouldBlock) => break,
            }
        }
        self.send();
    }

    /// The same of the USB. Runs whenever something happens there.
    fn serve_usb(&mut self) {
        if self.usb.receive(&mut self.interrupt) {
            self.over_usb = true;
        }
        self.look_at_line();
        self.send();
        if self.usb.is_in_reset() {
            // It would interrupt without end, and leave the main loop no time.
            NVIC::mask(Interrupt::USBCTRL_IRQ);
            USB_WAITS.store(true, Ordering::Relaxed);
        }
    }

    /// Tells the main loop whether the host's port is open. Only USB can tell. A close counts even
    /// while answers go to the UART, as noise there may look like a host.
    fn look_at_line(&mut self) {
        let is_open = self.usb.listens();
        if self.usb_was_open && !is_open {
            self.interrupt.set_listening(false);
        }
        self.usb_was_open = is_open;
        self.interrupt.set_listening(!self.over_usb || is_open);
    }

    fn send(&mut self) {
        if self.over_usb {
            self.tx.rest();
            self.usb.send(&mut self.interrupt);
        } else {
            transmit(&mut self.interrupt, &mut self.tx);
        }
    }
}

impl Transmitter for Writer<UART0, UartPins> {
    // It interrupts when its queue runs half empty, which filling it further ends.
    fn acknowledge(&mut self) {}

    fn has_room(&mut self) -> bool {
        let Ok(ready) = self.write_ready();
        ready
    }

    fn send(&mut self, byte: u8) {
        // There is room, as was just seen.
        let _ = self.write_raw(&[byte]);
    }

    fn wake(&mut self) {
        self.enable_tx_interrupt();
    }

    fn rest(&mut self) {
        self.disable_tx_interrupt();
    }
}

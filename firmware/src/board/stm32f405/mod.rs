//! STM32F405 and STM32F407, the latter on ST's Discovery board with its debugger
//! (STM32F407G-DISC1).
//!
//! | | |
//! |---|---|
//! | clock | 168 MHz from an external crystal of 8 MHz |
//! | serial port | USART2, 1 Mbaud, 8 data bits, no parity, 1 stop bit |
//! | PA2 | sends; pin 14 of P1 on the Discovery, to RX of a USB adapter of 3.3 V |
//! | PA3 | receives; pin 13 of P1 on the Discovery, to TX of the adapter |
//! | watchdog | the independent one, resets after 0.3 to 1 s: its own oscillator has 17 to 47 kHz |
//! | supply | below about 2.7 V the laser goes off and the board resets, until the supply is back |
//! | log | defmt over RTT, which the debugger reads |
//!
//! The Discovery's debugger has a serial port of its own, but it is not
//! connected; hence the adapter.
//!
//! The feature `pll-off` leaves the processor at 16 MHz from its internal
//! oscillator, for emulators in which the PLL never starts. All else stays.

mod sensor_port;

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use critical_section::Mutex;
use defmt_rtt as _;
use static_cell::ConstStaticCell;
use stm32f4xx_hal::gpio::{Edge, PinState, Pull};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{self, EXTI, Interrupt, PWR, RCC, USART2, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config as ClockConfig;
use stm32f4xx_hal::serial::{Config as SerialConfig, Rx, Tx};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

pub use self::sensor_port::SensorPort;

use super::reset_reason::{self, ResetReason};
use super::{Board, DRIVES_SENSOR, LaserOff, LastFed, Transmitter, systick, transmit};
use crate::serial::{BoardBuffers, Buffers, Serial, SerialInterrupt};

const BAUD: u32 = 1_000_000;

/// The port and its end of the queues.
struct Port {
    interrupt: SerialInterrupt<'static>,
    tx: Tx<USART2>,
    rx: Rx<USART2>,
}

static BUFFERS: ConstStaticCell<BoardBuffers> = ConstStaticCell::new(Buffers::new());
static PORT: Mutex<RefCell<Option<Port>>> = Mutex::new(RefCell::new(None));
static MILLISECONDS: AtomicU32 = AtomicU32::new(0);
static SENSOR_LINE: Mutex<RefCell<Option<EXTI>>> = Mutex::new(RefCell::new(None));
/// The sensor has something since the main loop slept last.
static SENSOR_READY: AtomicBool = AtomicBool::new(false);

/// The board, once started.
pub struct Stm32F405 {
    watchdog: IndependentWatchdog,
    last_fed: LastFed,
    reset_reason: ResetReason,
}

impl Stm32F405 {
    /// Starts clock, timer, serial port, the interrupt of the sensor and the
    /// watchdog. Waits for the crystal: a board without one stays here.
    ///
    /// # Panics
    /// If called twice.
    #[must_use]
    pub fn start() -> (Self, Serial<'static>, SensorPort) {
        let (Some(core), Some(device)) = (cortex_m::Peripherals::take(), pac::Peripherals::take())
        else {
            panic!("the board is started twice");
        };
        let cause = device.RCC.csr().read().bits();
        // Otherwise the flags accumulate.
        device.RCC.csr().modify(|_, w| w.rmvf().clear());
        wait_for_supply(&device.RCC, &device.EXTI, &device.PWR);
        let reset_reason = reset_reason::take().unwrap_or(ResetReason::of_stm32f4(cause));
        let clocks = if cfg!(feature = "pll-off") {
            ClockConfig::hsi()
        } else {
            ClockConfig::hse(8.MHz()).sysclk(168.MHz())
        };
        let mut rcc = device.RCC.freeze(clocks);

        let mut timer = core.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(systick::reload(rcc.clocks.hclk().raw()));
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();

        let pins = device.GPIOA.split(&mut rcc);
        let pins_b = device.GPIOB.split(&mut rcc);
        let pins_c = device.GPIOC.split(&mut rcc);
        let config = SerialConfig::default().baudrate(BAUD.bps());
        // Silent while nothing is connected: a low line is a break.
        let rx = pins.pa3.into_alternate().internal_resistor(Pull::Up);
        let Ok(usart) = device.USART2.serial((pins.pa2, rx), config, &mut rcc) else {
            panic!("this clock does not give {BAUD} baud");
        };
        let (tx, mut rx) = usart.split();
        rx.listen();
        let (interrupt, serial) = BUFFERS.take().split(Self::start_sending);
        critical_section::with(|cs| PORT.replace(cs, Some(Port { interrupt, tx, rx })));

        // High when the sensor is silent, or is not there.
        let mut interrupt = pins_c.pc8.into_pull_up_input();
        let mut exti = device.EXTI;
        interrupt.make_interrupt_source(&mut device.SYSCFG.constrain(&mut rcc));
        interrupt.trigger_on_edge(&mut exti, Edge::Falling);
        interrupt.enable_interrupt(&mut exti);
        critical_section::with(|cs| SENSOR_LINE.replace(cs, Some(exti)));
        let high = PinState::High;
        let sensor = SensorPort {
            interrupt,
            enable: pins_c.pc6.into_push_pull_output_in_state(PinState::Low),
            spi: device.SPI2,
            cs: pins_b.pb12.into_push_pull_output_in_state(high),
            sck: pins_b.pb13,
            miso: pins_b.pb14,
            mosi: pins_b.pb15,
            scl: pins
                .pa8
                .into_open_drain_output_in_state(high)
                .internal_resistor(Pull::Up),
            sda: pins_c
                .pc9
                .into_open_drain_output_in_state(high)
                .internal_resistor(Pull::Up),
            rcc,
        };

        // SAFETY: the handlers share data with the main loop through queues,
        // atomics and mutexes only, and nothing relies on their being masked.
        #[allow(unsafe_code, reason = "there is no other way to unmask")]
        unsafe {
            NVIC::unmask(Interrupt::PVD);
            NVIC::unmask(Interrupt::USART2);
            NVIC::unmask(Interrupt::EXTI9_5);
        }

        let mut watchdog = IndependentWatchdog::new(device.IWDG);
        watchdog.stop_on_debug(&device.DBGMCU, !DRIVES_SENSOR);
        // At 32 kHz. Its oscillator has 17 kHz at least (data sheet DS8626, LSI oscillator characteristics): 0.94 s.
        watchdog.start(500.millis());
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

/// Starts the voltage detector and waits while the supply is low; nothing else has been started then. A fall
/// from now on is pending as an interrupt: the detector's output rises then, on line 16 of EXTI (RM0090, 5.2.3,
/// 5.4.1, 5.4.2 and 12.2.5). RM0090 names the level 2.6 V; thresholds are about 0.1 V higher.
fn wait_for_supply(rcc: &RCC, exti: &EXTI, pwr: &PWR) {
    const PLS_2V6: u8 = 0b100;
    rcc.apb1enr().modify(|_, w| w.pwren().set_bit());
    exti.rtsr().modify(|_, w| w.tr16().set_bit());
    pwr.cr()
        .modify(|_, w| w.pls().set(PLS_2V6).pvde().set_bit());
    let is_low = || pwr.csr().read().pvdo().bit_is_set();
    loop {
        while is_low() {}
        // The detector's start may have been an edge; a fall after this is one again.
        exti.pr().write(|w| w.pr16().clear_bit_by_one());
        if !is_low() {
            break;
        }
    }
    exti.imr().modify(|_, w| w.mr16().set_bit());
}

impl LaserOff for Stm32F405 {
    /// Drives PC6 low, ENABLE or EN of the sensor: `BR6` of `GPIOC_BSRR` (RM0090, 8.4.7). Before
    /// the port has started nothing happens.
    fn laser_off() {
        // SAFETY: a write of 1 concerns this pin alone, and the image does nothing more.
        #[allow(unsafe_code, reason = "there is no handle of the peripheral here")]
        let port = unsafe { &*pac::GPIOC::PTR };
        port.bsrr().write(|w| w.br6().reset());
    }
}

impl Board for Stm32F405 {
    fn now_ms(&self) -> u32 {
        MILLISECONDS.load(Ordering::Relaxed)
    }

    fn feed_watchdog(&mut self) {
        let now_ms = self.now_ms();
        self.last_fed.at(now_ms, || self.watchdog.feed());
    }

    fn start_sending() {
        NVIC::pend(Interrupt::USART2);
    }

    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
        cortex_m::interrupt::free(|_| work(self));
    }

    fn sleep(&mut self) {
        if !SENSOR_READY.swap(false, Ordering::Relaxed) {
            // A pending interrupt ends it even while interrupts are masked.
            cortex_m::asm::wfi();
        }
    }
}

#[exception]
fn SysTick() {
    MILLISECONDS.fetch_add(1, Ordering::Relaxed);
}

/// The supply is too low. The next start waits until it is back.
#[interrupt]
fn PVD() {
    Stm32F405::laser_off();
    reset_reason::remember(ResetReason::BrownOut);
    Stm32F405::end()
}

#[interrupt]
fn EXTI9_5() {
    critical_section::with(|cs| {
        if let Some(exti) = SENSOR_LINE.borrow_ref(cs).as_ref() {
            exti.pr().write(|w| w.pr8().clear_bit_by_one());
        }
    });
    SENSOR_READY.store(true, Ordering::Relaxed);
}

#[interrupt]
fn USART2() {
    critical_section::with(|cs| {
        if let Some(port) = PORT.borrow_ref_mut(cs).as_mut() {
            port.serve();
        }
    });
}

impl Port {
    /// Fetches what has been received and hands over what there is to send. Runs
    /// when either is possible, and when sending is to start.
    fn serve(&mut self) {
        loop {
            match self.rx.read() {
                Ok(byte) => self.interrupt.on_receive(byte),
                Err(nb::Error::Other(_)) => self.interrupt.on_loss(),
                Err(nb::Error::WouldBlock) => break,
            }
        }
        transmit(&mut self.interrupt, &mut self.tx);
    }
}

impl Transmitter for Tx<USART2> {
    // It interrupts as long as it listens and has room.
    fn acknowledge(&mut self) {}

    fn has_room(&mut self) -> bool {
        self.is_tx_empty()
    }

    fn send(&mut self, byte: u8) {
        // There is room, as was just seen.
        let _ = self.write(byte);
    }

    fn wake(&mut self) {
        self.listen();
    }

    fn rest(&mut self) {
        self.unlisten();
    }
}

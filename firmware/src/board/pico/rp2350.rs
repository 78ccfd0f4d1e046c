//! The chip of the Raspberry Pi Pico 2: two Cortex-M33, of which one runs, and 520 KiB of RAM.
//!
//! No emulator runs it. Its images are linked, sized and checked, and have never run.

pub use rp235x_hal as hal;
pub use rp235x_hal::pac::{USB as UsbRegisters, USB_DPRAM as UsbMemory};

use rp235x_hal::block::ImageDef;
use rp235x_hal::clocks::{ClocksManager, InitError};
use rp235x_hal::fugit::RateExtU32;
use rp235x_hal::pac::{CLOCKS, PLL_SYS, PLL_USB, Peripherals, RESETS, XOSC};
use rp235x_hal::pll::common_configs::PLL_USB_48MHZ;
use rp235x_hal::pll::{PLLConfig, setup_pll_blocking};
use rp235x_hal::watchdog::Watchdog;
use rp235x_hal::xosc::setup_xosc_blocking;

use crate::board::reset_reason::ResetReason;

/// The chip's ROM looks for this: a program for its Arm processors, in secure state.
#[unsafe(link_section = ".start_block")]
#[used]
#[allow(unsafe_code, reason = "the name of the section places it")]
static IMAGE_DEF: ImageDef = ImageDef::secure_exe();

/// 125 MHz instead of the 150 MHz of rp235x-hal's own function: the photon timer's bins have 8 ns.
const PLL_SYS_125MHZ: PLLConfig = PLLConfig {
    vco_freq: rp235x_hal::fugit::HertzU32::MHz(1500),
    refdiv: 1,
    post_div1: 6,
    post_div2: 2,
};

/// As rp235x-hal's function of this name, at 125 MHz.
pub fn init_clocks_and_plls(
    crystal_hz: u32,
    xosc: XOSC,
    clocks: CLOCKS,
    pll_sys: PLL_SYS,
    pll_usb: PLL_USB,
    resets: &mut RESETS,
    watchdog: &mut Watchdog,
) -> Result<ClocksManager, InitError> {
    const MHZ: u32 = 1_000_000;
    let xosc = setup_xosc_blocking(xosc, crystal_hz.Hz()).map_err(InitError::XoscErr)?;
    // A tick is a microsecond.
    watchdog.enable_tick_generation(u16::try_from(crystal_hz / MHZ).unwrap_or(u16::MAX));
    let mut clocks = ClocksManager::new(clocks);
    let frequency = xosc.operating_frequency();
    let pll_sys = setup_pll_blocking(pll_sys, frequency, PLL_SYS_125MHZ, &mut clocks, resets)
        .map_err(InitError::PllError)?;
    let pll_usb = setup_pll_blocking(pll_usb, frequency, PLL_USB_48MHZ, &mut clocks, resets)
        .map_err(InitError::PllError)?;
    let done = clocks.init_default(&xosc, &pll_sys, &pll_usb);
    done.map_err(InitError::ClockError)?;
    Ok(clocks)
}

/// Why the chip has started. `watched` is whether the image had started the watchdog.
pub fn reset_reason(device: &Peripherals, watched: bool) -> ResetReason {
    let reason = device.WATCHDOG.reason().read().bits();
    let chip_reset = device.POWMAN.chip_reset().read().bits();
    ResetReason::of_rp2350(reason, chip_reset, watched)
}

/// What the photon timer writes without the chip's crate.
#[cfg(feature = "sensor-photon-timer")]
pub mod registers {
    /// The alias of RESETS.RESET that sets bits, and the bit of PIO0 (RP2350 datasheet, 2.1.3 and 7.5.3).
    pub const RESET_SET: u32 = 0x4002_2000;
    pub const RESET_PIO0: u32 = 1 << 11;

    // Bits of a DMA channel's control register that each chip has elsewhere (12.6.10, CH0_CTRL_TRIG).
    pub const INCREMENT_WRITE: u32 = 1 << 6;
    pub const RING_SIZE: u32 = 8;
    pub const RING_OF_WRITES: u32 = 1 << 12;
    pub const CHAIN_TO: u32 = 13;
    pub const REQUEST: u32 = 17;
    pub const QUIET: u32 = 1 << 23;
}

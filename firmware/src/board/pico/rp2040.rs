//! The chip of the Raspberry Pi Pico: a Cortex-M0+ and 264 KiB of RAM.

pub use rp2040_hal as hal;
pub use rp2040_hal::clocks::init_clocks_and_plls;
pub use rp2040_hal::pac::{USBCTRL_DPRAM as UsbMemory, USBCTRL_REGS as UsbRegisters};

use rp2040_hal::pac::Peripherals;

use crate::board::reset_reason::ResetReason;

/// The chip's ROM loads this first: it sets the flash up for reading.
#[unsafe(link_section = ".boot2")]
#[used]
#[allow(unsafe_code, reason = "the name of the section places it")]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

/// Why the chip has started. `watched` is whether the image had started the watchdog.
pub fn reset_reason(device: &Peripherals, watched: bool) -> ResetReason {
    let reason = device.WATCHDOG.reason().read().bits();
    let chip_reset = device.VREG_AND_CHIP_RESET.chip_reset().read().bits();
    ResetReason::of_rp2040(reason, chip_reset, watched)
}

/// What the photon timer writes without the chip's crate.
#[cfg(feature = "sensor-photon-timer")]
pub mod registers {
    /// The alias of RESETS.RESET that sets bits, and the bit of PIO0 (RP2040 datasheet, 2.1.2 and 2.14.3).
    pub const RESET_SET: u32 = 0x4000_e000;
    pub const RESET_PIO0: u32 = 1 << 10;

    // Bits of a DMA channel's control register that each chip has elsewhere (2.5.7, CH0_CTRL_TRIG).
    pub const INCREMENT_WRITE: u32 = 1 << 5;
    pub const RING_SIZE: u32 = 6;
    pub const RING_OF_WRITES: u32 = 1 << 10;
    pub const CHAIN_TO: u32 = 11;
    pub const REQUEST: u32 = 15;
    pub const QUIET: u32 = 1 << 21;
}

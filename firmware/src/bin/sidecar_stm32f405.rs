//! The sidecar on STM32F405 and STM32F407: `cargo xtask flash`.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("an image for a board: cargo xtask image stm32f405");

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use dtof_firmware::board::{on_panic, run, stm32f405::Stm32F405};
use dtof_firmware::sidecar::{Block, Pixel};
#[cfg(not(any(
    feature = "sensor-tdc7200",
    feature = "sensor-tmf8829",
    feature = "sensor-tmf882x"
)))]
use dtof_sensors::simulated;
use heapless::Vec;
use static_cell::ConstStaticCell;

/// As many macropixels as the memory of the STM32F405 has room for.
const MOST_PIXELS: usize = if cfg!(feature = "count8") { 400 } else { 256 };
static PIXELS: ConstStaticCell<Vec<Pixel, MOST_PIXELS>> = ConstStaticCell::new(Vec::new());
/// The blocks of 16 x 8 macropixels in three levels.
static BLOCKS: ConstStaticCell<Vec<Block, 42>> = ConstStaticCell::new(Vec::new());

#[entry]
fn main() -> ! {
    #[allow(unused_variables, reason = "the simulated sensor is not connected")]
    let (board, serial, port) = Stm32F405::start();
    defmt::info!("stm32f405 started: {}", board.reset_reason());
    #[cfg(feature = "sensor-tdc7200")]
    let sensor = port.tdc7200();
    #[cfg(feature = "sensor-tmf8829")]
    let image = include_bytes!(concat!(env!("OUT_DIR"), "/tmf8829.bin"));
    #[cfg(all(feature = "sensor-tmf8829", not(feature = "sensor-tmf8829-spi")))]
    let sensor = port.tmf8829(image);
    #[cfg(feature = "sensor-tmf8829-spi")]
    let sensor = port.tmf8829_over_spi(image);
    #[cfg(feature = "sensor-tmf882x")]
    let sensor = port.tmf882x(include_bytes!(concat!(env!("OUT_DIR"), "/tmf882x.bin")));
    #[cfg(not(any(
        feature = "sensor-tdc7200",
        feature = "sensor-tmf8829",
        feature = "sensor-tmf882x"
    )))]
    let sensor = simulated::scene();
    let reason = board.reset_reason();
    run(board, serial, reason, sensor, PIXELS.take(), BLOCKS.take())
}

dtof_firmware::hard_fault!(Stm32F405);

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    on_panic::<Stm32F405>(info)
}

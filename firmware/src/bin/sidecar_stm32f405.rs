//! The sidecar on STM32F405 and STM32F407: `cargo xtask flash`.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("an image for a board: cargo xtask image stm32f405");

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use dtof_firmware::board::{on_panic, stm32f405::Stm32F405, turn};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_sensors::Sensor;
#[cfg(not(any(
    feature = "sensor-tdc7200",
    feature = "sensor-tmf8829",
    feature = "sensor-tmf882x"
)))]
use dtof_sensors::simulated;
use heapless::Vec;
use static_cell::ConstStaticCell;

/// As many macropixels as the memory of the STM32F405 has room for.
static PIXELS: ConstStaticCell<Vec<Pixel, 256>> = ConstStaticCell::new(Vec::new());
/// The blocks of 16 x 8 macropixels in three levels.
static BLOCKS: ConstStaticCell<Vec<Block, 42>> = ConstStaticCell::new(Vec::new());

#[entry]
fn main() -> ! {
    #[allow(unused_variables, reason = "the simulated sensor is not connected")]
    let (mut board, mut serial, port) = Stm32F405::start();
    defmt::info!("stm32f405 started: {}", board.reset_reason());
    #[cfg(feature = "sensor-tdc7200")]
    let mut sensor = port.tdc7200();
    #[cfg(feature = "sensor-tmf8829")]
    let mut sensor = port.tmf8829(include_bytes!(concat!(env!("OUT_DIR"), "/tmf8829.bin")));
    #[cfg(feature = "sensor-tmf882x")]
    let mut sensor = port.tmf882x(include_bytes!(concat!(env!("OUT_DIR"), "/tmf882x.bin")));
    #[cfg(not(any(
        feature = "sensor-tdc7200",
        feature = "sensor-tmf8829",
        feature = "sensor-tmf882x"
    )))]
    let mut sensor = simulated::scene();
    let mut sidecar = Sidecar::new(PIXELS.take(), BLOCKS.take(), Some(sensor.about()));
    sidecar.set_stop_reason(board.reset_reason().into());
    loop {
        turn(&mut board, &mut serial, |serial, now_ms| {
            let lost = serial.lost();
            sidecar.set_listening(serial.listens());
            let Ok(()) = sidecar.poll_with(&mut sensor, serial, lost, now_ms);
        });
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    on_panic(info)
}

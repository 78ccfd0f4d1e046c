//! The sidecar on a Raspberry Pi Pico: `cargo xtask flash pico`.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("an image for a board: cargo xtask image pico");

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, entry, exception};
use dtof_firmware::board::{pico::Pico, turn};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_sensors::Sensor;
use dtof_sensors::simulated;
use heapless::Vec;
use static_cell::ConstStaticCell;

/// As many macropixels as leave room for blocks and the stack.
static PIXELS: ConstStaticCell<Vec<Pixel, 512>> = ConstStaticCell::new(Vec::new());
/// The blocks of 16 x 16 macropixels in three levels.
static BLOCKS: ConstStaticCell<Vec<Block, 84>> = ConstStaticCell::new(Vec::new());

#[entry]
fn main() -> ! {
    let (mut board, mut serial) = Pico::start();
    defmt::info!("pico started");
    let mut sensor = simulated::scene();
    let mut sidecar = Sidecar::new(PIXELS.take(), BLOCKS.take(), Some(sensor.about()));
    loop {
        turn(&mut board, &mut serial, |serial, now_ms| {
            let lost = serial.lost();
            let Ok(()) = sidecar.poll_with(&mut sensor, serial, lost, now_ms);
        });
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    Pico::on_panic(info)
}

#[allow(unsafe_code, reason = "the attribute asks for it")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    Pico::on_hard_fault(frame)
}

//! The sidecar on the board QEMU emulates: `cargo xtask emulate`.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("an image for a board: cargo xtask image mps2-an386");

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use dtof_firmware::board::{mps2_an386::Mps2An386, on_panic, serve, turn};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_sensors::Sensor;
use dtof_sensors::simulated;
use heapless::Vec;
use static_cell::ConstStaticCell;

/// As many macropixels as the memory of the STM32F405 has room for; with counters of 8 bits as 192 KiB have
/// without blocks.
const MOST_PIXELS: usize = if cfg!(feature = "count8") { 800 } else { 256 };
static PIXELS: ConstStaticCell<Vec<Pixel, MOST_PIXELS>> = ConstStaticCell::new(Vec::new());
/// The blocks of 16 x 8 macropixels in three levels.
const MOST_BLOCKS: usize = if cfg!(feature = "count8") { 0 } else { 42 };
static BLOCKS: ConstStaticCell<Vec<Block, MOST_BLOCKS>> = ConstStaticCell::new(Vec::new());

#[entry]
fn main() -> ! {
    let (mut board, mut serial) = Mps2An386::start();
    let reason = board.reset_reason();
    defmt::info!("mps2-an386 started: {}", reason);
    let unpaced = board.obey_command_line();
    let mut sensor = simulated::scene();
    if unpaced.is_some() {
        sensor = sensor.without_clock();
    }
    let mut left = unpaced.unwrap_or_default();
    let mut sidecar = Sidecar::new(PIXELS.take(), BLOCKS.take(), Some(sensor.info()));
    sidecar.set_stop_reason(reason.into());
    let mut is_lit = false;
    loop {
        turn(&mut board, &mut serial, |serial, now_ms| {
            let has_more = serve(&mut sidecar, &mut sensor, serial, now_ms);
            if is_lit != sidecar.sensor_is_running() {
                is_lit = !is_lit;
                Mps2An386::set_laser(is_lit);
            }
            sidecar.simulate(&mut sensor, &mut left);
            has_more
        });
    }
}

dtof_firmware::hard_fault!(Mps2An386);

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    on_panic::<Mps2An386>(info)
}

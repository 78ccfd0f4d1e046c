//! The sidecar on a Raspberry Pi Pico, and on a Pico 2: `cargo xtask flash pico`, `cargo xtask flash pico2`.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("an image for a board: cargo xtask image pico");

use core::panic::PanicInfo;

use cortex_m_rt::entry;
#[cfg(feature = "sensor-photon-timer")]
use dtof_core::checked;
#[cfg(feature = "sensor-photon-timer")]
use dtof_firmware::DEFAULT_LASER;
use dtof_firmware::board::{on_panic, pico::Pico, run};
#[cfg(feature = "sensor-photon-timer")]
use dtof_firmware::photon_timer::{Config, ConfigError, Settings};
use dtof_firmware::sidecar::{Block, Pixel};
#[cfg(not(feature = "sensor-photon-timer"))]
use dtof_sensors::simulated;
use heapless::Vec;
use static_cell::ConstStaticCell;

/// As many macropixels as leave room for blocks and the stack, and all blocks of 16 x 16 or 32 x 32 macropixels in
/// three levels.
const MOST_PIXELS: usize = match (cfg!(feature = "pico2"), cfg!(feature = "count8")) {
    (false, false) => 512,
    (false, true) => 800,
    (true, false) => 1024,
    (true, true) => 1600,
};
const MOST_BLOCKS: usize = if cfg!(feature = "pico2") { 336 } else { 84 };
static PIXELS: ConstStaticCell<Vec<Pixel, MOST_PIXELS>> = ConstStaticCell::new(Vec::new());
static BLOCKS: ConstStaticCell<Vec<Block, MOST_BLOCKS>> = ConstStaticCell::new(Vec::new());

/// [`DEFAULT_LASER`], unless `LASER_HZ` and `LASER_PULSE_NS` say otherwise when the image is built.
#[cfg(feature = "sensor-photon-timer")]
const LASER: Config = checked!(laser(Settings {
    laser_hz: number(option_env!("LASER_HZ"), DEFAULT_LASER.laser_hz),
    pulse_ns: number(option_env!("LASER_PULSE_NS"), DEFAULT_LASER.pulse_ns),
}));

#[cfg(feature = "sensor-photon-timer")]
const fn laser(settings: Settings) -> Result<Config, ConfigError> {
    if cfg!(feature = "laser-beyond-limits") {
        Config::beyond_limits(settings)
    } else {
        Config::new(settings)
    }
}

/// For `cargo xtask image`, which prints what this image does with the laser.
#[cfg(feature = "sensor-photon-timer")]
#[unsafe(link_section = ".laser_clocks")]
#[unsafe(no_mangle)]
#[used]
#[allow(
    unsafe_code,
    reason = "found by its name, and kept by that of its section"
)]
static LASER_CLOCKS: [u32; 3] = LASER.laser_clocks();

/// The number in a text, or `default` without one.
#[cfg(feature = "sensor-photon-timer")]
const fn number(text: Option<&str>, default: u32) -> u32 {
    let Some(text) = text else {
        return default;
    };
    match u32::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("LASER_HZ and LASER_PULSE_NS are whole numbers"),
    }
}

#[entry]
fn main() -> ! {
    #[allow(unused_variables, reason = "the simulated sensor is not connected")]
    let (board, serial, port) = Pico::start();
    defmt::info!("pico started: {}", board.reset_reason());
    #[cfg(feature = "sensor-photon-timer")]
    let sensor = port.photon_timer(LASER);
    #[cfg(not(feature = "sensor-photon-timer"))]
    let sensor = simulated::scene();
    let reason = board.reset_reason();
    run(board, serial, reason, sensor, PIXELS.take(), BLOCKS.take())
}

dtof_firmware::hard_fault!(Pico);

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    on_panic::<Pico>(info)
}

#![doc = include_str!("../README.md")]
#![no_std]
#![no_main]
mod chip;

use core::{convert::Infallible, panic::PanicInfo};
use dtof_core::{PixelAddress, fixed::types::U16F16};
use dtof_firmware::board::{LaserOff, LastFed, on_panic, reset_reason};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorInfo, dither::Dither};
use heapless::Vec;

/// A sensor whose laser is on while it runs, and which sees a photon in each laser cycle.
struct Laser;
impl Sensor for Laser {
    type Error = Infallible;
    fn info(&self) -> SensorInfo {
        SensorInfo::new(1)
    }
    fn start(&mut self, _: U16F16, _: Dither) {
        chip::set_laser(true);
    }
    fn stop(&mut self) {
        chip::set_laser(false);
    }
    fn poll(&mut self, _: u32, sink: &mut impl PhotonSink) -> Result<Polled, Infallible> {
        sink.photon(PixelAddress::new(0), 40);
        sink.end_laser_cycles(1);
        Ok(Polled::Idle)
    }
}

impl LaserOff for Laser {
    fn laser_off() {
        chip::set_laser(false);
    }
    fn end() -> ! {
        chip::end()
    }
}
dtof_firmware::hard_fault!(Laser);
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    on_panic::<Laser>(info)
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let (mut port, mut watchdog, cause) = chip::start();
    let (mut pixels, mut blocks) = (Vec::<Pixel, 1>::new(), Vec::<Block, 0>::new());
    let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, Some(Laser.info()));
    sidecar.set_stop_reason(reset_reason::take().unwrap_or(cause).into());
    let mut last_fed = LastFed::default();
    // If the port fails, the laser is off.
    while sidecar
        .poll_with(&mut Laser, &mut port, 0, chip::now_ms())
        .is_ok()
        || chip::POLLS_AGAIN
    {
        last_fed.at(chip::now_ms(), || watchdog.feed());
    }
    chip::rest()
}

#![doc = include_str!("../README.md")]
#![no_std]
#![no_main]

mod depth;

use cortex_m::peripheral::SCB;
use defmt_rtt as _;
use embassy_nrf::gpio::{Input, Level, Output, OutputDrive, Pull};
use embassy_nrf::{bind_interrupts, peripherals::TWISPI0, twim, wdt};
use embassy_time::{Delay, Instant};

bind_interrupts!(struct Irqs { TWISPI0 => twim::InterruptHandler<TWISPI0>; });

/// The vendor's program for the sensor.
const PROGRAM: &[u8] = &[];

#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    let p = embassy_nrf::init(Default::default());
    let mut config = twim::Config::default();
    config.frequency = twim::Frequency::K400;
    let bus = twim::Twim::new(p.TWISPI0, Irqs, p.P0_26, p.P0_27, config, &mut []);
    let int = Input::new(p.P0_28, Pull::Up);
    let enable = Output::new(p.P0_29, Level::Low, OutputDrive::Standard);
    // Polls ask for the time. A program that stops polling for a second is reset.
    let watchdog = wdt::Watchdog::try_new(p.WDT, wdt::Config::default());
    let Ok((_, [mut watchdog])) = watchdog else {
        SCB::sys_reset()
    };
    let now_ms = move || {
        watchdog.pet();
        Instant::now().as_millis() as u32
    };
    let timing = dtof_sensors::protocol::Timing::new(now_ms, Delay, 100);
    depth::run((bus, int, enable), timing, PROGRAM, |report| match report {
        Ok((pixel, range)) => defmt::info!("{}: {=i32} mm", pixel, range.round().to_num()),
        Err(fault) => defmt::warn!("{}", fault),
    })
    .await;
    SCB::sys_reset()
}

#[cortex_m_rt::exception]
unsafe fn HardFault(_: &cortex_m_rt::ExceptionFrame) -> ! {
    SCB::sys_reset()
}

/// After a reset ENABLE is low, and with it the laser is off.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}

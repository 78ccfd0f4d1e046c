//! Sensors on a mocked bus, and a second of a device that has one.

use dtof_chips::Chip;
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::Report;
use dtof_sensors::tmf882x::Tmf882x;
use dtof_sensors::{Sensor, tdc7200, tmf882x};

use super::host::Host;
use super::plug::{Bus, Tdc, Tmf};

/// A TDC7200 of one pixel.
pub fn tdc7200(bus: &Bus<Tdc>) -> impl Sensor + use<> {
    let settings = tdc7200::Settings {
        first_bin_ps: 240_000,
        ..tdc7200::Settings::new(PixelAddress::new(0), 8_000, U16F16::lit("250"))
    };
    let config = tdc7200::Config::new(settings).unwrap();
    let (interrupt, enable) = (bus.interrupt.clone(), bus.enable.clone());
    tdc7200::Tdc7200::<_, _, _>::new(bus.clone(), interrupt, enable, config)
}

/// A TMF8820.
pub fn tmf882x(bus: &Bus<Tmf>) -> impl Sensor + use<> {
    let config = tmf882x::Config::new(tmf882x::Settings::new(PixelAddress::new(0))).unwrap();
    let (interrupt, enable) = (bus.interrupt.clone(), bus.enable.clone());
    Tmf882x::<_, _, _>::new(bus.clone(), interrupt, enable, &[1, 2, 3], config)
}

/// A second with `sensor` and a host that reads; what the device says then. The
/// sensor is asked three times a millisecond, as by a busy main loop.
pub fn second<C: Chip + Default>(
    sensor: &mut impl Sensor,
    bus: &Bus<C>,
    device: &mut Sidecar,
    host: &mut Host,
    now_ms: &mut u32,
) -> Report {
    for _ in 0..1000 {
        *now_ms += 1;
        for _ in 0..3 {
            let before = bus.transfers();
            device.poll_sensor(sensor, *now_ms);
            // Four polls; that which configures a TDC7200 takes 19.
            assert!(bus.transfers() - before <= 4 * 19);
        }
        host.exchange(device, *now_ms);
        host.read(8);
    }
    host.report(device, *now_ms)
}

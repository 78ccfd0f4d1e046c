//! Depth events from a TMF8829 on any bus, pins and timer.

use dtof_core::fixed::types::I24F8;
use dtof_core::{
    PixelAddress, PixelConfig, RangeGate, RangeScale, Statistics, WholeHistogram, checked,
};
use dtof_sensors::protocol::{AsyncBus, Timing};
use dtof_sensors::tmf8829::{Config, Error, Settings, Tmf8829, Zones};
use dtof_sensors::{PhotonSink, SensorFault, SensorInfo};
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use embedded_hal_async::{delay::DelayNs, digital::Wait};

const SETTINGS: Settings = Settings::new(PixelAddress::new(0), Zones::Z8x8);
const SENSOR: Config = checked!(Config::new(SETTINGS));
const INFO: SensorInfo = SENSOR.info();
const SCALE: RangeScale = checked!(RangeScale::new(INFO.bin_width.unwrap(), INFO.offset));
const MEASURED: RangeGate<128> = checked!(RangeGate::new(0, INFO.bins - 1));
const ZONE: PixelConfig<128> = checked!(PixelConfig::paper().gate(MEASURED).build());

/// An event of a pixel in millimetres, or why there is none.
type Report = Result<(PixelAddress, I24F8), SensorFault>;

struct Events<F>(F);

impl<F: FnMut(Report)> PhotonSink for Events<F> {
    fn photon(&mut self, _: PixelAddress, _: u16) {}
    fn end_laser_cycles(&mut self, _: u16) {}
    fn begin_frame(&mut self, _: u32) {}
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]) {
        let (mut whole, mut statistics) = (WholeHistogram::<128>::new(), Statistics::new());
        // Without a dead time the number of laser cycles does not matter.
        whole.decide(&ZONE, counts, 0, &mut statistics, |_, found| {
            (self.0)(Ok((pixel, SCALE.range(found.position()))));
        });
    }
}

/// Reports until the bus hangs: then it may still write to the driver, and has to be reset. After any other
/// error the driver starts the sensor again.
pub async fn run<INT: InputPin + Wait, EN: OutputPin + ErrorType<Error = INT::Error>>(
    (bus, int, enable): (impl AsyncBus, INT, EN),
    mut timing: Timing<impl FnMut() -> u32, impl DelayNs>,
    program: &[u8],
    report: impl FnMut(Report),
) {
    let mut events = Events(report);
    let mut sensor = Tmf8829::<_, _, _>::new(bus, int, enable, program, SENSOR);
    sensor.start_async();
    loop {
        if let Err(error) = sensor.next(&mut timing, &mut events).await {
            let hangs = matches!(error, Error::BusTimeout);
            (events.0)(Err(error.into()));
            if hangs {
                return;
            }
        }
    }
}

//! What a sidecar orders its sensor to do, and what a host is told of the sensor.

use crate::common::host::{CONFIGURATION, Host, device};
use dtof_core::fixed::types::U16F16;
use dtof_link::{Configuration, Refusal, SensorRecord, Source, message};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

/// A sensor that notes what it is told.
#[derive(Default)]
struct OrderLog(Vec<Order>);

#[derive(Debug, PartialEq)]
enum Order {
    Start(U16F16),
    Poll,
    Stop,
}

impl Sensor for OrderLog {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            bin_width: Some(U16F16::lit("160")),
            laser_millihertz: 0x0102_0304_0506_0708,
            dead_time: 0x0a14,
            ..SensorInfo::new(3)
        }
    }

    fn start(&mut self, bin_width: U16F16, _: Dither) {
        self.0.push(Order::Start(bin_width));
    }

    fn stop(&mut self) {
        self.0.push(Order::Stop);
    }

    fn poll(&mut self, _: u32, _: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        self.0.push(Order::Poll);
        Ok(Polled::Idle)
    }
}

#[test]
fn a_sensor_is_started_for_each_configuration_and_stopped_once() {
    let mut sensor = OrderLog::default();
    let mut device = device::<8>(Some(sensor.info()));
    let mut host = Host::new(1, 0);
    device.poll_sensor(&mut sensor, 0);
    let requested = |bin_width: u32, source| Configuration {
        bin_width_ps: U16F16::from_num(bin_width),
        source,
        ..CONFIGURATION
    };
    let (link, sensor_of) = (Source::Link, Source::Sensor);
    for (bin_width, source) in [(160, sensor_of), (150, sensor_of), (250, link), (250, link)] {
        host.configure(&mut device, 0, &requested(bin_width, source));
        device.poll_sensor(&mut sensor, 0);
        device.poll_sensor(&mut sensor, 1);
    }
    let start = |bin_width| Order::Start(U16F16::from_num(bin_width));
    let (poll, stop) = (|| Order::Poll, || Order::Stop);
    let expected = [
        stop(),
        start(160),
        poll(),
        poll(),
        start(150),
        poll(),
        poll(),
        stop(),
    ];
    assert_eq!(sensor.0, expected);

    // A new session stops it, too.
    host.configure(&mut device, 0, &requested(160, sensor_of));
    device.poll_sensor(&mut sensor, 2);
    sensor.0.clear();
    let mut next = Host::new(2, 0);
    next.report(&mut device, 3);
    device.poll_sensor(&mut sensor, 3);
    assert_eq!(sensor.0, [Order::Stop]);
}

#[test]
fn bins_that_are_not_the_sensors_are_refused() {
    let mut device = device::<8>(Some(OrderLog::default().info()));
    let mut host = Host::new(1, 0);
    // A sixteenth of 160 ps to either side.
    for (bin_width, taken) in [(149, false), (150, true), (170, true), (171, false)] {
        let requested = Configuration {
            bin_width_ps: U16F16::from_num(bin_width),
            source: Source::Sensor,
            ..CONFIGURATION
        };
        let answer = host.answer(&mut device, 0, message::CONFIGURE, &requested.to_le_bytes());
        let refusal = [Refusal::BinWidth as u8];
        assert_eq!(answer, refusal[..usize::from(!taken)], "{bin_width} ps");
        // Photons of the link have the bins of whoever sends them.
        let requested = Configuration {
            source: Source::Link,
            ..requested
        };
        host.configure(&mut device, 0, &requested);
    }
}

#[test]
fn the_host_is_told_what_the_sensor_is() {
    let info = OrderLog::default().info();
    let told_record = SensorRecord {
        pixels: info.pixels,
        bin_width: info.bin_width,
        offset: info.offset,
        laser_millihertz: info.laser_millihertz,
        bins: info.bins,
        dead_time: info.dead_time,
        most_dither: 0,
    };
    let mut host = Host::new(1, 0);
    let mut with_one = device::<8>(Some(info));
    let body = host.answer(&mut with_one, 0, message::SENSOR_REQUEST, &[]);
    // Then the range of bin 0, the laser rate, the bins, the dead time, and what is reserved.
    let rate = [8, 7, 6, 5, 4, 3, 2, 1];
    let bins_and_dead_time = [128, 0, 0x14, 0x0a];
    let expected = [
        [3, 0, 0, 0, 160, 0].as_slice(),
        &[0; 4],
        &rate,
        &bins_and_dead_time,
        &[0; 2],
    ]
    .concat();
    assert_eq!(body, expected);
    assert_eq!(
        SensorRecord::from_le_bytes(&body),
        Some((Some(told_record), 10))
    );

    let mut host = Host::new(1, 0);
    let mut bare = device::<8>(None);
    let body = host.answer(&mut bare, 0, message::SENSOR_REQUEST, &[]);
    assert_eq!(SensorRecord::from_le_bytes(&body), Some((None, 10)));
    assert_eq!(SensorRecord::from_le_bytes(&body[1..]), None);
}

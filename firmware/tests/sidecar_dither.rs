//! The dither that a host requests reaches the sensor, and no sensor gets one that it cannot have.

use crate::common::host::{CONFIGURATION, Host, configured_with};
use dtof_core::fixed::types::U16F16;
use dtof_link::{Configuration, Refusal, SensorRecord, Source, message};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

fn sensor_with(most_dither: u8) -> SensorInfo {
    SensorInfo {
        most_dither,
        ..SensorInfo::new(8)
    }
}

fn with(dither_bins: u16, dither_seed: u64) -> Configuration {
    Configuration {
        dither_bins,
        dither_seed,
        ..CONFIGURATION
    }
}

/// A sensor without photons.
struct Started {
    info: SensorInfo,
    with: Vec<Dither>,
}

impl Sensor for Started {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        self.info
    }

    fn start(&mut self, _: U16F16, dither: Dither) {
        self.with.push(dither);
    }

    fn stop(&mut self) {}

    fn poll(&mut self, _: u32, _: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        Ok(Polled::Idle)
    }
}

#[test]
fn each_dither_that_a_sensor_cannot_have_is_refused() {
    for most in [0, 2, 40, 253, 254, 255] {
        let (mut device, mut host) = configured_with::<8>(sensor_with(most), &CONFIGURATION);
        for bins in (0..300).chain([0x4000, u16::MAX]) {
            for source in [Source::Sensor, Source::Link] {
                let requested = Configuration {
                    source,
                    ..with(bins, 5)
                };
                let body = requested.to_le_bytes();
                let answer = host.answer(&mut device, 0, message::CONFIGURE, &body);
                let limit = match source {
                    Source::Sensor => u16::from(most).min(254),
                    Source::Link => 0,
                };
                let expected: &[u8] = match bins % 2 == 0 && bins <= limit {
                    true => &[],
                    false => &[Refusal::Dither as u8],
                };
                assert_eq!(answer, expected, "{bins} of {most}, {source:?}");
            }
        }
    }
}

#[test]
fn a_sensor_starts_with_the_dither_of_the_configuration_in_force() {
    let info = sensor_with(64);
    let mut sensor = Started {
        info,
        with: Vec::new(),
    };
    let (mut device, mut host) = configured_with::<8>(info, &with(64, 9));
    host.run(&mut device, &mut sensor, 0..2, usize::MAX);
    host.configure(&mut device, 2, &with(2, u64::MAX));
    host.run(&mut device, &mut sensor, 2..4, usize::MAX);
    // What is refused changes nothing.
    let refused = with(66, 1).to_le_bytes();
    let answer = host.answer(&mut device, 4, message::CONFIGURE, &refused);
    assert_eq!(answer, [Refusal::Dither as u8]);
    host.run(&mut device, &mut sensor, 4..6, usize::MAX);
    host.configure(&mut device, 6, &CONFIGURATION);
    host.run(&mut device, &mut sensor, 6..8, usize::MAX);
    let dither = |bins, seed| Dither::new(bins, seed).unwrap();
    assert_eq!(
        sensor.with,
        [dither(64, 9), dither(2, u64::MAX), dither(0, 0)]
    );
}

#[test]
fn a_host_learns_how_much_dither_a_sensor_can_have() {
    for most in [0, 40, 254] {
        let (mut device, _) = configured_with::<8>(sensor_with(most), &CONFIGURATION);
        let mut host = Host::new(2, 0);
        let body = host.answer(&mut device, 0, message::SENSOR_REQUEST, &[]);
        let (record, _) = SensorRecord::from_le_bytes(&body).unwrap();
        let record = record.unwrap();
        assert_eq!(record.most_dither, most);
    }
}

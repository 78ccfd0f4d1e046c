//! The 8×8 zones of a TMF8828.

use crate::common::bus::{self, Fault};
use crate::common::tmf8828::{Chip, MAP, count, zone};
use crate::common::{Broken, RecordingSink, SinkCall, started};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf882x::{Config, DeviceError, Error, Settings, Tmf882x};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::i2c::ErrorKind;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

type Bus = bus::Bus<Chip>;
type DriverError = Error<ErrorKind, Broken>;

struct Bench {
    sensor: Tmf882x<'static, Bus, Bus, Bus, 128>,
    bus: Bus,
    sink: RecordingSink,
    now_ms: u32,
}

fn bench(number: u8) -> Bench {
    let bus = Bus::new(Chip::new(number));
    let [i2c, interrupt, enable] = [(); 3].map(|()| bus.clone());
    let config = Config::new(Settings::of_8x8(PixelAddress::new(10))).unwrap();
    Bench {
        sensor: started(Tmf882x::new(i2c, interrupt, enable, &[], config)),
        bus,
        sink: RecordingSink::default(),
        now_ms: 0,
    }
}

impl Bench {
    fn poll(&mut self) -> Result<Polled, DriverError> {
        self.now_ms += 1;
        self.sensor.poll(self.now_ms, &mut self.sink)
    }

    fn bring_up(&mut self) {
        for _ in 0..100 {
            self.poll().unwrap();
            if self.sensor.is_measuring() {
                return;
            }
        }
        panic!("it does not come up");
    }

    /// Polls once for each of so many packets or results.
    fn take(&mut self, packets: u32) {
        for _ in 0..packets {
            let _ = self.poll().unwrap();
        }
    }

    /// Loses the next packet or result.
    fn lose(&self) {
        self.bus.0.borrow_mut().chip.next();
    }

    fn error(&mut self) -> DriverError {
        for _ in 0..300 {
            if let Err(error) = self.poll() {
                return error;
            }
        }
        panic!("no error");
    }
}

/// The histogram of a zone that the sink must get.
fn histogram(zone: u16) -> SinkCall {
    let counts = (0..128).map(|bin| count(Some(zone), bin));
    SinkCall::Histogram(10 + zone, counts.collect())
}

/// Compares the map of the vendor's viewer with the formula of the vendor's filter.
#[test]
fn the_map_follows_the_formula() {
    for capture in 0..4u8 {
        for half in 0..2u8 {
            for (channel, first) in (0..).zip([56u16, 60, 40, 44, 24, 28, 8, 12]) {
                let right = u16::from(half) + 2 * u16::from(capture % 2);
                let up = 8 * u16::from(capture / 2);
                assert_eq!(zone(capture, half, channel), Some(first + right - up));
            }
        }
    }
    assert_eq!(zone(2, 1, 0), Some(49));
    let mut all = MAP.concat();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), 64);
}

#[test]
fn each_of_64_zones_comes_once_in_four_captures() {
    for number in [0, 2, 255] {
        let mut bench = bench(number);
        bench.bring_up();
        assert_eq!(bench.bus.0.borrow().chip.page[0x34..0x36], [15, 0x84]);
        assert_eq!(bench.bus.0.borrow().chip.page[0x39], 1);
        // The driver does not know the number of the first capture before its result.
        bench.take(61);
        let given = bench.sink.take();
        assert_eq!(
            given[..2],
            [SinkCall::Frame(537 * 1024), SinkCall::Frame(537 * 1024)]
        );
        assert!(
            given[2..]
                .iter()
                .all(|given| matches!(given, SinkCall::Target(..)))
        );
        assert_eq!(bench.sensor.counts().left_out, 16);
        bench.take(4 * 61);
        let given = bench.sink.take();
        let mut histograms: Vec<(u16, &SinkCall)> = Vec::new();
        let mut targets = Vec::new();
        let mut frames = 0;
        for given in &given {
            match given {
                SinkCall::Histogram(pixel, _) => histograms.push((pixel - 10, given)),
                SinkCall::Target(pixel, target) => targets.push((pixel - 10, target.distance)),
                _ => frames += 1,
            }
        }
        histograms.sort_unstable_by_key(|(zone, _)| *zone);
        targets.sort_unstable();
        assert_eq!(histograms.len(), 64);
        for (zone, (at, given)) in (0..64).zip(&histograms) {
            assert_eq!((*at, *given), (zone, &histogram(zone)));
        }
        let expected = (0..64).map(|zone| (zone, I24F8::from_num(1000 + zone)));
        assert_eq!(targets, expected.collect::<Vec<_>>());
        assert_eq!(frames, 8);
        assert_eq!(bench.sensor.counts().errors, 0);
    }
}

#[test]
fn it_is_described_as_64_pixels() {
    let bench = bench(0);
    let info = bench.sensor.info();
    assert_eq!(
        (info.pixels, info.bins, info.laser_millihertz),
        (74, 128, 0)
    );
    // 57 mm a bin.
    let mm = info.bin_width.unwrap().to_num::<f64>() * 0.149_896_229;
    assert!((mm - 57.0).abs() < 0.1, "{mm}");
    let mut settings = Settings::of_8x8(PixelAddress::new(u16::MAX - 62));
    assert!(Config::new(settings).is_err());
    settings.first_pixel = PixelAddress::new(u16::MAX - 63);
    assert!(Config::new(settings).is_ok());
}

/// 244 packets and results need 0.8 s of a bus of 400 kHz.
#[test]
fn its_period_is_a_second() {
    let settings = Settings::of_8x8(PixelAddress::new(10));
    assert_eq!((settings.period_ms, settings.data_timeout_ms), (1000, 2000));
}

/// Targets 18 to 35 of a result are the second ones.
#[test]
fn a_second_target_is_given_as_such() {
    let mut bench = bench(0);
    bench.bus.0.borrow_mut().chip.has_second_targets = true;
    bench.bring_up();
    bench.take(61);
    let mut targets: Vec<(u16, u8, I24F8)> = Vec::new();
    for given in bench.sink.take() {
        if let SinkCall::Target(pixel, target) = given {
            targets.push((pixel - 10, target.number, target.distance));
        }
    }
    targets.sort_unstable();
    let zones = (0..64).filter(|&at| MAP.concat()[usize::from(at)].starts_with('0'));
    let expected = zones.flat_map(|zone| {
        let distance = |more: u16| I24F8::from_num(1000 + zone + more);
        [(zone, 0, distance(0)), (zone, 1, distance(500))]
    });
    assert_eq!(targets, expected.collect::<Vec<_>>());
}

#[test]
fn a_sensor_without_8x8_zones_is_an_error() {
    let mut bench = bench(0);
    bench.bus.0.borrow_mut().chip.is_fixed = true;
    assert_eq!(
        bench.error(),
        Error::Device(DeviceError::WrongMode { mode: 0 })
    );
    bench.bus.0.borrow_mut().chip.is_fixed = false;
    bench.bring_up();
}

#[test]
fn a_lost_packet_costs_its_capture() {
    let mut bench = bench(3);
    bench.bring_up();
    bench.take(61);
    bench.sink.take();
    bench.take(29);
    bench.lose();
    assert_eq!(
        bench.error(),
        Error::Device(DeviceError::OutOfOrder {
            expected: 29,
            found: 30
        })
    );
    let before = bench.sink.take();
    bench.take(60 - 31 + 1);
    let rest = bench.sink.take();
    assert!(
        rest.iter()
            .all(|given| matches!(given, SinkCall::Target(..)))
    );
    // Eight zones of the first half had come, the ninth channel is empty.
    assert_eq!(before.len(), 2 + 8);
    bench.take(61);
    assert!(
        bench
            .sink
            .take()
            .contains(&histogram(zone(1, 1, 7).unwrap()))
    );
    assert_eq!(bench.sensor.counts().errors, 1);
}

/// The driver drops histograms whose zones it does not know.
#[test]
fn a_lost_result_costs_the_next_capture() {
    let mut bench = bench(0);
    bench.bring_up();
    bench.take(61 + 60);
    bench.lose();
    bench.sink.take();
    let left_out = bench.sensor.counts().left_out;
    let lost = Error::Device(DeviceError::OutOfOrder {
        expected: 60,
        found: 0,
    });
    assert_eq!(bench.poll(), Err(lost));
    bench.take(60);
    let is_histogram = |given: &SinkCall| matches!(given, SinkCall::Histogram(..));
    assert!(!bench.sink.take().iter().any(is_histogram));
    assert_eq!(bench.sensor.counts().left_out, left_out + 16);
    bench.take(61);
    let given = bench.sink.take();
    assert!(given.contains(&histogram(zone(3, 0, 0).unwrap())));
}

#[test]
fn the_next_result_reveals_a_lost_capture() {
    let mut bench = bench(0);
    bench.bring_up();
    bench.take(61);
    bench.bus.0.borrow_mut().chip.number = 2;
    let expected = Error::Device(DeviceError::WrongCapture {
        expected: 1,
        found: 2,
    });
    assert_eq!(bench.error(), expected);
    assert!(bench.sensor.is_measuring());
    bench.sink.take();
    bench.take(61);
    assert!(
        bench
            .sink
            .take()
            .contains(&histogram(zone(3, 0, 0).unwrap()))
    );
}

/// Of a capture: the driver may give so many before its result says that their zones are not certain.
const CAPTURE: u32 = 16;

/// Lost packets, results and captures, errors of the bus, and restarts of the sensor: a histogram
/// goes to another zone only if the next result reports it, or the measurement ends with an error before it.
#[test]
fn no_fault_puts_a_histogram_into_another_zone_unreported() {
    let (mut faults, mut errors, mut histograms) = (0, 0, 0);
    let (mut reported, mut ended, mut counted) = (0, 0, 0);
    for seed in 0..50 {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut bench = bench(rng.next_u32().to_le_bytes()[0]);
        let one_in = 4 << (seed % 8);
        let mut wrong = 0;
        for polls in 0..20_000u32 {
            if polls < 18_000 && rng.next_u32().is_multiple_of(one_in) {
                faults += 1;
                let kind = rng.next_u32() % 4;
                if kind == 1 {
                    bench.bus.fail_next(Fault::Nack);
                }
                let chip = &mut bench.bus.0.borrow_mut().chip;
                match kind {
                    0 => chip.next(),
                    1 => {}
                    2 => chip.number = chip.number.wrapping_add(1),
                    _ => (chip.packets_sent, chip.mode) = (0, 0),
                }
            }
            let before = bench.bus.0.borrow().transfers;
            let polled = bench.poll();
            assert!(bench.bus.0.borrow().transfers - before <= 7);
            for given in bench.sink.take() {
                let SinkCall::Histogram(pixel, _) = given else {
                    continue;
                };
                histograms += 1;
                wrong += u32::from(given != histogram(pixel - 10));
            }
            assert!(wrong <= CAPTURE, "seed {seed}: {wrong} and no error");
            match polled {
                // Both report that the zones of the last capture are not certain.
                Err(
                    Error::Device(DeviceError::WrongCapture { .. })
                    | Error::Device(DeviceError::OutOfOrder { found: 0, .. }),
                ) => {
                    reported += wrong;
                    (wrong, errors) = (0, errors + 1);
                }
                Err(error) => {
                    errors += 1;
                    // The measurement starts again; its results say nothing about the last one.
                    if !bench.sensor.is_measuring() {
                        ended += wrong;
                        wrong = 0;
                    }
                    assert!(!error.to_string().contains('\n'));
                }
                Ok(_) => {}
            }
        }
        assert_eq!(wrong, 0, "seed {seed}");
        counted += bench.sensor.counts().errors;
        assert_eq!(counted, errors, "seed {seed}");
        assert!(bench.sensor.is_measuring());
        bench.sensor.start(U16F16::ZERO, Dither::OFF);
        bench.bring_up();
    }
    assert!(
        histograms > 10_000 && errors > 1000 && reported > 100,
        "{histograms} {errors} {reported}"
    );
    println!(
        "faults: TMF8828 with 8x8 zones, {faults} faults: {errors} errors counted, {histograms} \
         histograms; of another zone {reported} that their result reports, {ended} after which the measurement ends \
         with an error, 0 unreported; at most {CAPTURE} before the error"
    );
}

/// Its packets would be taken for those of other zones.
#[test]
fn a_sensor_left_in_its_8x8_mode_is_switched_off_for_nine_zones() {
    let mut bench = bench(0);
    bench.bring_up();
    let bus = bench.bus.clone();
    let config = Config::new(Settings::new(PixelAddress::new(10))).unwrap();
    bench.sensor = started(Tmf882x::new(bus.clone(), bus.clone(), bus, &[], config));
    // Another firmware has left it so; our driver has switched it off.
    {
        let chip = &mut bench.bus.0.borrow_mut().chip;
        assert_eq!((chip.mode, chip.is_measuring), (0, false));
        (chip.mode, chip.is_measuring) = (8, true);
    }
    assert_eq!(
        bench.error(),
        Error::Device(DeviceError::WrongMode { mode: 8 })
    );
    assert_eq!(bench.sink.take(), []);
    bench.bring_up();
    assert_eq!(bench.bus.0.borrow().chip.mode, 0);
    assert_eq!(bench.sensor.counts().errors, 1);
}

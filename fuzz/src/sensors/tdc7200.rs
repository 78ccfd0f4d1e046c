//! The TDC7200, as section 8 of its data sheet (SNAS647D) has it.

use dtof_chips::Tdc7200 as Tdc;
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::tdc7200::{Config, Mode, Settings, Stops, Tdc7200};

use super::bus::{Answer, Bus, Pin};
use super::{Model, SinkCall, drive};
use crate::Input;

const PIXEL: u16 = 7;
const CLOCK_KHZ: u16 = 8000;
const FIRST_BIN_PS: u32 = 240_000;
const BIN_PS: f64 = 250.0;
const STOPS: [Stops; 5] = [
    Stops::One,
    Stops::Two,
    Stops::Three,
    Stops::Four,
    Stops::Five,
];

/// What was read last: the results from TIME1 on.
struct Results {
    settings: Settings,
    registers: [Option<u32>; 13],
}

impl Results {
    fn of(settings: Settings, answers: &[Answer]) -> Self {
        let mut registers = [None; 13];
        for answer in answers {
            let first = answer.register & 0x3f;
            if first >= 0x10 {
                for (at, bytes) in (usize::from(first - 0x10)..).zip(answer.bytes.chunks(3)) {
                    let &[high, middle, low] = bytes else {
                        continue;
                    };
                    registers[at] = Some(u32::from_be_bytes([0, high & 0x7f, middle, low]));
                }
            }
        }
        Self {
            settings,
            registers,
        }
    }

    /// All that belongs to the measurement was read.
    fn is_whole(&self) -> bool {
        let two = usize::from(self.settings.mode == Mode::Two);
        let last = 2 * (self.settings.stops as usize - 1 + two);
        let mut needed = self.registers[..=last].iter().chain(&self.registers[11..]);
        needed.all(Option::is_some)
    }

    /// Picoseconds of each stop that came: the formulas of section 8.4.2.
    fn times(&self) -> Vec<f64> {
        let value = |at: usize| f64::from(self.registers[at].unwrap_or(0));
        let periods = f64::from(self.settings.calibration.periods());
        let clock_ps = 1e9 / f64::from(CLOCK_KHZ);
        let lsb = clock_ps * (periods - 1.0) / (value(12) - value(11));
        let mut times = Vec::new();
        for stop in 0..self.settings.stops as usize {
            let (time, clocks) = match self.settings.mode {
                Mode::One => (value(2 * stop), 0.0),
                Mode::Two => (value(2 * stop + 2), value(2 * stop + 1)),
            };
            if time == 0.0 && clocks == 0.0 {
                continue;
            }
            times.push(match self.settings.mode {
                Mode::One => time * lsb,
                // The data sheet leaves the upper bits of a clock count unused.
                Mode::Two => (value(0) - time) * lsb + clocks % 65536.0 * clock_ps,
            });
        }
        times
    }

    /// Whether a code may stand for a time: half a picosecond is rounded.
    fn is_code(&self, code: u16, time_ps: f64) -> bool {
        [-0.6, 0.0, 0.6].into_iter().any(|off| {
            let time_ps = time_ps + off;
            let measures = self.settings.mode == Mode::Two || (12e3..=500e3).contains(&time_ps);
            let bin = ((time_ps - f64::from(FIRST_BIN_PS)) / BIN_PS).floor();
            if measures && (0.0..65535.0).contains(&bin) {
                f64::from(code) == bin
            } else {
                code == u16::MAX
            }
        })
    }
}

struct Measurements(Settings);

impl Model<Tdc> for Measurements {
    fn restart(&mut self) {}

    fn check(&mut self, answers: &[Answer], failed: bool, calls: &[SinkCall]) {
        let results = Results::of(self.0, answers);
        let [photons @ .., last] = calls else {
            // What was measured whole is not lost.
            assert!(failed || !results.is_whole(), "no call of the sink");
            return;
        };
        assert_eq!(*last, SinkCall::End(1));
        assert!(results.is_whole(), "of no measurement");
        let times = results.times();
        assert_eq!(photons.len(), times.len());
        for (photon, time) in photons.iter().zip(times) {
            let SinkCall::Photon(PIXEL, code) = *photon else {
                panic!("{photon:?}");
            };
            assert!(results.is_code(code, time), "{code} of {time} ps");
        }
    }
}

pub fn run<const CHUNK: usize>(choice: u8, input: Input<'_>) {
    let mut settings = Settings {
        first_bin_ps: FIRST_BIN_PS,
        stops: STOPS[usize::from(choice) % 5],
        parity: choice & 0x80 != 0,
        ..Settings::new(PixelAddress::new(PIXEL), CLOCK_KHZ, U16F16::lit("250"))
    };
    if choice & 0x40 != 0 {
        settings.mode = Mode::Two;
    }
    let bus = Bus::new(Tdc::default(), input);
    let config = Config::new(settings).expect("good settings");
    let pins = [Pin(bus.clone()), Pin(bus.clone())];
    let [interrupt, enable] = pins;
    let mut sensor = Tdc7200::<_, _, _, CHUNK>::new(bus.clone(), interrupt, enable, config);
    drive(&mut sensor, &bus, &mut Measurements(settings));
    let counts = sensor.counts();
    assert!(counts.cycles > 0 && counts.photons >= counts.cycles - counts.empty);
}

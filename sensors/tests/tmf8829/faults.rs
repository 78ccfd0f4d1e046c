//! Fifty thousand faults of a TMF8829 and its bus. A poll is as short as ever, nothing is given
//! that was not seen on the bus, and all is right again afterwards. The driver counts each frame that broke off, and as
//! missed exactly the gaps between the numbers on the bus. A measurement ends only with an error.

use crate::common::SinkCall;
use std::fmt::Debug;

use crate::common::tmf8829::bench::{Bench, over, settings};
use crate::common::tmf8829::bus::{Bus, Fault, Wired};
use dtof_chips::Chip;
use dtof_chips::tmf8829::{order, shape};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf8829::{DeviceError, Error, Spi, Zones};
use dtof_sensors::{Sensor, Target};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const FAULTS: u64 = 50_000;
/// Short transfers of a poll: what configures the sensor, at the same address.
const MOST: usize = 7;
const CHUNK: usize = 252;
/// Bytes of the results of a zone: two targets of three bytes each.
const RECORD: usize = 6;

/// What was seen on the bus, and what has to be given of it.
struct Oracle {
    mode: u8,
    /// Of the frame that comes: kind, part, bytes of data, number.
    frame: Option<(u8, u8, usize, u32)>,
    bytes: Vec<u8>,
    begun: u32,
    whole: u32,
    histograms: u32,
    /// The number of the next frame of this measurement, once one has begun.
    next: Option<u32>,
    missed: u32,
    /// In this poll a frame has begun that was not the next one.
    has_gap: bool,
    /// Something has ended the last measurement.
    has_ended: bool,
}

impl Oracle {
    const fn new(mode: u8) -> Self {
        Self {
            mode,
            frame: None,
            bytes: Vec::new(),
            begun: 0,
            whole: 0,
            histograms: 0,
            next: None,
            missed: 0,
            has_gap: false,
            has_ended: true,
        }
    }

    /// The header, if it begins a frame of this measurement.
    fn header(&self, bytes: &[u8]) -> Option<(u8, u8, usize, u32)> {
        let (columns, rows, slots) = shape(self.mode);
        let (id, part) = (bytes[5], bytes[6]);
        let payload = usize::from(u16::from_le_bytes([bytes[7], bytes[8]]));
        let number = u32::from_le_bytes(bytes[9..13].try_into().unwrap());
        let halves = if slots > 2 { 2 } else { 1 };
        let data = match id {
            id if id == 0x20 | self.mode && part < slots => 25_344,
            id if id == 0x10 | self.mode && (part == 2 || (part == 0x42 && halves == 2)) => {
                columns * rows / halves * RECORD
            }
            _ => return None,
        };
        let fits = bytes[0] & 0x20 == 0 && payload == data + 24;
        fits.then_some((id, part, data, number))
    }

    fn see(&mut self, written: &[u8], read: Option<&[u8]>) -> Vec<SinkCall> {
        let mut given = Vec::new();
        match (written, read) {
            // The command to measure.
            ([0x08, 0x10], _) => {
                assert!(self.has_ended, "a measurement ended without an error");
                (self.next, self.has_ended) = (None, false);
            }
            ([0xFA], Some(bytes)) => {
                self.frame = self.header(bytes);
                self.bytes.clear();
                if let Some((id, _, _, number)) = self.frame {
                    self.begun += 1;
                    let expected = self.next.replace(number.wrapping_add(1));
                    let gap = expected.map_or(0, |expected| number.wrapping_sub(expected));
                    self.has_gap = gap != 0;
                    // A number that goes back does not tell how many are missed.
                    let missed = if gap < 1 << 31 { gap } else { 0 };
                    self.missed = self.missed.saturating_add(missed);
                    if id & 0xF0 == 0x20 {
                        let slots = u32::from(shape(self.mode).2);
                        given.push(SinkCall::Frame(586 * 1024 / slots));
                    }
                }
            }
            ([0xFF], Some(bytes)) => {
                let before = self.bytes.len();
                self.bytes.extend(bytes);
                if let Some((id, part, data, _)) = self.frame {
                    given = match id & 0xF0 {
                        0x20 => self.histograms(part.into(), before, data),
                        _ => self.targets(part & 0x40 != 0, before, data),
                    };
                }
            }
            _ => {}
        }
        given
    }

    /// Those of which the last byte has come.
    fn histograms(&mut self, slot: usize, before: usize, data: usize) -> Vec<SinkCall> {
        let bins = if self.mode == 0 { 256 } else { 64 };
        let columns = shape(self.mode).0;
        let mut given = Vec::new();
        for (index, (x, y)) in order(self.mode, slot).into_iter().enumerate() {
            let start = 4 * 64 * 3 + index * bins * 3;
            let end = start + bins * 3;
            if end <= before || end > self.bytes.len().min(data) {
                continue;
            }
            let words = self.bytes[start..end].chunks(3).take(128);
            let mut counts: Vec<u32> = words
                .map(|word| {
                    u32::from(word[0]) + 256 * u32::from(word[1]) + 65536 * u32::from(word[2])
                })
                .collect();
            counts.resize(128, 0);
            let pixel = u16::try_from(10 + y * columns + x).unwrap();
            given.push(SinkCall::Histogram(pixel, counts));
            self.histograms += 1;
        }
        given
    }

    /// Those of zones of which the last byte has come.
    fn targets(&self, is_second: bool, before: usize, data: usize) -> Vec<SinkCall> {
        let (columns, rows, slots) = shape(self.mode);
        let rows = (usize::from(is_second)..rows).step_by(if slots > 2 { 2 } else { 1 });
        let zones = rows.flat_map(|y| (0..columns).map(move |x| y * columns + x));
        let mut given = Vec::new();
        for (index, zone) in zones.enumerate() {
            let end = (index + 1) * RECORD;
            if end <= before || end > self.bytes.len().min(data) {
                continue;
            }
            let targets = self.bytes[end - RECORD..end].chunks(3);
            for (number, target) in (0..).zip(targets).filter(|(_, target)| **target != [0; 3]) {
                let quarters = i32::from(u16::from_le_bytes([target[0], target[1]]));
                let target = Target {
                    number,
                    distance: I24F8::from_bits(quarters << 6),
                    confidence: target[2],
                    signal: None,
                    noise: None,
                    crosstalk: None,
                };
                given.push(SinkCall::Target(u16::try_from(10 + zone).unwrap(), target));
            }
        }
        given
    }

    /// A poll is over; `ends` if the measurement is.
    fn end(&mut self, ends: bool) {
        if let Some((_, _, data, _)) = self.frame
            && self.bytes.len() == data + 12
        {
            self.whole += u32::from(self.bytes.ends_with(&[0xF7, 0xE0]));
            self.frame = None;
        }
        if ends {
            (self.frame, self.has_ended) = (None, true);
        }
        self.has_gap = false;
    }
}

/// Does one fault, of the bus or of the chip.
fn fault<B>(bench: &Bench<CHUNK, B>, rng: &mut Pcg32) {
    let random = rng.next_u32();
    let byte = random.to_le_bytes()[3];
    let of_the_bus = [
        Fault::Nack,
        Fault::Late,
        Fault::All(0),
        Fault::All(0xFF),
        Fault::All(byte),
        Fault::Bit(usize::from(byte), byte),
    ];
    let kind = random % 13;
    if let Some(&fault) = of_the_bus.get(kind as usize) {
        return bench.bus.fail_next(fault);
    }
    let mut wires = bench.bus.0.borrow_mut();
    match kind {
        6 => wires.stuck = Some(byte & 1 == 0),
        7 => wires.is_unplugged = true,
        8 => wires.chip.reset(),
        9 => {
            // Cut off in the middle.
            let half = wires.chip.fifo.len() / 2;
            wires.chip.fifo.truncate(half);
        }
        10 => {
            let half = wires.chip.fifo.len() / 2;
            wires.chip.fifo.drain(..half);
            wires.chip.set(0xFA, 0x20);
        }
        11 => wires.chip.number = wires.chip.number.wrapping_add(1 + u32::from(byte)),
        _ => wires.chip.flags = byte,
    }
}

/// Polls with faults, then without. How many faults, errors, frames, and gaps in their numbers there were.
fn survive<B: Wired<Error: Debug>>(zones: Zones, seed: u64) -> [u32; 4] {
    let mut rng = Pcg32::seed_from_u64(seed);
    let one_in = 1 << (3 + rng.next_u32() % 7);
    let mut bench = Bench::<CHUNK, B>::new(over::<B>(settings(zones)));
    let mut oracle = Oracle::new([0, 2, 3, 4, 5][zones as usize]);
    let (mut faults, mut errors, mut gaps) = (0, 0, 0);
    for polls in 0..40_000u32 {
        let goes_wrong = polls < 30_000 && rng.next_u32().is_multiple_of(one_in);
        if goes_wrong {
            fault(&bench, &mut rng);
            faults += 1;
        } else if rng.next_u32().is_multiple_of(32) || polls >= 30_000 {
            let mut wires = bench.bus.0.borrow_mut();
            (wires.stuck, wires.is_unplugged) = (None, false);
            wires.chip.flags = 1;
        }
        if rng.next_u32().is_multiple_of(4) {
            bench.now_ms = bench.now_ms.wrapping_add(1);
        }
        bench.bus.0.borrow_mut().log.clear();
        let polled = bench.sensor.poll(bench.now_ms, &mut bench.sink);
        let log = std::mem::take(&mut bench.bus.0.borrow_mut().log);
        assert!(log.len() <= MOST, "{} transfers", log.len());
        let chunks = log.iter().filter(|(written, _)| written[0] == 0xFF);
        assert!(chunks.count() <= 1);
        let mut expected = Vec::new();
        for (written, read) in &log {
            expected.extend(oracle.see(written, read.as_deref()));
        }
        assert!(bench.sink.take() == expected, "{polled:?}");
        let is_missed = matches!(polled, Err(Error::Device(DeviceError::Missed { .. })));
        assert_eq!(is_missed, oracle.has_gap, "{polled:?}");
        gaps += u32::from(is_missed);
        let is_aborted = matches!(polled, Err(Error::Device(DeviceError::Aborted { .. })));
        oracle.end(polled.is_err() && !is_missed && !is_aborted);
        errors += u32::from(polled.is_err());
        let counts = bench.sensor.counts();
        assert_eq!((counts.errors, counts.missed), (errors, oracle.missed));
        if polls == 30_000 {
            bench.sensor.start(U16F16::ZERO, Dither::OFF);
            oracle.end(true);
        }
        if polls > 35_000 {
            assert!(polled.is_ok(), "{polled:?} of {errors}");
        }
    }
    assert!(bench.sensor.is_measuring());
    let counts = bench.sensor.counts();
    assert_eq!(counts.frames, oracle.begun);
    let present = u32::from(oracle.frame.is_some());
    assert_eq!(counts.broken, oracle.begun - oracle.whole - present);
    assert_eq!(counts.histograms, oracle.histograms);
    assert!(counts.frames > 20, "{counts:?}");
    [faults, errors, counts.frames, gaps]
}

fn fifty_thousand_faults<B: Wired<Error: Debug>>(bus: &str) {
    let (mut sums, mut seed) = ([0u64; 4], 0);
    while sums[0] < FAULTS {
        let zones = Zones::ALL[usize::try_from(seed).unwrap() % 5];
        for (sum, more) in sums.iter_mut().zip(survive::<B>(zones, seed)) {
            *sum += u64::from(more);
        }
        seed += 1;
    }
    let [faults, errors, frames, gaps] = sums;
    assert!(gaps > 100, "{gaps}");
    println!(
        "faults: TMF8829 over {bus}, {faults} faults: {errors} errors counted, {frames} frames, {gaps} gaps in \
         their numbers, each counted in full, 0 panics, nothing given that was not on the bus, right again each time"
    );
}

#[test]
fn fifty_thousand_faults_over_i2c() {
    fifty_thousand_faults::<Bus>("I2C");
}

#[test]
fn fifty_thousand_faults_over_spi() {
    fifty_thousand_faults::<Spi<Bus>>("SPI");
}

//! The TMF8829, as its data sheet and published drivers have it.

use dtof_core::PixelAddress;
use dtof_sensors::tmf8829::{Config, Settings, Tmf8829, Zones};

use super::bus::{Answer, Bus, Chip, Pin};
use super::{Given, Model, drive};
use crate::Input;

const FIRST: u16 = 10;
const REFERENCE: u16 = 3000;
const HEADER: usize = 21;
const END: usize = 12;
/// Four references of 64 bins, and half of the 16×16 zones.
const HISTOGRAMS: usize = 3 * 64 * (4 + 128);
/// Two targets of three bytes.
const RESULTS: usize = 256 * 6;

/// After a reset its bootloader runs. While it measures it always has the next frame of 16×16
/// zones: two of histograms, and one of results.
#[derive(Default)]
struct Tmf {
    is_loaded: bool,
    status: u8,
    frame: u32,
    at: usize,
}

impl Chip for Tmf {
    fn write(&mut self, bytes: &[u8]) {
        let &[0x08, command, ..] = bytes else {
            return;
        };
        if !self.is_loaded {
            self.is_loaded = command == 0x16;
            return;
        }
        self.status = u8::from(command == 0x10);
        self.at = 0;
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) {
        match (register, bytes) {
            (0x00, [application]) => *application = if self.is_loaded { 0x01 } else { 0x80 },
            (0x08, [status]) => *status = self.status,
            (0x20, [page]) => *page = 0x43,
            (0xe1, [interrupt]) => *interrupt = if self.interrupts() { 0x09 } else { 0x00 },
            (0xe3, [id]) => *id = 0x9e,
            (0xf8, [enable]) => *enable = 0x84,
            (0xfa | 0xff, bytes) => bytes.iter_mut().for_each(|byte| *byte = self.next()),
            (register, bytes) => panic!("{} bytes of {register:#04x}", bytes.len()),
        }
    }

    fn interrupts(&self) -> bool {
        self.status == 1
    }
}

impl Tmf {
    fn next(&mut self) -> u8 {
        let slot = self.frame % 3;
        let (data, id, part) = match slot {
            2 => (RESULTS, 0x12, 2),
            slot => (HISTOGRAMS, 0x22, slot as u8),
        };
        let length = HEADER + data + END;
        let [low, high, ..] = (length - 9).to_le_bytes();
        let byte = match (self.at, length - self.at) {
            (5, _) => id,
            (6, _) => part,
            (7, _) => low,
            (8, _) => high,
            (at @ 9..13, _) => self.frame.to_le_bytes()[at - 9],
            (..HEADER, _) => 0,
            (_, 4) => 1,
            (_, 2) => 0xf7,
            (_, 1) => 0xe0,
            (at, _) => (at as u8).wrapping_mul(31),
        };
        self.at += 1;
        if self.at == length {
            (self.frame, self.at) = (self.frame.wrapping_add(1), 0);
        }
        byte
    }
}

/// A frame as it was seen: its slot, or none of results, and its data and end so far.
struct Frames {
    has_reference: bool,
    frame: Option<(Option<usize>, Vec<u8>)>,
}

impl Frames {
    fn length(slot: Option<usize>) -> usize {
        END + slot.map_or(RESULTS, |_| HISTOGRAMS)
    }

    fn header(bytes: &[u8]) -> Option<Option<usize>> {
        let payload = usize::from(u16::from_le_bytes([bytes[7], bytes[8]]));
        let slot = match bytes[5..7] {
            [0x22, part @ 0..2] => Some(usize::from(part)),
            [0x12, 2] => None,
            _ => return None,
        };
        let fits = bytes[0] & 0x20 == 0 && payload == HEADER + Self::length(slot) - 9;
        fits.then_some(slot)
    }

    /// The histograms of which the last byte came behind `before`.
    fn given(&self, slot: usize, data: &[u8], before: usize, given: &mut Vec<Given>) {
        for index in 0..132 {
            let end = 192 * (index + 1);
            if end <= before || end > data.len() {
                continue;
            }
            let words = data[end - 192..end].chunks(3);
            let mut counts: Vec<u32> = words
                .map(|word| u32::from_le_bytes([word[0], word[1], word[2], 0]))
                .collect();
            counts.resize(128, 0);
            let pixel = match index.checked_sub(4) {
                Some(zone) => FIRST + (16 * (zone / 8) + zone % 8 + 8 * slot) as u16,
                None if self.has_reference => REFERENCE + index as u16,
                None => continue,
            };
            given.push(Given::Histogram(pixel, counts));
        }
    }
}

impl Model<Tmf> for Frames {
    fn restart(&mut self) {
        self.frame = None;
    }

    fn check(&mut self, answers: &[Answer], failed: bool, given: &[Given]) {
        let mut expected = Vec::new();
        let mut ended = false;
        for answer in answers {
            match (answer.register, answer.bytes.len()) {
                (0xfa, HEADER) => {
                    self.frame = Self::header(&answer.bytes).map(|slot| (slot, Vec::new()));
                    if let Some((Some(_), _)) = self.frame {
                        expected.push(Given::Frame(586 * 512));
                    }
                    // A number that was not due is an error of a good frame.
                    ended = true;
                }
                (0xff, 1..) => {
                    let Some((slot, mut data)) = self.frame.take() else {
                        continue;
                    };
                    let before = data.len();
                    data.extend(&answer.bytes);
                    if let Some(slot) = slot {
                        let all = data.len().min(HISTOGRAMS);
                        self.given(slot, &data[..all], before, &mut expected);
                    }
                    if data.len() < Self::length(slot) {
                        self.frame = Some((slot, data));
                    }
                }
                _ => {}
            }
        }
        if failed && !ended {
            self.frame = None;
        }
        assert_eq!(given, expected);
    }
}

pub fn run<const CHUNK: usize>(choice: u8, input: Input<'_>) {
    let has_reference = choice & 1 != 0;
    let settings = Settings {
        reference: has_reference.then_some(PixelAddress(REFERENCE)),
        address: if choice & 2 == 0 { 0x41 } else { 0x30 },
        data_timeout_ms: 1500,
        ..Settings::new(PixelAddress(FIRST), Zones::Z16x16)
    };
    // Of one chunk, and of more.
    let image: &[u8] = if choice & 4 == 0 {
        &[1, 2, 3]
    } else {
        &[7; 300]
    };
    let bus = Bus::<Tmf>::new(input);
    let config = Config::new(settings).expect("good settings");
    let (interrupt, enable) = (Pin(bus.clone()), Pin(bus.clone()));
    let mut sensor = Tmf8829::<_, _, _, CHUNK>::new(bus.clone(), interrupt, enable, image, config);
    let mut frames = Frames {
        has_reference,
        frame: None,
    };
    drive(&mut sensor, &bus, &mut frames);
    let counts = sensor.counts();
    assert!(counts.histograms > 0 && counts.frames >= counts.broken + counts.aborted);
}

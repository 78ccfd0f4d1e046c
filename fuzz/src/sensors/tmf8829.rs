//! The TMF8829, as its data sheet and published drivers have it.

use dtof_chips::Tmf8829 as Tmf;
use dtof_chips::tmf8829::varied_counts;
use dtof_core::PixelAddress;
use dtof_sensors::tmf8829::{Config, Interface, Settings, Tmf8829, Zones};

use super::bus::{Answer, Bus, Pin};
use super::{Model, SinkCall, drive};
use crate::Input;

const FIRST: u16 = 10;
const REFERENCE: u16 = 3000;
const HEADER: usize = 21;
const END: usize = 12;
/// Four references of 64 bins, and half of the 16×16 zones.
const HISTOGRAMS: usize = 3 * 64 * (4 + 128);
/// Two targets of three bytes.
const RESULTS: usize = 256 * 6;

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
    fn add_calls(&self, slot: usize, data: &[u8], before: usize, calls: &mut Vec<SinkCall>) {
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
            calls.push(SinkCall::Histogram(pixel, counts));
        }
    }
}

impl Model<Tmf> for Frames {
    fn restart(&mut self) {
        self.frame = None;
    }

    fn check(&mut self, answers: &[Answer], failed: bool, calls: &[SinkCall]) {
        let mut expected = Vec::new();
        let mut ended = false;
        for answer in answers {
            match (answer.register, answer.bytes.len()) {
                (0xfa, HEADER) => {
                    self.frame = Self::header(&answer.bytes).map(|slot| (slot, Vec::new()));
                    if let Some((Some(_), _)) = self.frame {
                        expected.push(SinkCall::Frame(586 * 512));
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
                        self.add_calls(slot, &data[..all], before, &mut expected);
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
        assert_eq!(calls, expected);
    }
}

pub fn run<const CHUNK: usize>(choice: u8, input: Input<'_>) {
    let has_reference = choice & 1 != 0;
    let settings = Settings {
        reference: has_reference.then_some(PixelAddress::new(REFERENCE)),
        interface: Interface::I2c {
            address: if choice & 2 == 0 { 0x41 } else { 0x30 },
        },
        data_timeout_ms: 1500,
        ..Settings::new(PixelAddress::new(FIRST), Zones::Z16x16)
    };
    // Of one chunk, and of more.
    let image: &[u8] = if choice & 4 == 0 {
        &[1, 2, 3]
    } else {
        &[7; 300]
    };
    let bus = Bus::new(Tmf::new(image, varied_counts()), input);
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

//! The TMF8820, as its published headers and drivers have it.

use dtof_core::PixelAddress;
use dtof_sensors::tmf882x::{Config, Settings, Tmf882x};

use super::bus::{Answer, Bus, Chip, Pin};
use super::{Given, Model, drive};
use crate::Input;

const FIRST: u16 = 10;
const REFERENCE: u16 = 99;
/// Bytes of a packet, and of its header.
const PACKET: usize = 135;
const HEADER: usize = 7;

/// After a reset its bootloader runs. While it measures it always has the next packet.
#[derive(Default)]
struct Tmf {
    is_loaded: bool,
    status: u8,
    packet: u8,
}

impl Chip for Tmf {
    fn write(&mut self, bytes: &[u8]) {
        let &[0x08, command, ..] = bytes else {
            return;
        };
        if !self.is_loaded {
            // RAM_REMAP_RESET starts the application.
            self.is_loaded = command == 0x11;
            return;
        }
        // STAT_OK, or STAT_ACCEPTED while it measures.
        self.status = u8::from(command == 0x10);
        self.packet = 0;
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) {
        match (register, bytes) {
            (0x00, [application]) => *application = if self.is_loaded { 0x03 } else { 0x80 },
            (0x08, [status]) => *status = self.status,
            (0x08, [status, length, checksum]) => {
                [*status, *length, *checksum] = [0x00, 0x00, 0xff];
            }
            (0x10, [mode]) => *mode = 0x00,
            (0x20, [page]) => *page = 0x16,
            (0xe0, [enable]) => *enable = 0x41,
            (0xe1, [interrupt]) => *interrupt = if self.interrupts() { 0x08 } else { 0x00 },
            (0xe3, [id]) => *id = 0x08,
            (0x20..0xa7, bytes) => {
                let from = usize::from(register - 0x20);
                bytes.copy_from_slice(&self.packet()[from..from + bytes.len()]);
                if from + bytes.len() == PACKET {
                    self.packet = (self.packet + 1) % 30;
                }
            }
            (register, bytes) => panic!("{} bytes of {register:#04x}", bytes.len()),
        }
    }

    fn interrupts(&self) -> bool {
        self.status == 1
    }
}

impl Tmf {
    fn packet(&self) -> [u8; PACKET] {
        let mut bytes = [0; PACKET];
        bytes[..HEADER].copy_from_slice(&[0x81, self.packet, 0, 0, self.packet, 128, 0]);
        for (bin, byte) in bytes[HEADER..].iter_mut().enumerate() {
            *byte = (bin as u8).wrapping_mul(31).wrapping_add(self.packet);
        }
        bytes
    }
}

/// The packets of a set so far, from number 0 on without a gap.
struct Sets {
    has_reference: bool,
    packets: Vec<Vec<u8>>,
}

impl Sets {
    /// What a packet begins or completes: packet 0 a set, three of them have the bytes of all
    /// counts of a channel.
    fn take(&mut self, packet: &[u8]) -> Option<Given> {
        let number = usize::from(packet[4]);
        if packet[0] != 0x81 || packet[5] != 128 || (number != 0 && number != self.packets.len()) {
            self.packets.clear();
            return None;
        }
        if number == 0 {
            self.packets.clear();
        }
        self.packets.push(packet[HEADER..].to_vec());
        if number == 0 {
            return Some(Given::Frame(537 * 1024));
        }
        let channel = number.checked_sub(20)?;
        let counts = (0..128).map(|bin| {
            let byte = |plane: usize| u32::from(self.packets[10 * plane + channel][bin]);
            byte(0) + 256 * byte(1) + 65536 * byte(2)
        });
        let counts = counts.collect();
        if number == 29 {
            self.packets.clear();
        }
        match channel {
            0 if self.has_reference => Some(Given::Histogram(REFERENCE, counts)),
            0 => None,
            zone => Some(Given::Histogram(FIRST - 1 + zone as u16, counts)),
        }
    }
}

impl Model<Tmf> for Sets {
    fn restart(&mut self) {
        self.packets.clear();
    }

    fn check(&mut self, answers: &[Answer], failed: bool, given: &[Given]) {
        let mut packet = Vec::new();
        let mut expected = None;
        for answer in answers {
            if (0x20..0xa7).contains(&answer.register) {
                if answer.register == 0x20 {
                    packet.clear();
                }
                packet.extend(&answer.bytes);
            }
        }
        let whole = packet.len() == PACKET;
        if whole {
            expected = self.take(&packet);
        }
        // What fails otherwise ends the measurement.
        if failed && !whole {
            self.packets.clear();
        }
        assert_eq!(given, expected.as_slice());
    }
}

pub fn run<const CHUNK: usize>(choice: u8, input: Input<'_>) {
    let has_reference = choice & 1 != 0;
    let settings = Settings {
        reference: has_reference.then_some(PixelAddress(REFERENCE)),
        address: if choice & 2 == 0 { 0x41 } else { 0x30 },
        ..Settings::new(PixelAddress(FIRST))
    };
    // Of one message, and of more.
    let image: &[u8] = if choice & 4 == 0 {
        &[1, 2, 3]
    } else {
        &[7; 300]
    };
    let bus = Bus::<Tmf>::new(input);
    let config = Config::new(settings).expect("good settings");
    let (interrupt, enable) = (Pin(bus.clone()), Pin(bus.clone()));
    let mut sensor = Tmf882x::<_, _, _, CHUNK>::new(bus.clone(), interrupt, enable, image, config);
    let mut sets = Sets {
        has_reference,
        packets: Vec::new(),
    };
    drive(&mut sensor, &bus, &mut sets);
    let counts = sensor.counts();
    assert!(counts.histograms > 0 && counts.packets >= counts.histograms);
}

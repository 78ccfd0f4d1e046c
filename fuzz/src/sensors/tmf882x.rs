//! The TMF8820, as its published headers and drivers have it.

use dtof_chips::Tmf882x as Tmf;
use dtof_core::PixelAddress;
use dtof_sensors::tmf882x::{Config, Settings, Tmf882x};

use super::bus::{Answer, Bus, Pin};
use super::{Model, SinkCall, drive};
use crate::Input;

const FIRST: u16 = 10;
const REFERENCE: u16 = 99;
/// Bytes of a packet, and of its header.
const PACKET: usize = 135;
const HEADER: usize = 7;

/// The packets of one set so far, from number 0 on without a gap.
struct PacketSet {
    has_reference: bool,
    packets: Vec<Vec<u8>>,
}

impl PacketSet {
    /// Adds a packet. Returns the call of the sink that it causes: packet 0 begins a frame. The
    /// last of the three packets with the bytes of a channel's counts completes a histogram.
    fn take(&mut self, packet: &[u8]) -> Option<SinkCall> {
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
            return Some(SinkCall::Frame(537 * 1024));
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
            0 if self.has_reference => Some(SinkCall::Histogram(REFERENCE, counts)),
            0 => None,
            zone => Some(SinkCall::Histogram(FIRST - 1 + zone as u16, counts)),
        }
    }
}

impl Model<Tmf> for PacketSet {
    fn restart(&mut self) {
        self.packets.clear();
    }

    fn check(&mut self, answers: &[Answer], failed: bool, calls: &[SinkCall]) {
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
        // An error that is not about the packet ends the measurement.
        if failed && !whole {
            self.packets.clear();
        }
        assert_eq!(calls, expected.as_slice());
    }
}

/// Counts that differ in every channel and bin and use all three bytes.
fn count(channel: u8, bin: u32) -> u32 {
    (128 * u32::from(channel) + bin).wrapping_mul(2_654_435_761) & 0xff_ffff
}

pub fn run<const CHUNK: usize>(choice: u8, input: Input<'_>) {
    let has_reference = choice & 1 != 0;
    let settings = Settings {
        reference: has_reference.then_some(PixelAddress::new(REFERENCE)),
        address: if choice & 2 == 0 { 0x41 } else { 0x30 },
        ..Settings::new(PixelAddress::new(FIRST))
    };
    // Of one message, and of more.
    let image: &[u8] = if choice & 4 == 0 {
        &[1, 2, 3]
    } else {
        &[7; 300]
    };
    let bus = Bus::new(Tmf::new(count), input);
    let config = Config::new(settings).expect("good settings");
    let (interrupt, enable) = (Pin(bus.clone()), Pin(bus.clone()));
    let mut sensor = Tmf882x::<_, _, _, CHUNK>::new(bus.clone(), interrupt, enable, image, config);
    let mut set = PacketSet {
        has_reference,
        packets: Vec::new(),
    };
    drive(&mut sensor, &bus, &mut set);
    let counts = sensor.counts();
    assert!(counts.histograms > 0 && counts.packets >= counts.histograms);
}

//! A simulated TMF8828 with 8×8 zones, written from the vendor's drivers and not from ours. It runs
//! its application; a test can make it lose packets.

use super::bus::Lit;

/// Capture, half and channel of each zone, row by row: the map of the vendor's example for 8×8
/// zones, written out.
pub const MAP: [[&str; 8]; 8] = [
    ["206", "216", "306", "316", "207", "217", "307", "317"],
    ["006", "016", "106", "116", "007", "017", "107", "117"],
    ["204", "214", "304", "314", "205", "215", "305", "315"],
    ["004", "014", "104", "114", "005", "015", "105", "115"],
    ["202", "212", "302", "312", "203", "213", "303", "313"],
    ["002", "012", "102", "112", "003", "013", "103", "113"],
    ["200", "210", "300", "310", "201", "211", "301", "311"],
    ["000", "010", "100", "110", "001", "011", "101", "111"],
];

pub struct Chip {
    /// The mode it is in, and whether it may change.
    pub mode: u8,
    pub is_fixed: bool,
    status: u8,
    pub page: [u8; 256],
    /// Packets of the present capture that were sent: up to 60, and then the result.
    pub packets_sent: u8,
    /// The number of the present capture.
    pub number: u8,
    pub is_measuring: bool,
    interrupt: u8,
    /// A result has second targets, half a metre behind the first ones.
    pub has_second_targets: bool,
}

impl Chip {
    pub fn new(number: u8) -> Self {
        Self {
            mode: 0,
            is_fixed: false,
            status: 0,
            page: [0; 256],
            packets_sent: 0,
            number,
            is_measuring: false,
            interrupt: 0,
            has_second_targets: false,
        }
    }

    fn command(&mut self, command: u8) {
        self.status = 0;
        match command {
            0x6C if self.is_fixed => {}
            0x6C => self.mode = 8,
            0x16 => self.page[0x20] = 0x16,
            0x15 => {}
            0x10 => {
                (self.is_measuring, self.status, self.packets_sent) = (true, 1, 0);
                self.interrupt = 0x08;
            }
            0xFF => (self.is_measuring, self.interrupt) = (false, 0),
            _ => self.status = 8,
        }
    }

    /// The next packet, or the result after 60 packets.
    pub fn packet(&self) -> Vec<u8> {
        let capture = self.number % 4;
        let mut bytes = vec![0; 135];
        if self.packets_sent == 60 {
            bytes[..8].copy_from_slice(&[0x10, 9, 128, 0, self.number, 30, 9, 0]);
            for entry in 0..18 {
                let (half, channel) = (entry / 9, entry % 9);
                let mm = match zone(capture, half, channel) {
                    Some(zone) => 1000 + zone,
                    None => 9999,
                };
                let [low, high] = mm.to_le_bytes();
                let at = 24 + 3 * usize::from(entry);
                bytes[at..at + 3].copy_from_slice(&[100 + half, low, high]);
            }
            if self.has_second_targets {
                for entry in 18..36 {
                    let at = 24 + 3 * entry;
                    let [first_low, first_high] = [bytes[at - 53], bytes[at - 52]];
                    let mm = 500 + u16::from_le_bytes([first_low, first_high]);
                    let [low, high] = mm.to_le_bytes();
                    bytes[at..at + 3].copy_from_slice(&[50, low, high]);
                }
                return bytes;
            }
            // No second targets: they have no confidence, or no distance.
            for (entry, none) in (18..36).zip([[0, 200, 1], [100, 0, 0]].into_iter().cycle()) {
                let at = 24 + 3 * entry;
                bytes[at..at + 3].copy_from_slice(&none);
            }
            return bytes;
        }
        let (half, n) = (self.packets_sent / 30, self.packets_sent % 30);
        bytes[..7].copy_from_slice(&[0x81, self.packets_sent, 0, 0, n, 128, half]);
        let (plane, channel) = (usize::from(n / 10), n % 10);
        let zone = channel.checked_sub(1).and_then(|k| zone(capture, half, k));
        for (bin, byte) in (0..).zip(&mut bytes[7..]) {
            *byte = count(zone, bin).to_le_bytes()[plane];
        }
        bytes
    }

    /// Goes on to the next packet: the last one was read, or is lost.
    pub fn next(&mut self) {
        if self.packets_sent == 60 {
            (self.packets_sent, self.number) = (0, self.number.wrapping_add(1));
        } else {
            self.packets_sent += 1;
        }
        self.interrupt = if self.packets_sent == 60 { 0x02 } else { 0x08 };
    }
}

impl dtof_chips::Chip for Chip {
    fn write(&mut self, bytes: &[u8]) {
        match bytes {
            [0x08, command] => self.command(*command),
            [register, data @ ..] => {
                let at = usize::from(*register);
                self.page[at..at + data.len()].copy_from_slice(data);
            }
            [] => panic!("a register"),
        }
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) {
        match (register, &mut *bytes) {
            (0x00, [id]) => *id = 0x03,
            (0x08, [status]) => *status = self.status,
            (0x10, [mode]) => *mode = self.mode,
            (0xE0, [enable]) => *enable = 0x41,
            (0xE1, [interrupt]) => *interrupt = self.interrupt,
            (0xE3, [id]) => *id = 0x08,
            (0x20, [page]) if !self.is_measuring => *page = self.page[0x20],
            (at, bytes) => {
                let from = usize::from(at - 0x20);
                bytes.copy_from_slice(&self.packet()[from..from + bytes.len()]);
                if from + bytes.len() == 135 {
                    self.next();
                }
            }
        }
    }

    fn interrupts(&self) -> bool {
        self.is_measuring
    }

    fn reset(&mut self) {
        (self.mode, self.is_measuring) = (0, false);
    }
}

impl Lit for Chip {
    fn fresh() -> Self {
        Self::new(0)
    }
    fn shines(&self) -> bool {
        self.is_measuring
    }
    fn leave_on(&mut self) {
        self.is_measuring = true;
    }
}

/// The zone of a channel.
pub fn zone(capture: u8, half: u8, channel: u8) -> Option<u16> {
    let name = format!("{capture}{half}{channel}");
    let at = MAP.concat().iter().position(|other| *other == name)?;
    u16::try_from(at).ok()
}

/// Counts that differ between zones, and from those of a channel without a zone.
pub fn count(zone: Option<u16>, bin: u32) -> u32 {
    let zone = zone.map_or(255, u32::from);
    zone << 16 | (bin * 7 + zone) & 0xFFFF
}

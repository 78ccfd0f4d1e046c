//! The TMF8829, as its data sheet, application note and published drivers have it: registers,
//! bootloader, configuration page, FIFO and frames. Tests can make it fail.

use std::collections::VecDeque;
use std::rc::Rc;

use crate::Chip;

/// The counts of a zone (measurement, x, y) or, with `None`, of reference r.
pub type Scene = Rc<dyn Fn(u32, Option<(usize, usize)>, usize) -> Vec<u32>>;

/// A frame's number of zones, sub-frames, and columns of zones of a histogram frame.
#[must_use]
pub const fn shape(mode: u8) -> (usize, usize, u8) {
    match mode {
        0 => (8, 8, 2),
        2 => (16, 16, 2),
        3 | 4 => (32, 32, 8),
        5 => (48, 32, 12),
        _ => panic!("no such mode"),
    }
}

/// The zones of sub-frame s in the order of their histograms, as the application note lists them.
#[must_use]
pub fn order(mode: u8, s: usize) -> Vec<(usize, usize)> {
    let mut zones = Vec::new();
    match mode {
        0 => (0..8).for_each(|i| (0..4).for_each(|j| zones.push((j + 4 * s, i)))),
        2 => (0..16).for_each(|i| (0..8).for_each(|j| zones.push((j + 8 * s, i)))),
        3 | 4 => (0..16).for_each(|i| {
            (0..8).for_each(|j| zones.push((2 * j + 16 * (s & 1) + (s >> 1 & 1), 2 * i + s / 4)));
        }),
        _ => (0..16).for_each(|i| {
            (0..8).for_each(|j| zones.push((3 * j + 24 * (s & 1) + s / 2 % 3, 2 * i + s / 6)));
        }),
    }
    zones
}

/// Header and footer around data; the payload counts all but nine bytes.
#[must_use]
pub fn frame(id: u8, part: u8, number: u32, data: &[u8], flags: u8) -> Vec<u8> {
    let payload = u16::try_from(21 + data.len() + 12 - 9).unwrap();
    let mut bytes = vec![0x00, 0xA0, 0x86, 0x01, 0x00, id, part];
    bytes.extend(payload.to_le_bytes());
    bytes.extend(number.to_le_bytes());
    bytes.extend([0x19, 0x1A, 0xFF, 0x4A, 0xA0, 0x05, 0xA1, 0x05]);
    bytes.extend(data);
    bytes.extend([0x18, 0x73, 0x01, 0x00, 0x95, 0x7A, 0x01, 0x00]);
    bytes.extend([flags, 0x00, 0xF7, 0xE0]);
    bytes
}

/// Counts that differ in every bin and use all three bytes.
#[must_use]
pub fn varied_counts() -> Scene {
    Rc::new(|measurement, zone, bins| {
        let (zone, bins) = match zone {
            Some((x, y)) => (64 * y + x, bins),
            None => (5000 + bins, 64),
        };
        let seed = u32::try_from(zone).unwrap() * 7919 + measurement * 104_729;
        let count = |bin: u32| (seed + bin).wrapping_mul(2_654_435_761) & 0xff_ffff;
        (0..u32::try_from(bins).unwrap()).map(count).collect()
    })
}

/// A TMF8829 on its I²C or SPI bus.
pub struct Tmf8829 {
    registers: [u8; 256],
    /// RAM from `0x0001_0000` on, as far as it was uploaded.
    pub ram: Vec<u8>,
    /// What an upload has to bring.
    pub image: Vec<u8>,
    /// Bytes that the bootloader waits for.
    upload: usize,
    is_switched_on: bool,
    /// The command that is not answered yet, and what the answer will be.
    pending: Option<u8>,
    /// Bytes of the FIFO that are still to be read.
    pub fifo: VecDeque<u8>,
    /// Of the present measurement: frames to come.
    queue: VecDeque<(u8, u8)>,
    /// A frame is as it should be with 1.
    pub flags: u8,
    measurement: u32,
    /// The number of the next frame.
    pub number: u32,
    /// It measures.
    pub is_measuring: bool,
    /// The counts of its histograms.
    pub scene: Scene,
    /// Frames sent: kind, part, number.
    pub sent: Vec<(u8, u8, u32)>,
    /// It presents no frame of its own.
    pub is_halted: bool,
    /// Its processor is never ready.
    pub is_dead: bool,
    /// The I²C address it answers at.
    pub address: u8,
    /// The command that switched the other bus off: 0x20 SPI, 0x22 I²C.
    pub off: Option<u8>,
}

impl Tmf8829 {
    /// Just switched on. It starts only after an upload of `image`.
    #[must_use]
    pub fn new(image: &[u8], scene: Scene) -> Self {
        let mut chip = Self {
            registers: [0; 256],
            ram: Vec::new(),
            image: image.to_vec(),
            upload: 0,
            is_switched_on: false,
            pending: None,
            fifo: VecDeque::new(),
            queue: VecDeque::new(),
            flags: 1,
            measurement: 0,
            number: 100,
            is_measuring: false,
            scene,
            sent: Vec::new(),
            is_halted: false,
            is_dead: false,
            address: 0x41,
            off: None,
        };
        chip.reset();
        chip
    }

    /// As if it had been loaded and switched on.
    pub fn run(&mut self) {
        self.registers[0x00] = 0x01;
        self.registers[0xF8] = 0x80 | 0x24;
        self.is_switched_on = true;
    }

    /// From there into standby.
    pub fn stand_by(&mut self) {
        self.registers[0xF8] = 0x28;
        self.is_switched_on = false;
    }

    /// Its register ENABLE.
    #[must_use]
    pub fn enable(&self) -> u8 {
        self.registers[0xF8]
    }

    /// One transaction on SPI: what the host sends, and room for what it reads behind it.
    pub fn spi(&mut self, sent: &[u8], read: &mut [u8]) {
        match sent {
            // It does not drive MISO.
            _ if self.off == Some(0x20) => read.fill(0xFF),
            [0x02, bytes @ ..] if read.is_empty() => self.write(bytes),
            // One dummy byte, and the data behind it.
            &[0x03, register, _] => self.read(register, read),
            other => panic!("{other:02x?} is not of this SPI"),
        }
    }

    fn stop(&mut self) {
        self.is_measuring = false;
        self.registers[0xE1] = 0;
        self.fifo.clear();
        self.queue.clear();
    }

    /// The value of a register.
    #[must_use]
    pub fn page(&self, register: u8) -> u8 {
        self.registers[usize::from(register)]
    }

    /// Sets a register.
    pub fn set(&mut self, register: u8, value: u8) {
        self.registers[usize::from(register)] = value;
    }

    /// The last command has this answer instead of its own.
    pub fn answer(&mut self, status: u8) {
        self.pending = None;
        self.registers[0x08] = status;
    }

    fn boot(&mut self, data: &[u8]) {
        self.registers[0x08] = match *data {
            [bus @ (0x20 | 0x22)] => {
                self.off = Some(bus);
                0
            }
            [0x45, 6, 0x00, 0x00, 0x01, 0x00, low, high] => {
                let words = usize::from(u16::from_le_bytes([low, high]));
                assert!((1..=0x1000).contains(&words));
                (self.upload, self.ram) = (4 * words, Vec::new());
                0
            }
            [0x16] => {
                let mut image = self.image.clone();
                image.resize(image.len().next_multiple_of(4), 0);
                // Another program does not start, nor one with both buses on.
                if self.ram == image && self.off.is_some() {
                    self.registers[0x00] = 0x01;
                }
                0
            }
            _ => 1,
        };
    }

    fn command(&mut self, command: u8) {
        if command == 0xFF {
            self.stop();
        }
        // The answer stands at the new address.
        if command == 0x15 {
            self.address = self.registers[0x90] >> 1;
        }
        self.pending = Some(command);
        self.registers[0x08] = command;
    }

    /// It is done, when the host has asked once.
    fn finish(&mut self, command: u8) {
        self.registers[0x09] = command;
        self.registers[0x08] = match command {
            // After a page was loaded. A bus that lies may have told the host that it was.
            0x10 if self.registers[0x20] != 0 => {
                self.is_measuring = true;
                self.next_frame();
                1
            }
            0x40..=0x48 => {
                self.registers[0x22..=0xDF].fill(0);
                self.registers[0x20] = command;
                self.registers[0x21] = 190;
                self.registers[0x26] = [0, 0, 0, 2, 2, 4, 4, 5, 5][usize::from(command - 0x40)];
                self.registers[0x90] = 0x41 << 1;
                0
            }
            0x15 | 0xFF => 0,
            _ => 8,
        };
    }

    /// The next frame stands ready, if the one before has been read.
    fn next_frame(&mut self) {
        if !self.is_measuring || self.is_halted || !self.fifo.is_empty() {
            return;
        }
        let (mode, format) = (self.registers[0x26], self.registers[0x2A]);
        let slots = shape(mode).2;
        if self.queue.is_empty() {
            let halves = if slots > 2 { 2 } else { 1 };
            for half in 0..halves {
                let of_half = slots / halves;
                let frames = (0..of_half).map(|s| (0x20, s + half * of_half));
                self.queue
                    .extend(frames.chain([(0x10, format | half << 6)]));
            }
        }
        let (kind, part) = self.queue.pop_front().unwrap();
        let data = match kind {
            0x20 => self.histograms(mode, usize::from(part)),
            _ => self.results(mode, part),
        };
        let bytes = frame(kind | mode, part, self.number, &data, self.flags);
        self.sent.push((kind, part, self.number));
        self.present(&bytes, if kind == 0x20 { 8 } else { 1 });
        self.number = self.number.wrapping_add(1);
        if self.queue.is_empty() {
            self.measurement += 1;
        }
    }

    /// Puts a frame into the FIFO, FIFOSTATUS and systick first.
    pub fn present(&mut self, bytes: &[u8], interrupt: u8) {
        self.registers[0xFA..=0xFE].copy_from_slice(&bytes[..5]);
        self.fifo = bytes[5..].iter().copied().collect();
        self.registers[0xE1] |= interrupt;
    }

    fn histograms(&self, mode: u8, s: usize) -> Vec<u8> {
        let bins = if mode == 0 { 256 } else { 64 };
        let mut data = Vec::new();
        let mut add = |counts: Vec<u32>, bins| {
            assert_eq!(counts.len(), bins);
            data.extend(counts.iter().flat_map(|count| {
                let [low, middle, high, 0] = count.to_le_bytes() else {
                    panic!("24 bits");
                };
                [low, middle, high]
            }));
        };
        for reference in 0..4 {
            add((self.scene)(self.measurement, None, reference), 64);
        }
        for zone in order(mode, s) {
            add((self.scene)(self.measurement, Some(zone), bins), bins);
        }
        assert_eq!(data.len(), 25_344);
        data
    }

    /// Two targets a zone: at its own number in quarters of a millimetre, and none.
    fn results(&self, mode: u8, format: u8) -> Vec<u8> {
        let (columns, rows, slots) = shape(mode);
        let step = if slots > 2 { 2 } else { 1 };
        let first = usize::from(format >> 6 & 1);
        let zones = (first..rows).step_by(step);
        let zones = zones.flat_map(|y| (0..columns).map(move |x| y * columns + x));
        let mut data = Vec::new();
        for zone in zones {
            if format & 0x10 != 0 {
                data.extend([7, 0]);
            }
            if format & 0x20 != 0 {
                data.extend([9, 0]);
            }
            for peak in 0..format & 7 {
                let [low, high] = u16::try_from(zone + 1).unwrap().to_le_bytes();
                data.extend(if peak == 0 { [low, high, 41] } else { [0; 3] });
                if format & 8 != 0 {
                    data.extend([3, 0x80]);
                }
            }
        }
        data
    }
}

impl Chip for Tmf8829 {
    fn write(&mut self, bytes: &[u8]) {
        let (&register, data) = bytes.split_first().expect("a register");
        match (register, data) {
            (0x08, data) if self.registers[0x00] == 0x80 => self.boot(data),
            (0x08, &[command]) => self.command(command),
            (0xFF, data) => {
                // More than was announced is not taken.
                let data = &data[..data.len().min(self.upload)];
                self.ram.extend(data);
                self.upload -= data.len();
                if !data.is_empty() {
                    self.registers[0x08] = if self.upload == 0 { 0 } else { 4 };
                }
            }
            (0xF8, &[enable]) => {
                self.is_switched_on = enable & 0x04 != 0;
                self.registers[0xF8] = enable & 0x7F;
            }
            (register, data) => {
                for (register, &value) in (usize::from(register)..).zip(data) {
                    match register {
                        0x22..=0xDF | 0xE2 => self.registers[register] = value,
                        0xE1 => self.registers[0xE1] &= !value,
                        _ => panic!("{register:#04x} is not to be written"),
                    }
                }
            }
        }
    }

    fn read(&mut self, register: u8, bytes: &mut [u8]) {
        let mut at = register;
        for byte in bytes {
            *byte = match at {
                0xFF => self.fifo.pop_front().unwrap_or(0),
                0x08 => {
                    let now = self.registers[0x08];
                    if let Some(command) = self.pending.take() {
                        self.finish(command);
                    }
                    now
                }
                0xF8 => {
                    let now = self.registers[0xF8];
                    if self.is_switched_on && !self.is_dead {
                        self.registers[0xF8] |= 0x80;
                    }
                    now
                }
                at => self.registers[usize::from(at)],
            };
            at = at.saturating_add(1);
        }
        if register >= 0xFA {
            self.next_frame();
        }
    }

    fn interrupts(&self) -> bool {
        self.registers[0xE1] & self.registers[0xE2] != 0
    }

    /// As after power-up: the bootloader runs.
    fn reset(&mut self) {
        self.registers = [0; 256];
        self.registers[0x00] = 0x80;
        self.registers[0xE3] = 0x9E;
        self.ram.clear();
        self.is_switched_on = false;
        (self.upload, self.pending) = (0, None);
        self.stop();
        self.address = 0x41;
        self.off = None;
    }
}

//! Two wires, and a device that watches them.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use dtof_sensors::i2c::SoftwareI2c;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

pub const ADDRESS: u8 = 0x41;
/// The period of 400 kHz; how often a rising SCL is looked at.
pub const PERIOD_NS: u64 = 2500;
pub const LOOK_NS: u64 = 100;

/// What the device sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    Start,
    /// An address, and whether it reads.
    Address(u8, bool),
    Written(u8),
    /// A byte, and whether it is acknowledged.
    Read(u8, bool),
    Stop,
}

#[derive(Clone, Copy, Default)]
pub enum Phase {
    /// Not addressed.
    #[default]
    Idle,
    /// Takes bits, the most significant first: the byte so far, its bits, and whether it
    /// is an address.
    Receive(u8, u8, bool),
    /// Acknowledges; then it sends or takes bytes.
    Acknowledge { sends: bool },
    /// Sends a byte, of which so many bits are out.
    Send(u8, u8),
    /// Is acknowledged, or not: SDA is high.
    Acknowledged(u8, bool),
}

/// Two wires and a device on them.
#[derive(Default)]
pub struct Wires {
    pub now_ns: u64,
    /// What the controller and the device each let go of.
    pub controller: [bool; 2],
    pub device: [bool; 2],
    /// What a wire takes to rise, and since when it does.
    pub rise_ns: u64,
    pub free_since: [Option<u64>; 2],
    pub phase: Phase,
    pub seen: Vec<Seen>,
    /// Sends 0, 1, 2 and so on.
    pub next: u8,
    /// Takes so many bytes.
    pub takes: usize,
    /// Holds SCL low for so long after each byte.
    pub stretch_ns: u64,
    pub stretched_until: u64,
    /// How often SCL has fallen, and a wire that is low for good from one of the
    /// falls on.
    pub falls: usize,
    pub stuck: Option<(usize, usize)>,
    /// When SCL last rose and fell.
    pub rose_ns: u64,
    pub fell_ns: u64,
    pub shortest_high: u64,
    pub shortest_low: u64,
    pub shortest_period: u64,
    /// Of the periods without START and STOP.
    pub longest_period: u64,
    pub is_plain_period: bool,
    /// From SCL's fall to the controller's next change of SDA.
    pub shortest_hold: u64,
}

pub const SCL: usize = 0;
pub const SDA: usize = 1;

impl Wires {
    fn new() -> Self {
        Self {
            now_ns: 1_000_000,
            controller: [true; 2],
            device: [true; 2],
            free_since: [Some(0); 2],
            takes: usize::MAX,
            shortest_high: u64::MAX,
            shortest_low: u64::MAX,
            shortest_period: u64::MAX,
            shortest_hold: u64::MAX,
            ..Self::default()
        }
    }

    pub fn level(&self, wire: usize) -> bool {
        self.free_since[wire].is_some_and(|since| since + self.rise_ns <= self.now_ns)
    }

    /// A wire begins to rise once it is not held any more.
    fn settle(&mut self) {
        for wire in [SCL, SDA] {
            let stretched = wire == SCL && self.now_ns < self.stretched_until;
            let is_stuck =
                (self.stuck).is_some_and(|(stuck, fall)| stuck == wire && self.falls >= fall);
            let is_free = self.controller[wire] && self.device[wire] && !stretched && !is_stuck;
            self.free_since[wire] = match self.free_since[wire] {
                _ if !is_free => None,
                None => Some(self.now_ns),
                since => since,
            };
        }
    }

    /// Something else about the wires changes, the time or who holds them.
    fn change(&mut self, change: impl FnOnce(&mut Self)) {
        let before = [self.level(SCL), self.level(SDA)];
        change(self);
        self.settle();
        self.see(before);
        // What the device lets go of.
        self.settle();
    }

    /// The device holds a wire, or does not, whatever it is doing.
    pub fn hold(&mut self, wire: usize, holds: bool) {
        self.device[wire] = !holds;
        self.settle();
    }

    /// The controller drives a wire.
    fn set(&mut self, wire: usize, high: bool) {
        if wire == SDA && self.controller[SDA] != high && !self.level(SCL) {
            self.shortest_hold = self.shortest_hold.min(self.now_ns - self.fell_ns);
        }
        self.change(|wires| wires.controller[wire] = high);
    }

    pub fn wait(&mut self, ns: u32) {
        let end = self.now_ns + u64::from(ns);
        while self.now_ns < end {
            let rises = self.free_since.iter().flatten();
            let rises = rises.map(|since| since + self.rise_ns);
            let next = rises
                .chain([self.stretched_until])
                .filter(|&at| at > self.now_ns)
                .fold(end, u64::min);
            self.change(|wires| wires.now_ns = next);
        }
    }

    fn see(&mut self, [scl, sda]: [bool; 2]) {
        match (scl, self.level(SCL)) {
            (false, true) => self.rises(),
            (true, false) => self.falls(),
            (true, true) if sda && !self.level(SDA) => {
                self.seen.push(Seen::Start);
                self.is_plain_period = false;
                self.phase = Phase::Receive(0, 0, true);
            }
            (true, true) if !sda && self.level(SDA) => {
                self.seen.push(Seen::Stop);
                self.is_plain_period = false;
                self.phase = Phase::Idle;
            }
            _ => {}
        }
    }

    fn rises(&mut self) {
        if self.fell_ns > 0 {
            self.shortest_low = self.shortest_low.min(self.now_ns - self.fell_ns);
        }
        if self.rose_ns > 0 {
            let period = self.now_ns - self.rose_ns;
            self.shortest_period = self.shortest_period.min(period);
            if self.is_plain_period {
                self.longest_period = self.longest_period.max(period);
            }
        }
        self.is_plain_period = true;
        self.rose_ns = self.now_ns;
        let sda = self.level(SDA);
        match &mut self.phase {
            Phase::Receive(byte, bits, _) => {
                *byte = *byte << 1 | u8::from(sda);
                *bits += 1;
            }
            Phase::Acknowledged(_, high) => *high = sda,
            _ => {}
        }
    }

    fn falls(&mut self) {
        if self.rose_ns > 0 {
            self.shortest_high = self.shortest_high.min(self.now_ns - self.rose_ns);
        }
        self.fell_ns = self.now_ns;
        self.falls += 1;
        match self.phase {
            Phase::Receive(byte, 8, address) => {
                let taken = if address {
                    self.seen.push(Seen::Address(byte >> 1, byte & 1 == 1));
                    byte >> 1 == ADDRESS
                } else {
                    self.seen.push(Seen::Written(byte));
                    self.takes = self.takes.saturating_sub(1);
                    self.takes > 0
                };
                self.phase = Phase::Idle;
                if taken {
                    self.device[SDA] = false;
                    let sends = address && byte & 1 == 1;
                    self.phase = Phase::Acknowledge { sends };
                }
            }
            Phase::Acknowledge { sends } => {
                self.stretched_until = self.now_ns + self.stretch_ns;
                self.device[SDA] = true;
                self.phase = Phase::Receive(0, 0, false);
                if sends {
                    self.send();
                }
            }
            Phase::Send(byte, 8) => {
                self.device[SDA] = true;
                self.phase = Phase::Acknowledged(byte, true);
            }
            Phase::Send(byte, bits) => {
                self.device[SDA] = byte >> (7 - bits) & 1 == 1;
                self.phase = Phase::Send(byte, bits + 1);
            }
            Phase::Acknowledged(byte, high) => {
                self.seen.push(Seen::Read(byte, !high));
                self.phase = Phase::Idle;
                if !high {
                    self.send();
                }
            }
            Phase::Idle | Phase::Receive(..) => {}
        }
    }

    fn send(&mut self) {
        let byte = self.next;
        self.next = self.next.wrapping_add(1);
        self.device[SDA] = byte >> 7 == 1;
        self.phase = Phase::Send(byte, 1);
    }
}

#[derive(Clone)]
pub struct Wire(Rc<RefCell<Wires>>, usize);

impl ErrorType for Wire {
    type Error = Infallible;
}

impl OutputPin for Wire {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().set(self.1, false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().set(self.1, true);
        Ok(())
    }
}

impl InputPin for Wire {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.borrow().level(self.1))
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.borrow().level(self.1))
    }
}

pub struct Delay(Rc<RefCell<Wires>>);

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().wait(ns);
    }
}

pub type Bus = SoftwareI2c<Wire, Wire, Delay>;

pub fn bus() -> (Bus, Rc<RefCell<Wires>>) {
    let wires = Rc::new(RefCell::new(Wires::new()));
    let wire = |which| Wire(wires.clone(), which);
    let bus = SoftwareI2c::new(wire(SCL), wire(SDA), Delay(wires.clone()));
    (bus, wires)
}

//! The I²C bus made by software, against a device that watches the two wires:
//! what it sees, when, and that every wait ends.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use dtof_sensors::i2c::{Error, SoftwareI2c};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use embedded_hal::i2c::{I2c, Operation};
use proptest::prelude::*;

const ADDRESS: u8 = 0x41;
/// The period of 400 kHz; how often a rising SCL is looked at.
const PERIOD_NS: u64 = 2500;
const LOOK_NS: u64 = 100;

/// What the device sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Start,
    Address { address: u8, reads: bool },
    Written(u8),
    Read { byte: u8, acknowledged: bool },
    Stop,
}

#[derive(Clone, Copy)]
enum Phase {
    /// Not addressed.
    Idle,
    /// Takes bits, the most significant first.
    Receive {
        byte: u8,
        bits: u8,
        address: bool,
    },
    /// Acknowledges; then it sends or takes bytes.
    Acknowledge {
        sends: bool,
    },
    Send {
        byte: u8,
        bits: u8,
    },
    /// Is acknowledged, or not.
    Acknowledged {
        byte: u8,
        high: bool,
    },
}

/// Two wires and a device on them.
struct Wires {
    now_ns: u64,
    /// What the controller and the device each let go of.
    controller: [bool; 2],
    device: [bool; 2],
    /// What a wire takes to rise, and since when it does.
    rise_ns: u64,
    free_since: [Option<u64>; 2],
    phase: Phase,
    seen: Vec<Seen>,
    /// Sends 0, 1, 2 and so on.
    next: u8,
    /// Takes so many bytes.
    takes: usize,
    /// Holds SCL low for so long after each byte.
    stretch_ns: u64,
    stretched_until: u64,
    /// How often SCL has fallen, and a wire that is low for good from one of the
    /// falls on.
    falls: usize,
    stuck: Option<(usize, usize)>,
    /// When SCL last rose and fell.
    rose_ns: u64,
    fell_ns: u64,
    shortest_high: u64,
    shortest_low: u64,
    shortest_period: u64,
    /// Of the periods without START and STOP.
    longest_period: u64,
    is_plain_period: bool,
    /// From SCL's fall to the controller's next change of SDA.
    shortest_hold: u64,
}

const SCL: usize = 0;
const SDA: usize = 1;

impl Wires {
    fn new() -> Self {
        Self {
            now_ns: 1_000_000,
            controller: [true; 2],
            device: [true; 2],
            rise_ns: 0,
            free_since: [Some(0); 2],
            phase: Phase::Idle,
            seen: Vec::new(),
            next: 0,
            takes: usize::MAX,
            stretch_ns: 0,
            stretched_until: 0,
            falls: 0,
            stuck: None,
            rose_ns: 0,
            fell_ns: 0,
            shortest_high: u64::MAX,
            shortest_low: u64::MAX,
            shortest_period: u64::MAX,
            longest_period: 0,
            is_plain_period: false,
            shortest_hold: u64::MAX,
        }
    }

    fn level(&self, wire: usize) -> bool {
        self.free_since[wire].is_some_and(|since| since + self.rise_ns <= self.now_ns)
    }

    /// A wire begins to rise once nobody holds it any more.
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
    fn hold(&mut self, wire: usize, holds: bool) {
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

    fn wait(&mut self, ns: u32) {
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
                self.phase = Phase::Receive {
                    byte: 0,
                    bits: 0,
                    address: true,
                };
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
            Phase::Receive { byte, bits, .. } => {
                *byte = *byte << 1 | u8::from(sda);
                *bits += 1;
            }
            Phase::Acknowledged { high, .. } => *high = sda,
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
            Phase::Receive {
                byte,
                bits: 8,
                address,
            } => {
                let taken = if address {
                    self.seen.push(Seen::Address {
                        address: byte >> 1,
                        reads: byte & 1 == 1,
                    });
                    byte >> 1 == ADDRESS
                } else {
                    self.seen.push(Seen::Written(byte));
                    self.takes = self.takes.saturating_sub(1);
                    self.takes > 0
                };
                if taken {
                    self.device[SDA] = false;
                    self.phase = Phase::Acknowledge {
                        sends: address && byte & 1 == 1,
                    };
                } else {
                    self.phase = Phase::Idle;
                }
            }
            Phase::Acknowledge { sends } => {
                self.stretched_until = self.now_ns + self.stretch_ns;
                self.device[SDA] = true;
                if sends {
                    self.send();
                } else {
                    self.phase = Phase::Receive {
                        byte: 0,
                        bits: 0,
                        address: false,
                    };
                }
            }
            Phase::Send { byte, bits: 8 } => {
                self.device[SDA] = true;
                self.phase = Phase::Acknowledged { byte, high: true };
            }
            Phase::Send { byte, bits } => {
                self.device[SDA] = byte >> (7 - bits) & 1 == 1;
                self.phase = Phase::Send {
                    byte,
                    bits: bits + 1,
                };
            }
            Phase::Acknowledged { byte, high } => {
                self.seen.push(Seen::Read {
                    byte,
                    acknowledged: !high,
                });
                if high {
                    self.phase = Phase::Idle;
                } else {
                    self.send();
                }
            }
            Phase::Idle | Phase::Receive { .. } => {}
        }
    }

    fn send(&mut self) {
        let byte = self.next;
        self.next = self.next.wrapping_add(1);
        self.device[SDA] = byte >> 7 == 1;
        self.phase = Phase::Send { byte, bits: 1 };
    }
}

#[derive(Clone)]
struct Wire(Rc<RefCell<Wires>>, usize);

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

struct Delay(Rc<RefCell<Wires>>);

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().wait(ns);
    }
}

type Bus = SoftwareI2c<Wire, Wire, Delay>;

fn bus() -> (Bus, Rc<RefCell<Wires>>) {
    let wires = Rc::new(RefCell::new(Wires::new()));
    let wire = |which| Wire(wires.clone(), which);
    let bus = SoftwareI2c::new(wire(SCL), wire(SDA), Delay(wires.clone()));
    (bus, wires)
}

/// A transaction: what is written, or how many bytes are read.
#[derive(Clone, Debug)]
enum Part {
    Write(Vec<u8>),
    Read(usize),
}

/// What the contract of `embedded_hal::i2c::I2c::transaction` makes a device see.
fn expected(parts: &[Part]) -> Vec<Seen> {
    let parts: Vec<&Part> = parts
        .iter()
        .filter(|part| !matches!(part, Part::Read(0)))
        .collect();
    let reads = |part: &Part| matches!(part, Part::Read(_));
    let mut seen = Vec::new();
    let mut next = 0;
    for (index, part) in parts.iter().enumerate() {
        if index == 0 || reads(parts[index - 1]) != reads(part) {
            seen.push(Seen::Start);
            seen.push(Seen::Address {
                address: ADDRESS,
                reads: reads(part),
            });
        }
        match part {
            Part::Write(bytes) => seen.extend(bytes.iter().copied().map(Seen::Written)),
            Part::Read(count) => {
                let goes_on = parts.get(index + 1).is_some_and(|next| reads(next));
                for left in (0..*count).rev() {
                    seen.push(Seen::Read {
                        byte: next,
                        acknowledged: left > 0 || goes_on,
                    });
                    // A device sends what it has got ready anew after a START.
                    next += 1;
                }
            }
        }
    }
    if !parts.is_empty() {
        seen.push(Seen::Stop);
    }
    seen
}

fn run(bus: &mut Bus, parts: &[Part]) -> Result<Vec<u8>, Error> {
    let mut buffers: Vec<Vec<u8>> = parts
        .iter()
        .map(|part| match part {
            Part::Write(bytes) => bytes.clone(),
            Part::Read(count) => vec![0xAA; *count],
        })
        .collect();
    let mut operations: Vec<Operation<'_>> = parts
        .iter()
        .zip(&mut buffers)
        .map(|(part, buffer)| match part {
            Part::Write(_) => Operation::Write(buffer),
            Part::Read(_) => Operation::Read(buffer),
        })
        .collect();
    bus.transaction(ADDRESS, &mut operations)?;
    let read = parts.iter().zip(buffers);
    let read = read.filter(|(part, _)| matches!(part, Part::Read(_)));
    Ok(read.flat_map(|(_, buffer)| buffer).collect())
}

fn part() -> impl Strategy<Value = Part> {
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..5).prop_map(Part::Write),
        (0usize..5).prop_map(Part::Read),
    ]
}

proptest! {
    #[test]
    fn any_transaction_is_what_its_contract_says(
        parts in proptest::collection::vec(part(), 0..6),
        stretch_ns in prop_oneof![Just(0), 0u64..50_000],
        rise_ns in proptest::sample::select(vec![0, 50, 300]),
    ) {
        let (mut bus, wires) = bus();
        wires.borrow_mut().stretch_ns = stretch_ns;
        wires.borrow_mut().rise_ns = rise_ns;
        let read = run(&mut bus, &parts).unwrap();
        let wires = wires.borrow();
        prop_assert_eq!(&wires.seen, &expected(&parts));
        let count = u8::try_from(read.len()).unwrap();
        prop_assert_eq!(read, (0..count).collect::<Vec<_>>());
        // Fast mode, and both wires free afterwards.
        prop_assert!(wires.shortest_low >= 1300);
        prop_assert!(wires.shortest_high >= 600);
        prop_assert!(wires.shortest_period >= PERIOD_NS);
        prop_assert!(wires.shortest_hold >= 300);
        if stretch_ns == 0 {
            // No slower than the wires.
            let longest = wires.longest_period;
            prop_assert!(longest <= PERIOD_NS + rise_ns + LOOK_NS, "{longest} ns");
        }
        prop_assert!(wires.level(SCL) && wires.level(SDA));
    }
}

/// From any bit on SDA stays low, which acknowledges everything and reads as
/// zeros.
#[test]
fn data_stuck_low_is_never_taken_for_an_answer() {
    let parts = [Part::Write(vec![7, 8]), Part::Read(2), Part::Write(vec![9])];
    // START and three bytes, START and three, START and two.
    let ends = [28, 28 + 28, 28 + 28 + 19];
    for fall in 1..=ends[2] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().stuck = Some((SDA, fall));
        assert_eq!(run(&mut bus, &parts), Err(Error::DataLow), "{fall}");
        // Seen at the next START or STOP.
        let end = ends.into_iter().find(|&end| fall <= end);
        assert_eq!(Some(wires.borrow().falls), end);
        assert_eq!(wires.borrow().controller, [true; 2]);
        // Free again.
        wires.borrow_mut().stuck = None;
        assert_eq!(run(&mut bus, &parts).map(|read| read.len()), Ok(2));
    }
}

/// The register of a packet is written, its 135 bytes are read.
#[test]
fn a_packet_of_135_bytes_takes_3_to_4_ms() {
    for (rise_ns, microseconds) in [(0, 3116), (300, 3490)] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().rise_ns = rise_ns;
        let before = wires.borrow().now_ns;
        bus.write_read(ADDRESS, &[0x20], &mut [0; 135]).unwrap();
        let took = wires.borrow().now_ns - before;
        assert_eq!(took.div_ceil(1000), microseconds);
        // 138 bytes of 9 bits, START twice, STOP once.
        assert!(took <= (138 * 9 + 4) * (PERIOD_NS + rise_ns + LOOK_NS));
    }
}

#[test]
fn nobody_there_is_said_at_the_address_and_stops() {
    let (mut bus, wires) = bus();
    assert_eq!(bus.write(0x42, &[1, 2]), Err(Error::NoDevice));
    let address = Seen::Address {
        address: 0x42,
        reads: false,
    };
    assert_eq!(wires.borrow().seen, [Seen::Start, address, Seen::Stop]);
    // And the next works.
    assert_eq!(bus.write(ADDRESS, &[3]), Ok(()));
}

#[test]
fn a_byte_not_taken_ends_the_transaction() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().takes = 2;
    assert_eq!(bus.write(ADDRESS, &[1, 2, 3]), Err(Error::NotTaken));
    let seen = wires.borrow().seen.clone();
    assert_eq!(seen[2..], [Seen::Written(1), Seen::Written(2), Seen::Stop]);
}

/// The address and the byte are acknowledged, and the clock is then held.
#[test]
fn a_clock_held_for_24_ms_is_waited_for_and_one_held_for_26_ms_is_not() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().stretch_ns = 12_000_000;
    assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
    wires.borrow_mut().stretch_ns = 13_000_000;
    assert_eq!(bus.write(ADDRESS, &[1]), Err(Error::ClockLow));
    wires.borrow_mut().stretch_ns = 0;
    wires.borrow_mut().wait(20_000_000);
    assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
}

/// The time a device may hold the clock is one for all bytes of a transaction,
/// and another for the next.
#[test]
fn a_device_that_holds_the_clock_at_every_byte_is_given_up_after_25_ms() {
    let (mut bus, wires) = bus();
    wires.borrow_mut().stretch_ns = 1_000_000;
    let bytes = [0; 128];
    for _ in 0..2 {
        assert_eq!(bus.write(ADDRESS, &bytes[..23]), Ok(()));
    }
    let before = wires.borrow().now_ns;
    assert_eq!(bus.write(ADDRESS, &bytes), Err(Error::ClockLow));
    let took = wires.borrow().now_ns - before;
    assert!((25_000_000..26_000_000).contains(&took), "{took} ns");
    // As long as it would take without.
    wires.borrow_mut().wait(1_000_000);
    wires.borrow_mut().stretch_ns = 0;
    assert_eq!(bus.write(ADDRESS, &bytes), Ok(()));
}

/// STOP after a byte that is not acknowledged fails as well: the bus is let go of,
/// and the first error is told.
#[test]
fn an_error_of_the_stop_after_an_error_hides_nothing_and_drives_nothing() {
    for wire in [SCL, SDA] {
        for (address, bytes, error) in [(0x42, 1, Error::NoDevice), (ADDRESS, 2, Error::NotTaken)] {
            let (mut bus, wires) = bus();
            wires.borrow_mut().takes = 1;
            // START, and the bytes with the bit that acknowledges them.
            wires.borrow_mut().stuck = Some((wire, 1 + bytes * 9));
            assert_eq!(bus.write(address, &[1, 2]), Err(error));
            assert_eq!(wires.borrow().controller, [true; 2]);
            assert!(!wires.borrow().seen.contains(&Seen::Stop));
            wires.borrow_mut().stuck = None;
            wires.borrow_mut().takes = usize::MAX;
            assert_eq!(bus.write(ADDRESS, &[1, 2]), Ok(()));
        }
    }
}

#[test]
fn a_bus_that_nothing_pulls_up_costs_no_more_than_its_limit() {
    for (wire, error) in [(SCL, Error::ClockLow), (SDA, Error::DataLow)] {
        let (mut bus, wires) = bus();
        wires.borrow_mut().hold(wire, true);
        let before = wires.borrow().now_ns;
        assert_eq!(bus.write(ADDRESS, &[1]), Err(error));
        let took = wires.borrow().now_ns - before;
        assert!(took <= 25_100_000, "{took} ns");
        // Plugged in again.
        wires.borrow_mut().hold(wire, false);
        assert_eq!(bus.write(ADDRESS, &[1]), Ok(()));
    }
}

/// The controller was reset while the device sent a 0.
#[test]
fn a_device_stuck_in_a_byte_is_clocked_free() {
    for bits in 1..=8 {
        let (mut bus, wires) = bus();
        {
            let mut wires = wires.borrow_mut();
            wires.hold(SDA, true);
            wires.phase = Phase::Send { byte: 0, bits };
        }
        let mut byte = [0xAA];
        assert_eq!(bus.write_read(ADDRESS, &[7], &mut byte), Ok(()));
        assert_eq!(byte, [0]);
        assert!(
            wires
                .borrow()
                .seen
                .ends_with(&expected(&[Part::Write(vec![7]), Part::Read(1)]))
        );
    }
}

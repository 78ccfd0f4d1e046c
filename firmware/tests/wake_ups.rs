//! No byte waits without an interrupt to come, and the main loop does not sleep while it has work:
//! every order of events at one processor, tried one after the other.
//!
//! The code is that of the boards: `Serial`, `transmit`, `turn`. Here are the registers, the
//! interrupt controller, and what may happen between two of their accesses. The main loop is
//! interrupted between two calls of `Serial`, and before and after `start_sending`, but not between
//! two bytes of one write, which come before the same `start_sending`.

use std::cell::{Cell, RefCell};

use dtof_firmware::board::{Board, Transmitter, transmit, turn};
use dtof_firmware::serial::{Buffers, Serial, SerialInterrupt};
use embedded_io::{Read, Write, WriteReady};

/// One order of events after another: each run makes the same choices as the last, but for the
/// latest that has another way to go.
#[derive(Default)]
struct Orders {
    /// Of each choice: which way, and of how many.
    chosen: Vec<(usize, usize)>,
    next: usize,
}

impl Orders {
    fn choose(&mut self, ways: usize) -> usize {
        if self.next == self.chosen.len() {
            self.chosen.push((0, ways));
        }
        let (way, of) = self.chosen[self.next];
        assert_eq!(of, ways, "a run depends on more than its choices");
        self.next += 1;
        way
    }

    /// Whether there is another order.
    fn turn_over(&mut self) -> bool {
        assert_eq!(self.next, self.chosen.len());
        self.next = 0;
        while let Some((way, ways)) = self.chosen.pop() {
            if way + 1 < ways {
                self.chosen.push((way + 1, ways));
                return true;
            }
        }
        false
    }
}

/// How a transmitter interrupts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// While it has room and was told to wake: STM32.
    Level,
    /// When a byte leaves it, until the handler clears that: CMSDK.
    Latch,
}

/// What lies beside the processor.
#[derive(Default)]
struct World {
    /// The byte in the transmitter.
    holds: Option<u8>,
    /// `Level`: it is to interrupt.
    wakes: bool,
    /// `Latch`: a byte has left it.
    latch: bool,
    /// Its interrupt is pending: software has said so.
    pending: bool,
    sent: Vec<u8>,
    /// Bytes that will come, and the one that has.
    to_come: Vec<u8>,
    came: Option<u8>,
    /// How often a handler ran.
    handled: u32,
}

thread_local! {
    // `start_sending` is a function without an environment.
    static WORLD: RefCell<World> = RefCell::default();
    static ORDERS: RefCell<Orders> = RefCell::default();
    static KIND: Cell<Kind> = const { Cell::new(Kind::Level) };
    static PORT: RefCell<Option<SerialInterrupt<'static>>> = const { RefCell::new(None) };
    /// Interrupt handlers do not run.
    static HELD: Cell<bool> = const { Cell::new(false) };
    /// The main loop sleeps, and no interrupt is there to end that.
    static SLEPT: Cell<bool> = const { Cell::new(false) };
}

fn choose(ways: usize) -> usize {
    ORDERS.with_borrow_mut(|orders| orders.choose(ways))
}

impl World {
    /// Whether the handler of the transmitter is to run.
    fn interrupts(&self) -> bool {
        let port = match KIND.get() {
            Kind::Level => self.wakes && self.holds.is_none(),
            Kind::Latch => self.latch,
        };
        self.pending || port
    }

    /// A byte leaves the transmitter.
    fn leave(&mut self) {
        if let Some(byte) = self.holds.take() {
            self.sent.push(byte);
            self.latch = true;
        }
    }

    /// A byte comes in, as fast as the one before was fetched.
    fn come(&mut self) {
        if self.came.is_none() && !self.to_come.is_empty() {
            self.came = Some(self.to_come.remove(0));
        }
    }
}

/// The line goes on, or does not, between two steps of the handler.
fn line_goes_on() {
    if WORLD.with_borrow(|world| world.holds.is_some()) && choose(2) == 1 {
        WORLD.with_borrow_mut(World::leave);
    }
}

/// The registers of the transmitter.
struct Registers;

impl Transmitter for Registers {
    fn acknowledge(&mut self) {
        WORLD.with_borrow_mut(|world| world.latch = false);
        line_goes_on();
    }

    fn has_room(&mut self) -> bool {
        let has_room = WORLD.with_borrow(|world| world.holds.is_none());
        line_goes_on();
        has_room
    }

    fn send(&mut self, byte: u8) {
        WORLD.with_borrow_mut(|world| assert_eq!(world.holds.replace(byte), None));
        line_goes_on();
    }

    fn wake(&mut self) {
        WORLD.with_borrow_mut(|world| world.wakes = true);
        line_goes_on();
    }

    fn rest(&mut self) {
        WORLD.with_borrow_mut(|world| world.wakes = false);
    }
}

/// The interrupt handler. The main loop stands still meanwhile. `Level` has one for both ways,
/// `Latch` one for each, the receiver's first.
fn handle() {
    WORLD.with_borrow_mut(|world| {
        world.handled += 1;
        assert!(world.handled < 100, "an interrupt without end");
    });
    PORT.with_borrow_mut(|port| {
        let port = port.as_mut().expect("the board is started");
        let came = WORLD.with_borrow_mut(|world| world.came.take());
        if let Some(byte) = came {
            port.on_receive(byte);
        }
        if came.is_none() || KIND.get() == Kind::Level {
            // The interrupt controller has done so when the handler begins.
            WORLD.with_borrow_mut(|world| world.pending = false);
            transmit(port, &mut Registers);
        }
    });
}

fn is_interrupted() -> bool {
    WORLD.with_borrow(|world| world.interrupts() || world.came.is_some())
}

/// What may happen to the main loop now.
fn ways() -> Vec<fn()> {
    WORLD.with_borrow(|world| {
        let mut ways: Vec<fn()> = Vec::new();
        if world.holds.is_some() {
            ways.push(|| WORLD.with_borrow_mut(World::leave));
        }
        if world.came.is_none() && !world.to_come.is_empty() {
            ways.push(|| WORLD.with_borrow_mut(World::come));
        }
        if !HELD.get() && (world.interrupts() || world.came.is_some()) {
            ways.push(handle);
        }
        ways
    })
}

/// Anything may happen between two steps of the main loop, or nothing.
fn anything() {
    loop {
        let ways = ways();
        match choose(ways.len() + 1) {
            0 => return,
            way => ways[way - 1](),
        }
    }
}

/// Writes as much as there is room for, and waits for room until all is written.
fn write_all(serial: &mut Serial<'_>, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        while !serial.write_ready().unwrap() {
            let ways = ways();
            assert!(!ways.is_empty(), "no interrupt to come, and a full queue");
            ways[choose(ways.len())]();
        }
        let written = serial.write(bytes).unwrap();
        bytes = &bytes[written..];
        anything();
    }
}

struct Model;

impl Board for Model {
    fn now_ms(&self) -> u32 {
        0
    }

    fn start_sending() {
        anything();
        WORLD.with_borrow_mut(|world| world.pending = true);
        anything();
    }

    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
        anything();
        HELD.set(true);
        SLEPT.set(false);
        work(self);
        HELD.set(false);
    }

    fn sleep(&mut self) {
        anything();
        SLEPT.set(!is_interrupted());
    }
}

/// Runs a program in every order of events, and says how many there are.
fn every_order<const TRANSMIT: usize>(
    kind: Kind,
    to_come: &[u8],
    program: impl Fn(&mut Serial<'static>),
) -> usize {
    let mut orders = 0;
    KIND.set(kind);
    ORDERS.take();
    loop {
        let world = World {
            to_come: to_come.to_vec(),
            ..World::default()
        };
        WORLD.set(world);
        let buffers = Box::leak(Box::new(Buffers::<4, TRANSMIT>::new()));
        let (interrupt, mut serial) = buffers.split(Model::start_sending);
        PORT.set(Some(interrupt));
        program(&mut serial);
        orders += 1;
        if !ORDERS.with_borrow_mut(Orders::turn_over) {
            return orders;
        }
    }
}

/// Nothing but the line and its interrupts from here on.
fn settle() {
    while WORLD.with_borrow(|world| world.holds.is_some() || world.interrupts()) {
        if is_interrupted() {
            handle();
        } else {
            WORLD.with_borrow_mut(World::leave);
        }
    }
}

/// Four bytes in three writes, one of them of two.
fn four_bytes(serial: &mut Serial<'static>) {
    for bytes in [&[1][..], &[2, 3], &[4]] {
        write_all(serial, bytes);
    }
    settle();
    WORLD.with_borrow(|world| assert_eq!(world.sent, [1, 2, 3, 4]));
}

#[test]
fn no_byte_is_left_without_an_interrupt_to_come() {
    let orders = [Kind::Level, Kind::Latch].map(|kind| every_order::<8>(kind, &[], four_bytes));
    println!(
        "faults: a queue with room: {orders:?} orders of a level and of a latch, no byte left"
    );
    assert_eq!(orders, [396_559, 1_466_799]);
}

#[test]
fn no_byte_is_left_in_a_full_queue() {
    // It holds one byte.
    let orders = [Kind::Level, Kind::Latch].map(|kind| every_order::<2>(kind, &[], four_bytes));
    println!("faults: a full queue: {orders:?} orders of a level and of a latch, no byte left");
    assert_eq!(orders, [491_127, 4_391_434]);
}

#[test]
fn the_main_loop_does_not_sleep_while_a_byte_waits() {
    let orders = [Kind::Level, Kind::Latch].map(|kind| {
        every_order::<8>(kind, &[1, 2], |serial| {
            let mut read = Vec::new();
            for _ in 0..2 {
                turn(&mut Model, serial, |serial, _| {
                    anything();
                    while serial.has_received() {
                        let mut byte = [0];
                        assert_eq!(serial.read(&mut byte), Ok(1));
                        read.push(byte[0]);
                        write_all(serial, &byte);
                    }
                    anything();
                });
                assert!(!SLEPT.get() || !serial.has_received(), "asleep");
            }
            settle();
            WORLD.with_borrow(|world| assert_eq!(world.sent, read));
            assert!([1, 2].starts_with(&read));
        })
    });
    println!("faults: the main loop: {orders:?} orders of a level and of a latch, never asleep");
    assert_eq!(orders, [232_561, 1_072_410]);
}

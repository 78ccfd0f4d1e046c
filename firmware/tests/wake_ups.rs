//! No byte waits without an interrupt to come, and the main loop does not sleep while it has work:
//! every order of events at one processor, tried one after the other.
//!
//! The code is that of the boards: `Serial`, `transmit`, `turn`. Here are the registers, the
//! interrupt controller, and what may happen between any two steps.

use std::cell::{Cell, RefCell};

use dtof_firmware::board::{Board, Transmitter, transmit, turn};
use dtof_firmware::serial::{Buffers, Serial, SerialInterrupt};
use embedded_io::{Read, Write};

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
}

thread_local! {
    // `start_sending` is a function without an environment.
    static WORLD: RefCell<World> = RefCell::default();
    static ORDERS: RefCell<Orders> = RefCell::default();
    static KIND: Cell<Kind> = const { Cell::new(Kind::Level) };
    static PORT: RefCell<Option<SerialInterrupt<'static>>> = const { RefCell::new(None) };
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

/// The interrupt handler. The main loop stands still meanwhile.
fn handle() {
    WORLD.with_borrow_mut(|world| {
        world.pending = false;
        world.latch = false;
    });
    PORT.with_borrow_mut(|port| {
        let port = port.as_mut().expect("the board is started");
        if let Some(byte) = WORLD.with_borrow_mut(|world| world.came.take()) {
            port.on_receive(byte);
        }
        transmit(port, &mut Registers);
    });
}

fn is_interrupted() -> bool {
    WORLD.with_borrow(|world| world.interrupts() || world.came.is_some())
}

/// Anything may happen between two steps of the main loop, or nothing.
fn anything() {
    loop {
        let ways: Vec<fn()> = WORLD.with_borrow(|world| {
            let mut ways: Vec<fn()> = Vec::new();
            if world.holds.is_some() {
                ways.push(|| WORLD.with_borrow_mut(World::leave));
            }
            if world.came.is_none() && !world.to_come.is_empty() {
                ways.push(|| WORLD.with_borrow_mut(World::come));
            }
            if world.interrupts() || world.came.is_some() {
                ways.push(handle);
            }
            ways
        });
        match choose(ways.len() + 1) {
            0 => return,
            way => ways[way - 1](),
        }
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

    /// As on both boards. What comes while interrupts are held back ends the sleep.
    fn wait_for_interrupt(&mut self, has_work: impl FnOnce() -> bool) {
        SLEPT.set(false);
        if has_work() {
            return;
        }
        if choose(2) == 1 {
            WORLD.with_borrow_mut(World::come);
        }
        SLEPT.set(!is_interrupted());
    }
}

/// Runs a program in every order of events, and says how many there are.
fn every_order(to_come: &[u8], program: impl Fn(&mut Serial<'static>)) -> usize {
    let mut orders = 0;
    ORDERS.take();
    loop {
        let world = World {
            to_come: to_come.to_vec(),
            ..World::default()
        };
        WORLD.set(world);
        let buffers = Box::leak(Box::new(Buffers::<4, 8>::new()));
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

#[test]
fn no_byte_is_left_without_an_interrupt_to_come() {
    for (kind, expected) in [(Kind::Level, 340_752), (Kind::Latch, 983298)] {
        KIND.set(kind);
        let orders = every_order(&[], |serial| {
            for bytes in [&[1][..], &[2, 3], &[4]] {
                serial.write_all(bytes).unwrap();
                anything();
            }
            settle();
            WORLD.with_borrow(|world| assert_eq!(world.sent, [1, 2, 3, 4]));
        });
        assert_eq!(orders, expected);
    }
}

#[test]
fn the_main_loop_does_not_sleep_while_a_byte_waits() {
    let orders = every_order(&[1, 2], |serial| {
        let mut board = Model;
        let mut read = Vec::new();
        for _ in 0..4 {
            turn(&mut board, serial, |serial, _| {
                anything();
                while serial.has_received() {
                    let mut byte = [0];
                    assert_eq!(serial.read(&mut byte), Ok(1));
                    read.push(byte[0]);
                    anything();
                }
                anything();
            });
            assert!(!SLEPT.get() || !serial.has_received(), "asleep");
        }
    });
    assert_eq!(orders, 5025);
}

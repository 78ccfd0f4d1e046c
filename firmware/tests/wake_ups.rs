//! Every byte is sent, and the main loop does not sleep while it has work: a test of every
//! interleaving of main loop, interrupts and serial line on one processor.
//!
//! The code under test is that of the boards: `Serial`, `transmit`, `turn`. This file simulates the
//! registers and the interrupt controller. The main loop is interrupted between two calls of `Serial`,
//! and before and after `start_sending`, but not between two bytes of one write, which come before the
//! same `start_sending`.

use std::cell::{Cell, RefCell};

use dtof_firmware::board::{Board, Transmitter, transmit, turn};
use dtof_firmware::serial::{Buffers, Serial, SerialInterrupt};
use embedded_io::{Read, Write, WriteReady};

/// Goes through all interleavings, depth first. Each run repeats the choices of the last one, except
/// for the last choice that has an alternative left.
#[derive(Default)]
struct Interleavings {
    /// The alternative taken at each choice, and how many there are.
    chosen: Vec<(usize, usize)>,
    next: usize,
}

impl Interleavings {
    fn choose(&mut self, alternatives: usize) -> usize {
        if self.next == self.chosen.len() {
            self.chosen.push((0, alternatives));
        }
        let (taken, of) = self.chosen[self.next];
        assert_eq!(of, alternatives, "a run depends on more than its choices");
        self.next += 1;
        taken
    }

    /// Prepares the next run. Returns false after the last interleaving.
    fn next_interleaving(&mut self) -> bool {
        assert_eq!(self.next, self.chosen.len());
        self.next = 0;
        while let Some((taken, alternatives)) = self.chosen.pop() {
            if taken + 1 < alternatives {
                self.chosen.push((taken + 1, alternatives));
                return true;
            }
        }
        false
    }
}

/// How a transmitter interrupts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// While it has room and its interrupt is enabled: STM32.
    Level,
    /// After a byte was sent, until the handler clears the flag: CMSDK.
    Latch,
}

/// The serial port and its interrupts.
#[derive(Default)]
struct Hardware {
    /// The byte in the transmitter.
    sending: Option<u8>,
    /// `Level`: the transmitter's interrupt is enabled.
    interrupt_enabled: bool,
    /// `Latch`: the flag that a byte was sent.
    byte_left: bool,
    /// Software has set the transmitter's interrupt pending.
    pending: bool,
    sent: Vec<u8>,
    /// Bytes that will arrive, and the one that has arrived.
    incoming: Vec<u8>,
    received: Option<u8>,
    /// How often a handler ran.
    handler_runs: u32,
}

thread_local! {
    // Thread-local, because `start_sending` is a plain function.
    static HARDWARE: RefCell<Hardware> = RefCell::default();
    static INTERLEAVINGS: RefCell<Interleavings> = RefCell::default();
    static KIND: Cell<Kind> = const { Cell::new(Kind::Level) };
    static PORT: RefCell<Option<SerialInterrupt<'static>>> = const { RefCell::new(None) };
    /// Whether interrupts are held, so that handlers do not run.
    static INTERRUPTS_HELD: Cell<bool> = const { Cell::new(false) };
    /// Whether the main loop sleeps without an interrupt to wake it.
    static SLEPT: Cell<bool> = const { Cell::new(false) };
}

fn choose(alternatives: usize) -> usize {
    INTERLEAVINGS.with_borrow_mut(|interleavings| interleavings.choose(alternatives))
}

impl Hardware {
    /// Whether the transmitter requests its interrupt.
    fn transmitter_interrupts(&self) -> bool {
        let port = match KIND.get() {
            Kind::Level => self.interrupt_enabled && self.sending.is_none(),
            Kind::Latch => self.byte_left,
        };
        self.pending || port
    }

    /// The byte in the transmitter has been sent.
    fn finish_byte(&mut self) {
        if let Some(byte) = self.sending.take() {
            self.sent.push(byte);
            self.byte_left = true;
        }
    }

    /// The next byte arrives, once the one before was fetched.
    fn receive_byte(&mut self) {
        if self.received.is_none() && !self.incoming.is_empty() {
            self.received = Some(self.incoming.remove(0));
        }
    }
}

/// Between two steps of the handler, the byte in the transmitter is sent, or not.
fn maybe_finish_byte() {
    if HARDWARE.with_borrow(|hardware| hardware.sending.is_some()) && choose(2) == 1 {
        HARDWARE.with_borrow_mut(Hardware::finish_byte);
    }
}

/// The registers of the transmitter.
struct Registers;

impl Transmitter for Registers {
    fn acknowledge(&mut self) {
        HARDWARE.with_borrow_mut(|hardware| hardware.byte_left = false);
        maybe_finish_byte();
    }

    fn has_room(&mut self) -> bool {
        let has_room = HARDWARE.with_borrow(|hardware| hardware.sending.is_none());
        maybe_finish_byte();
        has_room
    }

    fn send(&mut self, byte: u8) {
        HARDWARE.with_borrow_mut(|hardware| assert_eq!(hardware.sending.replace(byte), None));
        maybe_finish_byte();
    }

    fn wake(&mut self) {
        HARDWARE.with_borrow_mut(|hardware| hardware.interrupt_enabled = true);
        maybe_finish_byte();
    }

    fn rest(&mut self) {
        HARDWARE.with_borrow_mut(|hardware| hardware.interrupt_enabled = false);
    }
}

/// The interrupt handler, which pauses the main loop. `Level` has one for both directions, `Latch` one
/// for each, the receiver's first.
fn run_handler() {
    HARDWARE.with_borrow_mut(|hardware| {
        hardware.handler_runs += 1;
        assert!(hardware.handler_runs < 100, "an interrupt without end");
    });
    PORT.with_borrow_mut(|port| {
        let port = port.as_mut().expect("the board is started");
        let received = HARDWARE.with_borrow_mut(|hardware| hardware.received.take());
        if let Some(byte) = received {
            port.on_receive(byte);
        }
        if received.is_none() || KIND.get() == Kind::Level {
            // The interrupt controller clears this when the handler begins.
            HARDWARE.with_borrow_mut(|hardware| hardware.pending = false);
            transmit(port, &mut Registers);
        }
    });
}

fn is_interrupted() -> bool {
    HARDWARE
        .with_borrow(|hardware| hardware.transmitter_interrupts() || hardware.received.is_some())
}

/// The steps of line and interrupts that are possible now.
fn possible_steps() -> Vec<fn()> {
    HARDWARE.with_borrow(|hardware| {
        let mut steps: Vec<fn()> = Vec::new();
        if hardware.sending.is_some() {
            steps.push(|| HARDWARE.with_borrow_mut(Hardware::finish_byte));
        }
        if hardware.received.is_none() && !hardware.incoming.is_empty() {
            steps.push(|| HARDWARE.with_borrow_mut(Hardware::receive_byte));
        }
        if !INTERRUPTS_HELD.get()
            && (hardware.transmitter_interrupts() || hardware.received.is_some())
        {
            steps.push(run_handler);
        }
        steps
    })
}

/// Runs any number of possible steps between two steps of the main loop.
fn run_any_steps() {
    loop {
        let steps = possible_steps();
        match choose(steps.len() + 1) {
            0 => return,
            step => steps[step - 1](),
        }
    }
}

/// Writes as much as there is room for, and waits for room until all is written.
fn write_all(serial: &mut Serial<'_>, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        while !serial.write_ready().unwrap() {
            let steps = possible_steps();
            assert!(
                !steps.is_empty(),
                "a full queue without an interrupt to empty it"
            );
            steps[choose(steps.len())]();
        }
        let written = serial.write(bytes).unwrap();
        bytes = &bytes[written..];
        run_any_steps();
    }
}

struct Model;

impl Board for Model {
    fn now_ms(&self) -> u32 {
        0
    }

    fn start_sending() {
        run_any_steps();
        HARDWARE.with_borrow_mut(|hardware| hardware.pending = true);
        run_any_steps();
    }

    fn hold_interrupts(&mut self, work: impl FnOnce(&mut Self)) {
        run_any_steps();
        INTERRUPTS_HELD.set(true);
        SLEPT.set(false);
        work(self);
        INTERRUPTS_HELD.set(false);
    }

    fn sleep(&mut self) {
        run_any_steps();
        SLEPT.set(!is_interrupted());
    }
}

/// Runs a program in every interleaving. Returns their number.
fn every_interleaving<const TRANSMIT: usize>(
    kind: Kind,
    incoming: &[u8],
    program: impl Fn(&mut Serial<'static>),
) -> usize {
    let mut count = 0;
    KIND.set(kind);
    INTERLEAVINGS.take();
    loop {
        let hardware = Hardware {
            incoming: incoming.to_vec(),
            ..Hardware::default()
        };
        HARDWARE.set(hardware);
        let buffers = Box::leak(Box::new(Buffers::<4, TRANSMIT>::new()));
        let (interrupt, mut serial) = buffers.split(Model::start_sending);
        PORT.set(Some(interrupt));
        program(&mut serial);
        count += 1;
        if !INTERLEAVINGS.with_borrow_mut(Interleavings::next_interleaving) {
            return count;
        }
    }
}

/// Runs only the line and its interrupts until all bytes are sent.
fn settle() {
    while HARDWARE
        .with_borrow(|hardware| hardware.sending.is_some() || hardware.transmitter_interrupts())
    {
        if is_interrupted() {
            run_handler();
        } else {
            HARDWARE.with_borrow_mut(Hardware::finish_byte);
        }
    }
}

/// Four bytes in three writes, one of them of two.
fn four_bytes(serial: &mut Serial<'static>) {
    for bytes in [&[1][..], &[2, 3], &[4]] {
        write_all(serial, bytes);
    }
    settle();
    HARDWARE.with_borrow(|hardware| assert_eq!(hardware.sent, [1, 2, 3, 4]));
}

#[test]
fn no_byte_is_left_without_an_interrupt_to_come() {
    let counts =
        [Kind::Level, Kind::Latch].map(|kind| every_interleaving::<8>(kind, &[], four_bytes));
    println!(
        "faults: a queue with room: {counts:?} orders of a level and of a latch, no byte left"
    );
    assert_eq!(counts, [396_559, 1_466_799]);
}

#[test]
fn no_byte_is_left_in_a_full_queue() {
    // The queue holds one byte.
    let counts =
        [Kind::Level, Kind::Latch].map(|kind| every_interleaving::<2>(kind, &[], four_bytes));
    println!("faults: a full queue: {counts:?} orders of a level and of a latch, no byte left");
    assert_eq!(counts, [491_127, 4_391_434]);
}

#[test]
fn the_main_loop_does_not_sleep_while_a_byte_waits() {
    let counts = [Kind::Level, Kind::Latch].map(|kind| {
        every_interleaving::<8>(kind, &[1, 2], |serial| {
            let mut read = Vec::new();
            for _ in 0..2 {
                turn(&mut Model, serial, |serial, _| {
                    run_any_steps();
                    while serial.has_received() {
                        let mut byte = [0];
                        assert_eq!(serial.read(&mut byte), Ok(1));
                        read.push(byte[0]);
                        write_all(serial, &byte);
                    }
                    run_any_steps();
                    false
                });
                assert!(!SLEPT.get() || !serial.has_received(), "asleep");
            }
            settle();
            HARDWARE.with_borrow(|hardware| assert_eq!(hardware.sent, read));
            assert!([1, 2].starts_with(&read));
        })
    });
    println!("faults: the main loop: {counts:?} orders of a level and of a latch, never asleep");
    assert_eq!(counts, [232_561, 1_072_410]);
}

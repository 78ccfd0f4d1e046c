//! A serial port fed by interrupts: two queues between the interrupt handler
//! and the main loop.
//!
//! The interrupt handler has [`SerialInterrupt`]: it delivers every received
//! byte and fetches every byte to send. The main loop has [`Serial`],
//! which reads and writes through the traits of `embedded-io`. Neither locks
//! nor waits for the other. A byte that finds the receive queue full is lost,
//! and counted ([`Serial::lost`]); the link repeats its contents.
//!
//! [`Read::read`] and [`Write::write`] wait if they must, as their traits say.
//! They return at once if [`ReadReady::read_ready`] and
//! [`WriteReady::write_ready`] was true just before: only the main loop empties
//! the one queue and fills the other. [`Write::flush`] always waits, for the
//! line.
//!
//! ```
//! use dtof_firmware::serial::Buffers;
//! use embedded_io::{Read, ReadReady, Write};
//!
//! let mut buffers = Buffers::<16, 16>::new();
//! // The function makes the interrupt handler run, so that it begins to send.
//! let (mut interrupt, mut serial) = buffers.split(|| ());
//!
//! interrupt.on_receive(7);
//! assert_eq!(serial.read_ready(), Ok(true));
//! assert_eq!(serial.read(&mut [0; 8]), Ok(1));
//!
//! assert_eq!(serial.write(&[1, 2, 3]), Ok(3));
//! assert_eq!(interrupt.next_to_send(), Some(1));
//! ```
//!
//! A byte takes either side the same short time however full the queue is, with
//! no interrupt held back.

use core::convert::Infallible;
use core::hint;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use heapless::spsc::{Consumer, Producer, Queue};

/// The receive queue of either board in bytes: twice the link's window of four frames. If more
/// arrives, bytes are lost and the link repeats them.
pub const RECEIVE_CAPACITY: usize = 2047;

/// The transmit queue of either board in bytes.
pub const TRANSMIT_CAPACITY: usize = 1023;

/// The memory of a port of either board.
pub type BoardBuffers = Buffers<{ RECEIVE_CAPACITY + 1 }, { TRANSMIT_CAPACITY + 1 }>;

/// The memory of a port. Its queues hold one byte less than `RECEIVE` and
/// `TRANSMIT`, powers of two being the fastest.
pub struct Buffers<const RECEIVE: usize, const TRANSMIT: usize> {
    receive: Queue<u8, RECEIVE>,
    transmit: Queue<u8, TRANSMIT>,
    lost: AtomicU32,
    line: Line,
}

/// The state of the program at the other end, as far as the port knows.
struct Line {
    /// No program has the port open, as far as the port can tell. (Zero, so that the static
    /// with the queues takes no flash.)
    is_closed: AtomicBool,
    /// It was closed since the main loop's last check.
    was_closed: AtomicBool,
}

impl<const RECEIVE: usize, const TRANSMIT: usize> Buffers<RECEIVE, TRANSMIT> {
    /// Empty queues.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            receive: Queue::new(),
            transmit: Queue::new(),
            lost: AtomicU32::new(0),
            line: Line {
                is_closed: AtomicBool::new(false),
                was_closed: AtomicBool::new(false),
            },
        }
    }

    /// The two ends. `start_sending` makes the interrupt handler run soon;
    /// [`Serial`] calls it whenever there is something new to send.
    #[must_use]
    pub fn split(&mut self, start_sending: fn()) -> (SerialInterrupt<'_>, Serial<'_>) {
        let (received, to_read) = self.receive.split();
        let (to_send, sending) = self.transmit.split();
        let (lost, line) = (&self.lost, &self.line);
        let interrupt = SerialInterrupt {
            received,
            sending,
            lost,
            line,
        };
        let serial = Serial {
            to_read,
            to_send,
            lost,
            line,
            start_sending,
        };
        (interrupt, serial)
    }
}

impl<const RECEIVE: usize, const TRANSMIT: usize> Default for Buffers<RECEIVE, TRANSMIT> {
    fn default() -> Self {
        Self::new()
    }
}

/// The end of the interrupt handler.
pub struct SerialInterrupt<'a> {
    received: Producer<'a, u8>,
    sending: Consumer<'a, u8>,
    lost: &'a AtomicU32,
    line: &'a Line,
}

impl SerialInterrupt<'_> {
    /// The port received this byte. It is lost if the main loop has left no
    /// room.
    #[inline]
    pub fn on_receive(&mut self, byte: u8) {
        if self.received.enqueue(byte).is_err() {
            self.on_loss();
        }
    }

    /// The port itself lost a byte: one came before the last was fetched, or
    /// came broken.
    #[inline]
    pub fn on_loss(&mut self) {
        // Nothing else writes it, so it need not be atomic.
        let lost = self.lost.load(Ordering::Relaxed);
        self.lost.store(lost.saturating_add(1), Ordering::Relaxed);
    }

    /// A program at the other end has the port open, or no longer. A port that cannot tell
    /// never calls it.
    #[inline]
    pub fn set_listening(&mut self, listens: bool) {
        self.line.is_closed.store(!listens, Ordering::Relaxed);
        if !listens {
            self.line.was_closed.store(true, Ordering::Relaxed);
        }
    }

    /// Whether there is something to send.
    #[inline]
    #[must_use]
    pub fn has_to_send(&self) -> bool {
        self.sending.ready()
    }

    /// The byte that the port sends next, if any. Once there is nothing, the
    /// handler stops sending; `start_sending` makes it call this again.
    #[inline]
    pub fn next_to_send(&mut self) -> Option<u8> {
        self.sending.dequeue()
    }
}

/// The end of the main loop.
pub struct Serial<'a> {
    to_read: Consumer<'a, u8>,
    to_send: Producer<'a, u8>,
    lost: &'a AtomicU32,
    line: &'a Line,
    start_sending: fn(),
}

impl Serial<'_> {
    /// Bytes received and lost since the start.
    #[must_use]
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Whether a program at the other end has had the port open since the last call, and
    /// has it open now; true if the port cannot tell. What a program sent before it closed the
    /// port is dropped.
    #[must_use]
    pub fn listens(&mut self) -> bool {
        // In two steps, as not every processor can do it in one. What is closed in between is
        // not open in the line below.
        let was_closed = self.line.was_closed.load(Ordering::Relaxed);
        if was_closed {
            self.line.was_closed.store(false, Ordering::Relaxed);
            while self.to_read.dequeue().is_some() {}
        }
        !self.line.is_closed.load(Ordering::Relaxed) && !was_closed
    }

    /// Whether a byte waits to be read.
    #[must_use]
    pub fn has_received(&self) -> bool {
        self.to_read.ready()
    }
}

impl ErrorType for Serial<'_> {
    type Error = Infallible;
}

impl ReadReady for Serial<'_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.to_read.ready())
    }
}

impl Read for Serial<'_> {
    /// Reads what has been received and fits `buffer`; waits if nothing has.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while !self.to_read.ready() {
            hint::spin_loop();
        }
        let mut count = 0;
        for place in buffer {
            let Some(byte) = self.to_read.dequeue() else {
                break;
            };
            *place = byte;
            count += 1;
        }
        Ok(count)
    }
}

impl WriteReady for Serial<'_> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.to_send.ready())
    }
}

impl Write for Serial<'_> {
    /// Hands over as many bytes as fit the queue; waits if none does.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        if bytes.is_empty() {
            return Ok(0);
        }
        while !self.to_send.ready() {
            hint::spin_loop();
        }
        let mut count = 0;
        for &byte in bytes {
            if self.to_send.enqueue(byte).is_err() {
                break;
            }
            count += 1;
        }
        (self.start_sending)();
        Ok(count)
    }

    /// Waits until the port has been given every byte. Its own registers may
    /// still hold the last two.
    fn flush(&mut self) -> Result<(), Infallible> {
        while !self.to_send.is_empty() {
            hint::spin_loop();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use core::sync::atomic::AtomicU32;
    use std::thread;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn bytes_come_through_in_order_both_ways() {
        let mut buffers = Buffers::<8, 8>::new();
        let (mut interrupt, mut serial) = buffers.split(|| ());
        // More often than the queues are long.
        for round in 0..10 {
            let bytes = [round, 100 + round, 200 + round];
            for byte in bytes {
                interrupt.on_receive(byte);
            }
            let mut read = [0; 5];
            assert_eq!(serial.read(&mut read), Ok(3));
            assert_eq!(read[..3], bytes);

            assert_eq!(serial.write(&bytes), Ok(3));
            assert_eq!(bytes.map(|_| interrupt.next_to_send()), bytes.map(Some));
            assert_eq!(interrupt.next_to_send(), None);
        }
        assert_eq!(serial.lost(), 0);
    }

    #[test]
    fn a_full_receive_queue_loses_the_newest_and_counts_them() {
        let mut buffers = Buffers::<8, 8>::new();
        let (mut interrupt, mut serial) = buffers.split(|| ());
        for byte in 0..10 {
            interrupt.on_receive(byte);
        }
        assert_eq!(serial.lost(), 3);
        interrupt.on_loss();
        assert_eq!(serial.lost(), 4);

        let mut read = [0; 10];
        assert_eq!(serial.read(&mut read), Ok(7));
        assert_eq!(read[..7], [0, 1, 2, 3, 4, 5, 6]);
        // And it takes bytes again.
        interrupt.on_receive(42);
        assert_eq!(serial.read(&mut read), Ok(1));
        assert_eq!((read[0], serial.lost()), (42, 4));
    }

    #[test]
    fn losses_do_not_start_over() {
        let mut buffers = Buffers::<2, 2>::new();
        buffers.lost = AtomicU32::new(u32::MAX - 1);
        let (mut interrupt, serial) = buffers.split(|| ());
        for _ in 0..3 {
            interrupt.on_loss();
        }
        assert_eq!(serial.lost(), u32::MAX);
    }

    #[test]
    fn what_is_ready_does_not_wait() {
        let mut buffers = Buffers::<4, 4>::new();
        let (mut interrupt, mut serial) = buffers.split(|| ());
        assert_eq!(serial.read_ready(), Ok(false));
        assert!(!serial.has_received());
        interrupt.on_receive(1);
        assert_eq!(serial.read_ready(), Ok(true));
        assert!(serial.has_received());
        // One byte is there, so that a long read returns with one.
        assert_eq!(serial.read(&mut [0; 64]), Ok(1));
        assert_eq!(serial.read_ready(), Ok(false));

        assert_eq!(serial.write_ready(), Ok(true));
        // Room for three, so that a long write returns with three.
        assert_eq!(serial.write(&[9; 64]), Ok(3));
        assert_eq!(serial.write_ready(), Ok(false));
        assert_eq!(interrupt.next_to_send(), Some(9));
        assert_eq!(serial.write_ready(), Ok(true));
        assert_eq!(serial.write(&[9; 64]), Ok(1));
    }

    #[test]
    fn nothing_is_read_and_written_at_once() {
        let mut buffers = Buffers::<2, 2>::new();
        let (_interrupt, mut serial) = buffers.split(|| unreachable!());
        assert_eq!(serial.read(&mut []), Ok(0));
        assert_eq!(serial.write(&[]), Ok(0));
        assert_eq!(serial.flush(), Ok(()));
    }

    #[test]
    fn every_write_starts_sending() {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let mut buffers = Buffers::<8, 8>::new();
        let (interrupt, mut serial) = buffers.split(|| {
            STARTED.fetch_add(1, Ordering::Relaxed);
        });
        assert!(!interrupt.has_to_send());
        assert_eq!(serial.write(&[1, 2]), Ok(2));
        assert_eq!(serial.write(&[3]), Ok(1));
        assert!(interrupt.has_to_send());
        assert_eq!(STARTED.load(Ordering::Relaxed), 2);
    }

    #[test]
    fn waits_for_an_interrupt_handler_that_runs_beside_it() {
        const BYTES: u32 = if cfg!(miri) { 100 } else { 100_000 };
        #[allow(clippy::cast_possible_truncation, reason = "any byte will do")]
        let byte = |index: u32| (index.wrapping_mul(2_654_435_761) >> 24) as u8;

        let mut buffers = Buffers::<16, 16>::new();
        let (mut interrupt, mut serial) = buffers.split(|| ());
        thread::scope(|scope| {
            // Sends back what it is sent, never more than the queue holds.
            scope.spawn(move || {
                let mut looped = 0;
                while looped < BYTES {
                    match interrupt.next_to_send() {
                        Some(byte) => {
                            interrupt.on_receive(byte);
                            // As a port that loses one for each that it gets.
                            interrupt.on_loss();
                            looped += 1;
                        }
                        None => thread::yield_now(),
                    }
                }
            });
            let (mut next, mut lost) = (0, 0);
            while next < BYTES {
                let last = BYTES.min(next + 15);
                let bytes: Vec<u8> = (next..last).map(byte).collect();
                serial.write_all(&bytes).unwrap();
                serial.flush().unwrap();
                let mut read = std::vec![0; bytes.len()];
                serial.read_exact(&mut read).unwrap();
                assert_eq!(read, bytes);
                next = last;
                assert!(serial.lost() >= lost);
                lost = serial.lost();
            }
        });
        assert_eq!(serial.lost(), BYTES);
    }
}

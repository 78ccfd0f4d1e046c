//! The samples of the photon timer on their way into memory, and its dither out of it, without the
//! processor.
//!
//! Each of the two shift registers fills a ring, by two DMA channels that take turns: while
//! one counts down, the other waits, and is started by its end. Both write through the same
//! ring. How far they are is read from their counters at any time, so that nothing has to be
//! done at any time. The ring's size divides what a channel transfers, so that it begins where
//! the other has ended. See the datasheet of RP2040, sections 2.5 and 3.5; RP2350 does the same (12.6 and 11).
//!
//! In the same way two channels for each state machine send it what the dither adds to each laser cycle, a byte
//! from a table. A byte comes four times in a word of the queue (section 2.1.4).

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering, compiler_fence};

use dtof_sensors::dither::Dither;

use super::chip::hal::pac::{DMA, PIO0, RESETS};
use super::chip::hal::pio::{Rx, StateMachineIndex, Tx};
use super::chip::registers::{
    CHAIN_TO, INCREMENT_WRITE, QUIET, REQUEST, RING_OF_WRITES, RING_SIZE,
};
use crate::photon_timer::Samples;

/// Words of a ring, a power of two.
const WORDS: u32 = 2048;
/// The logarithm of its bytes.
const RING_BITS: u32 = (4 * WORDS).ilog2();
/// Words of a laser cycle in each ring: the level before, and 64 samples.
const WORDS_A_CYCLE: u32 = 3;
/// Laser cycles that are certainly there: besides, one that comes, and a word on its way.
pub const KEPT: u32 = (WORDS - 2 * WORDS_A_CYCLE) / WORDS_A_CYCLE;

/// Words that a channel transfers before the other takes over: a multiple of the ring's. RP2350 counts to less
/// than 2²⁸.
const TURN: u32 = 1 << 27;

/// Aligned to its size, as the DMA's rings are.
#[repr(align(8192))]
struct Ring([AtomicU32; WORDS as usize]);

const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

impl Ring {
    const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; WORDS as usize])
    }

    /// Three words from word `3 cycle` on; after the last comes the first.
    fn cycle(&self, cycle: u32) -> [u32; 3] {
        let first = cycle.wrapping_mul(WORDS_A_CYCLE);
        [0, 1, 2].map(|word| {
            let place = self.0.get((first.wrapping_add(word) % WORDS) as usize);
            place.map_or(0, |place| place.load(Ordering::Relaxed))
        })
    }
}

static EVEN: Ring = Ring::new();
static ODD: Ring = Ring::new();

/// What the dither adds to each laser cycle. Aligned to its size.
#[repr(align(1024))]
struct Table([AtomicU8; Dither::LENGTHS]);

const _: () = assert!(align_of::<Table>() == size_of::<Table>());

static TABLE: Table = Table([const { AtomicU8::new(0) }; Dither::LENGTHS]);

/// A queue of a state machine, and what requests a transfer.
#[derive(Clone, Copy)]
pub struct Queue {
    address: u32,
    request: u8,
}

impl Queue {
    pub fn read<SM: StateMachineIndex>(queue: &Rx<(PIO0, SM)>) -> Self {
        Self {
            address: queue.fifo_address() as u32,
            request: queue.dreq_value(),
        }
    }

    pub fn write<SM: StateMachineIndex>(queue: &Tx<(PIO0, SM)>) -> Self {
        Self {
            address: queue.fifo_address() as u32,
            request: queue.dreq_value(),
        }
    }
}

/// Both rings and what fills them.
pub struct SampleRings {
    dma: DMA,
    /// Words counted so far, and how many laser cycles they were.
    words: u32,
    cycles: u32,
}

/// Channels 0 and 1 fill one ring, 2 and 3 the other.
const PAIRS: [u32; 2] = [0, 2];
/// Channels that send the dither to the laser and to both shift registers.
const DITHER_PAIRS: [u32; 3] = [4, 6, 8];

// Bits of a channel's control register (2.5.7, CH0_CTRL_TRIG); the others are in `rp2040.rs` and `rp2350.rs`.
const ENABLE: u32 = 1 << 0;
const HIGH_PRIORITY: u32 = 1 << 1;
const WORDS_OF_4_BYTES: u32 = 2 << 2;
const INCREMENT_READ: u32 = 1 << 4;

impl SampleRings {
    pub const fn new(dma: DMA) -> Self {
        Self {
            dma,
            words: 0,
            cycles: 0,
        }
    }

    /// Ends all transfers.
    #[allow(clippy::unused_self, reason = "of these rings")]
    pub fn stop(&mut self, resets: &mut RESETS) {
        // All counters are 0 then, and nothing is under way.
        resets.reset().modify(|_, w| w.dma().set_bit());
        resets.reset().modify(|_, w| w.dma().clear_bit());
        while resets.reset_done().read().dma().bit_is_clear() {}
    }

    /// Begins with empty rings: the samples of the even and the odd clocks, and what `dither` adds for the
    /// laser and for both shift registers. It has been stopped.
    pub fn start(&mut self, samples: [Queue; 2], added: [Queue; 3], dither: Dither) {
        clear_stalls();
        for (place, added) in TABLE.0.iter().zip(dither.added()) {
            place.store(added, Ordering::Relaxed);
        }
        // The DMA reads the table after this.
        compiler_fence(Ordering::SeqCst);
        for ((first, from), ring) in PAIRS.into_iter().zip(samples).zip([&EVEN, &ODD]) {
            let control = HIGH_PRIORITY
                | WORDS_OF_4_BYTES
                | INCREMENT_WRITE
                | RING_OF_WRITES
                | RING_BITS << RING_SIZE;
            let to = ring.0.as_ptr() as u32;
            self.transfer(first, [from.address, to], control, from.request);
        }
        for (first, to) in DITHER_PAIRS.into_iter().zip(added) {
            let control = HIGH_PRIORITY | INCREMENT_READ | Dither::LENGTHS.ilog2() << RING_SIZE;
            let from = TABLE.0.as_ptr() as u32;
            self.transfer(first, [from, to.address], control, to.request);
        }
        let pairs = PAIRS.into_iter().chain(DITHER_PAIRS);
        let first = pairs.map(|channel| 1 << channel).sum();
        // SAFETY: these channels have just been set up.
        #[allow(unsafe_code, reason = "every write that starts the DMA is unsafe")]
        self.dma
            .multi_chan_trigger()
            .write(|w| unsafe { w.bits(first) });
        self.words = 0;
        self.cycles = 0;
    }

    /// Sets two channels up that take turns to transfer from one address to another.
    fn transfer(&mut self, first: u32, [from, to]: [u32; 2], control: u32, request: u8) {
        for (channel, other) in [(first, first + 1), (first + 1, first)] {
            let registers = self.dma.ch(channel as usize);
            let control =
                ENABLE | control | other << CHAIN_TO | u32::from(request) << REQUEST | QUIET;
            // SAFETY: the channel reads a queue of the PIO and writes words within a ring, or reads bytes
            // within the table and writes a queue. Rings and table live as long as the image, are
            // aligned to their sizes, and are accessed through atomics only.
            #[allow(unsafe_code, reason = "the DMA accesses memory")]
            unsafe {
                registers.ch_read_addr().write(|w| w.bits(from));
                registers.ch_write_addr().write(|w| w.bits(to));
                registers.ch_trans_count().write(|w| w.bits(TURN));
                registers.ch_al1_ctrl().write(|w| w.bits(control));
            }
        }
    }

    /// Words that have come into both rings, modulo [`TURN`]: one channel of each pair has 0
    /// left. Between two reads the turn may pass to the other; then it is a few too few.
    fn written(&self) -> u32 {
        let [even, odd] = PAIRS.map(|first| {
            let left = |channel: u32| self.dma.ch(channel as usize).ch_trans_count().read().bits();
            TURN.wrapping_sub(left(first).wrapping_add(left(first + 1)))
        });
        let behind = even.wrapping_sub(odd) & (TURN - 1);
        // The odd one is the later one, unless it has just been read after the other.
        let is_behind = behind < TURN / 2;
        (if is_behind { odd } else { even }) & (TURN - 1)
    }

    /// How many laser cycles have come whole, since the start.
    pub fn completed(&mut self) -> u32 {
        // The compiler may not move reads of the rings across this.
        compiler_fence(Ordering::SeqCst);
        let new = self.written().wrapping_sub(self.words) & (TURN - 1);
        compiler_fence(Ordering::SeqCst);
        // It has not gone back: see above.
        if new < TURN / 2 {
            let whole = new / WORDS_A_CYCLE;
            self.words = self.words.wrapping_add(whole * WORDS_A_CYCLE);
            self.cycles = self.cycles.wrapping_add(whole);
        }
        self.cycles
    }

    pub fn samples(&self, cycle: u32) -> Samples {
        let [_, first_even, last_even] = EVEN.cycle(cycle);
        let [before, first_odd, last_odd] = ODD.cycle(cycle);
        Samples {
            before,
            even: [first_even, last_even],
            odd: [first_odd, last_odd],
        }
    }

    /// Whether a queue was full when a shift register had a word for it, or was empty when a state machine
    /// waited for what the dither adds. It alone is late then, and out of step with the others from then on.
    #[allow(clippy::unused_self, reason = "of these rings")]
    pub fn has_stalled(&self) -> bool {
        // SAFETY: it is only read, and reading it changes nothing.
        #[allow(unsafe_code, reason = "the chip's crate keeps the register to itself")]
        let debug = unsafe { &*PIO0::PTR }.fdebug().read();
        debug.rxstall().bits() != 0 || debug.txstall().bits() != 0
    }
}

/// The state machines have not begun: only a `pull` that waits sets the flag of an empty queue (3.7, FDEBUG), and the
/// first one comes after the samples of a laser cycle, when the DMA has long filled the queues.
fn clear_stalls() {
    // SAFETY: this clears flags only, and nothing else reads them.
    #[allow(unsafe_code, reason = "the chip's crate keeps the register to itself")]
    unsafe {
        (*PIO0::PTR)
            .fdebug()
            .write(|w| w.rxstall().bits(0xf).txstall().bits(0xf));
    }
}

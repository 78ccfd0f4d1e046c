//! The operations of `firmware/src/bin/bench` between marks, on the same photons: the
//! testbench counts the cycles. Each is done cold, when a cache holds nothing of it, and
//! warm, when the counts were read and the same was just done on others that are equal.

#![no_std]
#![no_main]

#[path = "../../../firmware/src/bin/bench/scene.rs"]
#[allow(dead_code, reason = "not every operation is measured here")]
mod scene;
#[path = "../../../firmware/src/bin/bench/ways.rs"]
mod ways;

use core::arch::asm;
use core::hint::black_box;

use dtof_core::paper::isqrt;
use dtof_core::{AerEncoder, AsyncPixel, Look, PixelAddress, PixelConfig};
use dtof_softcore::{cache, io, println, program};

use scene::{BINS, CYCLES, PHOTONS, State};
use ways::{add_batch, clear, count_batch, exposure, kept, look, pack, whole};

/// Exposures of each kind: fewer than an emulator would do, as the bit-serial
/// processor takes a second for each.
const EXPOSURES: u32 = 8;

/// Loads or stores, one after the other.
const ACCESSES: u32 = 32;

type Operation = extern "C" fn(&mut State, u32) -> u32;

/// Brings the state, whose photons are those of the exposure, to where the operation
/// begins.
type Prepare = fn(&mut State);

/// One operation.
struct Row {
    name: &'static str,
    /// Whether on exposures with a target, or without.
    target: bool,
    prepare: Prepare,
    way: Operation,
    /// How many photons, say, are in one call.
    each: u32,
}

const fn row(name: &'static str, prepare: Prepare, way: Operation, each: u32) -> Row {
    Row {
        name,
        target: true,
        prepare,
        way,
        each,
    }
}

const fn photons(name: &'static str, way: Operation) -> Row {
    row(name, empty, way, PHOTONS)
}

/// On exposures without a target.
const fn without(name: &'static str, prepare: Prepare, way: Operation) -> Row {
    Row {
        target: false,
        ..row(name, prepare, way, 1)
    }
}

/// The first is taken off all others.
const ROWS: [Row; 16] = [
    row("call", empty, call, 1),
    photons("photon: AsyncPixel::count", count),
    photons("photon: AsyncPixel::count_batch", count_batch),
    photons("photon: Histogram::add_batch", add_batch),
    without("decision: kept peak; no event", counted, kept),
    row("decision: kept peak; event and depth", counted, kept, 1),
    without("decision: look; no event", counted, look),
    without("decision: whole histogram; no event", arrived, whole),
    row(WHOLE_EVENT, arrived, whole, 1),
    row("event: look to packed word", counted, event, 1),
    row("pack: encode and to_le_bytes", at_event, pack, 1),
    row("clear: Histogram::clear", counted, clear, 1),
    row("exposure: count_batch", empty, exposure, 1),
    row("root: isqrt::<5>", empty, root, 1),
    row("access: load", empty, load, ACCESSES),
    row("access: store", empty, store, ACCESSES),
];
const WHOLE_EVENT: &str = "decision: whole histogram; event and depth";

fn run() -> bool {
    let (Some(mut state), Some(mut other)) = (State::new(), State::new()) else {
        println!("the configuration is refused");
        return false;
    };
    let mut times = [0; ROWS.len()];
    for number in 0..EXPOSURES {
        for target in [false, true] {
            state.empty(number, target);
            other.codes = state.codes;
            counted(&mut state);
            let fires = state.config.detect(state.pixel.histogram()).is_some();
            for (index, (row, times)) in ROWS.iter().zip(&mut times).enumerate() {
                let is_decision = row.name.starts_with("decision") || row.name.starts_with("event");
                // Noise may fire, if seldom.
                if row.target != target || is_decision && fires != target {
                    continue;
                }
                (row.prepare)(&mut state);
                cache::evict();
                measure(2 * index, row.way, &mut state, CYCLES.into());
                for state in [&mut state, &mut other] {
                    (row.prepare)(state);
                }
                cache::read(&state);
                black_box((row.way)(&mut other, CYCLES.into()));
                measure(2 * index + 1, row.way, &mut state, CYCLES.into());
                *times += row.each;
            }
        }
    }
    for (index, (row, times)) in ROWS.iter().zip(times).enumerate() {
        println!("operation {} {times} {}; cold", 2 * index, row.name);
        println!("operation {} {times} {}; warm", 2 * index + 1, row.name);
    }
    true
}

program!(run);

/// Marks 2 k + 1 and 2 k + 2 are about operation k. Its place is that of the start, which
/// nothing else is near: in a cache with one way it should not be in an operation's.
#[allow(unsafe_code, reason = "a section of its own")]
#[unsafe(link_section = ".text.measure")]
#[inline(never)]
fn measure(number: usize, operation: Operation, state: &mut State, argument: u32) {
    let Ok(number) = u32::try_from(number) else {
        return;
    };
    let after = 2 * number + 2;
    io::mark(after - 1);
    black_box(operation(state, argument));
    io::mark(after);
}

fn empty(state: &mut State) {
    state.pixel = AsyncPixel::new(PixelAddress::new(7));
    state.histogram.clear();
    state.encoder = AerEncoder::new();
    state.event = None;
}

/// Counts all photons, up to where the last laser cycle ends.
fn counted(state: &mut State) {
    empty(state);
    state.pixel.count_batch(&state.config, &state.codes);
    state.histogram.add_batch(&state.codes);
    state.foreign = *state.histogram.counts();
    state.wait_for_last_look();
}

/// The counts come from elsewhere.
fn arrived(state: &mut State) {
    counted(state);
    state.histogram.clear();
}

fn at_event(state: &mut State) {
    counted(state);
    let _ = state.end_laser_cycle(u32::from(CYCLES) - 1);
    state.event = state.pixel.take_event();
}

#[allow(unsafe_code, reason = "beside what calls it, for the same reason")]
#[unsafe(link_section = ".text.measure")]
extern "C" fn call(_: &mut State, _: u32) -> u32 {
    0
}

extern "C" fn count(state: &mut State, _: u32) -> u32 {
    // Each as if it came alone, not as a batch.
    for &code in &state.codes {
        one(&mut state.pixel, &state.config, code);
    }
    0
}

#[inline(never)]
fn one(pixel: &mut AsyncPixel<BINS>, config: &PixelConfig<BINS>, code: u16) {
    pixel.count(config, code);
}

extern "C" fn event(state: &mut State, cycle: u32) -> u32 {
    if state.end_laser_cycle(cycle) == Look::Event {
        state.event = state.pixel.take_event();
    }
    pack(state, 0)
}

extern "C" fn root(_: &mut State, value: u32) -> u32 {
    isqrt::<5>(value)
}

#[allow(unsafe_code, reason = "so many instructions of one kind")]
extern "C" fn load(state: &mut State, _: u32) -> u32 {
    // SAFETY: reads the first word of what a reference reaches, which is aligned to 8.
    unsafe {
        asm!(".rept {n}", "lw {t}, 0({p})", ".endr", n = const ACCESSES, t = out(reg) _,
            p = in(reg) &raw const *state, options(nostack, readonly));
    }
    0
}

#[allow(unsafe_code, reason = "so many instructions of one kind")]
extern "C" fn store(_: &mut State, value: u32) -> u32 {
    let mut word = value;
    // SAFETY: writes a variable of its own.
    unsafe {
        asm!(".rept {n}", "sw {v}, 0({p})", ".endr", n = const ACCESSES, v = in(reg) value,
            p = in(reg) &raw mut word, options(nostack));
    }
    word
}

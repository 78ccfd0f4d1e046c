//! The operations, each called as a program would call it.

use dtof_core::fixed::types::U24F8;
use dtof_core::paper::centroid;
use dtof_core::{LaserCycle, Look, OncePerBin};

use crate::counter::{Counter, Operation};
use crate::report;
use crate::scene::{BINS, CYCLES, EXPOSURES, PHOTONS, PHOTONS_A_CYCLE, State};
use crate::ways::{add_batch, clear, count_batch, exposure, look, pack};

/// Measures all.
pub fn run(counter: &Counter, state: &mut State) {
    let photons = EXPOSURES * PHOTONS;
    let mut total = 0;
    for number in 0..EXPOSURES {
        state.empty(number, true);
        for index in 0..PHOTONS {
            total += counter.measure(count, state, index);
        }
    }
    report::line("photon", "AsyncPixel::count", total, photons);
    let of_photons: [(&str, Operation, Prepare); 4] = [
        ("AsyncPixel::count_batch", count_batch, empty),
        ("AsyncPixel::count_batch; gate", count_batch, gated),
        ("AsyncPixel::count_once_per_bin", count_once_per_bin, empty),
        ("Histogram::add_batch", add_batch, empty),
    ];
    for (variant, way, prepare) in of_photons {
        let total = exposures(counter, state, way, prepare);
        report::line("photon", variant, total, photons);
    }
    let rows: [(&str, &str, Operation, Prepare); 7] = [
        ("frame", "Histogram::add_frame", add_frame, frame),
        ("depth", "centroid", depth, with_target),
        ("pack", "encode and to_le_bytes", pack, with_event),
        ("clear", "Histogram::clear", clear, with_target),
        ("clear", "look at L2", look, at_l2),
        ("exposure", "count_batch", exposure, empty),
        ("exposure", "count", exposure_single, empty),
    ];
    for (operation, variant, way, prepare) in rows {
        let total = exposures(counter, state, way, prepare);
        report::line(operation, variant, total, EXPOSURES);
    }
}

/// Laser cycles of 16 photons.
extern "C" fn count_once_per_bin(state: &mut State, _: u32) -> u32 {
    let mut bins = OncePerBin::<{ OncePerBin::words(BINS) }>::new();
    for codes in state.codes.chunks(16) {
        let (config, statistics) = (&state.config, &mut state.statistics);
        state
            .pixel
            .count_once_per_bin(config, statistics, &mut bins, codes);
        bins.end_laser_cycle();
    }
    0
}

/// All exposures together.
pub fn exposures(counter: &Counter, state: &mut State, way: Operation, prepare: Prepare) -> u32 {
    let mut total = 0;
    for number in 0..EXPOSURES {
        prepare(state, number);
        total += counter.measure(way, state, number);
    }
    total
}

/// Brings the state to where the operation begins.
pub type Prepare = fn(&mut State, u32);

fn empty(state: &mut State, number: u32) {
    state.empty(number, true);
}

fn gated(state: &mut State, number: u32) {
    state.empty(number, true);
    state.config = state.gated;
}

pub fn with_target(state: &mut State, number: u32) {
    state.counted(number, true);
}

fn frame(state: &mut State, number: u32) {
    state.counted(number, true);
    state.histogram.clear();
}

pub fn with_event(state: &mut State, number: u32) {
    state.target(number);
}

fn at_l2(state: &mut State, number: u32) {
    state.counted(number, true);
    state.config = state.never_fires;
    state.wait_for_last_look();
}

extern "C" fn count(state: &mut State, index: u32) -> u32 {
    if let Some(&code) = state.codes.get(index as usize) {
        state.pixel.count(&state.config, code);
    }
    0
}

extern "C" fn add_frame(state: &mut State, _: u32) -> u32 {
    let gate = state.config.gate();
    state.histogram.add_frame(&state.foreign, gate);
    0
}

extern "C" fn depth(state: &mut State, _: u32) -> u32 {
    let peak = state.histogram.peak();
    let gate = state.config.gate();
    let depth = centroid(&state.histogram, gate, peak, const { U24F8::lit("3") });
    depth.offset.raw().unsigned_abs().into()
}

extern "C" fn exposure_single(state: &mut State, _: u32) -> u32 {
    let mut photons = state.codes.chunks(PHOTONS_A_CYCLE);
    for cycle in 0..CYCLES {
        for &code in photons.next().unwrap_or_default() {
            state.pixel.count(&state.config, code);
        }
        let (statistics, cycle) = (&mut state.statistics, LaserCycle::new(cycle.into()));
        let look = (state.pixel).end_laser_cycle(&state.config, statistics, cycle);
        if look == Look::Event {
            state.event = state.pixel.take_event();
        }
    }
    pack(state, 0)
}

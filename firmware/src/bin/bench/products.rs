//! The products of a pixel's events.

use core::hint::black_box;

use dtof_core::fixed::types::I24F8;

use crate::counter::{Counter, Operation};
use crate::operations::{exposures, with_event};
use crate::report;
use crate::scene::{EXPOSURES, State};

/// Measures all, an event of each exposure with a target.
pub fn run(counter: &Counter, state: &mut State) {
    let rows: [(&str, Operation); 6] = [
        ("running mean of 3", mean_of_3),
        ("running mean of 10", mean_of_10),
        ("dynamic depth; no change", dynamic_depth),
        ("dynamic depth; change and word", dynamic_depth),
        ("reflectivity, event in", reflectivity),
        ("reflectivity, signal × range²", of_signal),
    ];
    let [still, moving] = state.dynamic_depths;
    for (variant, way) in rows {
        let of_change = variant.ends_with("word");
        state.dynamic_depth = if of_change { moving } else { still };
        // The exposures have their targets at different ranges.
        let total = exposures(counter, state, way, with_event);
        report::line("product", variant, total, EXPOSURES);
    }
}

extern "C" fn mean_of_3(state: &mut State, _: u32) -> u32 {
    let Some(event) = &state.event else {
        return 0;
    };
    state.mean_of_3.push(event.position());
    black_box(state.mean_of_3.mean());
    1
}

extern "C" fn mean_of_10(state: &mut State, _: u32) -> u32 {
    let Some(event) = &state.event else {
        return 0;
    };
    state.mean_of_10.push(event.position());
    black_box(state.mean_of_10.mean());
    1
}

extern "C" fn dynamic_depth(state: &mut State, _: u32) -> u32 {
    let Some(event) = &state.event else {
        return 0;
    };
    let Some(change) = state.changes.observe(&state.dynamic_depth, event) else {
        return 0;
    };
    let (_, word) = state.encoder.encode_dynamic_depth(&change);
    black_box(word.to_le_bytes());
    1
}

extern "C" fn reflectivity(state: &mut State, _: u32) -> u32 {
    let Some(event) = &state.event else {
        return 0;
    };
    state.reflectivity.add(event);
    1
}

extern "C" fn of_signal(state: &mut State, _: u32) -> u32 {
    black_box(state.reflectivity.of_signal(const { I24F8::lit("2000") }));
    1
}

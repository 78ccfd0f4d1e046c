//! Operations that the soft-cores' bench measures as well.

use core::hint::black_box;

use dtof_core::{Detection, LaserCycle, Look};

use crate::scene::{CYCLES, PHOTONS_A_CYCLE, State};

pub extern "C" fn count_batch(state: &mut State, _: u32) -> u32 {
    state.pixel.count_batch(&state.config, &state.codes);
    0
}

pub extern "C" fn add_batch(state: &mut State, _: u32) -> u32 {
    state.histogram.add_batch(&state.codes);
    0
}

/// A number of the decision, so that no part of it is optimised away.
#[inline(always)]
pub fn offset(detection: Option<Detection>) -> u32 {
    detection.map_or(0, |found| found.depth.offset.raw().unsigned_abs().into())
}

/// A decision on the peak kept while counting.
pub extern "C" fn kept(state: &mut State, _: u32) -> u32 {
    offset(state.config.detect(state.pixel.histogram()))
}

/// From counts that come from elsewhere to the decision.
pub extern "C" fn whole(state: &mut State, _: u32) -> u32 {
    let gate = state.config.gate();
    state.histogram.add_frame(&state.foreign, gate);
    offset(state.config.detect(&state.histogram))
}

pub extern "C" fn look(state: &mut State, cycle: u32) -> u32 {
    state.end_laser_cycle(cycle) as u32
}

pub extern "C" fn pack(state: &mut State, _: u32) -> u32 {
    let Some(event) = &state.event else {
        return 0;
    };
    let (_, word) = state.encoder.encode(event);
    black_box(word.to_le_bytes());
    1
}

pub extern "C" fn clear(state: &mut State, _: u32) -> u32 {
    state.histogram.clear();
    0
}

/// A whole exposure, to the word of its event.
pub extern "C" fn exposure(state: &mut State, _: u32) -> u32 {
    let mut photons = state.codes.chunks(PHOTONS_A_CYCLE);
    for cycle in 0..CYCLES {
        let photons = photons.next().unwrap_or_default();
        state.pixel.count_batch(&state.config, photons);
        let (statistics, cycle) = (&mut state.statistics, LaserCycle::new(cycle.into()));
        let look = (state.pixel).end_laser_cycle(&state.config, statistics, cycle);
        if look == Look::Event {
            state.event = state.pixel.take_event();
        }
    }
    pack(state, 0)
}

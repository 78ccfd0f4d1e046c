//! Decisions: with the peak kept while counting, and on a histogram that arrives
//! whole from elsewhere.

use dtof_core::{Count10, LaserCycle, detect};

use crate::counter::{Counter, Operation};
use crate::report::Report;
use crate::scene::{CYCLES, EXPOSURES, State};

const WITH_GATE: &str = "kept peak; no event; gate";

/// Brings the state to where the decision begins.
type Prepare = fn(&mut State);

/// Measures all.
pub fn run(report: &mut Report, counter: &Counter, state: &mut State) {
    let rows: [(&str, Operation, bool); 6] = [
        ("kept peak; no event", kept, false),
        (WITH_GATE, kept, false),
        ("kept peak; event and depth", kept, true),
        ("look; no event", look, false),
        ("whole histogram; no event", whole, false),
        ("whole histogram; event", whole, true),
    ];
    for (variant, way, event) in rows {
        let (mut total, mut runs) = (0, 0);
        for number in 0..EXPOSURES {
            state.counted(number, event);
            if variant == WITH_GATE {
                state.count_gated();
            }
            state.wait_for_last_look();
            // Noise may fire, if seldom.
            if fires(state) == event {
                total += counter.measure(way, state, CYCLES.into());
                runs += 1;
            }
        }
        report.line("decision", variant, total, runs);
    }
    for (variant, exposures) in [
        ("whole histogram; no event; background of 20", 10),
        ("whole histogram; no event; background of 100", 50),
    ] {
        let (mut total, mut runs) = (0, 0);
        for number in 0..EXPOSURES {
            state.counted_together(number * exposures, exposures);
            // Noise may fire, if seldom.
            if whole(state, 0) == 0 {
                total += counter.measure(whole, state, 0);
                runs += 1;
            }
        }
        report.line("decision", variant, total, runs);
    }
    let slowest: [(&str, Operation, Prepare); 2] = [
        ("kept peak; slowest no event", kept, State::late_background),
        (
            "whole histogram; slowest no event",
            whole,
            State::undecided_bits,
        ),
    ];
    for (variant, way, prepare) in slowest {
        prepare(state);
        report.line("decision", variant, counter.measure(way, state, 0), 1);
    }
}

fn fires(state: &State) -> bool {
    let config = &state.config;
    detect(
        state.pixel.histogram(),
        config.gate(),
        config.rule(),
        config.estimator(),
    )
    .is_some()
}

extern "C" fn kept(state: &mut State, _: u32) -> u32 {
    let config = &state.config;
    match detect(
        state.pixel.histogram(),
        config.gate(),
        config.rule(),
        config.estimator(),
    ) {
        Some(detection) => detection.depth.offset.raw().unsigned_abs().into(),
        None => 0,
    }
}

extern "C" fn look(state: &mut State, cycle: u32) -> u32 {
    let cycle = LaserCycle(cycle.into());
    state.pixel.end_laser_cycle(&state.config, cycle) as u32
}

extern "C" fn whole(state: &mut State, _: u32) -> u32 {
    let config = &state.config;
    let detected = config
        .rule()
        .detect_whole::<Count10, _>(&state.foreign, config.gate());
    detected.map_or(0, |(peak, background)| {
        u32::from(peak.bin.raw()) + background.raw()
    })
}

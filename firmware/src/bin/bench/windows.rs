//! Window rules and centred windows, which differ by their width, and rules chosen when the
//! program runs.

use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::{AnyRule, Count, DepthEstimator, RangeGate, WindowRule, detect};

use crate::counter::Counter;
use crate::report::Report;
use crate::scene::{EXPOSURES, State};

const RULES: [(u8, &str); 5] = [
    (1, "window of 1; no event"),
    (2, "window of 2; no event"),
    (3, "window of 3; no event"),
    (5, "window of 5; no event"),
    (7, "window of 7; no event"),
];
/// Pulses, σ in bins.
const PULSES: [(U8F8, &str); 4] = [
    (U8F8::lit("0.4"), "centred window, σ 0.4"),
    (U8F8::lit("0.5"), "centred window, σ 0.5"),
    (U8F8::lit("1"), "centred window, σ 1"),
    (U8F8::lit("1.5"), "centred window, σ 1.5"),
];

/// Measures all.
pub fn run(report: &mut Report, counter: &Counter, state: &mut State) {
    for (width, variant) in RULES {
        let z = const { U4F12::lit("4.4") };
        let Ok(rule) = WindowRule::new(width, z, Count::saturating(5)) else {
            continue;
        };
        state.window = rule;
        let (mut total, mut runs) = (0, 0);
        for number in 0..EXPOSURES {
            state.counted(number, false);
            if !fires(state) {
                total += counter.measure(decide, state, 0);
                runs += 1;
            }
        }
        report.line("decision", variant, total, runs);
    }
    let Ok(window) = WindowRule::new(3, const { U4F12::lit("4.4") }, Count::saturating(5)) else {
        return;
    };
    let rules = [
        (
            AnyRule::from(*state.config.rule()),
            "any rule: the paper's; no event",
        ),
        (AnyRule::from(window), "any rule: window of 3; no event"),
    ];
    for (rule, variant) in rules {
        state.any_rule = rule;
        let (mut total, mut runs) = (0, 0);
        for number in 0..EXPOSURES {
            state.counted(number, false);
            if decided_by_any(state).is_none() {
                total += counter.measure(decide_by_any, state, 0);
                runs += 1;
            }
        }
        report.line("decision", variant, total, runs);
    }
    for (sigma, variant) in PULSES {
        state.estimator = DepthEstimator::for_pulse(sigma);
        let mut total = 0;
        for number in 0..EXPOSURES {
            state.counted(number, true);
            total += counter.measure(estimate, state, 0);
        }
        report.line("depth", variant, total, EXPOSURES);
    }
}

fn fires(state: &State) -> bool {
    decided(state).is_some()
}

#[inline(always)]
fn decided(state: &State) -> Option<dtof_core::Detection> {
    detect(
        state.pixel.histogram(),
        &RangeGate::full(),
        &state.window,
        &state.estimator,
    )
}

extern "C" fn decide(state: &mut State, _: u32) -> u32 {
    decided(state).map_or(0, |detection| {
        detection.depth.offset.raw().unsigned_abs().into()
    })
}

#[inline(always)]
fn decided_by_any(state: &State) -> Option<dtof_core::Detection> {
    detect(
        state.pixel.histogram(),
        &RangeGate::full(),
        &state.any_rule,
        &state.estimator,
    )
}

extern "C" fn decide_by_any(state: &mut State, _: u32) -> u32 {
    decided_by_any(state).map_or(0, |detection| {
        detection.depth.offset.raw().unsigned_abs().into()
    })
}

extern "C" fn estimate(state: &mut State, _: u32) -> u32 {
    let background = const { U24F8::lit("2") };
    let (peak, gate) = (state.histogram.peak(), state.config.gate());
    let depth = state
        .estimator
        .estimate(&state.histogram, gate, peak, background);
    depth.offset.raw().unsigned_abs().into()
}

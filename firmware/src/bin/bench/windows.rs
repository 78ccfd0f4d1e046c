//! The average rule, window rules and centred windows, which differ by their width, and
//! rules chosen when the program runs.

use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::rule::detect;
use dtof_core::{
    AnyRule, CentredWindow, Count, DepthEstimator, Detection, DetectionRule, RangeGate, WindowRule,
};

use crate::counter::{Counter, Operation};
use crate::operations::{exposures, with_target};
use crate::report;
use crate::scene::{EXPOSURES, State};
use crate::ways::offset;

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

/// Half widths of a window for a pulse that falls slowly, in bins.
const BEFORE: U8F8 = U8F8::lit("1.75");
const AFTER: U8F8 = U8F8::lit("4");

/// Measures all.
pub fn run(counter: &Counter, state: &mut State) {
    undecided(
        counter,
        state,
        "average; no event",
        decide_by_average,
        average_fires,
    );
    for (width, variant) in RULES {
        if let Some(rule) = window(width) {
            state.window = rule;
            undecided(counter, state, variant, decide, fires);
        }
    }
    let Some(window) = window(3) else {
        return;
    };
    let paper = AnyRule::from(*state.config.rule());
    for (rule, variant) in [
        (paper, "any rule: the paper's; no event"),
        (AnyRule::from(window), "any rule: window of 3; no event"),
    ] {
        state.any_rule = rule;
        undecided(counter, state, variant, decide_by_any, any_fires);
    }
    for (sigma, variant) in PULSES {
        state.estimator = DepthEstimator::for_pulse(sigma);
        depth(counter, state, variant);
    }
    if let Some(skew) = CentredWindow::with_sides(BEFORE, AFTER) {
        state.estimator = DepthEstimator::CentredWindow(skew);
        depth(counter, state, "centred window, 1.75 before and 4 after");
    }
}

fn depth(counter: &Counter, state: &mut State, variant: &str) {
    let total = exposures(counter, state, estimate, with_target);
    report::line("depth", variant, total, EXPOSURES);
}

fn window(width: u8) -> Option<WindowRule> {
    let z = const { U4F12::lit("4.4") };
    WindowRule::new(width, z, Count::saturating(5)).ok()
}

/// Measures decisions without an event.
fn undecided(
    counter: &Counter,
    state: &mut State,
    variant: &str,
    decide: Operation,
    fires: fn(&State) -> bool,
) {
    let (mut total, mut runs) = (0, 0);
    for number in 0..EXPOSURES {
        state.counted(number, false);
        if !fires(state) {
            total += counter.measure(decide, state, 0);
            runs += 1;
        }
    }
    report::line("decision", variant, total, runs);
}

#[inline(always)]
fn decided(state: &State, rule: &impl DetectionRule) -> Option<Detection> {
    let (gate, estimator) = (&RangeGate::full(), &state.estimator);
    detect(state.pixel.histogram(), gate, rule, estimator)
}

fn average_fires(state: &State) -> bool {
    decided(state, &state.average).is_some()
}

extern "C" fn decide_by_average(state: &mut State, _: u32) -> u32 {
    offset(decided(state, &state.average))
}

fn fires(state: &State) -> bool {
    decided(state, &state.window).is_some()
}

fn any_fires(state: &State) -> bool {
    decided(state, &state.any_rule).is_some()
}

extern "C" fn decide(state: &mut State, _: u32) -> u32 {
    offset(decided(state, &state.window))
}

extern "C" fn decide_by_any(state: &mut State, _: u32) -> u32 {
    offset(decided(state, &state.any_rule))
}

extern "C" fn estimate(state: &mut State, _: u32) -> u32 {
    let background = const { U24F8::lit("2") };
    let (peak, gate) = (state.histogram.peak(), state.config.gate());
    let depth = state
        .estimator
        .estimate(&state.histogram, gate, peak, background);
    depth.offset.raw().unsigned_abs().into()
}

//! Decisions: with the peak kept while counting, and on a histogram that arrives
//! whole from elsewhere.

use crate::counter::{Counter, Operation};
use crate::report;
use crate::scene::{CYCLES, EXPOSURES, State};
use crate::ways::{kept, look, whole};

const WITH_GATE: &str = "kept peak; no event; gate";

/// Measures all.
pub fn run(counter: &Counter, state: &mut State) {
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
                state.histogram.clear();
                total += counter.measure(way, state, CYCLES.into());
                runs += 1;
            }
        }
        report::line("decision", variant, total, runs);
    }
    state.late_background();
    let slowest = counter.measure(kept, state, 0);
    report::line("decision", "kept peak; slowest no event", slowest, 1);
}

fn fires(state: &State) -> bool {
    state.config.detect(state.pixel.histogram()).is_some()
}

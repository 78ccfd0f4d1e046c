//! When the histograms of four pixels are in their processing element: the paper's Fig. 22, for
//! each possible interpretation.

use crate::studies::scenes::latency::element::{PIXELS, ProcessingElement, READINGS};
use dtof_draw::palette::Colour;
use dtof_draw::svg::{Anchor, At, BOLD, EDGE, Svg, TEXT, TITLE, wrapped};

/// Laser cycles drawn.
const CYCLES: u16 = 24;
const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
/// The left edge of the laser cycles, and the width of one.
const LEFT: f64 = EDGE + 72.0;
const CYCLE: f64 = (INNER - 72.0) / CYCLES as f64;
const ROW: f64 = 22.0;
const LINE: f64 = 19.0;
/// One colour per pixel.
const COLOURS: [Colour; PIXELS as usize] =
    [Colour::Blue, Colour::Orange, Colour::Green, Colour::Purple];

/// A histogram in a stage, in laser cycles of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Occupancy {
    pixel: u16,
    from: u16,
    to: u16,
}

/// The occupancy of stage `stage` in steady state.
fn occupancies(element: ProcessingElement, stage: u16) -> Vec<Occupancy> {
    let interval = element.interval;
    // Starts early enough that the element is full.
    let before = element.x() * 4;
    let enters = (0..before + CYCLES).filter(|end| end % interval == 0);
    let occupancies = enters.filter_map(|enter| {
        let from = enter + stage * interval;
        let to = (from + interval).min(before + CYCLES);
        (before..before + CYCLES)
            .contains(&from)
            .then(|| Occupancy {
                pixel: enter / interval % PIXELS,
                from: from - before,
                to: to - before,
            })
    });
    occupancies.collect()
}

/// The drawing.
pub fn timing() -> String {
    let title = "With X = 4 and four laser cycles each, four histograms are in the element at once";
    let note = "Numbers are pixels: each colour is the histogram of one of four, handed in when its turn \
                comes. All pixels count on meanwhile.";
    let mut svg = Svg::default();
    let lines = wrapped(title, BOLD * TITLE.0, INNER);
    let mut y = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines) + 6.0;
    for element in &READINGS[1..] {
        y = panel(&mut svg, *element, y);
    }
    for cycle in (0..=CYCLES).step_by(4) {
        let place = (LEFT + f64::from(cycle) * CYCLE, y + 6.0);
        svg.text("soft", place, TEXT, Anchor::Middle, &cycle.to_string());
    }
    let place = (LEFT + INNER / 2.0 - 36.0, y + 6.0 + LINE);
    svg.text("soft", place, TEXT, Anchor::Middle, "laser cycles");
    y += 2.0 * LINE + 8.0;
    let lines = wrapped(note, TEXT, INNER);
    y = svg.lines("soft", (EDGE, y), (TEXT, LINE), Anchor::Start, &lines);
    svg.document((WIDTH, y + EDGE - 4.0), title)
}

/// Draws one interpretation with a row per stage. Returns its bottom.
fn panel(svg: &mut Svg, element: ProcessingElement, top: f64) -> f64 {
    let name = format!(
        "{}: X = {}, an answer after {}",
        element.name,
        element.x(),
        element.delay
    );
    svg.text(
        "ink panel",
        (EDGE, top + LINE / 2.0),
        TEXT,
        Anchor::Start,
        &name,
    );
    let mut y = top + LINE + 3.0;
    for stage in 0..element.in_flight() {
        let place = (EDGE, y + ROW / 2.0);
        let name = format!("stage {}", stage + 1);
        svg.text("soft", place, TEXT, Anchor::Start, &name);
        for occupancy in occupancies(element, stage) {
            let left = LEFT + f64::from(occupancy.from) * CYCLE;
            let width = f64::from(occupancy.to - occupancy.from) * CYCLE;
            let class = COLOURS[usize::from(occupancy.pixel)].class();
            let [x, y_at, wide, high] = [left + 1.0, y + 1.0, width - 2.0, ROW - 2.0].map(At);
            svg.raw(&format!(
                "<g class=\"{class}\"><rect class=\"fill\" fill-opacity=\".22\" x=\"{x}\" y=\"{y_at}\" width=\"{wide}\" height=\"{high}\"/></g>"
            ));
            let place = (left + width / 2.0, y + ROW / 2.0);
            let number = (occupancy.pixel + 1).to_string();
            svg.text("ink", place, TEXT, Anchor::Middle, &number);
        }
        y += ROW;
    }
    y + 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_never_empty_and_holds_one_histogram() {
        for element in &READINGS[1..] {
            for stage in 0..element.in_flight() {
                let occupancies = occupancies(*element, stage);
                assert_eq!(
                    (occupancies[0].from, occupancies.last().unwrap().to),
                    (0, CYCLES)
                );
                for pair in occupancies.windows(2) {
                    assert_eq!(pair[0].to, pair[1].from);
                    assert_eq!((pair[0].pixel + 1) % PIXELS, pair[1].pixel);
                }
            }
        }
    }

    /// The second stage holds what the first held one interval earlier; four histograms at once are
    /// of four pixels.
    #[test]
    fn the_title_holds() {
        let [_, pipeline, ..] = READINGS;
        assert_eq!(
            (pipeline.x(), pipeline.delay, pipeline.in_flight()),
            (4, 4, 4)
        );
        let mut at_once: Vec<u16> = (0..4)
            .map(|stage| occupancies(pipeline, stage)[8].pixel)
            .collect();
        at_once.sort_unstable();
        assert_eq!(at_once, [0, 1, 2, 3]);
    }
}

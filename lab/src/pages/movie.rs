//! Events as an animation: each flash is an event.
//!
//! A pixel appears with its first event, in the colour of its range, and lights up with each event.
//! An event of a block lights up the whole block. A second echo is a smaller square within the
//! pixel. The picture is an SVG document with CSS animations. Viewers without animations, and
//! readers who prefer reduced motion, see the last frame.

use std::collections::{BTreeMap, HashMap};

use anyhow::Result;
use dtof_core::{Array, EchoNumber, PixelAddress};

use dtof_data::events::events_csv::range_mm;
use dtof_data::events::last_events::LastEvents;
use dtof_data::options::rows::grouped;
use dtof_data::photons::source::PhotonSource;
use dtof_draw::palette;
use dtof_draw::picture::{levels, span};
use dtof_draw::svg::{Anchor, At, BOLD, EDGE, Svg, TEXT, TITLE, wrapped};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_light::demo;

/// Laser cycles shown, and the number of animation frames.
const CYCLES: u16 = 2000;
const MOMENTS: u16 = 100;
/// Seconds until the last laser cycle, and until the animation repeats.
const PLAY_SECONDS: f64 = 10.0;
const LOOP_SECONDS: f64 = 12.0;
/// Ranges are drawn in every 15th colour level.
const STEP: u8 = 15;

const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
const LINE: f64 = 19.0;
/// The time a flash takes to fade, in percent of [`LOOP_SECONDS`].
const FADE: f64 = 6.0;

/// An event: its frame, its square in the array, and its range in millimetres.
#[derive(Clone, Copy, Debug)]
struct Flash {
    moment: u16,
    square: Square,
    range_mm: f64,
}

/// A pixel, or a block of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Square {
    column: u32,
    row: u32,
    side: u32,
    /// Whether it is a second echo, which is drawn smaller.
    is_behind: bool,
}

/// The first laser cycles of `dtof demo`.
///
/// # Errors
/// Fails if the scene of the demo cannot be simulated.
pub fn demo() -> Result<String> {
    let (scene, settings) = (demo::scene()?, Settings::demo(1)?);
    let mut photons = scene.photons(settings.seed, CYCLES.into())?;
    let mut engine = host_engine(&settings, photons.array(), &photons.addresses())?;
    let slice = photons.next_slice(CYCLES)?;
    let events = engine.run(&slice)?;
    let array = photons.array();
    let ranges = settings.ranges(array)?;
    let mut firsts = vec![u64::MAX; array.pixels() as usize];
    let mut last_events = vec![LastEvents::default(); array.pixels() as usize];
    let mut flashes = Vec::new();
    let mut marks = Vec::new();
    for event in &events {
        let flash = |pixel, side| Flash {
            moment: moment(event.cycle.raw()),
            square: square(pixel, side, event.echo, array),
            range_mm: range_mm(event, &ranges),
        };
        flashes.push(flash(event.pixel, 1 << event.level.raw()));
        for pixel in array.pixels_of(event.pixel, event.level) {
            let index = usize::from(pixel.raw());
            if last_events[index].record(event.level, event.cycle, event.exposure.into()) {
                marks.push(flash(pixel, 1));
                firsts[index] = firsts[index].min(event.cycle.raw() + 1);
            }
        }
    }
    let mut notes = Vec::new();
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let on_surface = |address| {
            let view = scene.truth(address, 0);
            view.is_some_and(|view| view.surface == index)
        };
        let seen = photons.addresses().into_iter();
        let seen = seen.filter(|&address| on_surface(address));
        let mut firsts: Vec<u64> = seen.map(|pixel| firsts[usize::from(pixel.raw())]).collect();
        firsts.sort_unstable();
        let median = firsts.get(firsts.len() / 2).copied().unwrap_or(u64::MAX);
        let more = if median > u64::from(CYCLES) {
            "more than "
        } else {
            ""
        };
        let first = grouped(median.min(CYCLES.into()));
        notes.push(format!("{} after {more}{first}", surface.name));
    }
    let title = "Each flash is an event: bright pixels report often, dim ones later and in blocks";
    let notes = notes.join(", ");
    let note = format!(
        "First event of a typical pixel, in laser cycles: {notes}. Small squares are \
         second echoes: on the pane the wall behind it, elsewhere edges and motion."
    );
    Ok(draw(array, &flashes, &marks, title, &note))
}

fn moment(cycle: u64) -> u16 {
    let moment = cycle * u64::from(MOMENTS) / u64::from(CYCLES);
    u16::try_from(moment).unwrap_or(MOMENTS)
}

/// The square of a pixel, or of a block that starts there.
fn square(pixel: PixelAddress, side: u32, echo: EchoNumber, array: Array) -> Square {
    let pixel = u32::from(pixel.raw());
    Square {
        column: pixel % array.columns(),
        row: pixel / array.columns(),
        side,
        is_behind: echo > EchoNumber::FIRST,
    }
}

/// Draws `flashes`, which light up, and `marks`, which stay until the next mark of their square.
fn draw(array: Array, flashes: &[Flash], marks: &[Flash], title: &str, note: &str) -> String {
    let mut svg = Svg::default();
    svg.raw(&format!("<style>{}</style>", sheet()));
    let lines = wrapped(title, BOLD * TITLE.0, INNER);
    let mut y = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines) + 8.0;
    let side = INNER / f64::from(array.columns());
    let (left, top) = (At(EDGE), At(y));
    svg.raw(&format!(
        "<g transform=\"translate({left} {top})scale({side})\">"
    ));
    let all = flashes.iter().chain(marks);
    let ranges: Vec<Option<f64>> = all.map(|flash| Some(flash.range_mm)).collect();
    let mut steps = levels(&ranges)
        .into_iter()
        .map(|level| (level.unwrap_or(0).saturating_add(STEP / 2) / STEP) * STEP);
    let mut stepped = |flashes: &[Flash]| -> Vec<(Flash, u8)> {
        flashes.iter().copied().zip(&mut steps).collect()
    };
    let (flashes, marks) = (stepped(flashes), changes(&stepped(marks)));
    svg.raw("<g class=\"s\">");
    for moment in 0..=MOMENTS {
        let mark = shapes(&marks, moment);
        if !mark.is_empty() {
            svg.raw(&format!("<g class=\"b b{moment}\">{mark}</g>"));
        }
    }
    svg.raw("</g>");
    for moment in 0..=MOMENTS {
        let flash = shapes(&flashes, moment);
        if !flash.is_empty() {
            let delay = At(f64::from(moment) / f64::from(MOMENTS) * PLAY_SECONDS);
            svg.raw(&format!(
                "<g class=\"f\" style=\"animation-delay:{delay}s\">{flash}</g>"
            ));
        }
    }
    svg.raw("</g>");
    let height = side * f64::from(array.rows());
    let [left, top, width, high] = [EDGE, y, INNER, height].map(At);
    svg.raw(&format!(
        "<rect class=\"edge\" fill=\"none\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{high}\"/>"
    ));
    y = time(&mut svg, y + height + 14.0);
    y = colours(&mut svg, span(&ranges).unwrap_or_default(), y + 10.0);
    let lines = wrapped(note, TEXT, INNER);
    y = svg.lines("soft", (EDGE, y), (TEXT, LINE), Anchor::Start, &lines);
    svg.document((WIDTH, y + EDGE - 4.0), title)
}

/// The marks that change the colour of their square.
fn changes(marks: &[(Flash, u8)]) -> Vec<(Flash, u8)> {
    let mut shown: HashMap<Square, u8> = HashMap::new();
    let mut changes = Vec::new();
    for &(flash, step) in marks {
        let before = shown.insert(flash.square, step);
        let is_far = before.is_none_or(|before| before.abs_diff(step) > STEP);
        if is_far {
            changes.push((flash, step));
        } else if let Some(before) = before {
            shown.insert(flash.square, before);
        }
    }
    changes
}

/// The squares of one frame: a path for each size and colour, the small ones on top.
fn shapes(those: &[(Flash, u8)], moment: u16) -> String {
    let mut paths: BTreeMap<(bool, u32, u8), String> = BTreeMap::new();
    for (flash, step) in those.iter().filter(|(flash, _)| flash.moment == moment) {
        let Square {
            column,
            row,
            side,
            is_behind,
        } = flash.square;
        // A line as long as wide is the shortest way to write a square.
        let y = At(f64::from(row) + f64::from(side) / 2.0);
        let path = paths.entry((is_behind, side, *step)).or_default();
        *path += &match is_behind {
            false => format!("M{column} {y}h{side}"),
            true => {
                let x = At(f64::from(column) + f64::from(side) * 0.3);
                format!("M{x} {y}h{}", At(f64::from(side) * 0.4))
            }
        };
    }
    let mut text = String::new();
    for ((is_behind, side, step), path) in paths {
        let width = match is_behind {
            false => format!("{side}.05"), // no seams
            true => At(f64::from(side) * 0.4).to_string(),
        };
        let colour = palette::hex(palette::level(step));
        text += &format!("<path stroke=\"{colour}\" stroke-width=\"{width}\" d=\"{path}\"/>");
    }
    text
}

/// The style sheet of the animation.
fn sheet() -> String {
    let end = PLAY_SECONDS / LOOP_SECONDS * 100.0;
    let mut sheet = format!(
        ".s{{opacity:.45}}.f{{opacity:0;animation:f {LOOP_SECONDS}s linear infinite}}\
         .t{{transform-box:fill-box;transform-origin:left;animation:t {LOOP_SECONDS}s linear infinite}}\
         @keyframes f{{0%{{opacity:1}}{FADE}%,to{{opacity:0}}}}\
         @keyframes t{{0%{{transform:scaleX(0)}}{}%,to{{transform:scaleX(1)}}}}",
        At(end)
    );
    for moment in 0..=MOMENTS {
        let at = f64::from(moment) / f64::from(MOMENTS) * end;
        let (before, at) = (At(at), At(at + 0.1));
        sheet += &format!(
            "\n.b{moment}{{animation:b{moment} {LOOP_SECONDS}s linear infinite}}\
             @keyframes b{moment}{{0%,{before}%{{opacity:0}}{at}%,to{{opacity:1}}}}"
        );
    }
    sheet
        + "\n@media (prefers-reduced-motion:reduce){.b,.f,.t{animation:none!important}.s{opacity:1}}"
}

/// Draws the laser cycles as a growing bar. Returns its bottom.
fn time(svg: &mut Svg, y: f64) -> f64 {
    let [left, top, width] = [EDGE, y, INNER].map(At);
    svg.raw(&format!(
        "<g class=\"soft\"><rect class=\"fill t\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"5\"/></g>"
    ));
    for quarter in 0..=4u16 {
        let cycles = CYCLES / 4 * quarter;
        let x = EDGE + INNER * f64::from(quarter) / 4.0;
        svg.line("edge", (x, y - 3.0), (x, y + 8.0));
        let (anchor, text) = match quarter {
            0 => (Anchor::Start, "laser cycle 0".to_owned()),
            4 => (Anchor::End, grouped(cycles.into())),
            _ => (Anchor::Middle, grouped(cycles.into())),
        };
        svg.text("soft", (x, y + 19.0), TEXT, anchor, &text);
    }
    y + 28.0
}

/// Draws the legend of the colours. Returns its bottom.
fn colours(svg: &mut Svg, (low, high): (f64, f64), y: f64) -> f64 {
    let name = "range, mm:";
    svg.text("soft", (EDGE, y + LINE / 2.0), TEXT, Anchor::Start, name);
    let mut x = EDGE + 86.0;
    let place = (x, y + LINE / 2.0);
    svg.text("soft", place, TEXT, Anchor::Start, &format!("{low:.0}"));
    x += 44.0;
    for step in (0..=u8::MAX).step_by(STEP.into()) {
        let (left, top, fill) = (At(x), At(y + 4.0), palette::hex(palette::level(step)));
        svg.raw(&format!(
            "<rect fill=\"{fill}\" x=\"{left}\" y=\"{top}\" width=\"10\" height=\"11\" shape-rendering=\"crispEdges\"/>"
        ));
        x += 10.0;
    }
    let place = (x + 8.0, y + LINE / 2.0);
    svg.text("soft", place, TEXT, Anchor::Start, &format!("{high:.0}"));
    y + LINE + 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_appears_once_and_flashes_with_each_event() {
        let array = Array::new(2, 2).unwrap();
        let flash = |moment, column, row, side| Flash {
            moment,
            square: Square {
                column,
                row,
                side,
                is_behind: false,
            },
            range_mm: 1000.0 + 100.0 * f64::from(column),
        };
        let flashes = [flash(3, 1, 0, 1), flash(3, 0, 0, 2), flash(40, 1, 0, 1)];
        let marks = [flash(3, 1, 0, 1), flash(3, 0, 1, 1), flash(40, 1, 0, 1)];
        let svg = draw(array, &flashes, &marks, "t", "n");
        assert_eq!(svg.matches("<g class=\"b b").count(), 1);
        assert_eq!(svg.matches("<g class=\"f\"").count(), 2);
        assert_eq!(svg.matches("M1 0.5h1\"").count(), 3);
        assert_eq!(svg.matches("M0 1h2\"").count(), 1);
        assert_eq!(svg.matches("M0 1.5h1\"").count(), 1);
        assert!(svg.contains("animation-delay:4s"));
    }

    /// The animation is at the top of the README.
    #[test]
    fn the_demo_is_small_and_reproducible() {
        let svg = demo().unwrap();
        assert!(svg.len() < 400_000, "{}", svg.len());
        assert_eq!(svg, demo().unwrap());
    }
}

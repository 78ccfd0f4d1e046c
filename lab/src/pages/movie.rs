//! Events as a moving picture: each flash is an event.
//!
//! A pixel appears with its first event, in the colour of its range, and lights up with
//! each event. The picture is an SVG document with animations of its own style sheet: a
//! viewer that knows none, or a reader who wants no motion, sees the last moment.

use anyhow::Result;
use dtof_core::RangeScale;

use dtof::engine::host::host_engine;
use dtof::events::events_csv::range_mm;
use dtof::input::source::{Geometry, PhotonSource};
use dtof::rows::grouped;
use dtof::simulate::scene::{self, Scene};
use dtof_draw::palette;
use dtof_draw::picture::{levels, span};
use dtof_draw::svg::{Anchor, At, EDGE, Svg, TEXT, TITLE, wrapped};

/// Laser cycles that are shown, and moments into which they are cut.
const CYCLES: u16 = 2000;
const MOMENTS: u16 = 100;
/// Seconds until the last laser cycle, and until the picture starts over.
const RUN: f64 = 10.0;
const WHOLE: f64 = 12.0;
/// Colours a range is shown in: every so many levels.
const STEP: u8 = 15;

const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
const LINE: f64 = 19.0;
/// Seconds that a flash takes to fade, of [`WHOLE`], in percent.
const FADE: f64 = 6.0;

/// An event: its moment, its pixel, and its range in millimetres.
#[derive(Clone, Copy, Debug)]
struct Flash {
    moment: u16,
    pixel: u16,
    range_mm: f64,
}

/// The first laser cycles of `dtof demo`.
///
/// # Errors
/// If the scene of the demo cannot be simulated.
pub fn demo() -> Result<String> {
    let (scene, settings) = (Scene::demo()?, scene::settings(1));
    let mut photons = scene.photons(settings.seed, CYCLES.into())?;
    let mut engine = host_engine(&settings, photons.geometry(), &photons.addresses())?;
    let slice = photons.next_slice(CYCLES)?;
    let events = engine.run(&slice)?;
    let scale: RangeScale = settings.range_scale()?;
    let moment = |cycle: u64| {
        let moment = cycle * u64::from(MOMENTS) / u64::from(CYCLES);
        u16::try_from(moment).unwrap_or(MOMENTS)
    };
    let flashes: Vec<Flash> = events
        .iter()
        .map(|event| Flash {
            moment: moment(event.cycle.0),
            pixel: event.pixel.0,
            range_mm: range_mm(event, &scale),
        })
        .collect();
    let mut notes = Vec::new();
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let on_surface = |address| {
            let view = scene.truth(address, 0);
            view.is_some_and(|view| view.surface == index)
        };
        let mut firsts: Vec<u64> = photons
            .addresses()
            .into_iter()
            .filter(|&address| on_surface(address))
            .map(|address| {
                let first = events.iter().find(|event| event.pixel == address);
                first.map_or(u64::MAX, |event| event.cycle.0 + 1)
            })
            .collect();
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
    let title = "Each flash is an event: bright pixels report often, dim ones later";
    let notes = notes.join(", ");
    let note = format!("First event of a typical pixel, in laser cycles: {notes}.");
    Ok(draw(scene.geometry, &flashes, title, &note))
}

fn draw(geometry: Geometry, flashes: &[Flash], title: &str, note: &str) -> String {
    let mut svg = Svg::default();
    svg.raw(&format!("<style>{}</style>", sheet()));
    let lines = wrapped(title, TITLE.0, INNER);
    let mut y = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines) + 8.0;
    let side = INNER / f64::from(geometry.columns);
    let (left, top) = (At(EDGE), At(y));
    svg.raw(&format!(
        "<g transform=\"translate({left} {top})scale({side})\">"
    ));
    let ranges: Vec<Option<f64>> = flashes.iter().map(|flash| Some(flash.range_mm)).collect();
    let steps: Vec<u8> = levels(&ranges)
        .into_iter()
        .map(|level| (level.unwrap_or(0).saturating_add(STEP / 2) / STEP) * STEP)
        .collect();
    let mut seen = vec![false; geometry.addresses()];
    let (mut firsts, mut all) = (Vec::new(), Vec::new());
    for (flash, step) in flashes.iter().zip(steps) {
        let seen = &mut seen[usize::from(flash.pixel)];
        if !*seen {
            firsts.push((flash, step));
            *seen = true;
        }
        all.push((flash, step));
    }
    for moment in 0..=MOMENTS {
        let of = |those: &[(&Flash, u8)]| shapes(those, moment, geometry);
        let (first, flash) = (of(&firsts), of(&all));
        if !first.is_empty() {
            svg.raw(&format!("<g class=\"b b{moment}\">{first}</g>"));
        }
        if !flash.is_empty() {
            let delay = At(f64::from(moment) / f64::from(MOMENTS) * RUN);
            svg.raw(&format!(
                "<g class=\"f\" style=\"animation-delay:{delay}s\">{flash}</g>"
            ));
        }
    }
    svg.raw("</g>");
    let height = side * f64::from(geometry.rows);
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

/// The pixels of one moment, a path a colour.
fn shapes(those: &[(&Flash, u8)], moment: u16, geometry: Geometry) -> String {
    let mut text = String::new();
    let here = those.iter().filter(|(flash, _)| flash.moment == moment);
    for step in (0..=u8::MAX).step_by(STEP.into()) {
        let mut path = String::new();
        for (flash, _) in here.clone().filter(|(_, of)| *of == step) {
            let pixel = u32::from(flash.pixel);
            let (row, column) = (pixel / geometry.columns, pixel % geometry.columns);
            path += &format!("M{column} {row}h1.05v1.05h-1.05z");
        }
        if !path.is_empty() {
            let fill = palette::hex(palette::level(step));
            text += &format!("<path fill=\"{fill}\" d=\"{path}\"/>");
        }
    }
    text
}

/// How the picture moves.
fn sheet() -> String {
    let end = RUN / WHOLE * 100.0;
    let mut sheet = format!(
        ".b{{opacity:.35}}.f{{opacity:0;animation:f {WHOLE}s linear infinite}}\
         .t{{transform-box:fill-box;transform-origin:left;animation:t {WHOLE}s linear infinite}}\
         @keyframes f{{0%{{opacity:1}}{FADE}%,to{{opacity:0}}}}\
         @keyframes t{{0%{{transform:scaleX(0)}}{}%,to{{transform:scaleX(1)}}}}",
        At(end)
    );
    for moment in 0..=MOMENTS {
        let at = f64::from(moment) / f64::from(MOMENTS) * end;
        let (before, at) = (At(at), At(at + 0.1));
        sheet += &format!(
            "\n.b{moment}{{animation:b{moment} {WHOLE}s linear infinite}}\
             @keyframes b{moment}{{0%,{before}%{{opacity:0}}{at}%,to{{opacity:.35}}}}"
        );
    }
    sheet
        + "\n@media (prefers-reduced-motion:reduce){.b,.f,.t{animation:none!important}.b{opacity:1}}"
}

/// The laser cycles as a bar that grows. Gives where it ends.
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

/// What the colours mean. Gives where it ends.
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
        let geometry = Geometry {
            columns: 2,
            rows: 2,
        };
        let flash = |moment, pixel| Flash {
            moment,
            pixel,
            range_mm: 1000.0 + f64::from(pixel),
        };
        let flashes = [flash(3, 1), flash(3, 2), flash(40, 1)];
        let svg = draw(geometry, &flashes, "t", "n");
        assert_eq!(svg.matches("<g class=\"b b").count(), 1);
        assert_eq!(svg.matches("<g class=\"f\"").count(), 2);
        assert_eq!(svg.matches("M1 0h1.05").count(), 3);
        assert_eq!(svg.matches("M0 1h1.05").count(), 2);
        assert!(svg.contains("animation-delay:4s"));
    }

    /// As promised: it is shown at the head of the README.
    #[test]
    fn that_of_the_demo_is_small_and_the_same_each_time() {
        let svg = demo().unwrap();
        assert!(svg.len() < 400_000, "{}", svg.len());
        assert_eq!(svg, demo().unwrap());
    }
}

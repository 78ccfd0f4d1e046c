//! What an asynchronous pixel does: its histogram fills, its peak stands clear, an event leaves, it starts over.
//!
//! The pixel is that of the core, with simulated photons.

use anyhow::{Context, Result};
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::paper::{Threshold, quadrant_background};
use dtof_core::{
    AsyncPixel, Count, Count10, LaserCycle, PaperRule, PixelAddress, PixelConfig, RangeScale,
    Statistics,
};
use dtof_data::options::rows::significant;
use dtof_data::photons::source::{PhotonSource, PixelPhotons};
use dtof_draw::palette::Colour;
use dtof_draw::svg::{Anchor, At, BOLD, EDGE, Svg, TEXT, TITLE, wrapped};
use dtof_light::scene::Scene;

/// A bright pixel and a dim one.
const SCENE: &str = "
columns = 2
bins = 16
bin_width_ps = 2000
background = 0.1
pulse_sigma_bins = 0.5
[[surface]]
position_bins = 12.5
signal = 0.6
[[surface]]
position_bins = 11.5
signal = 0.25
rectangle = { columns = [1, 2], rows = [0, 1] }
";
const BINS: usize = 16;
const SEED: u64 = 267;
/// Laser cycles drawn, and those of a frame.
const CYCLES: u16 = 600;
const ALPHA: U8F8 = U8F8::lit("6");
const MIN_COUNT: Count = Count::saturating(5);
const X: u16 = 4;
const L1: u16 = 20;

const WIDTH: f64 = 560.0;
const INNER: f64 = WIDTH - 2.0 * EDGE;
const LINE: f64 = 19.0;
/// Between two histograms.
const GAP: f64 = 22.0;
const PANEL: f64 = (INNER - 3.0 * GAP) / 4.0;
const PLOT: f64 = 120.0;
/// The left edge of the time axis.
const LEFT: f64 = EDGE + 112.0;

/// A histogram, and what the rule makes of it.
struct Moment {
    cycle: u16,
    counts: [u32; BINS],
    background: f64,
    threshold: f64,
}

/// A pixel's histogram at each look, and its events: laser cycle and range in metres.
struct Life {
    looks: Vec<Moment>,
    events: Vec<(u16, f64)>,
}

impl Life {
    fn of(photons: &PixelPhotons, scale: &RangeScale) -> Result<Self> {
        let rule = PaperRule::new(ALPHA, MIN_COUNT);
        let config = PixelConfig::<BINS>::with_rule(rule).x(X).l1(L1).l2(2000);
        let config = config.build()?;
        let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
        let mut statistics = Statistics::new();
        let (mut looks, mut events) = (Vec::new(), Vec::new());
        let mut photons = photons.photons.iter().peekable();
        for cycle in 0..CYCLES {
            while let Some(photon) = photons.next_if(|photon| photon.cycle == cycle) {
                pixel.count(&config, photon.code);
            }
            let histogram = pixel.histogram().clone();
            pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle.into()));
            if (cycle + 1).is_multiple_of(X) {
                let peak = histogram.peak().bin;
                let background = quadrant_background(histogram.counts(), config.gate(), peak);
                let threshold = Threshold::new(ALPHA, MIN_COUNT).level::<Count10>(background);
                looks.push(Moment {
                    cycle: cycle + 1,
                    counts: histogram.counts().map(u32::from),
                    background: background.raw().into(),
                    threshold: threshold.to_num(),
                });
            }
            if let Some(event) = pixel.take_event() {
                events.push((
                    cycle + 1,
                    scale.range(event.position()).to_num::<f64>() / 1000.0,
                ));
            }
        }
        Ok(Self { looks, events })
    }
}

/// The drawing.
///
/// # Errors
/// Fails if the scene or the settings are invalid.
pub fn pixel() -> Result<String> {
    let [bright, dim] = lives(SEED)?;
    let &(first, metres) = bright.events.first().context("no event")?;
    let title = "A pixel reports the moment its peak stands clear";
    let mut svg = Svg::default();
    let lines = wrapped(title, BOLD * TITLE.0, INNER);
    let top = svg.lines("ink title", (EDGE, EDGE), TITLE, Anchor::Start, &lines) + 4.0;
    let mut left = EDGE;
    for (_, colour, dashes, name) in levels(0.0, 0.0) {
        let middle = top + LINE / 2.0;
        dashed(&mut svg, colour, dashes, (left, middle), 28.0);
        let place = (left + 36.0, middle);
        svg.text(colour.class(), place, TEXT, Anchor::Start, name);
        left += PANEL + GAP;
    }
    let top = top + LINE + 12.0;
    let moments = [
        (first / 3 / X * X, "the histogram fills"),
        (first - X, "no peak is clear yet"),
        (first, "an event leaves at once"),
        (first + 3 * X, "the pixel starts over"),
    ];
    let look = |cycle: u16| bright.looks.iter().find(move |look| look.cycle == cycle);
    let highest = look(first).and_then(|look| look.counts.into_iter().max());
    let unit = PLOT / f64::from(highest.unwrap_or(1));
    let floor = top + LINE + 42.0 + PLOT;
    let (mut left, mut bottom) = (EDGE, floor);
    for (cycle, caption) in moments {
        let name = format!("cycle {cycle}");
        let place = (left, top + LINE / 2.0);
        svg.text("ink panel", place, TEXT, Anchor::Start, &name);
        let event = (cycle == first).then_some(metres);
        histogram(
            &mut svg,
            look(cycle).context("no look")?,
            event,
            (left, floor),
            unit,
        );
        let lines = wrapped(caption, TEXT, PANEL);
        let place = (left, floor + 6.0);
        let under = svg.lines("soft", place, (TEXT, LINE), Anchor::Start, &lines);
        bottom = under.max(bottom);
        left += PANEL + GAP;
    }
    let bottom = timeline(&mut svg, &bright, &dim, bottom + 16.0);
    Ok(svg.document((WIDTH, bottom + EDGE), title))
}

/// What the bright pixel and the dim one do.
fn lives(seed: u64) -> Result<[Life; 2]> {
    let scene = Scene::parse(SCENE)?;
    let slice = scene.photons(seed, CYCLES.into())?.next_slice(CYCLES)?;
    let scale = RangeScale::new(U16F16::from_num(scene.bin_width_ps), I24F8::ZERO)?;
    let lives = slice.pixels.iter().map(|photons| Life::of(photons, &scale));
    let lives = lives.collect::<Result<Vec<_>>>()?.try_into();
    lives.ok().context("two pixels")
}

/// The levels of a histogram: photons, colour, dashes and name.
fn levels(background: f64, threshold: f64) -> [(f64, Colour, &'static str, &'static str); 2] {
    [
        (threshold, Colour::Orange, "6 4", "threshold"),
        (background, Colour::Green, "2 3", "background"),
    ]
}

/// Draws a level line from `place` on.
fn dashed(svg: &mut Svg, colour: Colour, dashes: &str, (x, y): (f64, f64), width: f64) {
    let class = colour.class();
    let [x, y, width] = [x, y, width].map(At);
    svg.raw(&format!(
        "<g class=\"{class}\"><path class=\"stroke\" stroke-width=\"2\" stroke-dasharray=\"{dashes}\" d=\"M{x} {y}h{width}\"/></g>"
    ));
}

/// Draws a histogram, and the range in metres of its event if it has one. A photon is `unit` high.
fn histogram(
    svg: &mut Svg,
    moment: &Moment,
    event: Option<f64>,
    (left, floor): (f64, f64),
    unit: f64,
) {
    let width = PANEL / BINS as f64;
    let peak = (0..BINS).max_by_key(|&bin| moment.counts[bin]).unwrap_or(0);
    let bins = moment.counts.iter().enumerate();
    for (bin, &count) in bins.filter(|(_, count)| **count > 0) {
        let colour = match event {
            Some(_) if bin == peak => Colour::Blue,
            _ => Colour::Soft,
        };
        let high = f64::from(count) * unit;
        let x = left + bin as f64 * width + 0.5;
        let [x, y, wide, high] = [x, floor - high, width - 1.0, high].map(At);
        svg.raw(&format!(
            "<g class=\"{}\"><rect class=\"fill\" x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\"/></g>",
            colour.class()
        ));
    }
    svg.line("edge", (left, floor), (left + PANEL, floor));
    for (level, colour, dashes, _) in levels(moment.background, moment.threshold) {
        dashed(svg, colour, dashes, (left, floor - level * unit), PANEL);
    }
    if let Some(metres) = event {
        let class = Colour::Blue.class();
        let x = At(left + (peak as f64 + 0.5) * width);
        let y = floor - f64::from(moment.counts[peak]) * unit - 4.0;
        let top = At(y);
        svg.raw(&format!(
            "<g class=\"{class}\"><path class=\"stroke\" stroke-width=\"2\" d=\"M{x} {top}v-16m-5 5l5 -5l5 5\"/></g>"
        ));
        let name = format!("event: {} m", significant(metres, 3));
        let place = (left + PANEL, y - 28.0);
        svg.text(class, place, TEXT, Anchor::End, &name);
    }
}

/// Draws the events of both pixels and a frame over time. Returns its bottom.
fn timeline(svg: &mut Svg, bright: &Life, dim: &Life, top: f64) -> f64 {
    let x = |cycle: u16| LEFT + (EDGE + INNER - LEFT) * f64::from(cycle) / f64::from(CYCLES);
    let cycles = |life: &Life| life.events.iter().map(|event| event.0).collect();
    let rows: [(&str, Colour, Vec<u16>); 3] = [
        ("this pixel", Colour::Blue, cycles(bright)),
        ("a dim pixel", Colour::Blue, cycles(dim)),
        ("a frame", Colour::Soft, vec![CYCLES]),
    ];
    let mut y = top;
    for (name, colour, cycles) in rows {
        let middle = y + 13.0;
        svg.text("ink", (EDGE, middle), TEXT, Anchor::Start, name);
        svg.line("edge", (LEFT, middle), (EDGE + INNER, middle));
        for cycle in cycles {
            let [x, y] = [x(cycle) - 2.0, middle - 8.0].map(At);
            svg.raw(&format!(
                "<g class=\"{}\"><rect class=\"fill\" x=\"{x}\" y=\"{y}\" width=\"4\" height=\"16\"/></g>",
                colour.class()
            ));
        }
        y += 26.0;
    }
    svg.text(
        "soft",
        (EDGE, y + LINE / 2.0),
        TEXT,
        Anchor::Start,
        "laser cycle",
    );
    for cycle in (0..=CYCLES).step_by(200) {
        let anchor = match cycle {
            0 => Anchor::Start,
            CYCLES => Anchor::End,
            _ => Anchor::Middle,
        };
        let place = (x(cycle), y + LINE / 2.0);
        svg.text("soft", place, TEXT, anchor, &cycle.to_string());
    }
    y + LINE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the histograms drawn only that of the event has a clear peak, and the next begins with few photons.
    #[test]
    fn the_title_and_the_captions_hold() {
        let [bright, dim] = lives(SEED).unwrap();
        let first = bright.events[0].0;
        let is_clear =
            |look: &Moment| f64::from(*look.counts.iter().max().unwrap()) > look.threshold;
        let until_next = bright
            .looks
            .iter()
            .filter(|look| look.cycle <= first + 3 * X);
        let clear = until_next.filter(|look| look.cycle >= first / 3 && is_clear(look));
        let clear: Vec<u16> = clear.map(|look| look.cycle).collect();
        assert_eq!(clear, [first]);
        let photons = |cycle: u16| {
            let look = bright
                .looks
                .iter()
                .find(|look| look.cycle == cycle)
                .unwrap();
            look.counts.iter().sum::<u32>()
        };
        assert!(photons(first + X) < photons(first) / 4);
        // Both report what they see to a bin of 0.3 m, the dim one seldom.
        for (life, metres) in [(&bright, 3.747), (&dim, 3.447)] {
            assert!(
                life.events
                    .iter()
                    .all(|event| (event.1 - metres).abs() < 0.3)
            );
        }
        assert!(dim.events.len() > 2 && dim.events.len() < bright.events.len() / 3);
        assert!(dim.events[0].0 > 2 * first);
    }
}

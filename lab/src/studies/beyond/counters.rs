//! Counters of 8 bits: the laser cycles to an event over the background, beside wider counters.

use super::light::Light;
use super::setting::{BINS, L1, X, window_rule};
use crate::sweep::charts::{joined, joined_key, level, level_key, panel};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::Result;
use dtof_core::{
    AsyncPixel, Count8, Count10, CounterWidth, LaserCycle, PixelAddress, PixelConfig, Statistics,
    WindowRule,
};
use dtof_draw::chart::{Axis, Chart, Key};
use dtof_draw::palette::{EVENTS, PAPER, Pen};
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const L2: u16 = 2000;
/// A run without an event ends after so many laser cycles: the exposures of ten times L2.
const MOST: u16 = 10 * L2;
/// Photons a bin and laser cycle.
const BACKGROUNDS: [f64; 7] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
/// Signal photons a laser cycle.
const SIGNALS: [f64; 4] = [1.0, 0.5, 0.2, 0.1];
/// Events of a trial.
const EVENTS_OF_TRIAL: u64 = 20;
/// Bits, bytes of a macropixel of 128 bins.
const WIDTHS: [(&str, usize, Pen); 2] = [
    ("8", size_of::<AsyncPixel<BINS, Count8>>(), PAPER),
    ("10", size_of::<AsyncPixel<BINS, Count10>>(), EVENTS),
];

/// Laser cycles to an event, by the width of the counters.
pub const STUDY: Study = Study {
    name: "counters",
    about: "laser cycles to an event with counters of 8 and 10 bits, over the background",
    revision: 1,
    few_seeds: 2,
    all_seeds: 40,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    grid([("signal", &SIGNALS), ("background", &BACKGROUNDS)])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let mut tally = Tally::new();
    for _ in 0..EVENTS_OF_TRIAL {
        let place = Uniform::new(20.0, 108.0)?.sample(rng);
        let light = Light::new(point["background"], &[(point["signal"], place)])?;
        run(&light, rng, &mut tally)?;
    }
    Ok(tally)
}

/// A pixel that runs until its first event.
struct Run<W: CounterWidth> {
    bits: &'static str,
    pixel: AsyncPixel<BINS, W>,
    statistics: Statistics,
    is_done: bool,
}

impl<W: CounterWidth> Run<W> {
    fn new(bits: &'static str) -> Self {
        Self {
            bits,
            pixel: AsyncPixel::new(PixelAddress::new(0)),
            statistics: Statistics::new(),
            is_done: false,
        }
    }

    fn cycle(
        &mut self,
        config: &PixelConfig<BINS, WindowRule>,
        codes: &[u16],
        now: u16,
        tally: &mut Tally,
    ) {
        if self.is_done {
            return;
        }
        self.pixel.count_batch(config, codes);
        let cycle = LaserCycle::new(now.into());
        self.pixel
            .end_laser_cycle(config, &mut self.statistics, cycle);
        let is_event = self.pixel.has_event();
        self.is_done = is_event || now == MOST;
        if self.is_done {
            add_value(tally, self.bits, now.into());
            add(tally, self.bits, "events", is_event.into());
            add(tally, self.bits, "full", self.statistics.ended_full);
        }
    }
}

/// The same photons for both, until each has an event or time is over.
fn run(light: &Light, rng: &mut Pcg64, tally: &mut Tally) -> Result<()> {
    let config = PixelConfig::with_rule(window_rule(L1, L2)?)
        .x(X)
        .l1(L1)
        .l2(L2)
        .build()?;
    let mut narrow = Run::<Count8>::new(WIDTHS[0].0);
    let mut wide = Run::<Count10>::new(WIDTHS[1].0);
    for now in 1..=MOST {
        if narrow.is_done && wide.is_done {
            break;
        }
        let codes = light.draw(rng);
        narrow.cycle(&config, &codes, now, tally);
        wide.cycle(&config, &codes, now, tally);
    }
    Ok(())
}

/// Laser cycles to the end of a run, and the share of runs that end with an event.
fn measured(point: &PointTally, bits: &str) -> [Measured; 2] {
    let events = point.share(&format!("{bits} events"), &format!("{bits} values"));
    [Measured::mean(point, bits), events]
}

fn results(part: &Part) -> Result<Results> {
    let panels = SIGNALS.map(|signal| {
        let mut series = vec![level(&BACKGROUNDS, MOST.into())];
        series.extend(WIDTHS.map(|(bits, _, pen)| {
            let cycles = |point: &PointTally| measured(point, bits)[0];
            joined(pen, part.dots([("signal", signal)], "background", cycles))
        }));
        panel(format!("{signal} signal photons"), series)
    });
    let both = |signal, background| {
        let point = part.one([("background", background), ("signal", signal)]);
        ["8", "10"].map(|bits| measured(point, bits)[0])
    };
    let is_same = |signal, background| {
        let [narrow, wide] = both(signal, background);
        (narrow.value - wide.value).abs() < 1.0
    };
    let [narrow, wide] = both(0.2, 0.5);
    let fails = narrow.interval.0 > wide.interval.1;
    let are_same = SIGNALS.into_iter().all(|signal| {
        let dark = &BACKGROUNDS[..3];
        dark.iter().all(|&background| is_same(signal, background))
    });
    let widths = WIDTHS.iter();
    let mut key: Vec<Key> = widths
        .map(|(bits, bytes, pen)| joined_key(*pen, format!("{bytes} bytes: {bits} bits")))
        .collect();
    key.push(level_key("no event until then"));
    let chart = Chart {
        finding: "8 bits are as fast, unless a bright background fills them first".to_owned(),
        holds: fails && are_same,
        note: format!(
            "Means of the laser cycles to the first event, right or wrong, or {MOST} without one. Bytes are of a macropixel of {BINS} \
             bins. Bars hold 99 %. L2 = {L2}."
        ),
        x: Axis::logarithmic("background photons a bin and laser cycle"),
        y: Axis::logarithmic("laser cycles to an event"),
        key,
        columns: 2,
        panels: panels.into(),
    };
    Ok(Results {
        figures: vec![Figure::new("counters", &chart)?],
        values: [("runs", (EVENTS_OF_TRIAL * STUDY.all_seeds).to_string())].into(),
        tables: vec![("results/data/counters.csv", csv(part)?)],
        ..Results::default()
    })
}

fn csv(part: &Part) -> Result<String> {
    let mut csv = "signal,background,bits,bytes,cycles,cycles_low,cycles_high,events,events_low,events_high,ended_full\n".to_owned();
    for point in part.points() {
        let [signal, background] = ["signal", "background"].map(|name| point.parameter(name));
        for (bits, bytes, _) in WIDTHS {
            let [cycles, events] = measured(point, bits);
            let (cycles, events) = (cycles.cells(1), events.cells(4));
            let full = point.count(&format!("{bits} full"));
            writeln!(
                csv,
                "{signal},{background},{bits},{bytes},{cycles},{events},{full}"
            )?;
        }
    }
    Ok(csv)
}

//! The time from the first photon of a pixel to its event (Table I), and the delay of a processing
//! element that four pixels share (sections IV-A and IV-B).
//!
//! The pulse has 120 ps (full width at half maximum). We assume a jitter of 70 ps, together 0.35
//! bins. Signal and background are our choices, too.

mod claims;
pub(crate) mod element;

use self::element::{LONG_STAGES, PIPELINE, PIXELS, ProcessingElement, SharedPixel};
use super::one_pixel::{BINS, CODES, PROTOTYPE_X, prototype};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, whole};
use anyhow::Result;
use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, Statistics};
use dtof_data::options::rows::grouped;
use dtof_data::random::pixel_rng;
use dtof_draw::chart::{Axis, Chart, Panel, Series, Style};
use dtof_draw::palette::STEPS;
use dtof_light::SimulatedPixel;
use dtof_light::rates::{Rates, signal_for_snr};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// Events of a trial, at most.
const EVENTS: u64 = 20;
/// Laser cycles of a trial, at most.
const CYCLES: u64 = 20_000;
/// Laser cycles from the first photon at which the share of events is counted.
const BY: [u64; 17] = [
    20, 24, 28, 36, 40, 44, 48, 56, 64, 80, 100, 140, 200, 300, 500, 1000, 2000,
];
/// Laser cycles a microsecond.
const RATE_MHZ: f64 = 10.0;
/// Standard deviation of the pulse, in bins.
const SIGMA: f64 = 0.35;
/// Signal-to-noise ratios after 40 laser cycles.
const SNRS: [f64; 7] = [4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0];
/// Events of each pixel of an element, in a trial.
const SHARED_EVENTS: u64 = 5;

/// Laser cycles of the shortest exposure with an event: the first look with N > L1.
fn shortest_exposure(l1: u16) -> u16 {
    (l1 / PROTOTYPE_X + 1) * PROTOTYPE_X
}

/// Compared with the paper's 2.4 µs.
pub const STUDY: Study = Study {
    name: "latency",
    about: "laser cycles from the first photon after a reset to the event, by SNR and L1",
    revision: 2,
    few_seeds: 10,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// The SNR always refers to 40 laser cycles. A single pixel, then four that share an element.
fn points() -> Vec<Point> {
    let mut points = grid([
        ("shared", &[0.0]),
        ("l1", &[20.0, 40.0]),
        ("background", &[0.02, 0.2]),
        ("snr", &SNRS),
    ]);
    points.extend(grid([
        ("shared", &[1.0]),
        ("l1", &[40.0]),
        ("background", &[0.02]),
        ("snr", &SNRS),
    ]));
    points
}

/// The photons of a pixel.
fn photons(point: &Point, rng: &mut Pcg64) -> Result<SimulatedPixel> {
    let background = point["background"];
    let rates = Rates {
        background,
        signal: signal_for_snr(point["snr"], background, 40.0),
        position: 60.5,
        sigma: SIGMA,
    };
    SimulatedPixel::new(
        &rates,
        CODES,
        pixel_rng(rng.next_u64(), PixelAddress::new(0)),
    )
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    if point["shared"] > 0.0 {
        return shared(point, rng);
    }
    let config = prototype(whole(point, "l1"))?;
    let address = PixelAddress::new(0);
    let mut photons = photons(point, rng)?;
    let mut pixel = AsyncPixel::<BINS>::new(address);
    let (mut tally, mut statistics) = (Tally::new(), Statistics::new());
    let (mut reset, mut first, mut events) = (0, None, 0);
    for cycle in 0..CYCLES {
        photons.next_cycle(|code| {
            first.get_or_insert(cycle);
            pixel.count(&config, code);
        });
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
        if pixel.take_event().is_none() {
            continue;
        }
        let end = cycle + 1;
        add_waits(&mut tally, end - reset, end - first.take().unwrap_or(reset));
        reset = end;
        events += 1;
        if events == EVENTS {
            break;
        }
    }
    add(&mut tally, "events", "cut off", EVENTS - events);
    Ok(tally)
}

/// Four pixels that share an element: each interpretation of the paper gets the same photons.
fn shared(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = prototype(whole(point, "l1"))?;
    let mut tally = Tally::new();
    for turn in 0..PIXELS {
        let photons = photons(point, rng)?;
        for element in element::READINGS {
            let mut photons = photons.clone();
            let mut pixel = SharedPixel::new(element, turn);
            let mut ends = (0..CYCLES).filter(|&cycle| {
                photons.next_cycle(|code| pixel.count(code));
                pixel.end_laser_cycle(&config, cycle)
            });
            let (mut before, mut events) = (None, 0);
            for last in ends.by_ref().take(usize::try_from(SHARED_EVENTS)?) {
                let end = i64::try_from(last + 1)?;
                match before {
                    None => add_value(&mut tally, &first(element), end),
                    Some(before) => add_value(&mut tally, &next(element), end - before),
                }
                before = Some(end);
                events += 1;
            }
            add(&mut tally, "shared", "cut off", SHARED_EVENTS - events);
        }
    }
    Ok(tally)
}

/// Laser cycles from the start to the first event.
fn first(element: ProcessingElement) -> String {
    format!("first of {}", element.name)
}

/// Laser cycles from an event to the next.
fn next(element: ProcessingElement) -> String {
    format!("next of {}", element.name)
}

/// Adds the laser cycles to an event, including its own: `waited` since the previous event,
/// `latency` since the first photon after it.
fn add_waits(tally: &mut Tally, waited: u64, latency: u64) {
    let whole = |cycles: u64| i64::try_from(cycles).unwrap_or(i64::MAX);
    add_value(tally, "waited", whole(waited));
    add_value(tally, "latency", whole(latency));
    for by in BY {
        for (what, cycles) in [("waited by", waited), ("latency by", latency)] {
            if cycles <= by {
                add(tally, what, &by.to_string(), 1);
            }
        }
    }
}

/// The share of events within `by` laser cycles, of all possible events.
fn share_by(point: &PointTally, what: &str, by: u64) -> Measured {
    let all = point.count("latency values") + point.count("events cut off");
    Measured::share(point.count(&format!("{what} by {by}")), all)
}

fn results(part: &Part) -> Result<Results> {
    Ok(Results {
        figures: vec![
            Figure::new("latency", &by_then(part))?,
            Figure::new("latency-processing", &processing(part))?,
        ],
        claims: claims::claims(part),
        values: [
            ("events", grouped(EVENTS * part.seed_count())),
            ("readings", readings(part)),
            ("subgroups", claims::subgroups()),
        ]
        .into(),
        ..Results::default()
    })
}

fn by_then(part: &Part) -> Chart {
    let points = || part.at([("shared", 0.0), ("l1", 40.0), ("background", 0.02)]);
    let series = points().zip(STEPS).map(|(point, pen)| {
        let mut dots = Vec::new();
        for by in BY.into_iter().filter(|&by| by >= 36) {
            let share = share_by(point, "latency", by);
            dots.push(share.at(by as f64));
            // All events have been reported.
            if share.value > 0.998 {
                break;
            }
        }
        let name = format!("SNR {}", point.parameter("snr"));
        Series::named(name, pen, Style::JoinedDots, dots)
    });
    let none_before = points().all(|point| point.count("latency by 36") == 0);
    let strongest = points().last();
    let soon = strongest.map_or(0.0, |point| share_by(point, "latency", 44).value);
    Chart {
        finding:
            "A strong signal is reported at the first decision, 44 laser cycles, a weak one later"
                .to_owned(),
        holds: none_before && soon > 0.95,
        note:
            "A curve ends where all events are there. Bars hold 99 %. Ten laser cycles are a microsecond."
                .to_owned(),
        x: Axis::logarithmic("laser cycles from the first photon after a reset"),
        y: Axis::linear("events that are there by then, %")
            .percent()
            .within(0.0, 1.12),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(series.collect())],
    }
}

/// The points of four pixels that share an element, without truncated events.
fn shared_points(part: &Part) -> impl Iterator<Item = &PointTally> + Clone {
    let points = part.at([("shared", 1.0)]);
    points.filter(|point| point.count("shared cut off") == 0)
}

fn processing(part: &Part) -> Chart {
    let series = element::READINGS
        .into_iter()
        .zip(STEPS)
        .map(|(element, pen)| {
            let points = shared_points(part);
            let dots = points.map(|point| {
                let mean = Measured::mean(point, &next(element));
                mean.at(point.parameter("snr"))
            });
            let name = format!("{}, X = {}", element.name, element.x());
            Series::named(name, pen, Style::JoinedDots, dots.collect())
        });
    let longest = shared_points(part).all(|point| {
        let [pipeline, long] =
            [PIPELINE, LONG_STAGES].map(|element| Measured::mean(point, &next(element)));
        pipeline.interval.1 < long.interval.0
    });
    Chart {
        finding:
            "Processing in a pipeline delays an event by four laser cycles, rarer looks by more"
                .to_owned(),
        holds: claims::is_later_by_the_delay(part) && longest,
        note: "Bars hold 99 %; most are smaller than their dots.".to_owned(),
        x: Axis::logarithmic("signal-to-noise ratio after 40 laser cycles"),
        y: Axis::logarithmic("mean laser cycles from an event to the next"),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(series.collect())],
    }
}

/// A row for each interpretation: X, histograms in the element, and laser cycles to the first event
/// and to the next at three SNRs.
fn readings(part: &Part) -> String {
    let mut rows = String::new();
    for element in element::READINGS {
        let ProcessingElement { name, delay, .. } = element;
        rows += &format!(
            "| {name} | {} | {delay} | {} |",
            element.x(),
            element.in_flight()
        );
        for snr in [64.0, 16.0, 4.0] {
            let mut points = shared_points(part).filter(|point| point.is_at([("snr", snr)]));
            let point = points.next();
            for what in [first, next] {
                let mean = point.map(|point| Measured::mean(point, &what(element)));
                let cell = mean.map_or("cut off".to_owned(), |mean| mean.with_half(1));
                rows += &format!(" {cell} |");
            }
        }
        rows += "\n";
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::point;

    #[test]
    fn a_wait_counts_by_every_later_time() {
        let mut tally = Tally::new();
        add_waits(&mut tally, 44, 43);
        assert!(!tally.contains_key("waited by 40"));
        assert_eq!(tally["waited by 44"], 1);
        assert_eq!((tally["latency by 44"], tally["latency by 2000"]), (1, 1));
        assert!(!tally.contains_key("latency by 40"));
    }

    #[test]
    fn no_event_comes_before_the_first_look() {
        use rand_core::SeedableRng;
        for (l1, before, at) in [(20, 20, 24), (40, 40, 44)] {
            assert_eq!(shortest_exposure(l1), at);
            let point = point([
                ("shared", 0.0),
                ("l1", l1.into()),
                ("background", 0.02),
                ("snr", 250.0),
            ]);
            let tally = trial(&point, &mut Pcg64::seed_from_u64(1)).unwrap();
            assert!(!tally.contains_key(&format!("waited by {before}")));
            assert_eq!(tally[&format!("waited by {at}")], EVENTS);
        }
    }
}

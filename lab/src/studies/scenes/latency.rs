//! How long a pixel takes from its first photon to its event (Table II).

use super::one_pixel::{BINS, CODES, PROTOTYPE_X, prototype};
use crate::sweep::mean::{Measured, add, add_value};
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, whole};
use anyhow::Result;
use dtof::rows::grouped;
use dtof::simulate::SimulatedPixel;
use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, Statistics};
use dtof_draw::chart::{Axis, Chart, Panel, Series, Style};
use dtof_draw::palette::STEPS;
use dtof_theory::random::pixel_rng;
use dtof_theory::rates::{Rates, signal_for_snr};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// Events of a trial, at most.
const EVENTS: u64 = 20;
/// Laser cycles of a trial, at most.
const CYCLES: u64 = 20_000;
/// Laser cycles from the first photon by which events are counted.
const BY: [u64; 17] = [
    20, 24, 28, 36, 40, 44, 48, 56, 64, 80, 100, 140, 200, 300, 500, 1000, 2000,
];
/// Laser cycles a microsecond.
const RATE_MHZ: f64 = 10.0;

/// The paper's latency, in microseconds.
const PRINTED_US: f64 = 2.4;

/// Laser cycles of the shortest exposure with an event: the first look with
/// N > L1.
fn shortest_exposure(l1: u16) -> u16 {
    (l1 / PROTOTYPE_X + 1) * PROTOTYPE_X
}

/// Held against the paper's 2.4 µs.
pub const STUDY: Study = Study {
    name: "latency",
    about: "laser cycles from the first photon after a reset to the event, by SNR and L1",
    revision: 1,
    few_seeds: 10,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// The SNR is that of 40 laser cycles, whatever L1.
fn points() -> Vec<Point> {
    grid([
        ("l1", &[20.0, 40.0]),
        ("background", &[0.02, 0.2]),
        ("snr", &[4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0]),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let config = prototype(whole(point, "l1"))?;
    let background = point["background"];
    let rates = Rates {
        background,
        signal: signal_for_snr(point["snr"], background, 40.0),
        position: 60.5,
        sigma: 1.0,
    };
    let address = PixelAddress(0);
    let mut photons = SimulatedPixel::new(&rates, CODES, pixel_rng(rng.next_u64(), address))?;
    let mut pixel = AsyncPixel::<BINS>::new(address);
    let (mut tally, mut statistics) = (Tally::new(), Statistics::new());
    let (mut reset, mut first, mut events) = (0, None, 0);
    for cycle in 0..CYCLES {
        photons.next_cycle(|code| {
            first.get_or_insert(cycle);
            pixel.count(&config, code);
        });
        pixel.end_laser_cycle(&config, &mut statistics, LaserCycle(cycle));
        if pixel.acknowledge().is_none() {
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

/// Laser cycles to an event, its own included: `waited` since the event before,
/// `latency` since the first photon after that.
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

/// The share of events that are there `by` then, of all that could have been.
fn share_by(point: &PointTally, what: &str, by: u64) -> Measured {
    let all = point.count("latency values") + point.count("events cut off");
    Measured::share(point.count(&format!("{what} by {by}")), all)
}

fn results(part: &Part) -> Result<Results> {
    let points = || part.at([("l1", 40.0), ("background", 0.02)]);
    let series = points().zip(STEPS).map(|(point, pen)| {
        let mut dots = Vec::new();
        for by in BY.into_iter().filter(|&by| by >= 36) {
            let share = share_by(point, "latency", by);
            dots.push(share.at(by as f64));
            // All events are there.
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
    let chart = Chart {
        finding: "A strong signal is reported at the first decision, 44 laser cycles, a weak one later".to_owned(), holds: none_before && soon > 0.95,
        note: "A curve ends where all events are there. Bars hold 99 %. Ten laser cycles are a microsecond."
            .to_owned(),
        x: Axis::logarithmic("laser cycles from the first photon after a reset"),
        y: Axis::linear("events that are there by then, %")
            .percent()
            .within(0.0, 1.12),
        key: Vec::new(),
        columns: 1,
        panels: vec![Panel::only(series.collect())],
    };
    let events = EVENTS * part.seed_count();
    Ok(Results {
        figures: vec![Figure::new("latency", &chart)?],
        claims: claims(part)?,
        values: [("events", grouped(events))].into(),
        ..Results::default()
    })
}

fn claims(part: &Part) -> Result<Vec<Claim>> {
    // Both sides of the first look with N > L1.
    let shortest = |l1: f64, before: u64, at: u64| {
        let points = part.at([("l1", l1)]);
        let count = |by: u64| {
            let counts = points
                .clone()
                .map(|point| point.count(&format!("waited by {by}")));
            counts.sum::<u64>()
        };
        count(before) == 0 && count(at) > 0
    };
    let (at_40, at_20) = (shortest(40.0, 40, 44), shortest(20.0, 20, 24));
    let best = part.one([("l1", 40.0), ("background", 0.02), ("snr", 64.0)])?;
    let usual = part.one([("l1", 40.0), ("background", 0.02), ("snr", 16.0)])?;
    let microseconds = |point| {
        Measured::mean(point, "latency")
            .times(1.0 / RATE_MHZ)
            .text(2)
    };
    let [at_least_40, at_least_20] = [40, 20].map(|l1| f64::from(shortest_exposure(l1)) / RATE_MHZ);
    Ok(vec![Claim::new(
        "exposure",
        format!(
            "by arithmetic at least {at_least_40:.1} µs after a reset (L1 = 20: {at_least_20:.1} µs), in simulation the earliest {}, and at L1 = 20 {}; \
             from the first photon {} µs at SNR 64, {} µs at SNR 16; events within 2.4 µs of it: {} of {}",
            if at_40 { "just then" } else { "not then" },
            if at_20 { "just then" } else { "not then" },
            microseconds(best),
            microseconds(usual),
            best.count("latency by 24"),
            grouped(best.count("latency values")),
        ),
        Verdict::of(at_least_40 <= PRINTED_US),
    )])
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
            let point = point([("l1", l1.into()), ("background", 0.02), ("snr", 250.0)]);
            let tally = trial(&point, &mut Pcg64::seed_from_u64(1)).unwrap();
            assert!(!tally.contains_key(&format!("waited by {before}")));
            assert_eq!(tally[&format!("waited by {at}")], EVENTS);
        }
    }
}

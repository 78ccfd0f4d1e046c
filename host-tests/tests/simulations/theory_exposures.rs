//! False alarms of whole exposures: compares the table with new simulations, at and between its points,
//! and `tune` with the engine.

use crate::slow_or_quick;
use dtof_core::fixed::types::U8F8;
use dtof_core::paper::Threshold;
use dtof_core::{Array, BlockLevel, Count, DepthEvent, PaperRule, PixelAddress};
use dtof_data::photons::source::PhotonSource;
use dtof_data::random::{pixel_rng, trial_rng};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_light::counts::binomial::{alike, plausible};
use dtof_light::looks::exposure::{Exposures, Looks};
use dtof_light::looks::repeated_looks::{
    ALPHA_STEPS, FalseAlarms, MINIMUM_COUNT, Point, RepeatedLooks, alpha_bits, single_looks,
};
use dtof_light::looks::single_look::SingleLook;
use dtof_light::looks::table::{self, Estimate, MARGIN, Row, Table};
use dtof_light::progress::NONE;
use dtof_light::rates::Rates;
use dtof_light::tune::{FalseAlarmLimit, Request, Tuned, tune};
use dtof_light::{SimulatedArray, SimulatedPixel};

/// The probability that a test fails by chance.
const LEVEL: f64 = 1e-3;

/// The most by which a probability between the table's points may be too high, as a factor.
const OFF_ABOVE: f64 = 1.75;

/// Seeds of the simulations here. The table's trials have seeds mixed from the study's name, the point
/// and the seed: a collision with one of the 36,000 is unlikely.
const SEEDS: [u64; 2] = [0xa076_1d64_78bd_642f, 0xe703_7ed1_a0b4_28db];

fn count(count: u64) -> u32 {
    u32::try_from(count).unwrap()
}

/// The table's row for a point at α, if there is one.
fn row<'a>(table: &'a Table, point: &Point, last: u32, alpha: u16) -> Option<&'a Row> {
    table.rows.iter().find(|row| {
        let place = (row.first_mean, row.first, row.last, row.alpha);
        place == (point.first_mean, point.first, last, alpha)
    })
}

/// Whether the share of events is consistent with a probability between two bounds.
fn lies_between(events: u32, exposures: u32, [low, high]: [f64; 2], level: f64) -> bool {
    let share = f64::from(events) / f64::from(exposures);
    (share >= low || plausible(events, exposures, low, level))
        && (share <= high || plausible(events, exposures, high, level))
}

#[test]
fn another_seed_gives_the_same_table() {
    let table = Table::load().unwrap();
    let all = table::points();
    // One in six or in 24, without those with many photons, which would take long.
    let points: Vec<Point> = all
        .into_iter()
        .step_by(slow_or_quick(6, 24))
        .map(|mut point| {
            let first_mean = point.first_mean;
            let first = point.first;
            point.lasts.retain(|&last| {
                last <= 200 && first_mean * f64::from(last) / f64::from(first) <= 400.0
            });
            point
        })
        .collect();
    let mut compared = Vec::new();
    for (index, point) in (0..).zip(&points) {
        let tally = table::simulate(SEEDS[0], index * 4, point, 4).unwrap();
        for (&last, events) in point.lasts.iter().zip(&tally.events) {
            for (step, &events) in (0..ALPHA_STEPS).zip(events) {
                if let Some(row) = row(&table, point, last, alpha_bits(step)) {
                    compared.push((row, events, tally.exposures));
                }
            }
        }
    }
    assert!(
        compared.len() > slow_or_quick(100, 25),
        "{}",
        compared.len()
    );
    let level = LEVEL / f64::from(u32::try_from(compared.len()).unwrap());
    for (row, events, exposures) in compared {
        let kept = [row.events, table.exposures, events, exposures].map(count);
        assert!(
            alike(kept[0], kept[1], kept[2], kept[3], level),
            "{row:?}: {kept:?}"
        );
    }
}

#[test]
fn the_table_lies_between_the_exact_bounds() {
    let table = Table::load().unwrap();
    let level = LEVEL / f64::from(u32::try_from(table.rows.len()).unwrap());
    let exposures = count(table.exposures);
    // Rows of one point share their looks.
    for point in table::points()
        .iter()
        .filter(|point| point.first < 30)
        .step_by(4)
    {
        let last = *point.lasts.last().unwrap();
        let steps = single_looks(128, point.first_mean / f64::from(point.first), last);
        let of_point = table
            .rows
            .iter()
            .filter(|row| (row.first_mean, row.first) == (point.first_mean, point.first));
        for row in of_point {
            let minimum_count = Count::saturating(MINIMUM_COUNT.into());
            let threshold = Threshold::new(U8F8::from_bits(row.alpha), minimum_count);
            let bounds = RepeatedLooks::new(&steps, row.first, row.last).bounds(&threshold);
            assert!(
                (bounds.independent / row.intensity - 1.0).abs() < 1e-4,
                "{row:?}"
            );
            let events = count(row.events);
            let (low, high) = (bounds.worst_look, bounds.sum);
            let is_between = lies_between(events, exposures, [low, high], level);
            assert!(is_between, "{row:?} {bounds:?}");
            let is_low = row.first < row.last || plausible(events, exposures, low, level);
            assert!(is_low, "one look: {row:?} {bounds:?}");
        }
    }
}

/// Random points between those of the table: mean at the first look, first and last look.
const BETWEEN: [(f64, u32, u32); 21] = [
    (0.21, 6, 275),
    (0.364, 8, 28),
    (0.463, 40, 163),
    (0.507, 40, 154),
    (0.662, 3, 62),
    (0.74, 4, 18),
    (0.813, 14, 22),
    (1.01, 4, 102),
    (1.73, 14, 209),
    (2.31, 40, 71),
    (2.52, 2, 17),
    (2.97, 8, 55),
    (4.36, 60, 429),
    (6.73, 6, 39),
    (8.21, 6, 14),
    (10.6, 6, 12),
    (15.1, 8, 77),
    (22.0, 3, 19),
    (39.4, 20, 61),
    (63.8, 8, 22),
    (209.0, 14, 20),
];

/// The highest α of each exposure at one point, and the probability in the table at an α.
struct Place {
    highest: Vec<u16>,
    steps: Vec<SingleLook>,
    first_mean: f64,
    first: u32,
    last: u32,
}

impl Place {
    fn new(trial: u16, place: (f64, u32, u32), exposures: u32) -> Self {
        let (first_mean, first, last) = place;
        let rates = Rates::without_target(first_mean / f64::from(first));
        let simulated = Exposures::new(&rates, 128, Looks { x: 1, first, last }).unwrap();
        let minimum_count = Count::saturating(MINIMUM_COUNT.into());
        let mut rng = trial_rng(SEEDS[1], trial);
        let highest = (0..exposures)
            .filter_map(|_| simulated.highest_alphas::<128>(minimum_count, &[last], &mut rng)[0])
            .collect();
        Self {
            highest,
            steps: single_looks(128, rates.background, last),
            first_mean,
            first,
            last,
        }
    }

    fn events(&self, alpha: u16) -> u32 {
        let events = self.highest.iter().filter(|&&highest| highest >= alpha);
        u32::try_from(events.count()).unwrap()
    }

    /// The probability in the table at α. `None` without a nearby point: there `tune` takes the sum over
    /// looks.
    fn look_up(&self, table: &Table, alpha: u16) -> Option<Estimate> {
        let minimum_count = Count::saturating(MINIMUM_COUNT.into());
        let threshold = Threshold::new(U8F8::from_bits(alpha), minimum_count);
        let looks = RepeatedLooks::new(&self.steps, self.first, self.last);
        let independent = looks.bounds(&threshold).independent;
        table.look_up(self.first_mean, self.first, self.last, independent)
    }

    fn found(&self, table: &Table, alpha: u16) -> Estimate {
        self.look_up(table, alpha).unwrap_or_else(|| {
            panic!(
                "the table has no value for a mean of {} and looks {} to {} at α = {alpha}/256",
                self.first_mean, self.first, self.last
            )
        })
    }
}

/// Eighths, which are not in the table.
fn eighths() -> impl Iterator<Item = u16> {
    (256..2560).step_by(32)
}

#[test]
fn how_far_the_table_is_off_between_its_points() {
    const EXPOSURES: u32 = 5000;
    let table = Table::load().unwrap();
    let mut ratios = Vec::new();
    for (trial, place) in (0..).zip(BETWEEN) {
        let place = Place::new(trial, place, EXPOSURES);
        for alpha in eighths() {
            let seen = f64::from(place.events(alpha)) / f64::from(EXPOSURES);
            // Enough events to resolve a tenth.
            if (0.02..0.5).contains(&seen) {
                ratios.push(place.found(&table, alpha).probability / seen);
            }
        }
    }
    assert!(ratios.len() > 200, "{}", ratios.len());
    ratios.sort_by(f64::total_cmp);
    let [lowest, highest] = [ratios[0], ratios[ratios.len() - 1]];
    println!("{lowest:.2} to {highest:.2} at {} α", ratios.len());
    // Never far too low, which would allow false alarms.
    assert!(
        1.0 / MARGIN < lowest && highest < OFF_ABOVE,
        "{lowest} {highest}"
    );
}

/// The points with the fewest photons, where many exposures take little time.
const RARE: [usize; 10] = [1, 4, 5, 6, 9, 10, 11, 13, 14, 15];

#[test]
fn rare_false_alarms_are_not_more_than_the_upper_limit_and_its_margin() {
    const EXPOSURES: u32 = 50_000;
    let places = slow_or_quick(&RARE[..], &RARE[..4]);
    let table = Table::load().unwrap();
    let mut compared = Vec::new();
    for (trial, place) in (100..).zip(places) {
        let place = Place::new(trial, BETWEEN[*place], EXPOSURES);
        for alpha in eighths() {
            let events = place.events(alpha);
            if (0.001..0.02).contains(&(f64::from(events) / f64::from(EXPOSURES))) {
                compared.extend(place.look_up(&table, alpha).map(|found| (events, found)));
            }
        }
    }
    println!("{} α", compared.len());
    assert!(compared.len() > slow_or_quick(20, 8), "{}", compared.len());
    let level = LEVEL / f64::from(u32::try_from(compared.len()).unwrap());
    for (events, found) in compared {
        let most = found.upper_limit * MARGIN;
        assert!(
            lies_between(events, EXPOSURES, [0.0, most], level),
            "{events} {found:?}"
        );
    }
}

fn request(background: f64, signal: f64, l2: u16, allowed: f64) -> Request {
    Request {
        background,
        signal,
        sigma: 0.8,
        bins: 128,
        minimum_count: 5,
        x: 4,
        l1: None,
        l2,
        levels: BlockLevel::PIXEL,
        limit: FalseAlarmLimit::PerExposure(allowed),
        seed: 1,
    }
}

/// The first event of each pixel that has one in its first exposure, from the engine.
fn first_events(request: &Request, tuned: &Tuned, signal: f64, side: u32) -> Vec<DepthEvent> {
    let settings = Settings::static_scene(11).configured(|array| {
        array.rule =
            PaperRule::new(tuned.alpha, Count::saturating(request.minimum_count.into())).into();
        array.l1 = tuned.l1;
        array.l2 = request.l2;
        array.x = request.x;
    });
    let array = Array::new(side, side).unwrap();
    let pixels = (0..side * side).map(|pixel| {
        let rates = Rates {
            background: request.background,
            signal,
            position: position(pixel),
            sigma: request.sigma,
        };
        let address = PixelAddress::new(u16::try_from(pixel).unwrap());
        SimulatedPixel::new(&rates, 128, pixel_rng(settings.seed, address)).unwrap()
    });
    let cycles = tuned.looks.expiry();
    let mut photons = SimulatedArray::new(array, pixels.collect(), cycles.into(), None).unwrap();
    let mut engine = host_engine(&settings, photons.array(), &photons.addresses()).unwrap();
    let slice = photons.next_slice(u16::try_from(cycles).unwrap()).unwrap();
    let mut events = engine.run(&slice).unwrap();
    events.sort_by_key(|event| (event.pixel, event.cycle));
    events.dedup_by_key(|event| event.pixel);
    events
}

/// The position of a pixel's pulse: one of the eight that `tune` simulates.
fn position(pixel: u32) -> f64 {
    48.0 + (f64::from(pixel % 8) + 0.5) / 8.0
}

#[test]
fn tuned_settings_keep_their_word_in_the_engine() {
    let table = Table::load().unwrap();
    let allowed = 0.02;
    for (background, l2, side) in [(0.02, 800, 40), (0.2, 400, 60), (1.0, 300, 24)] {
        let request = request(background, 1.0, l2, allowed);
        let tuned = tune(&request, &table, NONE).unwrap();
        assert!(tuned.false_alarms <= allowed);
        let events = first_events(&request, &tuned, 0.0, side);
        let events = u32::try_from(events.len()).unwrap();
        let exposures = side * side;
        println!(
            "B {background}: α {}, L1 {}: {events} of {exposures}, expected {:.4} ({:?})",
            tuned.alpha, tuned.l1, tuned.false_alarms, tuned.source
        );
        assert!(lies_between(events, exposures, [0.0, allowed], LEVEL / 3.0));
        // The prediction agrees with the engine, within the error of the table.
        let bounds = [1.0 / OFF_ABOVE, MARGIN].map(|off| off * tuned.false_alarms);
        assert!(
            lies_between(events, exposures, bounds, LEVEL / 6.0),
            "{events}"
        );
    }
}

#[test]
fn time_and_depth_error_are_those_of_the_engine() {
    let table = Table::load().unwrap();
    let request = request(0.05, 0.4, 800, 0.01);
    let tuned = tune(&request, &table, NONE).unwrap();
    let events = first_events(&request, &tuned, request.signal, 40);
    let (mut cycles, mut squares) = (Vec::new(), Vec::new());
    for event in &events {
        let truth = position(event.pixel.raw().into());
        let error = f64::from(event.position().raw()) / 256.0 - truth;
        if error.abs() < 3.0 {
            cycles.push(f64::from(event.exposure));
            squares.push(error * error);
        }
    }
    assert!(cycles.len() > 1500, "{}", cycles.len());
    let simulated = tuned.detections;
    let [near, near_cycles] =
        [simulated.near, simulated.near_cycles].map(|sum| f64::from(count(sum)));
    // Four and a half standard errors, which are larger for the engine's fewer
    // events: one run in 2,000 with both comparisons and both samples.
    let distance = |values: &[f64], expected: f64| {
        let times = values.len() as f64;
        let mean = values.iter().sum::<f64>() / times;
        let square = |value: &f64| (value - mean).powi(2);
        let variance = values.iter().map(square).sum::<f64>() / (times - 1.0);
        (mean - expected).abs() / (variance * (1.0 / times + 1.0 / near)).sqrt()
    };
    let time = distance(&cycles, near_cycles / near);
    let depth = distance(&squares, tuned.detections.depth_error_bins().powi(2));
    assert!(time < 4.5 && depth < 4.5, "{time} {depth}");
}

#[test]
fn a_trial_is_a_pure_function() {
    let point = &table::points()[7];
    let trial = |seed, number| FalseAlarms::trial(point, 20, &mut trial_rng(seed, number)).unwrap();
    assert_eq!(trial(1, 3), trial(1, 3));
    assert_ne!(trial(1, 3), trial(1, 4));
    assert_ne!(trial(1, 3), trial(2, 3));
}

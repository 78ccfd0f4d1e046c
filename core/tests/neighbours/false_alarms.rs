//! The false alarms of pixels that ask neighbours are those of the rule, whatever the background.

use dtof_core::neighbours::{NeighbourConfig, end_laser_cycles_of_array};
use dtof_core::{
    Array, AsyncPixel, Count, Flags, LaserCycle, Neighbours, PixelAddress, PixelConfig, RangeGate,
    Statistics, WindowRule, z_for,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BINS: usize = 128;
const SIDE: u16 = 20;
const X: u16 = 4;
const L1: u16 = 40;
const L2: u16 = 1000;

/// Exposures, and their events: by pixels alone, and confirmed.
#[derive(Debug, Default)]
struct Found {
    exposures: u64,
    alone: u32,
    confirmed: u32,
    /// Confirmed events at the array's corners and beside the hot pixel.
    at_corners: u32,
    beside_hot: u32,
}

/// An array without a target. Pixel `hot` has ten times the background.
fn run(background_a_look: f64, exposures: u64, hot: Option<u16>, seed: u64) -> Found {
    let gate = RangeGate::<BINS>::full();
    let rule = WindowRule::new(3, z_for(100, &gate, X, L1, L2), Count::saturating(5)).unwrap();
    let array = Array::new(SIDE.into(), SIDE.into()).unwrap();
    let neighbours = NeighbourConfig::new(array, Neighbours::Eight, &rule);
    let config = PixelConfig::<BINS, _>::with_rule(*neighbours.rule().own());
    let config = config.x(X).l1(L1).l2(L2).build().unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let pixels = SIDE * SIDE;
    let mut array: Vec<AsyncPixel<BINS>> = (0..pixels)
        .map(|pixel| AsyncPixel::new(PixelAddress::new(pixel)))
        .collect();
    let (mut statistics, mut found) = (Statistics::default(), Found::default());
    let mut gap = |rate: f64| {
        let uniform = (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0;
        (
            -uniform.ln() / rate,
            ((u64::from(rng.next_u32()) * BINS as u64) >> 32) as u16,
        )
    };
    let mut next = vec![0.0; usize::from(pixels)];
    let mut look = 0.0;
    while statistics.expired + statistics.events < exposures {
        look += 1.0;
        for (pixel, next) in array.iter_mut().zip(&mut next) {
            let is_hot = hot == Some(pixel.address().raw());
            let rate = background_a_look * BINS as f64 * if is_hot { 10.0 } else { 1.0 };
            while *next < look {
                let (more, code) = gap(rate);
                pixel.count(&config, code);
                *next += more;
            }
        }
        let last = LaserCycle::new(look as u64 * u64::from(X) - 1);
        end_laser_cycles_of_array(&mut array, &config, &neighbours, &mut statistics, last, X);
        for event in array.iter_mut().filter_map(AsyncPixel::take_event) {
            if !event.flags.contains(Flags::CONFIRMED) {
                found.alone += 1;
                continue;
            }
            found.confirmed += 1;
            let at = |address: u16| (address / SIDE, address % SIDE);
            let (row, column) = at(event.pixel.raw());
            let edge = [0, SIDE - 1];
            found.at_corners += u32::from(edge.contains(&row) && edge.contains(&column));
            if let Some(hot) = hot {
                let (hot_row, hot_column) = at(hot);
                let apart = row.abs_diff(hot_row).max(column.abs_diff(hot_column));
                found.beside_hot += u32::from(apart == 1);
            }
        }
    }
    found.exposures = statistics.expired + statistics.events;
    found
}

/// 1 % is asked. `DTOF_SLOW=1` counts ten times the exposures.
#[test]
fn they_are_at_most_those_of_the_rule() {
    let exposures = match std::env::var_os("DTOF_SLOW") {
        Some(_) => 20_000,
        None => 2_000,
    };
    for background in [0.01, 0.05, 0.2, 2.0] {
        // The photons of bright background take long.
        let exposures = if background > 1.0 {
            exposures / 4
        } else {
            exposures
        };
        let found = run(background, exposures, Some(210), 3);
        let all = f64::from(found.alone + found.confirmed);
        let share = all / found.exposures as f64;
        println!(
            "{background} photons a bin and look: {:.2} % false alarms, {found:?}",
            100.0 * share
        );
        // Three standard deviations of 1 %.
        let allowed = 0.01 * found.exposures as f64;
        assert!(all <= 1.3 * allowed + 3.0 * allowed.sqrt(), "{found:?}");
        let confirmed = f64::from(found.confirmed);
        assert!(confirmed <= 0.5 * 1.3 * allowed + 3.0 * allowed.sqrt());
        assert!(found.alone > 0);
        // 4 of 400 pixels, and 8.
        for (events, pixels) in [(found.at_corners, 4.0), (found.beside_hot, 8.0)] {
            let expected = allowed * pixels / 400.0;
            assert!(
                f64::from(events) <= 1.3 * expected + 4.0 * expected.sqrt() + 1.0,
                "{found:?}"
            );
        }
    }
}

//! Whether an event can say that motion has spread its pulse: two tests that are not built, and why.
//!
//! A target that moves during an exposure leaves its photons along its way, and the event lags behind. The
//! width of the pulse in the histogram hardly tells. The distance from the event before does, but a
//! receiver of events can compute it by itself.

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, Count, DepthEstimator, LaserCycle, PixelAddress, PixelConfig, RangeGate,
    Statistics, WindowRule, z_for,
};
use dtof_light::rates::bin_share;
use rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal, Poisson};
use rand_pcg::Pcg64;

use crate::slow_or_quick;

const BINS: usize = 128;
/// Background photons a bin and laser cycle.
const BACKGROUND: f64 = 0.05;

/// An event, and how far each test stands out.
struct Event {
    /// Bins behind the target in the last laser cycle.
    lag: f64,
    /// Photons beside the pulse's three middle bins above those of a still pulse, in standard deviations.
    width: f64,
    /// Bins that the target moves in half the exposure, by the event before.
    predicted: Option<f64>,
}

/// Events of a target with `signal` photons a laser cycle that moves `speed` bins in each.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of photons, and bins"
)]
fn events(signal: f64, speed: f64, number: usize, seed: u64) -> Vec<Event> {
    let gate = RangeGate::<BINS>::full();
    let z = z_for(100, &gate, 4, 40, 2000);
    let rule = WindowRule::new(3, z, Count::saturating(5)).unwrap();
    let config = PixelConfig::<BINS, _>::with_rule(rule);
    let config = config.estimator(DepthEstimator::for_pulse(U8F8::ONE));
    let config = config.build().unwrap();
    let mut rng = Pcg64::seed_from_u64(seed);
    let pulse = Normal::new(0.0, 1.0).unwrap();
    let [background, light] =
        [BACKGROUND * BINS as f64, signal].map(|mean| Poisson::new(mean).unwrap());
    let mut events = Vec::new();
    while events.len() < number {
        let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
        let mut last: Option<(f64, f64)> = None;
        let mut place = 20.0 + f64::from(rng.next_u32()) / 4_294_967_296.0;
        // Before it leaves the bins. A still one gives twenty events.
        let (mut cycle, mut found) = (0.0, 0);
        while place < 110.0 && found < 20 {
            cycle += 1.0;
            place += speed;
            for _ in 0..background.sample(&mut rng) as usize {
                pixel.count(&config, (rng.next_u32() >> 25) as u16);
            }
            for _ in 0..light.sample(&mut rng) as usize {
                pixel.count(&config, (place + pulse.sample(&mut rng)) as u16);
            }
            let mut counts = [0.0; BINS];
            let statistics = &mut Statistics::default();
            pixel.end_laser_cycles_with(&config, statistics, LaserCycle::new(0), 1, |input| {
                counts = input.histogram.counts().map(f64::from);
            });
            let Some(event) = pixel.take_event() else {
                continue;
            };
            found += 1;
            let position = f64::from(event.position().raw()) / 256.0;
            let exposure = f64::from(event.exposure);
            // False alarms are another matter.
            if position > place + 3.0 || position < place - speed * exposure - 3.0 {
                continue;
            }
            events.push(Event {
                lag: place - position,
                width: width(&counts, position),
                predicted: last
                    .map(|(at, when)| ((position - at) / (cycle - when) * exposure / 2.0).abs()),
            });
            last = Some((position, cycle));
        }
    }
    events
}

/// How many photons within four bins of the peak, but not in its three middle ones, are more than the
/// latter and the background let expect, in standard deviations.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of photons, and bins"
)]
fn width(counts: &[f64; BINS], position: f64) -> f64 {
    let middle = (position as usize).clamp(9, BINS - 10);
    let sum = |reach: usize| counts[middle - reach..=middle + reach].iter().sum::<f64>();
    let share = |reach: usize| {
        let bins = middle - reach..=middle + reach;
        let of = |bin| bin_share(u32::try_from(bin).unwrap(), position, 1.0);
        bins.map(of).sum::<f64>()
    };
    let (near, wide) = (sum(1), sum(4));
    let background = (counts.iter().sum::<f64>() - wide) / (BINS - 9) as f64;
    let beside = wide - near;
    let ratio = (share(4) - share(1)) / share(1);
    let excess = beside - 6.0 * background - ratio * (near - 3.0 * background);
    excess / (beside + ratio * ratio * near).max(1.0).sqrt()
}

/// The level that one in a hundred of these exceeds.
fn level(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() - of.len() / 100]
}

/// Of events more than half a bin behind, the shares that each test finds when it flags 1 % of the events
/// of a still target.
fn found(signal: f64, speed: f64, number: usize) -> [f64; 2] {
    let still = events(signal, 0.0, number, 1);
    let levels = [
        level(still.iter().map(|event| event.width).collect()),
        level(still.iter().filter_map(|event| event.predicted).collect()),
    ];
    let moving = events(signal, speed, number, 2);
    let late: Vec<&Event> = moving.iter().filter(|event| event.lag > 0.5).collect();
    let share = |is_found: &dyn Fn(&Event) -> bool| {
        late.iter().filter(|event| is_found(event)).count() as f64 / late.len() as f64
    };
    let shares = [
        share(&|event| event.width > levels[0]),
        share(&|event| event.predicted.is_some_and(|lag| lag > levels[1])),
    ];
    println!(
        "signal {signal}, {speed} bins a laser cycle: {} of {number} events lag by more than half a bin; the \
         width finds {:.1} %, the event before {:.1} %",
        late.len(),
        100.0 * shares[0],
        100.0 * shares[1]
    );
    shares
}

/// The width finds at most one of eight, whatever the speed; the event before finds most where the target
/// is fast against its exposures.
#[test]
fn the_width_of_a_pulse_does_not_tell_that_its_target_moves() {
    let number = slow_or_quick(10_000, 1_000);
    for (signal, speed, least) in [(0.5, 0.02, 0.0), (0.145, 0.005, 0.2), (0.145, 0.01, 0.5)] {
        let [width, before] = found(signal, speed, number);
        assert!(width < 0.125, "{width}");
        assert!(before > least, "{before}");
    }
}

//! Pixels of a TDC with a dead time: right events, false alarms, and every photon accounted for.
//!
//! A photon in bin b blinds the TDC for the bins b + 1 to b + D.

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, Count, DepthEstimator, DepthEvent, EchoNumber, Flags, LaserCycle, Look,
    PixelAddress, PixelConfig, PixelConfigBuilder, RangeGate, Statistics, WindowRule, z_for,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const BINS: usize = 128;
/// Where the pulse lies, with a standard deviation of one bin.
const PLACE: f64 = 80.3;

/// Photons a laser cycle in each bin.
fn light(background: f64, signal: f64) -> [f64; BINS] {
    let below = |x: f64| 0.5 * (1.0 + libm::erf((x - PLACE) / 2f64.sqrt()));
    std::array::from_fn(|bin| {
        let bin = bin as f64;
        background / BINS as f64 + signal * (below(bin + 1.0) - below(bin))
    })
}

/// A TDC under some light.
struct Tdc {
    /// Light of the bins before each.
    before: [f64; BINS + 1],
    dead_time: usize,
    rng: Pcg32,
}

impl Tdc {
    fn new(light: &[f64; BINS], dead_time: usize, seed: u64) -> Self {
        let mut before = [0.0; BINS + 1];
        for (bin, light) in light.iter().enumerate() {
            before[bin + 1] = before[bin] + light;
        }
        let rng = Pcg32::seed_from_u64(seed);
        Self {
            before,
            dead_time,
            rng,
        }
    }

    /// Counts the photons of a laser cycle: the time to the next is exponential in the light that
    /// passes.
    fn cycle(&mut self, mut count: impl FnMut(u16)) {
        let mut bin = 0;
        while bin < BINS {
            let uniform = (f64::from(self.rng.next_u32()) + 0.5) / 4_294_967_296.0;
            let until = self.before[bin] - uniform.ln();
            if until >= self.before[BINS] {
                return;
            }
            let hit = self.before.partition_point(|&before| before <= until) - 1;
            count(hit as u16);
            bin = hit + 1 + self.dead_time;
        }
    }
}

fn config(one_in: u32, l2: u16) -> PixelConfigBuilder<BINS, WindowRule> {
    let gate = RangeGate::<BINS>::full();
    let rule = WindowRule::new(3, z_for(one_in, &gate, 4, 40, l2), Count::saturating(5));
    let estimator = DepthEstimator::for_pulse(U8F8::ONE);
    PixelConfig::with_rule(rule.unwrap()).estimator(estimator).l2(l2)
}

/// What some events were.
#[derive(Debug, Default)]
struct Outcome {
    events: u32,
    wrong: u32,
    cycles: u32,
    error: f64,
    statistics: Statistics,
}

impl Outcome {
    /// Share of events more than three bins off.
    fn wrong(&self) -> f64 {
        f64::from(self.wrong) / f64::from(self.events)
    }

    /// Laser cycles a right event.
    fn cycles(&self) -> f64 {
        f64::from(self.cycles) / f64::from(self.events - self.wrong)
    }

    /// Mean error of right events in bins.
    fn error(&self) -> f64 {
        self.error / f64::from(self.events - self.wrong)
    }
}

fn run(tdc: &mut Tdc, config: &PixelConfig<BINS, WindowRule>, events: u32) -> Outcome {
    let mut outcome = Outcome::default();
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
    while outcome.events < events && outcome.cycles < 20_000 * events {
        tdc.cycle(|code| pixel.count(config, code));
        let cycle = LaserCycle::new(outcome.cycles.into());
        pixel.end_laser_cycle(config, &mut outcome.statistics, cycle);
        outcome.cycles += 1;
        let Some(event) = pixel.take_event() else {
            continue;
        };
        let error = f64::from(event.position().raw()) / 256.0 - PLACE;
        outcome.events += 1;
        if error.abs() > 3.0 {
            outcome.wrong += 1;
        } else {
            outcome.error += error;
        }
    }
    outcome
}

/// Under strong light the rule goes on where counts alone are wrong or never end.
#[test]
fn events_are_right_under_strong_light() {
    // Dead time, background, events; most wrong, laser cycles an event, error.
    for (dead_time, background, events, wrong, cycles, error) in [
        (BINS, 6.0, 2000, 0.012, 1900.0, 0.15),
        (BINS, 3.0, 4000, 0.012, 160.0, 0.15),
        (20, 6.0, 4000, 0.012, 100.0, 0.15),
        (5, 6.0, 4000, 0.012, 100.0, 0.15),
    ] {
        let config = config(100, 2000).dead_time(dead_time as u16).build().unwrap();
        let light = light(background, 0.5);
        let outcome = run(&mut Tdc::new(&light, dead_time, 1), &config, events);
        println!(
            "dead for {dead_time}, {background} photons: {:.2} % wrong, {:.0} laser cycles, \
             error {:+.3} bins of {events} events",
            100.0 * outcome.wrong(),
            outcome.cycles(),
            outcome.error()
        );
        assert!(outcome.wrong() <= wrong && outcome.cycles() <= cycles);
        assert!(outcome.error().abs() <= error);
    }
}

//! Pixels of a TDC with a dead time: right events, false alarms, and every photon accounted for.
//!
//! A photon in bin b blinds the TDC for the bins b + 1 to b + D.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::rule::Tracking;
use dtof_core::{
    AnyRule, AsyncPixel, Count, Count16, DepthEstimator, Detection, EchoNumber, Flags, Histogram,
    LaserCycle, Look, PaperRule, PixelAddress, PixelConfig, PixelConfigBuilder, RangeGate,
    Statistics, WindowRule, z_for,
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
    PixelConfig::with_rule(rule.unwrap())
        .estimator(estimator)
        .l2(l2)
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
    // Dead time, photons of background, of signal; most wrong, laser cycles an event, error.
    for (dead_time, background, signal, events, wrong, cycles, error) in [
        (BINS, 5.5, 0.5, 2000, 0.012, 1900.0, 0.05),
        (BINS, 6.0, 0.5, 1000, 0.012, 1900.0, 0.15),
        (BINS, 2.5, 0.5, 4000, 0.012, 130.0, 0.05),
        (20, 5.5, 0.5, 4000, 0.012, 100.0, 0.05),
        (5, 5.5, 0.5, 4000, 0.012, 100.0, 0.05),
        (BINS, 0.0, 3.0, 4000, 0.0, 48.0, 0.15),
        (5, 0.0, 3.0, 4000, 0.0, 48.0, 0.15),
    ] {
        let config = config(100, 2000)
            .dead_time(dead_time as u16)
            .build()
            .unwrap();
        let light = light(background, signal);
        let outcome = run(&mut Tdc::new(&light, dead_time, 1), &config, events);
        println!(
            "dead for {dead_time}, {background} + {signal} photons: {:.2} % of {events} wrong, {:.0} \
             laser cycles, error {:+.3} bins",
            100.0 * outcome.wrong(),
            outcome.cycles(),
            outcome.error()
        );
        assert!(outcome.wrong() <= wrong && outcome.cycles() <= cycles);
        assert!(outcome.error().abs() <= error);
    }
}

/// Without a target, one exposure in a hundred.
#[test]
fn false_alarms_are_as_set() {
    let slow = std::env::var_os("DTOF_SLOW").is_some();
    let exposures = if slow { 20_000 } else { 1500 };
    for (dead_time, crosstalk) in [(BINS, 0.0), (20, 0.0), (5, 0.0), (BINS, 2.0), (20, 2.0)] {
        let gate = RangeGate::new(if crosstalk > 0.0 { 8 } else { 0 }, 127).unwrap();
        let rule = WindowRule::new(3, z_for(100, &gate, 4, 40, 1000), Count::saturating(5));
        let config = PixelConfig::with_rule(rule.unwrap()).gate(gate).l2(1000);
        let config = config.dead_time(dead_time as u16).build().unwrap();
        let mut light = light(6.0 - crosstalk, 0.0);
        light[3] += crosstalk;
        let mut tdc = Tdc::new(&light, dead_time, 2);
        let mut pixel = AsyncPixel::<BINS>::new(PixelAddress::new(0));
        let mut statistics = Statistics::default();
        while statistics.events + statistics.expired < exposures {
            tdc.cycle(|code| pixel.count(&config, code));
            pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(0));
            let _ = pixel.take_event();
        }
        let share = statistics.events as f64 / exposures as f64;
        let deviation = (share * (1.0 - share) / exposures as f64).sqrt();
        println!(
            "dead for {dead_time}, crosstalk of {crosstalk}: {:.2} ± {:.2} % of {exposures} \
             exposures, {} full",
            100.0 * share,
            196.0 * deviation,
            statistics.ended_full
        );
        assert!(share <= 0.013);
        assert_eq!(statistics.ended_full, 0);
    }
}

/// A pixel with a short exposure, and its statistics.
struct Lone {
    pixel: AsyncPixel<16>,
    config: PixelConfig<16, WindowRule>,
    statistics: Statistics,
}

impl Lone {
    fn new(config: PixelConfigBuilder<16, WindowRule>) -> Self {
        Self {
            pixel: AsyncPixel::new(PixelAddress::new(0)),
            config: config.build().unwrap(),
            statistics: Statistics::default(),
        }
    }

    /// Counts so many photons in each bin, by one of the three ways to count.
    fn count(&mut self, counts: [u16; 16], way: usize) {
        let codes = (0u16..).zip(counts);
        let codes: Vec<u16> = codes
            .flat_map(|(code, photons)| (0..photons).map(move |_| code))
            .collect();
        match way {
            0 => codes
                .iter()
                .for_each(|&code| self.pixel.count(&self.config, code)),
            1 => self.pixel.count_batch(&self.config, &codes),
            _ => self.pixel.count_frame(&self.config, &counts),
        }
    }

    fn end(&mut self, cycles: u16) -> Look {
        let (config, statistics) = (&self.config, &mut self.statistics);
        self.pixel
            .end_laser_cycles(config, statistics, LaserCycle::new(0), cycles)
    }
}

fn small(first: u16) -> PixelConfigBuilder<16, WindowRule> {
    let rule = WindowRule::new(2, U4F12::lit("3"), Count::saturating(3)).unwrap();
    let gate = RangeGate::new(first, 15).unwrap();
    PixelConfig::with_rule(rule).gate(gate).x(1).l1(1).l2(1000)
}

/// Photons before the gate blind the TDC, however they are counted. They are in no total.
#[test]
fn photons_before_the_gate_stay_in_their_counters() {
    let counts = [0, 400, 0, 0, 3, 2, 3, 2, 3, 2, 3, 2, 3, 2, 3, 9];
    for way in 0..3 {
        for (dead_time, kept) in [(0, 0), (16, 400), (4, 400)] {
            let mut lone = Lone::new(small(4).dead_time(dead_time));
            lone.count(counts, way);
            assert_eq!(lone.pixel.histogram().count(1), Some(kept));
            assert_eq!(lone.pixel.histogram().total(), 37);
            assert_eq!(lone.end(500), Look::NoPeak);
            lone.pixel.add_photons_to(&mut lone.statistics);
            let statistics = &lone.statistics;
            assert_eq!((statistics.counted, statistics.gated_out), (37, 400));
        }
    }
}

/// A counter that is full, before the gate or in it, no longer says how often the bins behind it
/// were live.
#[test]
fn an_exposure_with_a_full_counter_ends() {
    for (bin, first, photons) in [(1, 4, 1023), (6, 4, 1024), (6, 0, 1024)] {
        let mut lone = Lone::new(small(first).dead_time(16).l2(60_000));
        let mut counts = [0; 16];
        counts[bin] = photons - 1;
        lone.count(counts, 1);
        let look = lone.end(2000);
        assert_eq!(look == Look::Event, bin >= usize::from(first));
        assert_eq!(lone.statistics.ended_full, 0);
        let mut lone = Lone::new(small(first).dead_time(16).l2(60_000));
        counts[bin] = photons;
        lone.count(counts, 1);
        assert_eq!(lone.end(2000), Look::Expired);
        assert_eq!(
            (lone.statistics.ended_full, lone.statistics.expired),
            (1, 1)
        );
        assert_eq!(lone.pixel.histogram().counts(), &[0; 16]);
        assert_eq!(lone.statistics.photons(), u64::from(photons));
    }
}

/// More photons than laser cycles: the TDC has no such dead time. That is never an event.
#[test]
fn counts_that_contradict_the_dead_time_are_no_event() {
    let mut counts = [10; 16];
    counts[9] = 60;
    for (dead_time, look, blind) in [
        (0, Look::Event, 0),
        (3, Look::Event, 0),
        (16, Look::NoPeak, 1),
    ] {
        let mut lone = Lone::new(small(0).dead_time(dead_time));
        lone.count(counts, 0);
        assert_eq!(lone.end(100), look, "{dead_time}");
        assert_eq!(lone.statistics.blind_looks, blind);
    }
    // More than one photon a laser cycle in two bins next to each other, and in the last bin.
    let mut pair = [0u32; 16];
    pair[6..10].copy_from_slice(&[300, 900, 900, 300]);
    let mut last = [0u32; 16];
    last[15] = 600;
    for (counts, dead_time) in [(pair, 1), (last, 16)] {
        for (cycles, is_blind) in [(500, true), (2000, false)] {
            let mut histogram = Histogram::<16, Count16>::new();
            let config = small(0).dead_time(dead_time).build().unwrap();
            assert_eq!(config.add_frame(&mut histogram, &counts), 0);
            let mut events = 0;
            let found = config.detect_echoes(&mut histogram, cycles, |_, _| events += 1);
            assert_eq!((found, events), (is_blind, u32::from(!is_blind)));
        }
    }
}

/// An event that leaves nothing to the bins behind it says that they are blind.
#[test]
fn an_event_before_blind_bins_is_flagged() {
    let config = small(0).dead_time(16).build().unwrap();
    // A window of two bins has to be live in 4 of 2000 laser cycles.
    for (live, is_blind) in [(0, true), (1, true), (2, false), (8, false)] {
        let mut counts = [1u32; 16];
        counts[10] = 2000 - 10 - live;
        counts[11..].fill(0);
        let mut histogram = Histogram::<16, Count16>::new();
        assert_eq!(config.add_frame(&mut histogram, &counts), 0);
        let mut found = Vec::new();
        let detect = |_, echo: &Detection| found.push(*echo);
        assert_eq!(config.detect_echoes(&mut histogram, 2000, detect), is_blind);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].peak.bin.raw(), 10);
        assert_eq!(found[0].depth.flags.contains(Flags::PILE_UP), is_blind);
    }
}

/// In a short exposure: a window of two bins that was live twice never has the minimum of 3 photons.
/// A pixel that expects its next event says so too.
#[test]
fn a_pixel_flags_bins_in_which_no_target_can_be_seen() {
    for (live, is_blind) in [(1, true), (2, false)] {
        for tracks in [false, true] {
            let builder = small(0).dead_time(16);
            let rule = *builder.build().unwrap().rule();
            let tracking = rule.tracking(&RangeGate::<16>::full());
            let mut lone = Lone::new(builder.tracking(tracks.then_some(tracking)));
            for exposure in 1..=2 {
                let mut counts = [0; 16];
                counts[10] = 44 - live;
                lone.count(counts, 0);
                assert_eq!(lone.end(44), Look::Event);
                let event = lone.pixel.take_event().unwrap();
                assert_eq!(event.flags.contains(Flags::PILE_UP), is_blind);
                let blind_looks = if is_blind { exposure } else { 0 };
                assert_eq!(lone.statistics.blind_looks, blind_looks);
            }
        }
    }
}

/// Echoes of a TDC that is dead for 3 bins. The first stays in its counters and is left out; the
/// second is found as if it were alone.
#[test]
fn photons_of_an_echo_stay_in_their_counters() {
    let mut lone = Lone::new(small(0).dead_time(3).echoes(EchoNumber::new(2).unwrap(), 2));
    let first_only = [2, 2, 2, 2, 90, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2];
    lone.count(first_only, 0);
    assert_eq!(lone.end(100), Look::Event);
    let first = lone.pixel.take_event().unwrap();
    assert_eq!((first.peak_bin.raw(), first.echo), (4, EchoNumber::FIRST));
    assert_eq!(lone.statistics.excluded, 90 + 4 * 2);
    assert_eq!(lone.pixel.histogram().total(), 11 * 2);
    assert_eq!(lone.pixel.histogram().count(4), Some(90));
    // More of the first, and a second.
    lone.count([0, 0, 0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 38, 0, 0, 0], 0);
    assert_eq!(lone.end(100), Look::Event);
    let second = lone.pixel.take_event().unwrap();
    assert_eq!((second.peak_bin.raw(), second.echo.raw()), (12, 2));
    assert_eq!(lone.statistics.photons(), 120 + 48);
    assert_eq!(lone.statistics.excluded, 98 + 10);
    assert_eq!(lone.pixel.histogram().counts(), &[0; 16]);
}

/// Where a pixel expects its target, fewer photons are enough; elsewhere it takes as many as before.
#[test]
fn a_pixel_that_tracks_needs_fewer_photons_where_it_expects_the_target() {
    let builder = small(0).dead_time(16);
    let tracking = builder
        .build()
        .unwrap()
        .rule()
        .tracking(&RangeGate::<16>::full());
    // The fewest photons of a target in bin `place` after one in bin 8.
    let fewest = |tracking, place: usize| {
        let fires = |photons| {
            let mut lone = Lone::new(builder.tracking(Some(tracking)));
            let mut counts = [6; 16];
            counts[8] = 60;
            lone.count(counts, 0);
            assert_eq!(lone.end(500), Look::Event);
            let _ = lone.pixel.take_event();
            let mut counts = [6; 16];
            counts[place] = photons;
            lone.count(counts, 0);
            let look = lone.end(500);
            let event = lone.pixel.take_event();
            assert!(event.is_none_or(|event| usize::from(event.peak_bin.raw()) == place));
            look == Look::Event
        };
        (6..60).find(|&photons| fires(photons)).unwrap()
    };
    let [near, far] = [tracking.near(), tracking.far()].map(|rule| Tracking::new(*rule, *rule, 1));
    assert!(fewest(near, 8) < fewest(far, 8));
    assert_eq!(fewest(tracking, 8), fewest(near, 8));
    for place in [2, 6, 10, 15] {
        assert_eq!(fewest(tracking, place), fewest(far, place));
    }
}

/// The rule that is chosen at run time weighs as the rule itself does.
#[test]
fn any_window_rule_weighs() {
    let rule = WindowRule::new(3, U4F12::lit("4"), Count::saturating(5)).unwrap();
    let gate = RangeGate::new(4, 15).unwrap();
    let any = PixelConfig::<16, AnyRule>::with_rule(rule.into()).gate(gate);
    let any = any.dead_time(3).build().unwrap();
    let own = PixelConfig::<16, WindowRule>::with_rule(rule).gate(gate);
    let own = own.dead_time(3).build().unwrap();
    assert!(any.weighs_dead_time() && own.weighs_dead_time());
}

/// With other rules nothing is weighed: only the first photon's TDC has a flag (`pile_up`).
#[test]
fn other_rules_take_every_bin_as_live() {
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let gate = RangeGate::new(4, 15).unwrap();
    for dead_time in [1, 16] {
        let config = PixelConfig::<16, AnyRule>::with_rule(rule.into()).gate(gate);
        let config = config.dead_time(dead_time).build().unwrap();
        assert!(!config.weighs_dead_time());
        let mut pixel = AsyncPixel::<16>::new(PixelAddress::new(0));
        pixel.count_batch(&config, &[0, 1, 2, 9]);
        assert_eq!(
            (pixel.histogram().count(1), pixel.histogram().total()),
            (Some(0), 1)
        );
    }
}

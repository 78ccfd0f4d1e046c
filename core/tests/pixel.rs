//! The asynchronous pixel against its flow chart (section II-B), redrawn here
//! as plainly as it can be.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{
    AsyncPixel, BinIndex, ConfigError, Count, Count10, CounterWidth, DepthEvent, DetectionRule,
    EventSlot, Flags, Histogram, LaserCycle, Look, PaperRule, Peak, PixelAddress, PixelConfig,
    RangeGate, Statistics, SubBinOffset,
};
use proptest::prelude::*;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// What a pixel is set to.
#[derive(Clone, Copy, Debug)]
struct Settings {
    x: u16,
    l1: u16,
    l2: u16,
    first: usize,
    last: usize,
    /// In 1/256.
    alpha: u16,
    minimum: u32,
    is_one_hit: bool,
}

impl Settings {
    fn config<const BINS: usize>(&self) -> PixelConfig<BINS> {
        let rule = PaperRule::new(
            U8F8::from_bits(self.alpha),
            Count::new(self.minimum).unwrap(),
        );
        let gate = RangeGate::new(self.first as u16, self.last as u16).unwrap();
        let config = PixelConfig::new(self.x, self.l1, self.l2, gate, rule).unwrap();
        if self.is_one_hit {
            config.with_one_hit_tdc()
        } else {
            config
        }
    }
}

/// The flow chart. Its arithmetic is f64, exact for 10-bit counts.
struct Model {
    settings: Settings,
    counts: Vec<u32>,
    /// N.
    exposure: u32,
    since_look: u32,
    /// Photons of the exposure with the code of a bin.
    in_bins: u32,
    put_off: bool,
    waiting: Option<DepthEvent>,
    statistics: Statistics,
}

impl Model {
    fn new(bins: usize, settings: Settings) -> Self {
        Self {
            settings,
            counts: vec![0; bins],
            exposure: 0,
            since_look: 0,
            in_bins: 0,
            put_off: false,
            waiting: None,
            statistics: Statistics::default(),
        }
    }

    fn count(&mut self, code: usize) {
        self.in_bins += u32::from(code < self.counts.len());
        if code >= self.counts.len() {
            self.statistics.rejected += 1;
        } else if code < self.settings.first || code > self.settings.last {
            self.statistics.gated_out += 1;
        } else if self.counts[code] == 1023 {
            self.statistics.saturated += 1;
        } else {
            self.counts[code] += 1;
            self.statistics.counted += 1;
        }
    }

    fn end(&mut self, last_cycle: u64, cycles: u32) -> Look {
        self.exposure += cycles;
        self.since_look += cycles;
        if self.since_look < u32::from(self.settings.x) {
            return Look::NotDue;
        }
        self.since_look = 0;
        if self.exposure >= u32::from(self.settings.l2) {
            self.statistics.expired += 1;
            self.statistics.expired_deferred += u64::from(self.put_off);
            self.reset();
            return Look::Expired;
        }
        if self.exposure <= u32::from(self.settings.l1) {
            return Look::TooEarly;
        }
        if self.waiting.is_some() {
            self.statistics.deferred += 1;
            self.put_off = true;
            return Look::Deferred;
        }
        self.waiting = self.decide(last_cycle);
        if self.waiting.is_none() {
            return Look::NoPeak;
        }
        self.statistics.events += 1;
        self.reset();
        Look::Event
    }

    fn reset(&mut self) {
        self.counts.fill(0);
        self.exposure = 0;
        self.in_bins = 0;
        self.put_off = false;
    }

    fn decide(&self, cycle: u64) -> Option<DepthEvent> {
        let Settings { first, last, .. } = self.settings;
        let gated = &self.counts[first..=last];
        let n = gated.len();
        let peak = *gated.iter().max().unwrap();
        let at = gated.iter().position(|&count| count == peak).unwrap();

        let [a, b, c, d] = [0..n / 4, n / 4..n / 2, n / 2..n * 3 / 4, n * 3 / 4..n]
            .map(|quadrant| *gated[quadrant].iter().max().unwrap());
        let background = if at < n / 2 { c.min(d) } else { a.min(b) };

        let alpha = f64::from(self.settings.alpha) / 256.0;
        let level = f64::from(background) + alpha * f64::from(background).sqrt().floor();
        if f64::from(peak) <= level || peak < self.settings.minimum {
            return None;
        }

        let mut flags = 0;
        if peak == 1023 {
            flags |= 1;
        }
        if at == 0 || at == n - 1 {
            flags |= 2;
        }
        if self.put_off {
            flags |= 4;
        }
        if self.settings.is_one_hit && f64::from(self.in_bins) > 0.5 * f64::from(self.exposure) {
            flags |= 8;
        }
        let above =
            |count: Option<&u32>| f64::from(count.map_or(0, |c| c.saturating_sub(background)));
        let left = above(at.checked_sub(1).and_then(|left| gated.get(left)));
        let right = above(gated.get(at + 1));
        let shift = 256.0 * (right - left) / (left + above(Some(&peak)) + right);
        Some(DepthEvent {
            pixel: PixelAddress(77),
            cycle: LaserCycle(cycle),
            exposure: self.exposure as u16,
            peak_bin: BinIndex::new((first + at) as u16).unwrap(),
            offset: SubBinOffset::new(128 + shift.round() as i16).unwrap(),
            peak_count: Count::new(peak).unwrap(),
            background: Count::new(background).unwrap(),
            flags: Flags::from_bits(flags).unwrap(),
        })
    }
}

/// What happens to the pixel in one laser cycle.
#[derive(Clone, Debug)]
struct Cycle {
    /// TDC codes, and how many photons each has.
    photons: Vec<(u16, u16)>,
    /// Whether the link acknowledges at its end.
    acknowledge: bool,
}

/// Runs both, compares them after each laser cycle, and checks that no event
/// was lost.
fn compare<const BINS: usize>(settings: Settings, cycles: &[Cycle]) -> Statistics {
    let config = settings.config::<BINS>();
    let mut pixel = AsyncPixel::<BINS>::new(PixelAddress(77));
    let mut model = Model::new(BINS, settings);
    let (mut offered, mut acknowledged) = (0, 0);
    for (number, cycle) in (0..).zip(cycles) {
        for &(code, times) in &cycle.photons {
            for _ in 0..times {
                pixel.count(&config, code);
                model.count(code.into());
                offered += 1;
            }
        }
        let waiting_before = pixel.request();
        let look = pixel.end_laser_cycle(&config, LaserCycle(number));
        assert_eq!(look, model.end(number, 1), "laser cycle {number}");
        // An event that waits is never replaced.
        assert!(!(waiting_before && look == Look::Event));
        assert_eq!(u32::from(pixel.exposure()), model.exposure);
        assert_eq!(pixel.histogram().counts().map(u32::from), *model.counts);
        assert_eq!(pixel.request(), model.waiting.is_some());
        if cycle.acknowledge {
            let event = pixel.acknowledge();
            assert_eq!(event, model.waiting.take());
            acknowledged += u64::from(event.is_some());
        }
        let statistics = pixel.statistics();
        assert_eq!(statistics, model.statistics);
        let Statistics {
            counted,
            saturated,
            rejected,
            gated_out,
            ..
        } = statistics;
        assert_eq!(offered, counted + saturated + rejected + gated_out);
        assert_eq!(statistics.events, acknowledged + u64::from(pixel.request()));
    }
    assert_eq!(pixel.address(), PixelAddress(77));
    assert_eq!(pixel.acknowledge(), model.waiting);
    pixel.statistics()
}

/// Random laser cycles: noise all over (a few codes past the last bin), a pulse
/// of `signal` photons in about every other cycle, now and then a flood.
fn random_cycles(bins: u32, cycles: u32, patience: u32, rng: &mut Pcg32) -> Vec<Cycle> {
    let pulse = rng.next_u32() % bins;
    let signal = rng.next_u32() % 6;
    let flood = rng.next_u32().is_multiple_of(4);
    (0..cycles)
        .map(|_| {
            let noise = rng.next_u32() % 4;
            let mut photons: Vec<(u16, u16)> = (0..noise)
                .map(|_| ((rng.next_u32() % (bins + bins / 8)) as u16, 1))
                .collect();
            if rng.next_u32().is_multiple_of(2) {
                photons.push(((pulse + rng.next_u32() % 2) as u16, signal as u16));
            }
            if flood && rng.next_u32().is_multiple_of(50) {
                photons.push(((rng.next_u32() % bins) as u16, 800));
            }
            Cycle {
                photons,
                acknowledge: rng.next_u32().is_multiple_of(patience),
            }
        })
        .collect()
}

/// Adds what the runs have seen, so that a test can tell that they saw all.
fn add(sum: &mut Statistics, one: Statistics) {
    sum.saturated += one.saturated;
    sum.rejected += one.rejected;
    sum.gated_out += one.gated_out;
    sum.events += one.events;
    sum.deferred += one.deferred;
    sum.expired += one.expired;
}

#[test]
fn random_pixels_follow_the_flow_chart() {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut seen = Statistics::default();
    for _ in 0..600 {
        let x = 1 + (rng.next_u32() % 8) as u16;
        let l1 = x + (rng.next_u32() % 40) as u16;
        let settings = Settings {
            x,
            l1,
            l2: l1 + x + 1 + (rng.next_u32() % 200) as u16,
            first: (rng.next_u32() % 4) as usize,
            last: 15 - (rng.next_u32() % 4) as usize,
            alpha: (rng.next_u32() % (8 * 256)) as u16,
            minimum: rng.next_u32() % 10,
            is_one_hit: rng.next_u32().is_multiple_of(2),
        };
        let patience = 1 + rng.next_u32() % 100;
        let cycles = random_cycles(16, 1000, patience, &mut rng);
        add(&mut seen, compare::<16>(settings, &cycles));
    }
    let Statistics {
        saturated,
        rejected,
        gated_out,
        events,
        deferred,
        expired,
        ..
    } = seen;
    for number in [saturated, rejected, gated_out, events, deferred, expired] {
        assert!(number > 1000, "{seen:?}");
    }
}

#[test]
fn the_paper_s_settings_on_128_bins() {
    let mut rng = Pcg32::seed_from_u64(2);
    let mut seen = Statistics::default();
    // Section III-B, and section IV with X = 4 and L1 = 40.
    for (x, l1) in [(10, 100), (4, 40)] {
        let settings = Settings {
            x,
            l1,
            l2: 2000,
            first: 0,
            last: 127,
            alpha: 8 * 256,
            minimum: 5,
            is_one_hit: false,
        };
        for _ in 0..10 {
            let cycles = random_cycles(128, 10_000, 60, &mut rng);
            add(&mut seen, compare::<128>(settings, &cycles));
        }
    }
    assert!(
        seen.events > 100 && seen.deferred > 100 && seen.expired > 5,
        "{seen:?}"
    );
}

/// Settings of which a look exists; 16 bins.
fn settings() -> impl Strategy<Value = Settings> {
    let exposures = (1u16..=6, 0u16..10, 1u16..60);
    let gate = (0usize..=8, 8usize..=16);
    (exposures, gate, 0u16..1024, 0u32..6, any::<bool>())
        .prop_map(
            |((x, more, beyond), (first, width), alpha, minimum, is_one_hit)| Settings {
                x,
                l1: x + more,
                l2: x + more + beyond,
                first,
                last: (first + width - 1).min(15),
                alpha,
                minimum,
                is_one_hit,
            },
        )
        .prop_filter("no look", |s| (s.l1 + 1..s.l2).any(|n| n % s.x == 0))
}

fn cycle() -> impl Strategy<Value = Cycle> {
    let photon = prop_oneof![
        6 => (0u16..18, 1u16..3),
        2 => (9u16..11, 1u16..6),
        1 => (0u16..16, Just(600)),
        1 => (any::<u16>(), Just(1)),
    ];
    (
        prop::collection::vec(photon, 0..3),
        prop::bool::weighted(0.1),
    )
        .prop_map(|(photons, acknowledge)| Cycle {
            photons,
            acknowledge,
        })
}

proptest! {
    #[test]
    fn any_photons_and_acknowledge_times_follow_the_flow_chart(
        settings in settings(),
        cycles in prop::collection::vec(cycle(), 0..300),
    ) {
        compare::<16>(settings, &cycles);
    }

    /// Batches of any length, some of them long enough to fill a counter.
    #[test]
    fn a_batch_is_its_photons_one_at_a_time(
        settings in settings(),
        batches in prop::collection::vec(prop::collection::vec((0u16..20, 1usize..200), 0..30), 0..10),
    ) {
        let config = settings.config::<16>();
        let mut single = AsyncPixel::<16>::new(PixelAddress(77));
        let mut batched = AsyncPixel::<16>::new(PixelAddress(77));
        let mut model = Model::new(16, settings);
        for runs in batches {
            let runs = runs.into_iter().map(|(code, times)| vec![code; times]);
            let codes: Vec<u16> = runs.flatten().collect();
            batched.count_batch(&config, &codes);
            for code in codes {
                single.count(&config, code);
                model.count(code.into());
            }
            for pixel in [&single, &batched] {
                prop_assert_eq!(pixel.statistics(), model.statistics);
                prop_assert_eq!(&pixel.histogram().counts().map(u32::from)[..], &model.counts[..]);
            }
            prop_assert_eq!(batched.histogram().peak(), single.histogram().peak());
        }
    }

    /// Frames of any length, which need not divide X: the look falls on the
    /// first frame boundary after X laser cycles or more.
    #[test]
    fn any_frames_follow_the_flow_chart(
        settings in settings(),
        frames in prop::collection::vec((prop::array::uniform16(0u8..4), 0u16..9, any::<bool>()), 0..200),
    ) {
        let config = settings.config::<16>();
        let mut pixel = AsyncPixel::<16>::new(PixelAddress(77));
        let mut model = Model::new(16, settings);
        let mut cycles = 0;
        for (frame, length, acknowledge) in frames {
            pixel.count_frame(&config, &frame);
            for (code, &photons) in frame.iter().enumerate() {
                for _ in 0..photons {
                    model.count(code);
                }
            }
            cycles += u64::from(length);
            let look = pixel.end_laser_cycles(&config, LaserCycle(cycles), length);
            prop_assert_eq!(look, model.end(cycles, length.into()));
            if acknowledge {
                prop_assert_eq!(pixel.acknowledge(), model.waiting.take());
            }
            prop_assert_eq!(pixel.statistics(), model.statistics);
        }
    }
}

#[test]
fn frames_of_five_laser_cycles_are_their_photons_one_cycle_at_a_time() {
    let mut rng = Pcg32::seed_from_u64(3);
    let mut events = 0;
    for _ in 0..200 {
        let settings = Settings {
            x: 10,
            l1: 100,
            l2: 600,
            first: 1,
            last: 14,
            alpha: (rng.next_u32() % 1500) as u16,
            minimum: 5,
            is_one_hit: false,
        };
        let config = settings.config::<16>();
        let mut single = AsyncPixel::<16>::new(PixelAddress(5));
        let mut framed = AsyncPixel::<16>::new(PixelAddress(5));
        let mut frame = [0u16; 16];
        let cycles = random_cycles(16, 2000, 10, &mut rng);
        for (number, cycle) in (0..).zip(&cycles) {
            // A frame has no place for codes past the last bin.
            for &(code, times) in cycle.photons.iter().filter(|&&(code, _)| code < 16) {
                frame[usize::from(code)] += times;
                single.count_batch(&config, &vec![code; times.into()]);
            }
            let look = single.end_laser_cycle(&config, LaserCycle(number));
            if number % 5 == 4 {
                framed.count_frame(&config, &frame);
                frame = [0; 16];
                let framed_look = framed.end_laser_cycles(&config, LaserCycle(number), 5);
                assert_eq!(framed_look, look);
                assert_eq!(framed.statistics(), single.statistics());
                if cycle.acknowledge {
                    let event = single.acknowledge();
                    assert_eq!(framed.acknowledge(), event);
                    events += u32::from(event.is_some());
                }
            } else {
                assert_eq!(look, Look::NotDue);
            }
        }
    }
    assert!(events > 1000);
}

#[test]
fn the_first_decision_is_the_first_look_above_l1_and_the_last_below_l2() {
    // Never a peak: looks at 4, 8, 12, ..., of which 12 and 16 decide.
    let settings = Settings {
        x: 4,
        l1: 8,
        l2: 20,
        first: 0,
        last: 7,
        alpha: 0,
        minimum: 1,
        is_one_hit: false,
    };
    let config = settings.config::<8>();
    let mut pixel = AsyncPixel::<8>::new(PixelAddress(0));
    for round in 0..3 {
        for n in 1..=20 {
            let expected = match n {
                4 | 8 => Look::TooEarly, // 8 is not above L1
                12 | 16 => Look::NoPeak,
                20 => Look::Expired, // 20 is not below L2
                _ => Look::NotDue,
            };
            assert_eq!(pixel.end_laser_cycle(&config, LaserCycle(0)), expected);
            assert_eq!(pixel.exposure(), n % 20);
        }
        assert_eq!(pixel.statistics().expired, round + 1);
    }
}

#[test]
fn an_exposure_longer_than_its_counter_expires() {
    let settings = Settings {
        x: 1,
        l1: 65_000,
        l2: 65_535,
        first: 0,
        last: 7,
        alpha: 0,
        minimum: 1,
        is_one_hit: false,
    };
    let config = settings.config::<8>();
    let mut pixel = AsyncPixel::<8>::new(PixelAddress(0));
    pixel.count(&config, 3);
    assert_eq!(
        pixel.end_laser_cycles(&config, LaserCycle(0), 40_000),
        Look::TooEarly
    );
    assert_eq!(
        pixel.end_laser_cycles(&config, LaserCycle(0), 40_000),
        Look::Expired
    );
    assert_eq!((pixel.exposure(), pixel.histogram().total()), (0, 0));
}

#[test]
fn small_configurations_are_valid_if_and_only_if_there_is_a_look() {
    let rule = PaperRule::new(U8F8::lit("8"), Count::saturating(5));
    for x in 0..=12u16 {
        for l1 in 0..=12 {
            for l2 in 0..=12 {
                let config = PixelConfig::<8>::new(x, l1, l2, RangeGate::full(), rule);
                let valid =
                    0 < x && x <= l1 && l1 < l2 && (0..20).any(|k| l1 < k * x && k * x < l2);
                assert_eq!(config.is_ok(), valid, "{x} {l1} {l2}");
                let reason = if x == 0 {
                    ConfigError::ZeroX
                } else if x > l1 {
                    ConfigError::XAboveL1
                } else if l1 >= l2 {
                    ConfigError::L2NotAboveL1
                } else {
                    ConfigError::NoLook
                };
                match config {
                    Ok(config) => {
                        assert_eq!((config.x(), config.l1(), config.l2()), (x, l1, l2));
                        assert_eq!(config.gate(), &RangeGate::full());
                        assert_eq!(config.rule(), &rule);
                    }
                    Err(error) => assert_eq!(error, reason, "{x} {l1} {l2}"),
                }
            }
        }
    }
}

#[test]
fn large_configurations_are_checked_without_overflow() {
    let rule = PaperRule::new(U8F8::lit("8"), Count::saturating(5));
    for (x, l1, l2, expected) in [
        (1, 65_533, 65_535, None),
        (1, 65_534, 65_535, Some(ConfigError::NoLook)),
        (32_767, 32_767, 65_535, None), // looks at 65,534
        (32_767, 32_767, 65_534, Some(ConfigError::NoLook)),
        (65_535, 65_535, 65_535, Some(ConfigError::L2NotAboveL1)),
        (65_535, 65_534, 65_535, Some(ConfigError::XAboveL1)),
        (65_534, 65_534, 65_535, Some(ConfigError::NoLook)),
    ] {
        let config = PixelConfig::<8>::new(x, l1, l2, RangeGate::full(), rule);
        assert_eq!(config.err(), expected, "{x} {l1} {l2}");
    }
}

/// Fires on every second photon, whatever the bins say.
#[derive(Clone, Copy)]
struct EverySecond;

impl DetectionRule for EverySecond {
    fn detect<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        _: &RangeGate<BINS>,
        _: Peak,
    ) -> Option<U24F8> {
        (histogram.total() == 2).then_some(U24F8::lit("1.25"))
    }
}

#[test]
fn another_rule_takes_the_place_of_the_paper_s() {
    let config = PixelConfig::new(1, 1, 9, RangeGate::<8>::full(), EverySecond).unwrap();
    let mut pixel = AsyncPixel::<8, Count10>::new(PixelAddress(0));
    for cycle in 0..100 {
        pixel.count(&config, 5);
        let expected = if cycle % 2 == 0 {
            Look::TooEarly
        } else {
            Look::Event
        };
        assert_eq!(pixel.end_laser_cycle(&config, LaserCycle(cycle)), expected);
        if let Some(event) = pixel.acknowledge() {
            assert_eq!((event.peak_count.raw(), event.background.raw()), (2, 1));
        }
    }
    assert_eq!(pixel.statistics().events, 50);
}

proptest! {
    #[test]
    fn the_slot_gives_every_event_back_once(offers in prop::collection::vec(any::<bool>(), 0..100)) {
        let mut slot = EventSlot::new();
        let mut inside = None;
        for (number, offer) in (0..).zip(offers) {
            let event = DepthEvent {
                pixel: PixelAddress(1),
                cycle: LaserCycle(number),
                exposure: 1,
                peak_bin: BinIndex::default(),
                offset: SubBinOffset::CENTRE,
                peak_count: Count::default(),
                background: Count::default(),
                flags: Flags::NONE,
            };
            prop_assert_eq!(slot.request(), inside.is_some());
            if !offer {
                prop_assert_eq!(slot.acknowledge(), inside.take());
            } else if inside.is_some() {
                prop_assert_eq!(slot.offer(event), Err(event));
            } else {
                prop_assert_eq!(slot.offer(event), Ok(()));
                inside = Some(event);
            }
        }
    }
}

/// More than half of 44 laser cycles, whatever became of the photons, and those of
/// the exposure alone.
#[test]
fn pile_up_is_more_than_a_photon_in_every_other_laser_cycle() {
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let gate = RangeGate::new(1, 15).unwrap();
    let multi = PixelConfig::<16>::new(4, 40, 2000, gate, rule).unwrap();
    let one_hit = multi.with_one_hit_tdc();
    assert!(one_hit.is_one_hit() && !multi.is_one_hit());
    // In the peak, gated out, past the last bin.
    for (photons, is_flagged) in [
        ([22, 0, 0], false),
        ([23, 0, 0], true),
        ([10, 12, 22], false),
        ([10, 13, 0], true),
    ] {
        for (config, may_be_flagged) in [(&multi, false), (&one_hit, true)] {
            let mut pixel = AsyncPixel::<16>::new(PixelAddress(0));
            for exposure in 0..2 {
                for (code, photons) in [9, 0, 16].into_iter().zip(photons) {
                    (0..photons).for_each(|_| pixel.count(config, code));
                }
                let last = LaserCycle(exposure * 44 + 43);
                assert_eq!(pixel.end_laser_cycles(config, last, 44), Look::Event);
                let flags = pixel.acknowledge().unwrap().flags;
                let expected = is_flagged && may_be_flagged;
                assert_eq!(flags.contains(Flags::PILE_UP), expected, "{photons:?}");
            }
        }
    }
}

/// A full counter counts no more, but its photons came.
#[test]
fn photons_that_met_a_full_counter_pile_up_too() {
    let rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5));
    let config = PixelConfig::<8>::new(4, 40, 4000, RangeGate::full(), rule);
    let config = config.unwrap().with_one_hit_tdc();
    for (photons, is_flagged) in [(1500, false), (1501, true)] {
        let mut pixel = AsyncPixel::<8>::new(PixelAddress(0));
        (0..photons).for_each(|_| pixel.count(&config, 5));
        assert_eq!(
            pixel.end_laser_cycles(&config, LaserCycle(2999), 3000),
            Look::Event
        );
        let flags = pixel.acknowledge().unwrap().flags;
        assert_eq!(flags.contains(Flags::PILE_UP), is_flagged);
        assert!(flags.contains(Flags::SATURATED));
    }
}

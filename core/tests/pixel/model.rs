//! The flow chart (section II-B), redrawn as plainly as it can be, and a pixel beside it.

use dtof_core::fixed::types::U8F8;
use dtof_core::{
    AsyncPixel, BinIndex, BlockLevel, Count, DepthEvent, DetectionRule, EchoNumber, Flags,
    LaserCycle, Look, PaperRule, PixelAddress, PixelConfig, RangeGate, Statistics, SubBinOffset,
};
use proptest::prelude::*;
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::counted::Counted;

/// What a pixel is set to.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub x: u16,
    pub l1: u16,
    pub l2: u16,
    pub first: usize,
    pub last: usize,
    /// In 1/256.
    pub alpha: u16,
    pub minimum: u32,
    pub is_one_hit: bool,
}

impl Settings {
    pub fn config<const BINS: usize>(&self) -> PixelConfig<BINS> {
        let minimum = Count::new(self.minimum).unwrap();
        let rule = PaperRule::new(U8F8::from_bits(self.alpha), minimum);
        let gate = RangeGate::new(self.first as u16, self.last as u16).unwrap();
        let config = PixelConfig::with_rule(rule).gate(gate).x(self.x);
        let config = config
            .l1(self.l1)
            .l2(self.l2)
            .dead_time(if self.is_one_hit { u16::MAX } else { 0 });
        config.build().unwrap()
    }
}

/// A pixel with statistics of its own.
pub struct Lone<const BINS: usize> {
    pub pixel: AsyncPixel<BINS>,
    statistics: Statistics,
}

impl<const BINS: usize> Lone<BINS> {
    pub fn new(address: u16) -> Self {
        Self {
            pixel: AsyncPixel::new(PixelAddress::new(address)),
            statistics: Statistics::default(),
        }
    }

    /// Ends so many laser cycles, the last of which is `last`.
    pub fn end<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        last: u64,
        cycles: u16,
    ) -> Look {
        let (last, statistics) = (LaserCycle::new(last), &mut self.statistics);
        self.pixel
            .end_laser_cycles(config, statistics, last, cycles)
    }

    /// With the present exposure.
    pub fn statistics(&self) -> Statistics {
        let mut statistics = self.statistics;
        self.pixel.add_photons_to(&mut statistics);
        statistics
    }
}

/// The flow chart. Its arithmetic is f64, exact for 10-bit counts.
pub struct Model {
    pub settings: Settings,
    pub now: Counted,
    pub waiting: Option<DepthEvent>,
}

impl Model {
    pub fn new(bins: usize, settings: Settings) -> Self {
        Self {
            settings,
            now: Counted::new(bins, settings.first..=settings.last),
            waiting: None,
        }
    }

    pub fn end(&mut self, last_cycle: u64, cycles: u32) -> Look {
        let Settings { x, l1, l2, .. } = self.settings;
        if let Some(look) = self.now.end(cycles, x, l1) {
            return look;
        }
        if self.now.exposure >= u32::from(l2) {
            self.now.statistics.expired += 1;
            self.now.statistics.expired_deferred += u64::from(self.now.put_off);
            self.now.begin();
            return Look::Expired;
        }
        if self.waiting.is_some() {
            self.now.statistics.deferred += 1;
            self.now.put_off = true;
            return Look::Deferred;
        }
        self.waiting = self.decide(last_cycle);
        if self.waiting.is_none() {
            return Look::NoPeak;
        }
        self.now.statistics.events += 1;
        self.now.begin();
        Look::Event
    }

    pub fn decide(&self, cycle: u64) -> Option<DepthEvent> {
        let Settings { first, last, .. } = self.settings;
        let gated = &self.now.counts[first..=last];
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

        let many = f64::from(self.now.in_bins) > 0.5 * f64::from(self.now.exposure);
        let piles_up = self.settings.is_one_hit && many;
        let flags = [
            peak == 1023,
            at == 0 || at == n - 1,
            self.now.put_off,
            piles_up,
        ];
        let flags = (0..)
            .zip(flags)
            .map(|(bit, is_set)| u8::from(is_set) << bit);
        let above =
            |count: Option<&u32>| f64::from(count.map_or(0, |c| c.saturating_sub(background)));
        let left = above(at.checked_sub(1).and_then(|left| gated.get(left)));
        let right = above(gated.get(at + 1));
        let shift = 256.0 * (right - left) / (left + above(Some(&peak)) + right);
        Some(DepthEvent {
            pixel: PixelAddress::new(77),
            level: BlockLevel::PIXEL,
            echo: EchoNumber::FIRST,
            cycle: LaserCycle::new(cycle),
            exposure: self.now.exposure as u16,
            peak_bin: BinIndex::new((first + at) as u16).unwrap(),
            offset: SubBinOffset::new(128 + shift.round() as i16).unwrap(),
            peak_count: Count::new(peak).unwrap(),
            background: Count::new(background).unwrap(),
            flags: Flags::from_bits(flags.sum()).unwrap(),
        })
    }
}

/// What happens to the pixel in one laser cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// TDC codes, and how many photons each has.
    pub photons: Vec<(u16, u16)>,
    /// Whether the link acknowledges at its end.
    pub acknowledge: bool,
}

/// Runs both, compares them after each laser cycle, and checks that no event
/// was lost.
pub fn compare<const BINS: usize>(settings: Settings, cycles: &[Cycle]) -> Statistics {
    let config = settings.config::<BINS>();
    let mut lone = Lone::<BINS>::new(77);
    let mut model = Model::new(BINS, settings);
    let (mut offered, mut acknowledged) = (0, 0);
    for (number, cycle) in (0..).zip(cycles) {
        for &(code, times) in &cycle.photons {
            for _ in 0..times {
                lone.pixel.count(&config, code);
                model.now.count(code.into());
                offered += 1;
            }
        }
        let waiting_before = lone.pixel.has_event();
        let look = lone.end(&config, number, 1);
        assert_eq!(look, model.end(number, 1), "laser cycle {number}");
        // An event that waits is never replaced.
        assert!(!(waiting_before && look == Look::Event));
        assert_eq!(u32::from(lone.pixel.exposure()), model.now.exposure);
        let counts = lone.pixel.histogram().counts().map(u32::from);
        assert_eq!(counts, *model.now.counts);
        assert_eq!(lone.pixel.has_event(), model.waiting.is_some());
        if cycle.acknowledge {
            let event = lone.pixel.take_event();
            assert_eq!(event, model.waiting.take());
            acknowledged += u64::from(event.is_some());
        }
        let statistics = lone.statistics();
        assert_eq!(statistics, model.now.statistics);
        assert_eq!(offered, statistics.photons());
        let waiting = u64::from(lone.pixel.has_event());
        assert_eq!(statistics.events, acknowledged + waiting);
    }
    assert_eq!(lone.pixel.address(), PixelAddress::new(77));
    assert_eq!(lone.pixel.take_event(), model.waiting);
    lone.statistics()
}

/// Random laser cycles: noise all over (a few codes past the last bin), a pulse
/// of `signal` photons in about every other cycle, now and then a flood.
pub fn random_cycles(bins: u32, cycles: u32, patience: u32, rng: &mut Pcg32) -> Vec<Cycle> {
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

/// Settings of which a look exists; 16 bins.
pub fn settings() -> impl Strategy<Value = Settings> {
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

pub fn cycle() -> impl Strategy<Value = Cycle> {
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

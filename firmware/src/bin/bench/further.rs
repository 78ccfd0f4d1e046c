//! A pixel that tracks, has echoes or has a dead time, and what it does. The photons
//! are those of [`State`], in some exposures those of a second target, and with a dead time those
//! that a TDC takes of a flat background.

use dtof_core::fixed::types::U4F12;
use dtof_core::{
    AsyncPixel, Count, EchoNumber, Histogram, LaserCycle, Look, PixelAddress, PixelConfig,
    RangeGate, Statistics, WholeHistogram, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::scene::{BINS, CYCLES, PHOTONS, State};

/// Photons of the four laser cycles from a look to the next.
const PHOTONS_A_LOOK: usize = 24;
/// Laser cycles from a look to the next.
const X: u16 = 4;
/// The exposure at the second look.
const SECOND_LOOK: u16 = CYCLES + X;
/// The exposure at the first look of a pixel with a dead time.
const LONG: u16 = 1000;
/// Photons of its background that arrive in a laser cycle.
const BACKGROUND: u32 = 6;

/// What a pixel is configured for.
#[derive(Clone, Copy)]
pub struct Features {
    pub tracks: bool,
    /// 1 or 2.
    pub echoes: u8,
    pub l1: u16,
    pub l2: u16,
    pub dead_time: u16,
}

impl Features {
    pub const NONE: Self = Self {
        tracks: false,
        echoes: 1,
        l1: 40,
        l2: 2000,
        dead_time: 0,
    };
    pub const TRACKING: Self = Self {
        tracks: true,
        ..Self::NONE
    };
    pub const TWO_ECHOES: Self = Self {
        echoes: 2,
        ..Self::NONE
    };

    /// The first look comes after [`LONG`].
    pub const fn dead_time(dead_time: u16) -> Self {
        Self {
            l1: LONG - X,
            dead_time,
            ..Self::NONE
        }
    }

    /// Exposures end at the second look.
    pub const fn short(self) -> Self {
        Self {
            l2: SECOND_LOOK,
            ..self
        }
    }
}

/// All that operations read and change.
#[derive(Clone)]
pub struct Further {
    pub pixel: AsyncPixel<BINS>,
    /// A window of 3 bins, X = 4.
    config: PixelConfig<BINS, WindowRule>,
    statistics: Statistics,
    codes: [u16; PHOTONS as usize],
    histogram: Histogram<BINS>,
    /// The histogram as another sensor would send it.
    foreign: [u16; BINS],
}

impl Further {
    pub fn new() -> Option<Self> {
        Some(Self {
            pixel: AsyncPixel::new(PixelAddress::new(7)),
            config: Self::config(Features::NONE)?,
            statistics: Statistics::default(),
            codes: [0; PHOTONS as usize],
            histogram: Histogram::new(),
            foreign: [0; BINS],
        })
    }

    fn config(features: Features) -> Option<PixelConfig<BINS, WindowRule>> {
        let rule = WindowRule::new(3, const { U4F12::lit("4.4") }, Count::saturating(5)).ok()?;
        let tracking = rule.tracking(&RangeGate::<BINS>::full());
        let config = PixelConfig::with_rule(rule)
            .x(X)
            .l1(features.l1)
            .l2(features.l2);
        let config = config.dead_time(features.dead_time);
        let config = config.tracking(features.tracks.then_some(tracking));
        // Four standard deviations of a pulse of 0.5 bins.
        let config = config.echoes(EchoNumber::new(features.echoes)?, 2);
        config.build().ok()
    }

    /// An empty pixel.
    pub fn empty(&mut self, features: Features) -> Option<()> {
        // In place: a second one would take much of the stack.
        self.pixel = AsyncPixel::new(self.pixel.address());
        self.statistics = Statistics::default();
        self.histogram.clear();
        self.config = Self::config(features)?;
        Some(())
    }

    /// The photons of exposure `number`, of a second target as well if there are two.
    pub fn photons(&mut self, state: &mut State, number: u32, targets: u8) {
        state.empty(number, targets > 0);
        self.codes = state.codes;
        let first = self.codes.first().copied().unwrap_or_default();
        let second = if first < 64 { first + 40 } else { first - 40 };
        if targets == 2 {
            let photons = self.codes.iter_mut().skip(3).step_by(6);
            photons.for_each(|code| *code = second);
        }
    }

    /// The histogram of these photons, as it comes from elsewhere.
    pub fn arrive(&mut self) {
        self.histogram.clear();
        self.histogram.add_batch(&self.codes);
        self.foreign = *self.histogram.counts();
        self.histogram.clear();
    }

    /// Counts all photons, and lets the laser cycles up to the first look pass but the last.
    pub fn until_first_look(&mut self) {
        self.pixel.count_batch(&self.config, &self.codes);
        self.pass(0..CYCLES - 1);
    }

    /// The first look, whose event the link takes. Whether there was one.
    pub fn reports(&mut self) -> bool {
        let _ = self.end_laser_cycle(u32::from(CYCLES) - 1);
        self.pixel.take_event().is_some()
    }

    /// Counts a long exposure, and lets its laser cycles pass up to the look but the last. Each bin
    /// has the photons of the laser cycles in which it was live, with noise as large as their root.
    pub fn until_long_look(&mut self, number: u32) {
        let mut random = Pcg32::seed_from_u64(u64::from(number));
        let mut counts = [0; BINS];
        for bin in 0..BINS {
            let before = bin.saturating_sub(self.config.dead_time().into())..bin;
            let blind: u16 = counts.get(before).unwrap_or_default().iter().sum();
            let live = u32::from(LONG.saturating_sub(blind));
            #[allow(clippy::cast_possible_truncation, reason = "128")]
            let expected = live * BACKGROUND / BINS as u32;
            let root = expected.isqrt();
            let noise = random.next_u32() % (2 * root + 1);
            let count = (expected + noise).saturating_sub(root).min(live);
            if let Some(place) = counts.get_mut(bin) {
                *place = u16::try_from(count).unwrap_or_default();
            }
        }
        self.pixel.count_frame(&self.config, &counts);
        let (statistics, last) = (&mut self.statistics, LaserCycle::new(0));
        let _ = (self.pixel).end_laser_cycles(&self.config, statistics, last, LONG - X);
        self.pass(LONG - X..LONG - 1);
    }

    /// Some photons more, and the laser cycles up to the second look but its last.
    pub fn until_second_look(&mut self) {
        let codes = self.codes.get(..PHOTONS_A_LOOK).unwrap_or_default();
        self.pixel.count_batch(&self.config, codes);
        self.pass(CYCLES..SECOND_LOOK - 1);
    }

    fn pass(&mut self, cycles: core::ops::Range<u16>) {
        for cycle in cycles {
            let _ = self.end_laser_cycle(cycle.into());
        }
    }

    #[inline(always)]
    fn end_laser_cycle(&mut self, cycle: u32) -> Look {
        let cycle = LaserCycle::new(cycle.into());
        (self.pixel).end_laser_cycle(&self.config, &mut self.statistics, cycle)
    }
}

pub extern "C" fn look(further: &mut Further, cycle: u32) -> u32 {
    further.end_laser_cycle(cycle) as u32
}

/// How many echoes there are among counts that come from elsewhere.
pub extern "C" fn echoes(further: &mut Further, _: u32) -> u32 {
    let (config, counts) = (&further.config, &further.foreign);
    let (mut whole, mut echoes) = (WholeHistogram::<BINS>::new(), 0);
    whole.decide(
        config,
        counts,
        CYCLES.into(),
        &mut further.statistics,
        |_, detection| {
            core::hint::black_box(detection.depth.offset);
            echoes += 1;
        },
    );
    echoes
}

//! The photons that the operations work on: exposures of 256 photons over 44 laser cycles
//! into 128 bins, with and without a target.

use dtof_core::events::{
    DynamicDepthConfig, DynamicDepthPixel, Reference, Reflectivity, RunningMean,
};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::{
    AerEncoder, AnyRule, AsyncPixel, AverageRule, Count, DepthEstimator, DepthEvent, Histogram,
    LaserCycle, Look, PaperRule, PixelAddress, PixelConfig, PixelConfigError, RangeGate,
    RangeScale, Statistics, WindowRule,
};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

pub const BINS: usize = 128;
/// Photons of one exposure.
pub const PHOTONS: u32 = 256;
/// Its laser cycles: the first look with N > L1 = 40 is at its end.
pub const CYCLES: u16 = 44;
/// Photons of each laser cycle but the last two, which have fewer and none.
pub const PHOTONS_A_CYCLE: usize = 6;
/// Exposures of each kind.
pub const EXPOSURES: u32 = 64;

/// All that operations read and change. What is measured comes first, where the
/// processor's instructions reach it whatever else there is.
#[repr(C)]
pub struct State {
    pub histogram: Histogram<BINS>,
    pub pixel: AsyncPixel<BINS>,
    pub statistics: Statistics,
    /// X = 4, L1 = 40, α = 4, at least 5 photons.
    pub config: PixelConfig<BINS>,
    /// The same with a gate whose quadrants do not start at even bins.
    pub gated: PixelConfig<BINS>,
    /// L2 = 44, and no peak is high enough.
    pub never_fires: PixelConfig<BINS>,
    /// The histogram as another sensor would send it.
    pub foreign: [u16; BINS],
    pub codes: [u16; PHOTONS as usize],
    pub encoder: AerEncoder,
    pub event: Option<DepthEvent>,
    /// Which is measured.
    pub window: WindowRule,
    /// Which is measured.
    pub estimator: DepthEstimator,
    /// Which is measured.
    pub any_rule: AnyRule,
    pub mean_of_3: RunningMean<3>,
    pub mean_of_10: RunningMean<10>,
    pub changes: DynamicDepthPixel<3>,
    /// Which is measured.
    pub dynamic_depth: DynamicDepthConfig,
    /// One with a threshold that no change exceeds, one that nearly all changes exceed.
    pub dynamic_depths: [DynamicDepthConfig; 2],
    pub reflectivity: Reflectivity,
    pub average: AverageRule,
}

impl State {
    pub fn new() -> Option<Self> {
        let scale = RangeScale::new(const { U16F16::lit("250") }, I24F8::ZERO).ok()?;
        let dynamic_depth =
            |threshold| DynamicDepthConfig::new(threshold, &scale, Reference::Previous).ok();
        let still = dynamic_depth(const { U24F8::lit("100000") })?;
        let moving = dynamic_depth(const { U24F8::lit("1") })?;
        Some(Self {
            config: Self::config(40, 2000, 5, RangeGate::full()).ok()?,
            gated: Self::config(40, 2000, 5, RangeGate::new(3, 124).ok()?).ok()?,
            never_fires: Self::config(4, CYCLES, 1023, RangeGate::full()).ok()?,
            window: WindowRule::new(1, U4F12::ZERO, Count::saturating(5)).ok()?,
            estimator: DepthEstimator::default(),
            any_rule: PaperRule::new(U8F8::ZERO, Count::saturating(5)).into(),
            mean_of_3: RunningMean::new(),
            mean_of_10: RunningMean::new(),
            changes: DynamicDepthPixel::new(),
            dynamic_depth: still,
            dynamic_depths: [still, moving],
            reflectivity: Reflectivity::new(),
            average: AverageRule::new(const { U8F8::lit("4") }, Count::saturating(5)),
            codes: [0; PHOTONS as usize],
            pixel: AsyncPixel::new(PixelAddress::new(7)),
            statistics: Statistics::default(),
            histogram: Histogram::new(),
            foreign: [0; BINS],
            encoder: AerEncoder::new(),
            event: None,
        })
    }

    /// `minimum` photons in a reported peak.
    fn config(
        l1: u16,
        l2: u16,
        minimum: u32,
        gate: RangeGate<BINS>,
    ) -> Result<PixelConfig<BINS>, PixelConfigError> {
        let rule = PaperRule::new(const { U8F8::lit("4") }, Count::saturating(minimum));
        let config = PixelConfig::with_rule(rule).x(4).l1(l1).l2(l2);
        config.gate(gate).build()
    }

    /// The photons of exposure `number`, about six a laser cycle, and empty pixels
    /// and histograms.
    ///
    /// Background photons are evenly spread, 1.7 or 2 a bin. With a target every
    /// sixth photon lies in its bin or, one of these in four, in the next.
    pub fn empty(&mut self, number: u32, target: bool) {
        let mut random = Pcg32::seed_from_u64(u64::from(number));
        let mut below = |limit: u32| {
            let scaled = u64::from(random.next_u32()) * u64::from(limit);
            let [_, _, _, _, low, high, ..] = scaled.to_le_bytes();
            u16::from_le_bytes([low, high])
        };
        let bin = below(120) + 4;
        for (index, code) in self.codes.iter_mut().enumerate() {
            *code = if target && index % 6 == 0 {
                bin + u16::from(below(4) == 0)
            } else {
                below(128)
            };
        }
        if let Ok(config) = Self::config(40, 2000, 5, RangeGate::full()) {
            self.config = config;
        }
        self.pixel = AsyncPixel::new(PixelAddress::new(7));
        self.histogram.clear();
        self.encoder = AerEncoder::new();
        self.event = None;
    }

    /// The same, counted.
    pub fn counted(&mut self, number: u32, target: bool) {
        self.empty(number, target);
        self.pixel.count_batch(&self.config, &self.codes);
        self.histogram.add_batch(&self.codes);
        self.foreign = *self.histogram.counts();
    }

    /// The event of exposure `number` with a target.
    pub fn target(&mut self, number: u32) {
        self.counted(number, true);
        self.wait_for_last_look();
        let _ = self.end_laser_cycle(u32::from(CYCLES) - 1);
        self.event = self.pixel.take_event();
    }

    /// Counts the pixel's photons again, through a gate.
    pub fn count_gated(&mut self) {
        self.config = self.gated;
        self.pixel = AsyncPixel::new(PixelAddress::new(7));
        self.pixel.count_batch(&self.config, &self.codes);
    }

    /// Ends laser cycle `cycle`, looking if it is time.
    #[inline(always)]
    pub fn end_laser_cycle(&mut self, cycle: u32) -> Look {
        let cycle = LaserCycle::new(cycle.into());
        self.pixel
            .end_laser_cycle(&self.config, &mut self.statistics, cycle)
    }

    /// Lets all laser cycles but the last pass.
    pub fn wait_for_last_look(&mut self) {
        for cycle in 0..u32::from(CYCLES) - 1 {
            let _ = self.end_laser_cycle(cycle);
        }
    }

    /// Few photons but the peak's, those the background rule needs where it comes
    /// to last.
    pub fn late_background(&mut self) {
        self.empty(0, false);
        for (bin, photons) in [(5, 12), (95, 6), (127, 6)] {
            for _ in 0..photons {
                self.histogram.add(bin);
                self.pixel.count(&self.config, bin);
            }
        }
    }
}

//! How the pixels operate, in the units the command line uses.

use anyhow::{Result, ensure};
use dtof_core::fixed::traits::Fixed;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{
    AnyRule, BlockLevel, CentredWindow, ConfigError, Count, DepthEstimator, EchoNumber, GateError,
    PaperRule, PixelConfig, RangeGate, RangeScale, Threshold,
};
pub use dtof_link::AdaptiveBinning;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use dtof_options::Refused;

/// Everything an engine and the output need beside the photons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin.
    #[serde(serialize_with = "number")]
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    #[serde(serialize_with = "number")]
    pub offset_mm: I24F8,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// Addresses of pixels that are left out: hot and dead ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub masked: Vec<u16>,
    /// The rule that decides whether a peak stands clear.
    #[serde(flatten, serialize_with = "rule")]
    pub rule: AnyRule,
    /// The standard deviation of the pulse in bins, if it is known.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "known")]
    pub sigma_bins: Option<U8F8>,
    /// How far the window that the depth comes from reaches before and after its place, in bins,
    /// if not as suits `sigma_bins`.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "sides")]
    pub half_widths: Option<CentredWindow>,
    /// The depth comes from three bins, even if a window would suit the pulse.
    #[serde(skip)]
    pub centroid: bool,
    /// The exposure a decision must exceed, in laser cycles.
    pub l1: u16,
    /// The exposure at which a pixel starts over without an event.
    pub l2: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// Blocks of pixels that decide together.
    #[serde(flatten, serialize_with = "binning")]
    pub binning: Option<AdaptiveBinning>,
    /// Whether pixels expect their next event where the last was.
    pub tracking: bool,
    /// The last echo that a pixel reports in an exposure.
    #[serde(serialize_with = "echo")]
    pub echoes: EchoNumber,
    /// An exposure ends once it is so many times as long as it was at its last echo, without
    /// it at L2.
    pub echo_wait: Option<u8>,
    /// Whether the TDC takes one photon a laser cycle, so that events say when that
    /// makes for pile-up.
    pub one_hit_tdc: bool,
    /// A frame-based sensor instead: all pixels read their highest bin every so many
    /// laser cycles, and rule, minimum, L1, L2 and X mean nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u16>,
    /// Seed of every random number.
    pub seed: u64,
}

/// A fixed-point number as a decimal one.
fn number<S: Serializer>(number: &impl Fixed, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(number.to_num())
}

/// A rule by its name, with its own numbers.
fn rule<S: Serializer>(rule: &AnyRule, serializer: S) -> Result<S::Ok, S::Error> {
    let mut fields = serializer.serialize_map(None)?;
    match rule {
        AnyRule::Paper(rule) => with_alpha(&mut fields, "paper", rule.threshold())?,
        AnyRule::Average(rule) => with_alpha(&mut fields, "average", rule.threshold())?,
        AnyRule::Window(rule) => {
            fields.serialize_entry("rule", "window")?;
            fields.serialize_entry("window", &rule.width())?;
            fields.serialize_entry("z", &rule.z().to_num::<f64>())?;
            fields.serialize_entry("min_count", &rule.minimum_count().raw())?;
        }
    }
    fields.end()
}

/// A rule with a threshold.
fn with_alpha<M: SerializeMap>(
    fields: &mut M,
    rule: &str,
    threshold: &Threshold,
) -> Result<(), M::Error> {
    fields.serialize_entry("rule", rule)?;
    fields.serialize_entry("alpha", &threshold.alpha().to_num::<f64>())?;
    fields.serialize_entry("min_count", &threshold.minimum_count().raw())
}

/// A fixed-point number that is there.
fn known<S: Serializer>(sigma: &Option<U8F8>, serializer: S) -> Result<S::Ok, S::Error> {
    number(&sigma.unwrap_or_default(), serializer)
}

/// Both half widths of a window that is there.
fn sides<S: Serializer>(window: &Option<CentredWindow>, serializer: S) -> Result<S::Ok, S::Error> {
    let sides = window.map(|window| [window.before(), window.after()].map(U8F8::to_num::<f64>));
    sides.serialize(serializer)
}

/// The levels of adaptive binning, 0 without, and how patient pixels are.
fn binning<S: Serializer>(
    binning: &Option<AdaptiveBinning>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut fields = serializer.serialize_map(None)?;
    let levels = binning.map_or(0, |binning| binning.levels.raw());
    fields.serialize_entry("binning", &levels)?;
    if let Some(binning) = binning {
        fields.serialize_entry("patience", &binning.patience)?;
    }
    fields.end()
}

/// The number of an echo.
fn echo<S: Serializer>(echo: &EchoNumber, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u8(echo.raw())
}

impl Settings {
    /// The paper's settings for its static scene (section III-B), on 128 bins of 250 ps.
    #[must_use]
    pub fn static_scene(seed: u64) -> Self {
        Self {
            bins: 128,
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::ZERO,
            gate: None,
            masked: Vec::new(),
            rule: PaperRule::new(U8F8::lit("8"), Count::saturating(5)).into(),
            sigma_bins: None,
            half_widths: None,
            centroid: false,
            l1: 100,
            l2: 2000,
            x: 10,
            binning: None,
            tracking: false,
            echoes: EchoNumber::FIRST,
            echo_wait: None,
            one_hit_tdc: false,
            frame: None,
            seed,
        }
    }

    /// As a configuration of pixels for `BINS` bins.
    ///
    /// # Errors
    /// The constraint the settings break.
    pub fn config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        self.config_of(self.rule)
    }

    /// The same for blocks of pixels.
    ///
    /// # Errors
    /// The constraint the settings break.
    pub fn block_config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        let levels = self
            .binning
            .map_or(BlockLevel::PIXEL, |binning| binning.levels);
        self.config_of(self.rule.of_blocks(levels))
    }

    fn config_of<const BINS: usize>(&self, rule: AnyRule) -> Result<PixelConfig<BINS, AnyRule>> {
        let gate = self.range_gate()?;
        let tracking = rule.tracking(&gate).filter(|_| self.tracking);
        ensure!(
            tracking.is_some() == self.tracking,
            Refused::new("tracking", "is for `rule` window")
        );
        PixelConfig::with_rule(rule)
            .x(self.x)
            .l1(self.l1)
            .l2(self.l2)
            .gate(gate)
            .estimator(self.estimator())
            .one_hit_tdc(self.one_hit_tdc)
            .tracking(tracking)
            .echoes(self.echoes, self.peel_reach())
            .echo_wait(self.echo_wait_times())
            .build()
            .map_err(|error| self.refused(error).into())
    }

    fn refused(&self, error: ConfigError) -> Refused {
        let Self { x, l1, l2, .. } = self;
        match error {
            ConfigError::ZeroX => Refused::value("x", x, "must be at least 1"),
            ConfigError::XAboveL1 => {
                Refused::value("x", x, format!("must not be greater than `l1` {l1}"))
            }
            ConfigError::L2NotAboveL1 => {
                Refused::value("l2", l2, format!("must be greater than `l1` {l1}"))
            }
            ConfigError::NoLook => Refused::value(
                "x",
                x,
                format!("no multiple of it lies strictly between `l1` {l1} and `l2` {l2}"),
            ),
        }
    }

    /// [`Self::echo_wait`] as pixels know it: without it the most, which is until L2.
    #[must_use]
    pub fn echo_wait_times(&self) -> u8 {
        self.echo_wait.unwrap_or(u8::MAX)
    }

    /// Bins to either side of an echo's peak that are left out once it is reported: four
    /// standard deviations of the pulse, taken to be a bin unless it is known.
    #[must_use]
    pub fn peel_reach(&self) -> u8 {
        let sigma = self.sigma_bins.unwrap_or(const { U8F8::lit("1") });
        // At most 7.
        u8::try_from((4 * u32::from(sigma.to_bits())).div_ceil(256)).unwrap_or(u8::MAX)
    }

    /// The estimator of the depth of a peak.
    #[must_use]
    pub fn estimator(&self) -> DepthEstimator {
        let suits = self.sigma_bins.map(CentredWindow::for_pulse);
        self.half_widths
            .or(suits)
            .filter(|_| !self.centroid)
            .map_or(DepthEstimator::Centroid3, DepthEstimator::CentredWindow)
    }

    /// The gate among `BINS` bins.
    ///
    /// # Errors
    /// If it ends past the last, or is too narrow.
    pub fn range_gate<const BINS: usize>(&self) -> Result<RangeGate<BINS>> {
        Ok(match self.gate {
            None => RangeGate::full(),
            Some((first, last)) => {
                RangeGate::new(first, last).map_err(|error| no_gate((first, last), BINS, &error))?
            }
        })
    }

    /// From bins to millimetres.
    ///
    /// # Errors
    /// The constraint the settings break.
    pub fn range_scale(&self) -> Result<RangeScale> {
        RangeScale::new(self.bin_width_ps, self.offset_mm).map_err(|error| {
            let reason = format!("with `offset_mm` {}: {error}", self.offset_mm);
            Refused::value("bin_width_ps", self.bin_width_ps, reason).into()
        })
    }
}

/// There is no such gate in histograms of `bins` bins.
pub(crate) fn no_gate((first, last): (u16, u16), bins: usize, error: &GateError) -> Refused {
    let reason = format!("with {bins} bins: {error}");
    Refused::value("gate", format_args!("{first}..{last}"), reason)
}

//! The settings of an engine.

use std::fmt::Display;

use anyhow::Result;
use dtof_core::fixed::types::{I24F8, U8F8};
use dtof_core::{
    AnyRule, Array, ArrayConfig, BlockLevel, CentredWindow, Count, CounterWidth, DepthEstimator,
    DetectionRule, PaperRule, PixelConfig, PixelData, RangeGate, RangeScaleError,
};
pub use dtof_link::AdaptiveBinning;
use dtof_link::{Configuration, Refusal, Source};

use dtof_data::options::Refused;
use dtof_data::photons::ranges::{Ranges, RangesError};
use dtof_data::photons::source::PhotonSource;

/// The default of L2 in laser cycles.
pub const DEFAULT_L2: u16 = Configuration::DEFAULT.l2;

/// Everything an engine and its output need beside the photons.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How the array operates, as a device would be told. The dead time is given. Pixels and columns are 0, as the photons
    /// say them. With [`Self::frame`] only gate and estimator are used.
    pub configuration: Configuration,
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: usize,
    /// Millimetres added to the offset, for each pixel in the order of the addresses; empty if they are 0.
    pub offsets_mm: Vec<I24F8>,
    /// Addresses of pixels that are left out: hot and dead ones.
    pub masked: Vec<u16>,
    /// The standard deviation of the pulse in bins, if it is known.
    pub sigma_bins: Option<U8F8>,
    /// Whether sensor or scene say the dead time, and not the settings.
    pub is_dead_time_of_sensor: bool,
    /// Bits of a pixel's counters, 8 or 10. Blocks and [`Self::frame`] have 16.
    pub counter_bits: u8,
    /// A frame-based sensor instead: all pixels read their highest bin every so many laser cycles.
    pub frame: Option<u16>,
    /// Pixels decide once, on all photons of the recording. L1, L2, X, tracking and counters are not used.
    pub decide_once: bool,
    /// Seed of every random number.
    pub seed: u64,
}

impl Settings {
    /// The paper's settings for its static scene (section III-B), on 128 bins of 250 ps.
    #[must_use]
    pub fn static_scene(seed: u64) -> Self {
        Self {
            configuration: Configuration {
                rule: PaperRule::new(U8F8::lit("8"), Count::saturating(5)).into(),
                l1: 100,
                x: 10,
                dead_time: Some(0),
                source: Source::Link,
                ..Configuration::DEFAULT
            },
            bins: 128,
            offsets_mm: Vec::new(),
            masked: Vec::new(),
            sigma_bins: None,
            is_dead_time_of_sensor: false,
            counter_bits: 10,
            frame: None,
            decide_once: false,
            seed,
        }
    }

    /// These settings with histograms of so many bins, and no gate.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
    pub fn with_bins(mut self, bins: usize) -> Self {
        self.bins = bins;
        self.configuration.gate = (0, bins.saturating_sub(1) as u16);
        self
    }

    /// These settings with the configuration as `change` makes it.
    #[must_use]
    pub fn configured(mut self, change: impl FnOnce(&mut Configuration)) -> Self {
        change(&mut self.configuration);
        self
    }

    /// These settings for a pulse with a standard deviation of so many bins: its depth window, and what is left out
    /// around an echo.
    #[must_use]
    pub fn for_pulse(mut self, sigma: U8F8) -> Self {
        self.sigma_bins = Some(sigma);
        self.configuration.estimator =
            DepthEstimator::CentredWindow(CentredWindow::for_pulse(sigma));
        self.configuration.echo_guard_bins = echo_guard_bins(sigma);
        self
    }

    /// The depth window of these settings, or else that which suits the pulse, if it is known.
    #[must_use]
    pub fn depth_window(&self) -> Option<CentredWindow> {
        match self.configuration.estimator {
            DepthEstimator::CentredWindow(window) => Some(window),
            DepthEstimator::Centroid3 => self.sigma_bins.map(CentredWindow::for_pulse),
        }
    }

    /// How pixels with `BINS` bins operate. With neighbours they have half of the false alarms.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        let config = self.configuration.pixel_config(0);
        Ok(config.map_err(|refusal| self.refused(refusal))?)
    }

    /// How blocks of pixels operate.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn block_config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        let binning = self.configuration.binning;
        let levels = binning.map_or(BlockLevel::PIXEL, |binning| binning.levels);
        let config = self.configuration.block_config(levels, 0);
        Ok(config.map_err(|refusal| self.refused(refusal))?)
    }

    /// How an array operates. Photons that do not count once per bin are left out before, so the array counts all.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn array_config<const BINS: usize, W: CounterWidth, T: PixelData>(
        &self,
        layout: Array,
    ) -> Result<ArrayConfig<BINS, AnyRule, W, T>> {
        let configuration = Configuration {
            once_per_bin: false,
            ..self.configuration
        };
        let config = configuration.array_config(layout, layout.pixels(), 0);
        Ok(config.map_err(|refusal| self.refused(refusal))?)
    }

    /// Bins for which the TDC is blind after a photon, at most [`Self::bins`]: then it takes the first photon of a
    /// laser cycle only. 0 if it takes every photon.
    #[must_use]
    pub fn dead_time(&self) -> u16 {
        self.configuration.dead_time.unwrap_or(0)
    }

    /// The gate, unless it has all bins.
    #[must_use]
    pub fn gate(&self) -> Option<(u16, u16)> {
        let (first, last) = self.configuration.gate;
        (first > 0 || usize::from(last) + 1 != self.bins).then_some((first, last))
    }

    /// Whether pixels weigh bins by the laser cycles in which they were live.
    #[must_use]
    pub fn weighs_dead_time(&self) -> bool {
        let weighs = self.configuration.rule.weighs_dead_time();
        self.dead_time() > 0 && weighs && self.frame.is_none()
    }

    /// Whether photons of one laser cycle in one bin count once: frames count all.
    #[must_use]
    pub fn counts_once_per_bin(&self) -> bool {
        self.configuration.once_per_bin && self.frame.is_none()
    }

    /// The option that a refusal is about.
    pub(super) fn refused(&self, refusal: Refusal) -> Refused {
        let Configuration { x, l1, l2, .. } = self.configuration;
        let defaults = Configuration::DEFAULT;
        let defaults = [("x", defaults.x), ("l1", defaults.l1), ("l2", defaults.l2)];
        let default = |key, number| match defaults.contains(&(key, number)) {
            true => format!("; {number} is the default of `{key}`"),
            false => String::new(),
        };
        match refusal {
            Refusal::ZeroX => Refused::value("x", x, "must be at least 1"),
            Refusal::XAboveL1 => {
                let reason = format!("must not be greater than `l1` {l1}{}", default("x", x));
                Refused::value("x", x, reason)
            }
            Refusal::L2NotAboveL1 => {
                let (of_l2, of_l1) = (default("l2", l2), default("l1", l1));
                let reason = format!("must be greater than `l1` {l1}{of_l2}{of_l1}");
                Refused::value("l2", l2, reason)
            }
            Refusal::NoLook => Refused::value(
                "x",
                x,
                format!("no multiple of it lies strictly between `l1` {l1} and `l2` {l2}"),
            ),
            Refusal::GatePastLastBin | Refusal::GateTooNarrow => {
                no_gate(self.configuration.gate, self.bins, refusal)
            }
            Refusal::Tracking => Refused::new("tracking", "is for `rule` window"),
            Refusal::Neighbours => {
                let reason = match (&self.configuration.rule, self.configuration.binning) {
                    (AnyRule::Window(_), None) => {
                        "cannot be used with a dead time; `dead_time` 0 leaves it out"
                    }
                    (AnyRule::Window(_), Some(_)) => "cannot be used with `binning`",
                    _ => "is for `rule` window",
                };
                Refused::new("neighbours", reason)
            }
            Refusal::Blocks => Refused::new("binning", "is for arrays of columns and rows"),
            Refusal::DeadTime => {
                Refused::new("dead_time", "is for `rule` window, without `binning`")
            }
            other => Refused::input(other.to_string()),
        }
    }

    /// The gate for `BINS` bins.
    ///
    /// # Errors
    /// Fails if it ends past the last bin or is too narrow.
    pub fn range_gate<const BINS: usize>(&self) -> Result<RangeGate<BINS>> {
        let gate @ (first, last) = self.configuration.gate;
        Ok(RangeGate::new(first, last).map_err(|error| no_gate(gate, BINS, error))?)
    }

    /// From the events of `array` to millimetres.
    ///
    /// # Errors
    /// Fails if the settings break a constraint, or if there is not one offset for each pixel.
    pub fn ranges(&self, array: Array) -> Result<Ranges> {
        let configuration = &self.configuration;
        let ranges = Ranges::new(
            array,
            configuration.bin_width_ps,
            configuration.offset_mm,
            self.pixel_offsets(),
        );
        ranges.map_err(|error| match error {
            RangesError::Scale(RangeScaleError::ZeroBinWidth) => {
                let reason = "too narrow: a bin would be 0 mm; give picoseconds, such as 250";
                Refused::value("bin_width_ps", configuration.bin_width_ps, reason).into()
            }
            RangesError::Scale(_) => {
                let reason = format!("with `offset_mm` {}: {error}", configuration.offset_mm);
                Refused::value("bin_width_ps", configuration.bin_width_ps, reason).into()
            }
            _ => Refused::new("offsets_mm", error.to_string()).into(),
        })
    }

    /// The offset of each pixel, `None` for those that are left out; empty if they are 0.
    #[must_use]
    pub fn pixel_offsets(&self) -> Vec<Option<I24F8>> {
        let mut offsets: Vec<_> = self.offsets_mm.iter().copied().map(Some).collect();
        for &pixel in &self.masked {
            if let Some(offset) = offsets.get_mut(usize::from(pixel)) {
                *offset = None;
            }
        }
        offsets
    }

    /// These settings with one offset for each pixel of `source`: those of one capture hold for each.
    ///
    /// # Errors
    /// Fails as [`Self::ranges`] does.
    pub fn for_source(mut self, source: &dyn PhotonSource) -> Result<Self> {
        let (array, rows) = (source.array(), source.capture_rows());
        if self.offsets_mm.len() == (array.columns() * rows) as usize {
            self.offsets_mm = self.offsets_mm.repeat((array.rows() / rows) as usize);
        }
        self.ranges(array)?;
        Ok(self)
    }
}

/// The bins to either side of an echo's peak that are left out once it is reported: four standard deviations of the
/// pulse, at most 7.
pub(super) fn echo_guard_bins(sigma: U8F8) -> u8 {
    u8::try_from((4 * u32::from(sigma.to_bits())).div_ceil(256)).unwrap_or(u8::MAX)
}

/// The error of a gate in histograms of `bins` bins.
pub(super) fn no_gate((first, last): (u16, u16), bins: usize, error: impl Display) -> Refused {
    let reason = format!("with {bins} bins: {error}");
    Refused::value("gate", format_args!("{first}..{last}"), reason)
}

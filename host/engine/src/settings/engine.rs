//! The settings of an engine.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::neighbours::NeighbourRule;
use dtof_core::{
    AnyRule, Array, BlockLevel, CentredWindow, Count, DepthEstimator, DetectionRule, EchoNumber,
    GateError, Neighbours, PaperRule, PixelConfig, PixelConfigError, RangeGate, RangeScaleError,
};
pub use dtof_link::AdaptiveBinning;

use dtof_options::Refused;
use dtof_photons::ranges::{Ranges, RangesError};
use dtof_photons::source::PhotonSource;

/// The default of L2 in laser cycles.
pub const DEFAULT_L2: u16 = 2000;

/// Everything an engine and its output need beside the photons.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    pub offset_mm: I24F8,
    /// Millimetres added to that, for each pixel in the order of the addresses; empty if they are 0.
    pub offsets_mm: Vec<I24F8>,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// Addresses of pixels that are left out: hot and dead ones.
    pub masked: Vec<u16>,
    /// The rule that decides whether a peak stands clear.
    pub rule: AnyRule,
    /// The standard deviation of the pulse in bins, if it is known.
    pub sigma_bins: Option<U8F8>,
    /// How far the depth window reaches before and after its centre, in bins, if not as suits
    /// `sigma_bins`.
    pub half_widths: Option<CentredWindow>,
    /// The depth is the centroid of three bins, even if a window would suit the pulse.
    pub centroid: bool,
    /// The exposure a decision must exceed, in laser cycles.
    pub l1: u16,
    /// The exposure at which a pixel starts over without an event.
    pub l2: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// Blocks of pixels that decide together.
    pub binning: Option<AdaptiveBinning>,
    /// The pixels around a pixel that confirm what is not enough by itself, if any. Needs the window rule;
    /// not used with [`Self::frame`].
    pub neighbours: Option<Neighbours>,
    /// Whether pixels expect their next event where the last was.
    pub tracking: bool,
    /// The last echo that a pixel reports in an exposure.
    pub echoes: EchoNumber,
    /// An exposure ends once it is this many times as long as it was at its last echo; at L2 if
    /// `None`.
    pub echo_wait: Option<u8>,
    /// Bins for which the TDC is blind after a photon, at most [`Self::bins`]: then it takes the
    /// first photon of a laser cycle only. 0 if it takes every photon.
    pub dead_time: u16,
    /// Whether sensor or scene say [`Self::dead_time`], and not the settings.
    pub is_dead_time_of_sensor: bool,
    /// Whether photons of one laser cycle in one bin count once. Not used with [`Self::frame`].
    pub once_per_bin: bool,
    /// Bits of a pixel's counters, 8 or 10. Blocks and [`Self::frame`] have 16.
    pub counter_bits: u8,
    /// The range of the laser's dither in bins: by how much its longest cycle is longer than its shortest.
    /// Decisions do not depend on it.
    pub dither_bins: u16,
    /// The seed of the lengths of laser cycles.
    pub dither_seed: u64,
    /// A frame-based sensor instead: all pixels read their highest bin every so many laser cycles.
    /// Rule, minimum, L1, L2 and X are not used.
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
            bins: 128,
            bin_width_ps: U16F16::lit("250"),
            offset_mm: I24F8::ZERO,
            offsets_mm: Vec::new(),
            gate: None,
            masked: Vec::new(),
            rule: PaperRule::new(U8F8::lit("8"), Count::saturating(5)).into(),
            sigma_bins: None,
            half_widths: None,
            centroid: false,
            l1: 100,
            l2: DEFAULT_L2,
            x: 10,
            binning: None,
            neighbours: None,
            tracking: false,
            echoes: EchoNumber::FIRST,
            echo_wait: None,
            dead_time: 0,
            is_dead_time_of_sensor: false,
            once_per_bin: false,
            counter_bits: 10,
            dither_bins: 0,
            dither_seed: 0,
            frame: None,
            decide_once: false,
            seed,
        }
    }

    /// The configuration of pixels with `BINS` bins.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        self.config_of(self.own_rule())
    }

    /// The rule by which a pixel alone decides. With neighbours it has half of the false alarms.
    #[must_use]
    pub fn own_rule(&self) -> AnyRule {
        match (self.neighbours, self.rule) {
            (Some(_), AnyRule::Window(rule)) => (*NeighbourRule::new(&rule).own()).into(),
            (_, rule) => rule,
        }
    }

    /// The configuration of blocks of pixels.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
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
            .dead_time(self.dead_time)
            .tracking(tracking)
            .echoes(self.echoes, self.echo_guard_bins())
            .echo_wait(self.echo_wait_times())
            .build()
            .map_err(|error| self.refused(error).into())
    }

    /// Whether pixels weigh bins by the laser cycles in which they were live.
    #[must_use]
    pub fn weighs_dead_time(&self) -> bool {
        self.dead_time > 0 && self.rule.weighs_dead_time() && self.frame.is_none()
    }

    /// Whether photons of one laser cycle in one bin count once: frames count all.
    #[must_use]
    pub fn counts_once_per_bin(&self) -> bool {
        self.once_per_bin && self.frame.is_none()
    }

    fn refused(&self, error: PixelConfigError) -> Refused {
        let Self { x, l1, l2, .. } = self;
        match error {
            PixelConfigError::ZeroX => Refused::value("x", x, "must be at least 1"),
            PixelConfigError::XAboveL1 => {
                Refused::value("x", x, format!("must not be greater than `l1` {l1}"))
            }
            PixelConfigError::L2NotAboveL1 => {
                let default = match *l2 {
                    DEFAULT_L2 => "; 2000 is the default of `l2`",
                    _ => "",
                };
                let reason = format!("must be greater than `l1` {l1}{default}");
                Refused::value("l2", l2, reason)
            }
            PixelConfigError::NoLook => Refused::value(
                "x",
                x,
                format!("no multiple of it lies strictly between `l1` {l1} and `l2` {l2}"),
            ),
            other => Refused::value("x", x, other.text()),
        }
    }

    /// [`Self::echo_wait`] for pixels: the maximum, which lasts until L2, if `None`.
    #[must_use]
    pub fn echo_wait_times(&self) -> u8 {
        self.echo_wait.unwrap_or(u8::MAX)
    }

    /// The bins to either side of an echo's peak that are left out once it is reported: four
    /// standard deviations of the pulse, or 4 bins if its width is not known.
    #[must_use]
    pub fn echo_guard_bins(&self) -> u8 {
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

    /// The gate for `BINS` bins.
    ///
    /// # Errors
    /// Fails if it ends past the last bin or is too narrow.
    pub fn range_gate<const BINS: usize>(&self) -> Result<RangeGate<BINS>> {
        Ok(match self.gate {
            None => RangeGate::full(),
            Some((first, last)) => {
                RangeGate::new(first, last).map_err(|error| no_gate((first, last), BINS, &error))?
            }
        })
    }

    /// From the events of `array` to millimetres.
    ///
    /// # Errors
    /// Fails if the settings break a constraint, or if there is not one offset for each pixel.
    pub fn ranges(&self, array: Array) -> Result<Ranges> {
        let ranges = Ranges::new(
            array,
            self.bin_width_ps,
            self.offset_mm,
            self.pixel_offsets(),
        );
        ranges.map_err(|error| match error {
            RangesError::Scale(RangeScaleError::ZeroBinWidth) => {
                let reason = "too narrow: a bin would be 0 mm; give picoseconds, such as 250";
                Refused::value("bin_width_ps", self.bin_width_ps, reason).into()
            }
            RangesError::Scale(_) => {
                let reason = format!("with `offset_mm` {}: {error}", self.offset_mm);
                Refused::value("bin_width_ps", self.bin_width_ps, reason).into()
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

/// The error of a gate in histograms of `bins` bins.
pub(crate) fn no_gate((first, last): (u16, u16), bins: usize, error: &GateError) -> Refused {
    let reason = format!("with {bins} bins: {error}");
    Refused::value("gate", format_args!("{first}..{last}"), reason)
}

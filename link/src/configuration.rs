//! How an array operates: the settings of a host, the message to a device, and what pixels are built from.

use dtof_core::events::Reference;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::neighbours::{NeighbourConfig, NeighbourRule};
use dtof_core::paper::Threshold;
use dtof_core::{
    AnyRule, Array, ArrayConfig, AverageRule, BlockLevel, CentredWindow, Count, CounterWidth,
    DepthEstimator, DetectionRule, EchoNumber, Neighbours, PaperRule, PixelConfig, PixelData,
    RangeGate, WindowRule,
};

use crate::adaptive_binning::AdaptiveBinning;
use crate::dynamic_depth::DynamicDepth;
use crate::refusal::Refusal;

/// Where the device takes its photons from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// From the link: photons messages.
    Link,
    /// From its sensor.
    Sensor,
}

/// How the pixels of an array operate. Rule and estimator are valid by construction;
/// [`Self::array_config`] and [`Self::device_config`] check the rest, and a device what depends on its sensor.
/// `x`, `l1` and `l2` are the paper's names (section II-B).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// The detection rule.
    pub rule: AnyRule,
    /// The depth estimator.
    pub estimator: DepthEstimator,
    /// Laser cycles between looks.
    pub x: u16,
    /// The exposure a decision must exceed.
    pub l1: u16,
    /// The exposure at which a pixel starts over.
    pub l2: u16,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: (u16, u16),
    /// Bins for which the TDC is blind after a photon; `None`: those that the sensor says. With as
    /// many as the histogram has, or more, only the first photon of a laser cycle counts. See
    /// [`Self::dead_time_in_force`].
    pub dead_time: Option<u16>,
    /// Whether photons of one laser cycle in one bin count once. A device whose sensor gives histograms
    /// refuses it with that as the source.
    pub once_per_bin: bool,
    /// By how many bins the longest laser cycle is longer than the shortest: the range of the laser's random
    /// lengths. 0: all laser cycles are as long. A device refuses more than its sensor can, and any where the
    /// photons come from the link.
    pub dither_bins: u16,
    /// The seed of these lengths. LiDARs side by side need different ones.
    pub dither_seed: u64,
    /// The number of pixels; their addresses begin at 0.
    pub pixels: u16,
    /// Pixels in a row of the array.
    pub columns: u16,
    /// Blocks of pixels that decide together.
    pub binning: Option<AdaptiveBinning>,
    /// The pixels around a pixel that confirm it, if any; with a window rule, and without blocks, a dead time
    /// that is weighed, or whole histograms.
    pub neighbours: Option<Neighbours>,
    /// Whether pixels expect their next event where the last was; with a window rule.
    pub tracking: bool,
    /// The last echo that a pixel reports in an exposure.
    pub echoes: EchoNumber,
    /// Bins to either side of an echo's peak that are excluded once it is reported.
    pub echo_guard_bins: u8,
    /// An exposure with an echo ends when it is this many times as long as it was at its last
    /// echo; with 255, at L2.
    pub echo_wait: u8,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Millimetres added to every range.
    pub offset_mm: I24F8,
    /// Where photons come from.
    pub source: Source,
    /// Changes of depth that are sent in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
    /// The sensor stops if no frame of the host arrives for this many milliseconds:
    /// [`Self::HOST_TIMEOUTS_MS`]. With 0 it never does. A device refuses 0 unless its
    /// firmware was built for it.
    pub host_timeout_ms: u16,
}

// The choices as bytes.
const FROM_LINK: u8 = 0;
const FROM_SENSOR: u8 = 1;
const PAPER_RULE: u8 = 0;
const WINDOW_RULE: u8 = 1;
const AVERAGE_RULE: u8 = 2;
const CENTROID: u8 = 0;
const CENTRED_WINDOW: u8 = 1;
const DEPTH_EVENTS: u8 = 0;
const DYNAMIC_DEPTH_EVENTS: u8 = 1;
const PREVIOUS: u8 = 0;
const REPORTED: u8 = 1;
const DEAD_TIME_OF_SENSOR: u8 = 0;
const DEAD_TIME_GIVEN: u8 = 1;
const EVERY_PHOTON: u8 = 0;
const ONCE_PER_BIN: u8 = 1;
const NO_NEIGHBOURS: u8 = 0;
const NOT_TRACKING: u8 = 0;
const TRACKING: u8 = 1;

impl Configuration {
    /// One row of no pixels on 128 bins of 250 ps: the paper's rule with an alpha of 4 and at least 5 photons, its
    /// estimator, looks every 4 laser cycles after more than 40 and up to 2000. The sensor says the dead time. A device refuses it
    /// until it has pixels.
    pub const DEFAULT: Self = Self {
        rule: AnyRule::Paper(PaperRule::new(U8F8::lit("4"), Count::saturating(5))),
        estimator: DepthEstimator::Centroid3,
        x: 4,
        l1: 40,
        l2: 2000,
        gate: (0, 127),
        dead_time: None,
        once_per_bin: false,
        dither_bins: 0,
        dither_seed: 0,
        pixels: 0,
        columns: 0,
        binning: None,
        neighbours: None,
        tracking: false,
        echoes: EchoNumber::FIRST,
        echo_guard_bins: 4,
        echo_wait: u8::MAX,
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::ZERO,
        source: Source::Sensor,
        dynamic_depth: None,
        host_timeout_ms: Self::HOST_TIMEOUT_MS,
    };
    /// Bytes of the record.
    pub const BYTES: usize = 67;
    /// The range of the host timeout, in milliseconds. A host sends a frame every 50 ms.
    pub const HOST_TIMEOUTS_MS: core::ops::RangeInclusive<u16> = 200..=60_000;
    /// The default host timeout, in milliseconds.
    pub const HOST_TIMEOUT_MS: u16 = 3_000;
    /// The range of the minimum count, for counters of 10 bits.
    const MINIMUM_COUNTS: core::ops::RangeInclusive<u16> = 1..=1023;

    /// The bytes to send.
    #[must_use]
    pub fn to_le_bytes(&self) -> [u8; Self::BYTES] {
        let with_alpha = |rule, threshold: &Threshold| {
            let (alpha, minimum_count) = (threshold.alpha(), threshold.minimum_count());
            (rule, alpha, minimum_count, 0, U4F12::ZERO)
        };
        let (rule, alpha, minimum_count, window, z) = match self.rule {
            AnyRule::Paper(rule) => with_alpha(PAPER_RULE, rule.threshold()),
            AnyRule::Average(rule) => with_alpha(AVERAGE_RULE, rule.threshold()),
            AnyRule::Window(rule) => {
                let (minimum_count, width) = (rule.minimum_count(), rule.width());
                (WINDOW_RULE, U8F8::ZERO, minimum_count, width, rule.z())
            }
        };
        let (estimator, before, after) = match self.estimator {
            DepthEstimator::Centroid3 => (CENTROID, U8F8::ZERO, U8F8::ZERO),
            DepthEstimator::CentredWindow(window) => {
                (CENTRED_WINDOW, window.before(), window.after())
            }
        };
        let (output, reference, threshold) = match self.dynamic_depth {
            None => (DEPTH_EVENTS, PREVIOUS, U24F8::ZERO),
            Some(changes) => {
                let reference = match changes.reference {
                    Reference::Previous => PREVIOUS,
                    Reference::Reported => REPORTED,
                };
                (DYNAMIC_DEPTH_EVENTS, reference, changes.threshold_mm)
            }
        };
        let source = match self.source {
            Source::Link => FROM_LINK,
            Source::Sensor => FROM_SENSOR,
        };
        let (dead_time_from, dead_time) = match self.dead_time {
            None => (DEAD_TIME_OF_SENSOR, 0),
            Some(dead_time) => (DEAD_TIME_GIVEN, dead_time),
        };
        let binning = self.binning.unwrap_or(AdaptiveBinning {
            levels: BlockLevel::PIXEL,
            patience: 0,
        });
        let tracking = if self.tracking {
            TRACKING
        } else {
            NOT_TRACKING
        };
        let once_per_bin = if self.once_per_bin {
            ONCE_PER_BIN
        } else {
            EVERY_PHOTON
        };

        let first = [
            alpha.to_bits(),
            // A count that does not fit is refused by every device.
            u16::try_from(minimum_count.raw()).unwrap_or(u16::MAX),
            self.x,
            self.l1,
            self.l2,
            self.gate.0,
            self.gate.1,
            self.pixels,
        ];
        let fields = first
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .chain(self.bin_width_ps.to_le_bytes())
            .chain(self.offset_mm.to_le_bytes())
            .chain([source, rule, window])
            .chain(z.to_le_bytes())
            .chain([estimator])
            .chain(before.to_le_bytes())
            .chain(after.to_le_bytes())
            .chain([output, reference])
            .chain(threshold.to_le_bytes())
            .chain([dead_time_from])
            .chain(self.columns.to_le_bytes())
            .chain([binning.levels.raw()])
            .chain(binning.patience.to_le_bytes())
            .chain([
                tracking,
                self.echoes.raw(),
                self.echo_guard_bins,
                self.echo_wait,
            ])
            .chain(self.host_timeout_ms.to_le_bytes())
            .chain(dead_time.to_le_bytes())
            .chain([once_per_bin])
            .chain(self.dither_bins.to_le_bytes())
            .chain(self.dither_seed.to_le_bytes())
            // The byte after it is reserved.
            .chain([self.neighbours.map_or(NO_NEIGHBOURS, Neighbours::raw)]);
        let mut bytes = [0; Self::BYTES];
        for (place, byte) in bytes.iter_mut().zip(fields) {
            *place = byte;
        }
        bytes
    }

    /// The dead time that a device with `bins` bins a histogram applies. `of_sensor` is that of its
    /// sensor, 0 without one. 0 is none.
    ///
    /// The rules of paper and average, and blocks of pixels, take every bin as live. With them only
    /// a TDC of the first photon has an effect, which is a flag: a shorter dead time is refused, or
    /// not taken from the sensor. Photons from the link have that of the configuration or none.
    ///
    /// # Errors
    /// Fails with [`Refusal::DeadTime`] if the configuration has a dead time of less than a
    /// histogram with another rule than the window rule, or with blocks.
    pub fn dead_time_in_force(&self, of_sensor: u16, bins: u16) -> Result<u16, Refusal> {
        let is_weighed = self.rule.weighs_dead_time() && self.binning.is_none();
        let has_effect = |dead_time| dead_time == 0 || dead_time >= bins || is_weighed;
        match (self.dead_time, self.source) {
            (Some(dead_time), _) if has_effect(dead_time) => Ok(dead_time),
            (Some(_), _) => Err(Refusal::DeadTime),
            (None, Source::Sensor) if has_effect(of_sensor) => Ok(of_sensor),
            (None, _) => Ok(0),
        }
    }

    /// How each pixel operates, with histograms of `BINS` bins. `dead_time_of_sensor` is that of
    /// [`Self::dead_time_in_force`]. With neighbours a pixel has half of the false alarms, they have the others.
    ///
    /// # Errors
    /// Fails with the first setting that cannot be.
    pub fn pixel_config<const BINS: usize>(
        &self,
        dead_time_of_sensor: u16,
    ) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
        let own = match self.neighbours {
            None => self.rule,
            Some(_) => (*NeighbourRule::new(self.rule_of_neighbours()?).own()).into(),
        };
        let config = self.config_of(own, dead_time_of_sensor)?;
        match self.neighbours {
            Some(_) if config.weighs_dead_time() => Err(Refusal::Neighbours),
            _ => Ok(config),
        }
    }

    /// The same for pixels that decide alone, with less code.
    ///
    /// # Errors
    /// Fails with the first setting that cannot be, such as blocks and neighbours.
    #[inline]
    pub fn lone_config<const BINS: usize>(
        &self,
        dead_time_of_sensor: u16,
    ) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
        match (self.neighbours, self.binning) {
            (None, None) => self.config_with(self.rule, dead_time_of_sensor),
            (None, Some(_)) => Err(Refusal::Blocks),
            (Some(_), _) => Err(Refusal::Neighbours),
        }
    }

    /// How the blocks of so many levels operate, as [`Self::pixel_config`].
    ///
    /// # Errors
    /// Fails with the first setting that cannot be.
    pub fn block_config<const BINS: usize>(
        &self,
        levels: BlockLevel,
        dead_time_of_sensor: u16,
    ) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
        self.config_of(self.rule.of_blocks(levels), dead_time_of_sensor)
    }

    /// How the first `pixels` of an array operate, with their blocks or neighbours, as [`Self::pixel_config`].
    /// [`Self::pixels`] and [`Self::columns`] are not used.
    ///
    /// # Errors
    /// Fails with the first setting that cannot be.
    pub fn array_config<const BINS: usize, W: CounterWidth, T: PixelData>(
        &self,
        layout: Array,
        pixels: u32,
        dead_time_of_sensor: u16,
    ) -> Result<ArrayConfig<BINS, AnyRule, W, T>, Refusal> {
        let own = self.pixel_config(dead_time_of_sensor)?;
        let mut config = ArrayConfig::new(layout, own).first(pixels)?;
        if let Some(neighbours) = self.neighbours {
            let rule = self.rule_of_neighbours()?;
            config = config.neighbours(NeighbourConfig::new(layout, neighbours, rule))?;
        }
        if let Some(AdaptiveBinning { levels, patience }) = self.binning {
            if patience == 0 {
                return Err(Refusal::Patience);
            }
            let blocks = self.block_config(levels, dead_time_of_sensor)?;
            config = config.blocks(levels, blocks, patience)?;
        }
        Ok(match self.once_per_bin {
            true => config.once_per_bin(),
            false => config,
        })
    }

    /// The same for [`Self::pixels`] in rows of [`Self::columns`]. Without columns they are one row, which has neither
    /// blocks nor neighbours.
    ///
    /// # Errors
    /// Fails with the first setting that cannot be.
    pub fn device_config<const BINS: usize, W: CounterWidth, T: PixelData>(
        &self,
        dead_time_of_sensor: u16,
    ) -> Result<ArrayConfig<BINS, AnyRule, W, T>, Refusal> {
        let pixels = u32::from(self.pixels);
        let [columns, rows] = match u32::from(self.columns) {
            0 if self.neighbours.is_some() => return Err(Refusal::Neighbours),
            0 if self.binning.is_some() => return Err(Refusal::Blocks),
            0 => [pixels, 1],
            columns => [columns, pixels.div_ceil(columns)],
        };
        let layout = Array::new(columns, rows).ok_or(Refusal::Pixels)?;
        self.array_config(layout, pixels, dead_time_of_sensor)
    }

    fn rule_of_neighbours(&self) -> Result<&WindowRule, Refusal> {
        match &self.rule {
            AnyRule::Window(rule) if self.binning.is_none() => Ok(rule),
            _ => Err(Refusal::Neighbours),
        }
    }

    #[inline(never)]
    fn config_of<const BINS: usize>(
        &self,
        rule: AnyRule,
        dead_time_of_sensor: u16,
    ) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
        self.config_with(rule, dead_time_of_sensor)
    }

    #[allow(
        clippy::inline_always,
        reason = "a program of lone pixels is 300 bytes smaller"
    )]
    #[inline(always)]
    fn config_with<const BINS: usize>(
        &self,
        rule: AnyRule,
        dead_time_of_sensor: u16,
    ) -> Result<PixelConfig<BINS, AnyRule>, Refusal> {
        #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
        let dead_time = self.dead_time_in_force(dead_time_of_sensor, BINS as u16)?;
        let gate = RangeGate::new(self.gate.0, self.gate.1)?;
        let tracking = rule.tracking(&gate).filter(|_| self.tracking);
        if self.tracking && tracking.is_none() {
            return Err(Refusal::Tracking);
        }
        let config = PixelConfig::with_rule(rule)
            .x(self.x)
            .l1(self.l1)
            .l2(self.l2)
            .gate(gate)
            .estimator(self.estimator)
            .dead_time(dead_time)
            .tracking(tracking)
            .echoes(self.echoes, self.echo_guard_bins)
            .echo_wait(self.echo_wait);
        Ok(config.build()?)
    }

    /// Reads the record. Fields of another rule, estimator or output are ignored, and the dead
    /// time if it is that of the sensor.
    ///
    /// # Errors
    /// Fails at the first field that every device refuses.
    pub fn from_le_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().map_err(|_| Refusal::Unknown)?;
        let mut fields = Fields(bytes);
        let alpha = U8F8::from_le_bytes(fields.next()?);
        let minimum_count = u16::from_le_bytes(fields.next()?);
        let x = u16::from_le_bytes(fields.next()?);
        let l1 = u16::from_le_bytes(fields.next()?);
        let l2 = u16::from_le_bytes(fields.next()?);
        let gate_first = u16::from_le_bytes(fields.next()?);
        let gate_last = u16::from_le_bytes(fields.next()?);
        let pixels = u16::from_le_bytes(fields.next()?);
        let bin_width_ps = U16F16::from_le_bytes(fields.next()?);
        let offset_mm = I24F8::from_le_bytes(fields.next()?);
        let [source, rule, window] = fields.next()?;
        let z = U4F12::from_le_bytes(fields.next()?);
        let [estimator] = fields.next()?;
        let before = U8F8::from_le_bytes(fields.next()?);
        let after = U8F8::from_le_bytes(fields.next()?);
        let [output, reference] = fields.next()?;
        let threshold_mm = U24F8::from_le_bytes(fields.next()?);
        let [dead_time_from] = fields.next()?;
        let columns = u16::from_le_bytes(fields.next()?);
        let [levels] = fields.next()?;
        let patience = u16::from_le_bytes(fields.next()?);
        let [tracking, echoes, echo_guard_bins, echo_wait] = fields.next()?;
        let host_timeout_ms = u16::from_le_bytes(fields.next()?);
        let dead_time = u16::from_le_bytes(fields.next()?);
        let [once_per_bin] = fields.next()?;
        let dither_bins = u16::from_le_bytes(fields.next()?);
        let dither_seed = u64::from_le_bytes(fields.next()?);
        let [neighbours] = fields.next()?;
        let Fields(reserved) = fields;

        let changes = |reference| DynamicDepth {
            threshold_mm,
            reference,
        };
        if !Self::MINIMUM_COUNTS.contains(&minimum_count) {
            return Err(Refusal::MinimumCount);
        }
        let minimum_count = Count::saturating(minimum_count.into());
        if host_timeout_ms != 0 && !Self::HOST_TIMEOUTS_MS.contains(&host_timeout_ms) {
            return Err(Refusal::HostTimeout);
        }
        if reserved.iter().any(|&byte| byte != 0) {
            return Err(Refusal::Reserved);
        }
        Ok(Self {
            rule: match rule {
                PAPER_RULE => PaperRule::new(alpha, minimum_count).into(),
                AVERAGE_RULE => AverageRule::new(alpha, minimum_count).into(),
                WINDOW_RULE => WindowRule::new(window, z, minimum_count)?.into(),
                _ => return Err(Refusal::Unknown),
            },
            estimator: match estimator {
                CENTROID => DepthEstimator::Centroid3,
                CENTRED_WINDOW => CentredWindow::with_sides(before, after)
                    .map(DepthEstimator::CentredWindow)
                    .ok_or(Refusal::HalfWidth)?,
                _ => return Err(Refusal::Unknown),
            },
            x,
            l1,
            l2,
            gate: (gate_first, gate_last),
            dead_time: match dead_time_from {
                DEAD_TIME_OF_SENSOR => None,
                DEAD_TIME_GIVEN => Some(dead_time),
                _ => return Err(Refusal::Unknown),
            },
            once_per_bin: match once_per_bin {
                EVERY_PHOTON => false,
                ONCE_PER_BIN => true,
                _ => return Err(Refusal::Unknown),
            },
            dither_bins,
            dither_seed,
            pixels,
            columns,
            binning: match BlockLevel::new(levels).ok_or(Refusal::Unknown)? {
                BlockLevel::PIXEL => None,
                _ if patience == 0 => return Err(Refusal::Patience),
                levels => Some(AdaptiveBinning { levels, patience }),
            },
            neighbours: match (Neighbours::new(neighbours), neighbours) {
                (None, NO_NEIGHBOURS) => None,
                (None, _) => return Err(Refusal::Unknown),
                (neighbours, _) => neighbours,
            },
            tracking: match tracking {
                NOT_TRACKING => false,
                TRACKING => true,
                _ => return Err(Refusal::Unknown),
            },
            echoes: EchoNumber::new(echoes).ok_or(Refusal::Unknown)?,
            echo_guard_bins,
            echo_wait,
            bin_width_ps,
            offset_mm,
            source: match source {
                FROM_LINK => Source::Link,
                FROM_SENSOR => Source::Sensor,
                _ => return Err(Refusal::Unknown),
            },
            dynamic_depth: match (output, reference) {
                (DEPTH_EVENTS, _) => None,
                (DYNAMIC_DEPTH_EVENTS, PREVIOUS) => Some(changes(Reference::Previous)),
                (DYNAMIC_DEPTH_EVENTS, REPORTED) => Some(changes(Reference::Reported)),
                _ => return Err(Refusal::Unknown),
            },
            host_timeout_ms,
        })
    }
}

/// The fields that are not read yet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    /// The next field.
    fn next<const BYTES: usize>(&mut self) -> Result<[u8; BYTES], Refusal> {
        let (field, rest) = self.0.split_first_chunk().ok_or(Refusal::Unknown)?;
        self.0 = rest;
        Ok(*field)
    }
}

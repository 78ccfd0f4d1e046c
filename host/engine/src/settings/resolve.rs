//! From the settings file to the settings of an engine: defaults, and the thresholds of rules.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::U4F12;
use dtof_core::paper::Threshold;
use dtof_core::rule::{HIGHEST_Z, z_for_levels};
use dtof_core::{
    AnyRule, BlockLevel, CentredWindow, Count8, DepthEstimator, EchoNumber, Neighbours, RangeGate,
};
use dtof_link::{Configuration, Source};
use dtof_theory::tune::window::one_in;

use super::engine::{Settings, echo_guard_bins, no_gate};
use super::{
    DetectionSettings, EstimatorName, RuleName, RunSettings, SensorSettings, SettingsFile,
};
use dtof_options::Refused;

impl SettingsFile {
    /// The settings for histograms of `bins` bins.
    ///
    /// # Errors
    /// Fails if settings contradict each other. Names options, or the file and its keys.
    pub fn settings(&self, bins: usize) -> Result<Settings> {
        self.resolved(bins)
            .map_err(|error| self.add_file_name(error))
    }

    fn resolved(&self, bins: usize) -> Result<Settings> {
        let Self { sensor, run, .. } = self;
        let decide_once = run.decide_once.unwrap_or(false);
        ensure!(
            !decide_once || run.frame.is_none(),
            Refused::new("decide_once", "cannot be used with `frame`")
        );
        let configuration = self.configuration(bins, decide_once)?;
        let counter_bits = self.detection.counter_bits.unwrap_or(10);
        ensure!(
            counter_bits != 8 || run.frame.is_some() || configuration.rule.fits::<Count8>(),
            Refused::new("min_count", "is more than counters of 8 bits hold")
        );
        Ok(Settings {
            configuration,
            bins,
            offsets_mm: sensor.offsets_mm.clone().unwrap_or_default(),
            masked: sensor.masked.clone().unwrap_or_default(),
            sigma_bins: sensor.sigma_bins,
            is_dead_time_of_sensor: configuration.dead_time > Some(0) && sensor.dead_time.is_none(),
            counter_bits,
            frame: run.frame,
            decide_once,
            seed: run.seed.unwrap_or(1),
        })
    }

    /// How an array of histograms with `bins` bins operates.
    fn configuration(&self, bins: usize, decide_once: bool) -> Result<Configuration> {
        let Self {
            sensor, detection, ..
        } = self;
        let default = Configuration::DEFAULT;
        // The engine refuses a number of bins that is not one.
        #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
        let last_bin = bins.clamp(8, 1024) as u16 - 1;
        let mut configuration = Configuration {
            x: detection.x.unwrap_or(default.x),
            l1: detection.l1.unwrap_or(default.l1),
            l2: detection.l2.unwrap_or(default.l2),
            gate: sensor.gate.unwrap_or((0, last_bin)),
            bin_width_ps: sensor.bin_width_ps.unwrap_or(default.bin_width_ps),
            offset_mm: sensor.offset_mm.unwrap_or(default.offset_mm),
            tracking: detection.tracking.unwrap_or(default.tracking),
            once_per_bin: detection.once_per_bin.unwrap_or(default.once_per_bin),
            echo_wait: detection.echo_wait.unwrap_or(default.echo_wait),
            source: Source::Link,
            ..default
        };
        if let Some(sigma) = sensor.sigma_bins {
            configuration.echo_guard_bins = echo_guard_bins(sigma);
        }
        let requested = (sensor.dither_bins, sensor.dither_seed);
        (configuration.dither_bins, configuration.dither_seed) = self
            .dither_of_laser
            .unwrap_or((requested.0.unwrap_or(0), requested.1.unwrap_or(0)));
        configuration.echoes = detection.last_echo()?;
        configuration.dead_time = Some(self.dead_time(bins)?);
        configuration.neighbours = detection.confirming()?;
        if configuration.neighbours.is_some()
            && configuration.dead_time > Some(0)
            && self.run.frame.is_none()
        {
            let reason = "cannot be used with a dead time; `dead_time` 0 leaves it out";
            return Err(Refused::new("neighbours", reason).into());
        }
        if let Some(window) = detection.depth_window(sensor.sigma_bins)? {
            configuration.estimator = DepthEstimator::CentredWindow(window);
        }
        configuration.rule = detection.rule(sensor.sigma_bins, |share| {
            z_for_share(share, &configuration, bins, detection.levels(), decide_once)
        })?;
        configuration.binning = detection.blocks()?;
        Ok(configuration)
    }

    /// A file with `settings`, and the rest of this one.
    #[must_use]
    pub fn with_settings(&self, settings: &Settings) -> Self {
        let (masked, offsets_mm) = (&settings.masked, &settings.offsets_mm);
        let configuration = &settings.configuration;
        Self {
            sensor: SensorSettings {
                bins: u16::try_from(settings.bins).ok(),
                bin_width_ps: Some(configuration.bin_width_ps),
                offset_mm: Some(configuration.offset_mm),
                offsets_mm: (!offsets_mm.is_empty()).then(|| offsets_mm.clone()),
                gate: settings.gate(),
                masked: (!masked.is_empty()).then(|| masked.clone()),
                sigma_bins: settings.sigma_bins,
                dead_time: match settings.dead_time() {
                    // Written only if it overrides the sensor's.
                    0 => self.sensor.dead_time.filter(|&bins| bins == 0),
                    bins => Some(bins),
                },
                ..self.sensor.clone()
            },
            detection: self.detection.with_settings(settings),
            rays: self.rays.clone(),
            run: RunSettings {
                seed: Some(settings.seed),
                frame: settings.frame,
                decide_once: settings.decide_once.then_some(true),
                ..self.run.clone()
            },
            dead_time_of_sensor: self.dead_time_of_sensor,
            dither_of_laser: self.dither_of_laser,
            file: self.file.clone(),
        }
    }

    /// Why a dead time shorter than a histogram cannot be used, if it cannot.
    ///
    /// Only the window rule weighs bins by their live laser cycles, and only those of pixels. For all
    /// others a TDC of the first photon is known, but no shorter dead time.
    #[must_use]
    pub fn dead_time_obstacle(&self) -> Option<&'static str> {
        let Self { detection, run, .. } = self;
        let obstacles = [
            (
                detection.rule != Some(RuleName::Window),
                "is for `rule` window",
            ),
            (
                detection.binning.unwrap_or(0) > 0,
                "cannot be used with `binning`",
            ),
            (run.frame.is_some(), "cannot be used with `frame`"),
        ];
        let obstacle = obstacles.iter().find(|(is_there, _)| *is_there);
        obstacle.map(|(_, reason)| *reason)
    }

    /// The dead time of the settings, or else that of the sensor if it can be used.
    fn dead_time(&self, bins: usize) -> Result<u16, Refused> {
        let whole = u16::try_from(bins).unwrap_or(u16::MAX);
        let obstacle = self.dead_time_obstacle();
        let is_short = |dead_time: u16| (1..whole).contains(&dead_time);
        match (self.sensor.dead_time, obstacle) {
            (Some(dead_time), Some(reason)) if is_short(dead_time) => {
                let reason = format!("{reason}, unless it is {bins} bins or more");
                Err(Refused::value("dead_time", dead_time, reason))
            }
            (Some(dead_time), _) => Ok(dead_time.min(whole)),
            (None, _) => {
                let of_sensor = self.dead_time_of_sensor.unwrap_or(0);
                let is_used = obstacle.is_none() || !is_short(of_sensor);
                Ok(if is_used { of_sensor.min(whole) } else { 0 })
            }
        }
    }
}

/// The z for a share of exposures with a false alarm. A single decision is a single look.
fn z_for_share(
    share: f64,
    configuration: &Configuration,
    bins: usize,
    levels: BlockLevel,
    decide_once: bool,
) -> Result<U4F12> {
    let Configuration {
        gate, x, l1, l2, ..
    } = *configuration;
    // Only the number of bins within the gate matters.
    let range = RangeGate::<1024>::new(gate.0, gate.1);
    let range = range.map_err(|error| no_gate(gate, bins, error))?;
    let (x, l1, l2) = match decide_once {
        true => (1, 0, 2),
        false => (x, l1, l2),
    };
    let z = z_for_levels(one_in(share), &range, x, l1, l2, levels);
    ensure!(
        z < HIGHEST_Z,
        Refused::value(
            "false_alarm",
            share,
            "there is no z for so few; `z` may be up to 15.9998"
        )
    );
    Ok(z)
}

impl DetectionSettings {
    /// This section with what `settings` say. What its pulse or a default says is written only if this section does.
    fn with_settings(&self, settings: &Settings) -> Self {
        let configuration = &settings.configuration;
        let with_alpha = |name, threshold: &Threshold| {
            let detection = Self {
                rule: Some(name),
                alpha: Some(threshold.alpha()),
                ..Self::default()
            };
            (detection, threshold.minimum_count())
        };
        let (rule, minimum) = match configuration.rule {
            AnyRule::Paper(rule) => with_alpha(RuleName::Paper, rule.threshold()),
            AnyRule::Average(rule) => with_alpha(RuleName::Average, rule.threshold()),
            AnyRule::Window(rule) => {
                let detection = Self {
                    rule: Some(RuleName::Window),
                    window: Some(rule.width()),
                    z: Some(rule.z()),
                    ..Self::default()
                };
                (detection, rule.minimum_count())
            }
        };
        let suits = settings.sigma_bins.map(CentredWindow::for_pulse);
        let (estimator, half_widths) = match configuration.estimator {
            DepthEstimator::Centroid3 => {
                let asked = self.estimator == Some(EstimatorName::Centroid);
                let centroid = asked || suits.is_some();
                (centroid.then_some(EstimatorName::Centroid), None)
            }
            DepthEstimator::CentredWindow(window) => {
                let asked = self.half_widths == Some(window) || suits != Some(window);
                let window = asked.then_some(window);
                (window.map(|_| EstimatorName::Window), window)
            }
        };
        let binning = configuration.binning;
        let several = configuration.echoes > EchoNumber::FIRST;
        let wait = Some(configuration.echo_wait).filter(|&wait| several && wait < u8::MAX);
        Self {
            min_count: u16::try_from(minimum.raw()).ok(),
            estimator,
            half_widths,
            l1: Some(configuration.l1),
            l2: Some(configuration.l2),
            x: Some(configuration.x),
            binning: binning.map(|binning| binning.levels.raw()),
            patience: binning.map(|binning| binning.patience),
            neighbours: configuration.neighbours.map(Neighbours::raw),
            tracking: configuration.tracking.then_some(true),
            echoes: several.then(|| configuration.echoes.raw()),
            echo_wait: wait,
            once_per_bin: configuration.once_per_bin.then_some(true),
            counter_bits: Some(settings.counter_bits).filter(|&bits| bits != 10),
            ..rule
        }
    }
}

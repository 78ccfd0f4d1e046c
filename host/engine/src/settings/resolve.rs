//! From the settings file to the settings of an engine, and back.

use anyhow::{Result, ensure};
use dtof_core::Count8;
use dtof_link::{Configuration, Refusal, Source};

use super::engine::{Settings, echo_guard_bins};
use super::{RuleName, RunSettings, SensorSettings, SettingsFile};
use dtof_data::options::Refused;

impl Settings {
    /// The demo's: blocks of 4×4 pixels and two echoes, with the window rule and one false alarm in
    /// a hundred exposures.
    ///
    /// # Errors
    /// Never fails: the text is a part of the program.
    pub fn demo(seed: u64) -> Result<Self> {
        let mut file = SettingsFile::parse(
            "[sensor]
             sigma_bins = 1
             [detection]
             rule = 'window'
             binning = 2
             echoes = 2
             echo_wait = 4",
        )?;
        file.run.seed = Some(seed);
        file.settings(128)
    }
}

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
        let settings = Settings {
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
        };
        // A frame builds no array, which would refuse both.
        if configuration.neighbours.is_some() && configuration.binning.is_some() {
            return Err(settings.refused(Refusal::Neighbours).into());
        }
        Ok(settings)
    }

    /// How an array of histograms with `bins` bins operates.
    fn configuration(&self, bins: usize, decide_once: bool) -> Result<Configuration> {
        let Self {
            sensor, detection, ..
        } = self;
        // The engine refuses a number of bins that is not one.
        #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
        let last_bin = bins.clamp(8, 1024) as u16 - 1;
        let requested = (sensor.dither_bins, sensor.dither_seed);
        let (dither_bins, dither_seed) = self
            .dither_of_laser
            .unwrap_or((requested.0.unwrap_or(0), requested.1.unwrap_or(0)));
        let default = Configuration::DEFAULT;
        let of_sensor = Configuration {
            gate: sensor.gate.unwrap_or((0, last_bin)),
            dead_time: Some(self.dead_time(bins)?),
            dither_bins,
            dither_seed,
            bin_width_ps: sensor.bin_width_ps.unwrap_or(default.bin_width_ps),
            offset_mm: sensor.offset_mm.unwrap_or(default.offset_mm),
            echo_guard_bins: sensor
                .sigma_bins
                .map_or(default.echo_guard_bins, echo_guard_bins),
            source: Source::Link,
            ..default
        };
        detection.configuration(of_sensor, sensor.sigma_bins, bins, decide_once)
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
                gate: settings
                    .gate()
                    .or(self.sensor.gate.filter(|&gate| gate == configuration.gate)),
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

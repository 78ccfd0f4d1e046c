//! How pixels decide: the section `[detection]` of a file.

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::paper::Threshold;
use dtof_core::rule::{HIGHEST_Z, z_for_levels};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, DepthEstimator, EchoNumber, Neighbours,
    PaperRule, RangeGate, WindowRule, WindowWidthError,
};
use dtof_data::options::numbers::one_in;
use dtof_link::{AdaptiveBinning, Configuration};
use serde::Serialize;
use serde::ser::{Error as _, Serializer};

use super::engine::{Settings, no_gate};
use super::sections::decimal;
use dtof_data::named_values;
use dtof_data::option_table;
use dtof_data::options::Refused;
use dtof_data::options::keys::{Kind, Reader, above_zero, boolean, choice, fixed, integer, named};
use dtof_data::options::numbers::{self, shortest};

named_values! {
    /// The rules.
    #[derive(Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum RuleName {
        /// The highest bin against the background of two quadrants, as on the paper's FPGA
        Paper = "paper",
        /// The highest bin against the average of all bins, as the paper defines the background
        Average = "average",
        /// All photons in a window around the highest bin against all the others
        Window = "window",
    }
}

named_values! {
    /// The estimators.
    #[derive(Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum EstimatorName {
        /// The centroid of three bins
        Centroid = "centroid",
        /// The photons of a window that moves onto the pulse and suits its width, or has half widths
        Window = "window",
    }
}

/// Shares of exposures without a target that end with an event.
pub const FALSE_ALARM: Reader<f64> = above_zero(0.1);

option_table! {
    /// Everything that is left out has a default. `x`, `l1` and `l2` are the paper's names of the interval
    /// between looks, and of the shortest and the longest exposure. A look is one check whether a pixel has
    /// an event.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct DetectionSettings {
        rule: RuleName = named(), "RULE",
            "Detection rule, which decides whether a peak is a target [default: paper]",
            "paper, average or window";
        #[serde(serialize_with = "decimal")]
        alpha: U8F8 = fixed(), "ALPHA",
            "Rules paper and average: threshold above the background in its standard deviations, 0 to 255.996, rounded \
             to 1/256 [default: 4]",
            "standard deviations, of rules paper and average";
        window: u8 = integer(1, WindowRule::MAX_WIDTH as u64), "BINS",
            "Window rule: bins in the window, 1 to 7 [default: from `sigma_bins`]",
            "bins, of rule window";
        #[serde(serialize_with = "decimal")]
        z: U4F12 = fixed(), "Z",
            "Window rule: threshold of the photons in the window above the background in its standard deviations, 0 to \
             15.9998, rounded to 1/4096 [default: from `false_alarm`]",
            "standard deviations, of rule window";
        false_alarm: f64 = FALSE_ALARM, "SHARE",
            "Window rule, instead of `z`: share of exposures without a target that end with an event, at most 0.1 \
             [default: 0.01]",
            "share of exposures without a target, instead of z";
        estimator: EstimatorName = named(), "ESTIMATOR",
            "Estimator of the position of a peak [default: window with `sigma_bins` or `half_widths`, else centroid]",
            "centroid or window";
        #[serde(serialize_with = "two_numbers")]
        half_widths: CentredWindow = HALF_WIDTHS, "BEFORE,AFTER",
            "Estimator window: bins before and after its centre, 1 to 4 each, rounded to 1/256. A longer part after \
             suits a pulse that falls more slowly than it rises [default: from `sigma_bins`]",
            "bins before and after the place, of estimator window";
        min_count: u16 = integer(1, 1023), "N",
            "Fewest photons in a reported peak, or in the window around it [default: 5]",
            "photons";
        l1: u16 = integer(0, 65_535), "N",
            "Shortest exposure: pixels decide after more than N laser cycles [default: 40]",
            "laser cycles that a decision must exceed";
        l2: u16 = integer(0, 65_535), "N",
            "Longest exposure: a pixel without an event starts over after N laser cycles [default: 2000]",
            "laser cycles at which a pixel starts over";
        x: u16 = integer(1, 65_535), "N",
            "Laser cycles between two decisions [default: 4]",
            "laser cycles between looks";
        binning: u8 = integer(0, BlockLevel::MAX.raw() as u64), "LEVELS",
            "Levels of adaptive binning, 0 to 3: pixels without events also count in blocks, at level 1 of 2x2 pixels, \
             at 2 of 4x4 and at 3 of 8x8 [default: 0]",
            "levels of blocks";
        patience: u16 = integer(1, 65_535), "N",
            "Adaptive binning: laser cycles without an event after which a pixel also counts in its block [default: 64]",
            "laser cycles until a silent pixel counts in its block";
        neighbours: u8 = choice(&[0, 4, 8]), "N",
            "Window rule: the 4 or 8 pixels around a pixel confirm what is not enough by itself. For arrays, without \
             `binning` [default: 0]",
            "pixels around a pixel that confirm it";
        tracking: bool = boolean(), "YES",
            "Window rule: expect the next event of a pixel near its last, with a lower threshold there and a higher one \
             elsewhere",
            "expect the next event near the last";
        echoes: u8 = integer(1, EchoNumber::LAST.raw() as u64), "N",
            "Most echoes of a pixel in an exposure, 1 to 4. With 2 or more the exposure goes on until all are found or \
             `echo_wait` ends it [default: 1]",
            "of an exposure";
        echo_wait: u8 = integer(2, 254), "TIMES",
            "Two or more echoes: an exposure ends at this multiple of its length at the last echo [default: it ends at \
             L2]",
            "times the laser cycles of the last echo";
        once_per_bin: bool = boolean(), "YES",
            "Photons of one laser cycle in one bin count once, so that raindrops are no targets. For photons, not for \
             histograms",
            "photons of one laser cycle in one bin count once";
        counter_bits: u8 = choice(&[8, 10]), "N",
            "Bits of a pixel's counters, 8 or 10. With 8 an exposure ends without an event once a counter passes 255. A \
             device has one of both [default: 10]",
            "of a pixel's counters";
    }
}

impl DetectionSettings {
    /// These settings, and those of `other` that they lack, except numbers of another rule and of what is
    /// switched off.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        let decided = self.rule.or(other.rule);
        if decided != other.rule {
            // A file without a rule may have numbers of any: those of the requested one are kept.
            let is_open = other.rule.is_none();
            let is_window = decided == Some(RuleName::Window);
            if !is_open || is_window {
                other.alpha = None;
            }
            if !is_open || !is_window {
                other = Self {
                    window: None,
                    z: None,
                    false_alarm: None,
                    neighbours: None,
                    tracking: None,
                    ..other
                };
            }
        }
        if self.estimator == Some(EstimatorName::Centroid) {
            other.half_widths = None;
        }
        // What is switched off has no numbers.
        if self.binning == Some(0) {
            other.patience = None;
        }
        if self.echoes == Some(1) {
            other.echo_wait = None;
        }
        if self.z.is_some() || self.false_alarm.is_some() {
            (other.z, other.false_alarm) = (None, None);
        }
        self.first_of(other)
    }

    /// The first key that is set and that only the window rule has.
    #[must_use]
    pub fn of_window_rule(&self) -> Option<&'static str> {
        let keys = [
            ("window", self.window.is_some()),
            ("z", self.z.is_some()),
            ("false_alarm", self.false_alarm.is_some()),
            ("neighbours", self.neighbours.unwrap_or(0) > 0),
            ("tracking", self.tracking == Some(true)),
        ];
        let key = keys.iter().find(|(_, is_set)| *is_set);
        key.map(|(key, _)| *key)
    }

    /// `of_sensor` with the settings of this section. A single decision is a single look.
    ///
    /// # Errors
    /// Fails if settings contradict each other.
    pub(super) fn configuration(
        &self,
        of_sensor: Configuration,
        sigma_bins: Option<U8F8>,
        bins: usize,
        decide_once: bool,
    ) -> Result<Configuration> {
        let mut configuration = Configuration {
            x: self.x.unwrap_or(of_sensor.x),
            l1: self.l1.unwrap_or(of_sensor.l1),
            l2: self.l2.unwrap_or(of_sensor.l2),
            echoes: self.last_echo()?,
            echo_wait: self.echo_wait.unwrap_or(of_sensor.echo_wait),
            neighbours: self.neighbours.and_then(Neighbours::new),
            tracking: self.tracking.unwrap_or(of_sensor.tracking),
            once_per_bin: self.once_per_bin.unwrap_or(of_sensor.once_per_bin),
            ..of_sensor
        };
        if let Some(window) = self.depth_window(sigma_bins)? {
            configuration.estimator = DepthEstimator::CentredWindow(window);
        }
        configuration.rule = self.rule(sigma_bins, |share| {
            z_for_share(share, &configuration, bins, self.levels(), decide_once)
        })?;
        configuration.binning = self.blocks()?;
        Ok(configuration)
    }

    /// The rule. `z_for` gives the z for a share of false alarms.
    ///
    /// # Errors
    /// Fails if a number is for another rule, or missing.
    pub(super) fn rule(
        &self,
        sigma_bins: Option<U8F8>,
        z_for: impl FnOnce(f64) -> Result<U4F12>,
    ) -> Result<AnyRule> {
        let minimum_count = Count::saturating(self.min_count.unwrap_or(5).into());
        let name = self.rule.unwrap_or(RuleName::Paper);
        if name != RuleName::Window
            && let Some(key) = self.of_window_rule()
        {
            bail!(Refused::new(key, "is for `rule` window"));
        }
        let alpha = self.alpha.unwrap_or(const { U8F8::lit("4") });
        Ok(match name {
            RuleName::Paper => PaperRule::new(alpha, minimum_count).into(),
            RuleName::Average => AverageRule::new(alpha, minimum_count).into(),
            RuleName::Window => {
                ensure!(
                    self.alpha.is_none(),
                    Refused::new(
                        "alpha",
                        "is for `rule` paper or average; `rule` window takes `z` or `false_alarm`"
                    )
                );
                let suits = sigma_bins.map(WindowRule::width_for_pulse);
                let width = self
                    .window
                    .or(suits)
                    .ok_or_else(|| Refused::new("rule", "window needs `window` or `sigma_bins`"))?;
                let z = match self.z {
                    Some(z) => z,
                    None => z_for(self.false_alarm.unwrap_or(0.01))?,
                };
                let rule = WindowRule::new(width, z, minimum_count);
                let refused =
                    |error: WindowWidthError| Refused::value("window", width, error.to_string());
                rule.map_err(refused)?.into()
            }
        })
    }

    /// The highest level of blocks; [`BlockLevel::PIXEL`] without blocks.
    pub(super) fn levels(&self) -> BlockLevel {
        BlockLevel::saturating(self.binning.unwrap_or(0))
    }

    /// The blocks of pixels, if there are any.
    ///
    /// # Errors
    /// Fails if there is a patience without blocks.
    pub(super) fn blocks(&self) -> Result<Option<AdaptiveBinning>> {
        let levels = self.levels();
        let has_blocks = levels != BlockLevel::PIXEL;
        ensure!(
            has_blocks || self.patience.is_none(),
            Refused::new("patience", "is for `binning`")
        );
        Ok(has_blocks.then(|| AdaptiveBinning {
            levels,
            patience: self.patience.unwrap_or(AdaptiveBinning::PATIENCE),
        }))
    }

    /// The last echo of an exposure.
    ///
    /// # Errors
    /// Fails if there is a wait without a second echo.
    pub(super) fn last_echo(&self) -> Result<EchoNumber> {
        let echoes = EchoNumber::new(self.echoes.unwrap_or(1)).unwrap_or(EchoNumber::FIRST);
        ensure!(
            echoes > EchoNumber::FIRST || self.echo_wait.is_none(),
            Refused::new("echo_wait", "is for `echoes` of 2 or more")
        );
        Ok(echoes)
    }

    /// The window of the depth: with these half widths, or as suits the pulse; `None` for the centroid.
    ///
    /// # Errors
    /// Fails if the estimator needs what is not known, or has no window.
    pub(super) fn depth_window(&self, sigma_bins: Option<U8F8>) -> Result<Option<CentredWindow>> {
        let window = self.half_widths;
        let suits = window.or(sigma_bins.map(CentredWindow::for_pulse));
        match self.estimator {
            Some(EstimatorName::Window) if suits.is_none() => {
                let reason = "window needs `sigma_bins` or `half_widths`";
                Err(Refused::new("estimator", reason).into())
            }
            Some(EstimatorName::Centroid) if window.is_some() => {
                Err(Refused::new("half_widths", "is for `estimator` window").into())
            }
            Some(EstimatorName::Centroid) => Ok(None),
            _ => Ok(suits),
        }
    }

    /// This section with what `settings` say. What its pulse or a default says is written only if this section does.
    pub(super) fn with_settings(&self, settings: &Settings) -> Self {
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

const HALF_WIDTHS: Reader<CentredWindow> =
    Reader::new(Kind::Numbers("two numbers, [1.75, 4]"), |_, text| {
        half_widths(text)
    });

/// Reads `BEFORE,AFTER`: the half widths of the depth window.
///
/// # Errors
/// Fails if they are not two numbers of bins from 1 to 4.
fn half_widths(text: &str) -> Result<CentredWindow, String> {
    let sides = text.split_once(',');
    let sides = sides.and_then(|(before, after)| {
        let [before, after] = [before, after].map(|side| numbers::fixed::<U8F8>(side).ok());
        CentredWindow::with_sides(before?, after?)
    });
    sides.ok_or_else(|| {
        "must be BEFORE,AFTER, each 1 to 4 bins, as 2,3.5; in a file [2, 3.5]".to_owned()
    })
}

/// Half widths as a list, with the fewest digits.
fn two_numbers<S: Serializer>(
    window: &Option<CentredWindow>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let Some(window) = window else {
        return serializer.serialize_none();
    };
    let number = |side| shortest(side).parse::<f64>().map_err(S::Error::custom);
    [number(window.before())?, number(window.after())?].serialize(serializer)
}

//! How pixels decide: the section `[detection]` of a file.

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, EchoNumber, Neighbours, PaperRule,
    WindowRule, WindowWidthError,
};
use dtof_link::AdaptiveBinning;
use serde::Serialize;
use serde::ser::{Error as _, Serializer};

use super::sections::{decimal, section};
use dtof_options::numbers::{boolean, fixed, integer, real, shortest};
use dtof_options::{NO_OPTION, Refused, named, named_values};

/// Everything that is left out has a default. `x`, `l1` and `l2` are the paper's names of the interval
/// between looks, and of the shortest and the longest exposure. A look is one check whether a pixel has
/// an event.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DetectionSettings {
    /// The detection rule [default: paper]
    pub rule: Option<RuleName>,
    /// Rules paper and average: threshold in standard deviations, 0 to 255.996 in steps of 1/256 [default: 4]
    #[serde(serialize_with = "decimal")]
    pub alpha: Option<U8F8>,
    /// Window rule: width in bins, 1 to 7 [default: from `sigma_bins`]
    pub window: Option<u8>,
    /// Window rule: threshold in standard deviations, 0 to 15.9998 in steps of 1/4096 [default: from
    /// `false_alarm`]
    #[serde(serialize_with = "decimal")]
    pub z: Option<U4F12>,
    /// Window rule: share of exposures with a false alarm, at most 0.1; instead of `z` [default: 0.01]
    pub false_alarm: Option<f64>,
    /// The depth estimator [default: window if `sigma_bins` or `half_widths` are known, else centroid]
    pub estimator: Option<EstimatorName>,
    /// Bins of the depth window before and after its centre, 1 to 4 each, in steps of 1/256 [default: from
    /// `sigma_bins`]
    #[serde(serialize_with = "two_numbers")]
    pub half_widths: Option<CentredWindow>,
    /// Minimum of photons in a peak, or in the window around it, 1 to 1023 [default: 5]
    pub min_count: Option<u16>,
    /// Laser cycles that a decision must exceed [default: 40]
    pub l1: Option<u16>,
    /// Laser cycles after which a pixel without an event starts over [default: 2000]
    pub l2: Option<u16>,
    /// Laser cycles between looks [default: 4]
    pub x: Option<u16>,
    /// Levels of adaptive binning, 0 to 3 [default: 0]
    pub binning: Option<u8>,
    /// Laser cycles without an event after which a pixel counts in its block, at least 1 [default: 64]
    pub patience: Option<u16>,
    /// Window rule: neighbours of a pixel that confirm what is not enough by itself, 0, 4 or 8 [default: 0]
    pub neighbours: Option<u8>,
    /// Window rule: a lower threshold near the last event, and a higher one elsewhere
    pub tracking: Option<bool>,
    /// Most echoes in an exposure, 1 to 4 [default: 1]
    pub echoes: Option<u8>,
    /// An exposure ends at this multiple of its length at the last echo, 2 to 254 [default: at L2]
    pub echo_wait: Option<u8>,
    /// Photons of one laser cycle in one bin count once
    pub once_per_bin: Option<bool>,
    /// Bits of a pixel's counters, 8 or 10 [default: 10]
    pub counter_bits: Option<u8>,
}

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

section! {
    DetectionSettings:
    rule = named, "paper, average or window";
    alpha = fixed, "standard deviations, of rules paper and average";
    window = integer(1..=WindowRule::MAX_WIDTH), "bins, of rule window";
    z = fixed, "standard deviations, of rule window";
    false_alarm = share, "share of exposures without a target, instead of z";
    estimator = named, "centroid or window";
    half_widths = half_widths, "bins before and after the place, of estimator window";
    min_count = integer(1..=1023), "photons";
    l1 = integer(0..=u16::MAX), "laser cycles that a decision must exceed";
    l2 = integer(0..=u16::MAX), "laser cycles at which a pixel starts over";
    x = integer(0..=u16::MAX), "laser cycles between looks";
    binning = integer(0..=BlockLevel::MAX.raw()), "levels of blocks";
    patience = integer(1..=u16::MAX), "laser cycles until a silent pixel counts in its block";
    neighbours = neighbours, "pixels around a pixel that confirm it";
    tracking = boolean, "expect the next event near the last";
    echoes = integer(1..=EchoNumber::LAST.raw()), "of an exposure";
    echo_wait = integer(2..=u8::MAX - 1), "times the laser cycles of the last echo";
    once_per_bin = boolean, "photons of one laser cycle in one bin count once";
    counter_bits = counter_bits, "of a pixel's counters";
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
        if name != RuleName::Window {
            let of_window = [
                ("window", self.window.is_some()),
                ("z", self.z.is_some()),
                ("false_alarm", self.false_alarm.is_some()),
                ("neighbours", self.neighbours.unwrap_or(0) > 0),
                ("tracking", self.tracking == Some(true)),
            ];
            if let Some((key, _)) = of_window.iter().find(|option| option.1) {
                bail!(Refused::new(*key, "is for `rule` window"));
            }
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

    /// The neighbours that confirm, if any do.
    ///
    /// # Errors
    /// Fails if there are blocks, too.
    pub(super) fn confirming(&self) -> Result<Option<Neighbours>> {
        let neighbours = self.neighbours.and_then(Neighbours::new);
        ensure!(
            neighbours.is_none() || self.levels() == BlockLevel::PIXEL,
            Refused::new("neighbours", "cannot be used with `binning`")
        );
        Ok(neighbours)
    }

    /// The last echo of an exposure, and how long a pixel waits for the next.
    ///
    /// # Errors
    /// Fails if there is a wait without a second echo.
    pub(super) fn several(&self) -> Result<(EchoNumber, Option<u8>)> {
        let echoes = EchoNumber::new(self.echoes.unwrap_or(1)).unwrap_or(EchoNumber::FIRST);
        ensure!(
            echoes > EchoNumber::FIRST || self.echo_wait.is_none(),
            Refused::new("echo_wait", "is for `echoes` of 2 or more")
        );
        Ok((echoes, self.echo_wait))
    }
}

/// Reads a share of false alarms.
///
/// # Errors
/// Fails if it is not above 0 and at most 0.1.
pub fn share(text: &str) -> Result<f64, String> {
    let share = real(text).filter(|&share| share > 0.0 && share <= 0.1);
    share.ok_or("must be a number above 0, at most 0.1".to_owned())
}

/// Reads a number of neighbours.
fn neighbours(text: &str) -> Result<u8, String> {
    let number = integer(0..=8)(text).ok();
    let number = number.filter(|&number| number == 0 || Neighbours::new(number).is_some());
    number.ok_or("must be 0, 4 or 8".to_owned())
}

/// Reads the width of counters.
fn counter_bits(text: &str) -> Result<u8, String> {
    let bits = integer(0..=u8::MAX)(text).ok();
    let bits = bits.filter(|bits| [8, 10].contains(bits));
    bits.ok_or("must be 8 or 10".to_owned())
}

/// Reads `BEFORE,AFTER`: the half widths of the depth window.
///
/// # Errors
/// Fails if they are not two numbers of bins from 1 to 4.
fn half_widths(text: &str) -> Result<CentredWindow, String> {
    let sides = text.split_once(',');
    let sides = sides.and_then(|(before, after)| {
        let [before, after] = [before, after].map(|side| fixed::<U8F8>(side).ok());
        CentredWindow::with_sides(before?, after?)
    });
    sides.ok_or_else(|| "must be BEFORE,AFTER, each 1 to 4 bins, as 2,3.5".to_owned())
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

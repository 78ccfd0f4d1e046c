//! How pixels decide: the section `[detection]` of a file.

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, EchoNumber, PaperRule, WindowRule,
    WindowWidthError,
};
use dtof_link::AdaptiveBinning;
use serde::Serialize;
use serde::ser::{Error as _, Serializer};

use super::sections::{decimal, first_of};
use dtof_options::numbers::{fixed, real, shortest, truth, whole};
use dtof_options::{NO_OPTION, Named, Refused, named};

/// What is not given has its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Detection {
    /// The rule that decides whether a peak stands clear of the background [default: paper]
    pub rule: Option<RuleName>,
    /// Rules paper and average: standard deviations of the background a peak must exceed it by, 0 to 255.996,
    /// rounded to 1/256 [default: 4]
    #[serde(serialize_with = "decimal")]
    pub alpha: Option<U8F8>,
    /// Window rule: bins in the window, 1 to 7 [default: as suits `sigma_bins`]
    pub window: Option<u8>,
    /// Window rule: standard deviations of the background the photons in the window must exceed it
    /// by, 0 to 15.9998, rounded to 1/4096
    #[serde(serialize_with = "decimal")]
    pub z: Option<U4F12>,
    /// Window rule, instead of `z`: the share of exposures without a target that may end with an
    /// event, at most 0.1 [default: 0.01]
    pub false_alarm: Option<f64>,
    /// Where in its bins a peak lies [default: window if `sigma_bins` or `half_widths` are known, else centroid]
    pub estimator: Option<EstimatorName>,
    /// How far the window that the depth comes from reaches before and after its place, in bins:
    /// 1 to 4 each, rounded to 1/256. More after than before suits a pulse that falls more slowly
    /// than it rises [default: both as suits `sigma_bins`]
    #[serde(serialize_with = "two_numbers")]
    pub half_widths: Option<CentredWindow>,
    /// Photons a reported peak, or the window around it, holds at least [default: 5]
    pub min_count: Option<u16>,
    /// The exposure a decision must exceed, in laser cycles [default: 40]
    pub l1: Option<u16>,
    /// The exposure at which a pixel starts over without an event, in laser cycles [default: 2000]
    pub l2: Option<u16>,
    /// Laser cycles between looks [default: 4]
    pub x: Option<u16>,
    /// Adaptive binning: pixels that stay silent also count together, in blocks of 2x2 pixels,
    /// from level 2 on 4x4 and at level 3 8x8 [default: 0]
    pub binning: Option<u8>,
    /// Adaptive binning: laser cycles without an event after which a pixel counts in its block,
    /// too [default: 64]
    pub patience: Option<u16>,
    /// Window rule: expect the next event of a pixel near its last, and spend half of the false
    /// alarms there
    pub tracking: Option<bool>,
    /// Echoes that a pixel reports in an exposure, 1 to 4. From 2 on it goes on until it has them
    /// all, or has waited for the next [default: 1]
    pub echoes: Option<u8>,
    /// Two or more echoes: an exposure ends once it is so many times as long as it was at its
    /// last echo [default: it goes on until L2]
    pub echo_wait: Option<u8>,
}

/// The rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RuleName {
    /// The highest bin against the background of two quadrants, as on the paper's FPGA
    Paper,
    /// The highest bin against the average of all bins, as the paper defines the background
    Average,
    /// All photons in a window around the highest bin against all the others
    Window,
}

impl Named for RuleName {
    const NAMES: &'static [(&'static str, Self, &'static str)] = &[
        (
            "paper",
            Self::Paper,
            "The highest bin against the background of two quadrants, as on the paper's FPGA",
        ),
        (
            "average",
            Self::Average,
            "The highest bin against the average of all bins, as the paper defines the background",
        ),
        (
            "window",
            Self::Window,
            "All photons in a window around the highest bin against all the others",
        ),
    ];
}

/// The estimators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorName {
    /// The centroid of three bins
    Centroid,
    /// The photons of a window that moves onto the pulse and suits `sigma_bins`, or has `half_widths`
    Window,
}

impl Named for EstimatorName {
    const NAMES: &'static [(&'static str, Self, &'static str)] = &[
        ("centroid", Self::Centroid, "The centroid of three bins"),
        (
            "window",
            Self::Window,
            "The photons of a window that moves onto the pulse and suits its width, or has half widths",
        ),
    ];
}

impl Detection {
    /// The keys of the section.
    pub const KEYS: &'static [&'static str] = &[
        "rule",
        "alpha",
        "window",
        "z",
        "false_alarm",
        "estimator",
        "half_widths",
        "min_count",
        "l1",
        "l2",
        "x",
        "binning",
        "patience",
        "tracking",
        "echoes",
        "echo_wait",
    ];

    /// Sets one of [`Self::KEYS`].
    ///
    /// # Errors
    /// Why it cannot be so.
    pub(super) fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        match key {
            "rule" => self.rule = Some(named(text)?),
            "alpha" => self.alpha = Some(fixed(text)?),
            "window" => self.window = Some(whole(1..=WindowRule::MAX_WIDTH)(text)?),
            "z" => self.z = Some(fixed(text)?),
            "false_alarm" => self.false_alarm = Some(share(text)?),
            "estimator" => self.estimator = Some(named(text)?),
            "half_widths" => self.half_widths = Some(half_widths(text)?),
            "min_count" => self.min_count = Some(whole(1..=1023)(text)?),
            "l1" => self.l1 = Some(whole(0..=u16::MAX)(text)?),
            "l2" => self.l2 = Some(whole(0..=u16::MAX)(text)?),
            "x" => self.x = Some(whole(0..=u16::MAX)(text)?),
            "binning" => self.binning = Some(whole(0..=BlockLevel::MAX.raw())(text)?),
            "patience" => self.patience = Some(whole(1..=u16::MAX)(text)?),
            "tracking" => self.tracking = Some(truth(text)?),
            "echoes" => self.echoes = Some(whole(1..=EchoNumber::LAST.raw())(text)?),
            "echo_wait" => self.echo_wait = Some(whole(2..=u8::MAX - 1)(text)?),
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }

    /// These, and of `other` what these do not say. The numbers of another rule are not
    /// taken.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        let decided = self.rule.or(other.rule);
        if decided != other.rule {
            other = Self {
                alpha: None,
                window: None,
                z: None,
                false_alarm: None,
                tracking: None,
                ..other
            };
        }
        if self.estimator == Some(EstimatorName::Centroid) {
            other.half_widths = None;
        }
        if self.z.is_some() || self.false_alarm.is_some() {
            (other.z, other.false_alarm) = (None, None);
        }
        first_of!(
            self, other; rule, alpha, window, z, false_alarm, estimator, half_widths, min_count,
            l1, l2, x, binning, patience, tracking, echoes, echo_wait
        )
    }

    /// Are there two options of which only one can be given?
    ///
    /// # Errors
    /// Which.
    pub(super) fn check(&self) -> Result<(), Refused> {
        if self.z.is_some() && self.false_alarm.is_some() {
            return Err(Refused::new("z", "cannot be used with `false_alarm`"));
        }
        Ok(())
    }

    /// The rule; `z_for` gives the z for a share of false alarms.
    ///
    /// # Errors
    /// A number that belongs to another rule, or is missing.
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

    /// The highest level of blocks; pixels alone without any.
    pub(super) fn levels(&self) -> BlockLevel {
        BlockLevel::saturating(self.binning.unwrap_or(0))
    }

    /// Blocks of pixels, if there are any.
    ///
    /// # Errors
    /// A patience without them.
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

    /// The last echo of an exposure, and how long a pixel waits for the next.
    ///
    /// # Errors
    /// A wait without a second echo.
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
/// If it is not above 0 and at most 0.1.
pub fn share(text: &str) -> Result<f64, String> {
    let share = real(text).filter(|&share| share > 0.0 && share <= 0.1);
    share.ok_or("must be a number above 0, at most 0.1".to_owned())
}

/// Reads `BEFORE,AFTER`: how far the window of the depth reaches.
///
/// # Errors
/// If they are not two numbers of bins from 1 to 4.
fn half_widths(text: &str) -> Result<CentredWindow, String> {
    let sides = text.split_once(',');
    let sides = sides.and_then(|(before, after)| {
        let [before, after] = [before, after].map(|side| fixed::<U8F8>(side).ok());
        CentredWindow::with_sides(before?, after?)
    });
    sides.ok_or_else(|| "must be BEFORE,AFTER, each 1 to 4 bins, as 2,3.5".to_owned())
}

/// Half widths as a list, with as few digits as name them.
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

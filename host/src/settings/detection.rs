//! How pixels decide: options of the command line, and the section `[detection]` of a file.

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::{Args, ValueEnum};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, EchoNumber, PaperRule, WindowRule,
};
use dtof_link::AdaptiveBinning;
use serde::{Deserialize, Serialize};

use super::half_widths::half_widths;
use super::sections::{decimal, first_of};
use crate::cli::arguments::{fixed, real, whole};
use crate::input::range::within;

/// What is not given has its default.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Detection {
    /// The rule that decides whether a peak stands clear of the background [default: paper]
    #[arg(long, value_enum)]
    pub rule: Option<RuleName>,
    /// Rules paper and average: standard deviations of the background a peak must exceed it by, 0 to 255.996,
    /// rounded to 1/256 [default: 4]
    #[arg(long, value_parser = fixed::<U8F8>, allow_hyphen_values = true)]
    #[serde(with = "decimal")]
    pub alpha: Option<U8F8>,
    /// Window rule: bins in the window, 1 to 7 [default: as suits --sigma-bins]
    #[arg(long, value_name = "BINS", value_parser = whole(1..=WindowRule::MAX_WIDTH), allow_hyphen_values = true)]
    pub window: Option<u8>,
    /// Window rule: standard deviations of the background the photons in the window must exceed it
    /// by, 0 to 15.9998, rounded to 1/4096
    #[arg(long, value_parser = fixed::<U4F12>, conflicts_with = "false_alarm", allow_hyphen_values = true)]
    #[serde(with = "decimal")]
    pub z: Option<U4F12>,
    /// Window rule, instead of --z: the share of exposures without a target that may end with an
    /// event, at most 0.1 [default: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub false_alarm: Option<f64>,
    /// Where in its bins a peak lies [default: window if --sigma-bins or --half-widths are known, else centroid]
    #[arg(long, value_enum)]
    pub estimator: Option<EstimatorName>,
    /// How far the window that the depth comes from reaches before and after its place, in bins:
    /// 1 to 4 each, rounded to 1/256. More after than before suits a pulse that falls more slowly
    /// than it rises [default: both as suits --sigma-bins]
    #[arg(long, value_name = "BEFORE,AFTER", value_parser = half_widths)]
    #[serde(with = "super::half_widths")]
    pub half_widths: Option<CentredWindow>,
    /// Photons a reported peak, or the window around it, holds at least [default: 5]
    #[arg(long, value_name = "N", value_parser = whole(1..=1023_u16))]
    pub min_count: Option<u16>,
    /// The exposure a decision must exceed, in laser cycles [default: 40]
    #[arg(long, value_name = "N", value_parser = whole(0..=u16::MAX))]
    pub l1: Option<u16>,
    /// The exposure at which a pixel starts over without an event, in laser cycles [default: 2000]
    #[arg(long, value_name = "N", value_parser = whole(0..=u16::MAX))]
    pub l2: Option<u16>,
    /// Laser cycles between looks [default: 4]
    #[arg(long, value_name = "N", value_parser = whole(0..=u16::MAX))]
    pub x: Option<u16>,
    /// Adaptive binning: pixels that stay silent also count together, in blocks of 2x2 pixels,
    /// from level 2 on 4x4 and at level 3 8x8 [default: 0]
    #[arg(long, value_name = "LEVELS", value_parser = whole(0..=BlockLevel::MAX.raw()))]
    pub binning: Option<u8>,
    /// Adaptive binning: laser cycles without an event after which a pixel counts in its block,
    /// too [default: 64]
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX))]
    pub patience: Option<u16>,
    /// Window rule: expect the next event of a pixel near its last, and spend half of the false
    /// alarms there
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    pub tracking: Option<bool>,
    /// Echoes that a pixel reports in an exposure, 1 to 4. From 2 on it goes on until it has them
    /// all, or has waited for the next [default: 1]
    #[arg(long, value_name = "N", value_parser = whole(1..=EchoNumber::LAST.raw()))]
    pub echoes: Option<u8>,
    /// Two or more echoes: an exposure ends once it is so many times as long as it was at its
    /// last echo [default: it goes on until L2]
    #[arg(long, value_name = "TIMES", value_parser = whole(2..=u8::MAX - 1))]
    pub echo_wait: Option<u8>,
}

/// The rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RuleName {
    /// The highest bin against the background of two quadrants, as on the paper's FPGA
    Paper,
    /// The highest bin against the average of all bins, as the paper defines the background
    Average,
    /// All photons in a window around the highest bin against all the others
    Window,
}

/// The estimators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorName {
    /// The centroid of three bins
    Centroid,
    /// The photons of a window that moves onto the pulse and suits --sigma-bins, or has --half-widths
    Window,
}

impl Detection {
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

    /// Are the numbers of a file within their ranges?
    ///
    /// # Errors
    /// The key that is not.
    pub(super) fn check(&self) -> Result<()> {
        let limits = [
            (
                "window",
                self.window.map(f64::from),
                1,
                WindowRule::MAX_WIDTH.into(),
            ),
            ("min_count", self.min_count.map(f64::from), 1, 1023),
            (
                "binning",
                self.binning.map(f64::from),
                0,
                BlockLevel::MAX.raw().into(),
            ),
            ("patience", self.patience.map(f64::from), 1, u16::MAX),
            (
                "echoes",
                self.echoes.map(f64::from),
                1,
                EchoNumber::LAST.raw().into(),
            ),
            ("echo_wait", self.echo_wait.map(f64::from), 2, 254),
        ];
        for (key, value, least, most) in limits {
            if let Some(value) = value {
                within(key, value, f64::from(least)..=f64::from(most))?;
            }
        }
        if let Some(share) = self.false_alarm {
            share_of(share).map_err(|reason| anyhow!("false_alarm {share}: {reason}"))?;
            ensure!(self.z.is_none(), "z and false_alarm: give one of them");
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
                ("--window", self.window.is_some()),
                ("--z", self.z.is_some()),
                ("--false-alarm", self.false_alarm.is_some()),
                ("--tracking", self.tracking == Some(true)),
            ];
            if let Some((option, _)) = of_window.iter().find(|option| option.1) {
                bail!("{option} is for --rule window");
            }
        }
        let alpha = self.alpha.unwrap_or(const { U8F8::lit("4") });
        Ok(match name {
            RuleName::Paper => PaperRule::new(alpha, minimum_count).into(),
            RuleName::Average => AverageRule::new(alpha, minimum_count).into(),
            RuleName::Window => {
                ensure!(
                    self.alpha.is_none(),
                    "--alpha is for --rule paper or average; --rule window takes --z or --false-alarm"
                );
                let suits = sigma_bins.map(WindowRule::width_for_pulse);
                let width = self
                    .window
                    .or(suits)
                    .context("--rule window needs --window or --sigma-bins")?;
                let z = match self.z {
                    Some(z) => z,
                    None => z_for(self.false_alarm.unwrap_or(0.01))?,
                };
                let rule = WindowRule::new(width, z, minimum_count);
                rule.with_context(|| format!("--window {width}"))?.into()
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
            "--patience is for --binning"
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
            "--echo-wait is for --echoes of 2 or more"
        );
        Ok((echoes, self.echo_wait))
    }
}

/// Reads a share of false alarms.
///
/// # Errors
/// If it is not above 0 and at most 0.1.
pub fn share(text: &str) -> Result<f64, String> {
    share_of(real(text).unwrap_or(0.0))
}

/// `share`, if so many false alarms can be asked for.
fn share_of(share: f64) -> Result<f64, String> {
    let is_share = share > 0.0 && share <= 0.1;
    is_share
        .then_some(share)
        .ok_or("must be a number above 0, at most 0.1".to_owned())
}

//! The options that say which rule decides and which estimator finds the depth, the
//! same for every command.

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use dtof::cli::arguments::{fixed, positive, whole};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, AverageRule, CentredWindow, Count, PaperRule, WindowRule};

#[derive(Args)]
pub struct Detection {
    /// The rule that decides whether a peak stands clear of the background
    #[arg(long, value_enum, default_value_t = RuleName::Paper)]
    rule: RuleName,
    /// Rules paper and average: standard deviations of the background a peak must exceed it by, 0 to 255.996,
    /// rounded to 1/256 [default: 4]
    #[arg(long, value_parser = fixed::<U8F8>, allow_hyphen_values = true)]
    alpha: Option<U8F8>,
    /// Window rule: bins in the window, 1 to 7 [default: as suits --sigma-bins]
    #[arg(long, value_name = "BINS", value_parser = whole(1..=WindowRule::MAX_WIDTH), allow_hyphen_values = true)]
    window: Option<u8>,
    /// Window rule: standard deviations of the background the photons in the window must exceed it
    /// by, 0 to 15.9998, rounded to 1/4096
    #[arg(long, value_parser = fixed::<U4F12>, conflicts_with = "false_alarm", allow_hyphen_values = true)]
    z: Option<U4F12>,
    /// Window rule, instead of --z: the share of exposures without a target that may end with an
    /// event, at most 0.1 [default: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    false_alarm: Option<f64>,
    /// Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. The depth then
    /// comes from a window that suits it [default: the centroid of three bins]
    #[arg(long, value_name = "S", value_parser = sigma, allow_hyphen_values = true)]
    pub sigma_bins: Option<U8F8>,
}

/// The rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RuleName {
    /// The highest bin against the background of two quadrants, as on the paper's FPGA
    Paper,
    /// The highest bin against the average of all bins, as the paper defines the background
    Average,
    /// All photons in a window around the highest bin against all the others
    Window,
}

impl Detection {
    /// The rule; `z_for` gives the z for a share of false alarms.
    pub fn rule(
        &self,
        minimum_count: Count,
        z_for: impl FnOnce(f64) -> Result<U4F12>,
    ) -> Result<AnyRule> {
        match self.rule {
            RuleName::Paper | RuleName::Average => {
                let of_window = [
                    ("--window", self.window.is_some()),
                    ("--z", self.z.is_some()),
                    ("--false-alarm", self.false_alarm.is_some()),
                ];
                if let Some((option, _)) = of_window.iter().find(|option| option.1) {
                    bail!("{option} is for --rule window");
                }
                let alpha = self.alpha.unwrap_or(const { U8F8::lit("4") });
                Ok(match self.rule {
                    RuleName::Average => AverageRule::new(alpha, minimum_count).into(),
                    _ => PaperRule::new(alpha, minimum_count).into(),
                })
            }
            RuleName::Window => {
                if self.alpha.is_some() {
                    bail!(
                        "--alpha is for --rule paper or average; --rule window takes --z or --false-alarm"
                    );
                }
                let suits = self.sigma_bins.map(WindowRule::width_for_pulse);
                let width = self
                    .window
                    .or(suits)
                    .context("--rule window needs --window or --sigma-bins")?;
                let z = match self.z {
                    Some(z) => z,
                    None => z_for(self.false_alarm.unwrap_or(0.01))?,
                };
                let rule = WindowRule::new(width, z, minimum_count);
                Ok(rule.with_context(|| format!("--window {width}"))?.into())
            }
        }
    }
}

fn sigma(text: &str) -> Result<U8F8, String> {
    const WIDEST: U8F8 = CentredWindow::WIDEST_PULSE;
    let sigma = fixed::<U8F8>(text)?;
    if sigma == U8F8::ZERO || sigma > WIDEST {
        return Err(format!("must be above 0 and at most {WIDEST}"));
    }
    Ok(sigma)
}

fn share(text: &str) -> Result<f64, String> {
    let share = positive(text).ok().filter(|share| *share <= 0.1);
    share.ok_or("must be a number above 0, at most 0.1".to_owned())
}

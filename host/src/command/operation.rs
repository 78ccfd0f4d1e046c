//! The options that say how pixels operate, the same for every command.

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::cli::arguments::whole;
use dtof::engine::settings::Settings;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{BlockLevel, Count, EchoNumber, HIGHEST_Z, RangeGate, z_for_levels};
use dtof_link::AdaptiveBinning;
use dtof_theory::tune::window::one_in;

use super::detection::Detection;

#[derive(Args)]
pub struct Operation {
    /// Only these bins may hold the peak, both inclusive [default: all]
    #[arg(long, value_name = "FIRST..LAST", value_parser = gate)]
    gate: Option<(u16, u16)>,
    #[command(flatten)]
    detection: Detection,
    /// Photons a reported peak, or the window around it, holds at least
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole(1..=1023_u16))]
    min_count: u16,
    /// The exposure a decision must exceed, in laser cycles
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = whole(0..=u16::MAX))]
    l1: u16,
    /// The exposure at which a pixel starts over without an event, in laser cycles
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = whole(0..=u16::MAX))]
    l2: u16,
    /// Laser cycles between looks
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole(0..=u16::MAX))]
    x: u16,
    /// Adaptive binning: pixels that stay silent also count together, in blocks of 2x2 pixels,
    /// from level 2 on 4x4 and at level 3 8x8
    #[arg(long, value_name = "LEVELS", default_value_t = 0, value_parser = whole(0..=BlockLevel::MAX.raw()))]
    binning: u8,
    /// Adaptive binning: laser cycles without an event after which a pixel counts in its block,
    /// too
    #[arg(long, value_name = "N", default_value_t = AdaptiveBinning::PATIENCE, requires = "binning", value_parser = whole(1..=u16::MAX))]
    patience: u16,
    /// Window rule: expect the next event of a pixel near its last, and spend half of the false
    /// alarms there
    #[arg(long)]
    tracking: bool,
    /// Echoes that a pixel reports in an exposure, 1 to 4. From 2 on it goes on until it has them
    /// all, or has waited for the next
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1..=EchoNumber::LAST.raw()))]
    echoes: u8,
    /// Two or more echoes: an exposure ends once it is so many times as long as it was at its
    /// last echo [default: it goes on until L2]
    #[arg(long, value_name = "TIMES", requires = "echoes", value_parser = whole(2..=u8::MAX - 1))]
    echo_wait: Option<u8>,
}

/// The option of commands that run on this computer: a device reports events.
#[derive(Args)]
pub struct Frames {
    /// Simulate a frame-based sensor for comparison: every N laser cycles each pixel reads its
    /// highest bin, if that stands above the background
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX),
        conflicts_with_all = ["rule", "alpha", "window", "z", "false_alarm", "min_count", "l1", "l2", "x", "binning", "patience", "tracking", "echoes", "echo_wait"])]
    pub frame: Option<u16>,
}

impl Operation {
    /// Whether blocks of pixels decide together.
    pub const fn has_blocks(&self) -> bool {
        self.binning > 0
    }

    /// With what the options do not say.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub fn settings(
        &self,
        bins: usize,
        bin_width_ps: U16F16,
        offset_mm: I24F8,
        seed: u64,
    ) -> Result<Settings> {
        let levels = BlockLevel::saturating(self.binning);
        let z_for = |share| {
            // Only how many bins the gate leaves counts; a number of bins that cannot be is
            // refused by the engine.
            #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
            let last_bin = bins.clamp(8, 1024) as u16 - 1;
            let (first, last) = self.gate.unwrap_or((0, last_bin));
            let gate = RangeGate::<1024>::new(first, last)
                .with_context(|| format!("--gate {first}..{last} with {bins} bins"))?;
            let (x, l1, l2) = (self.x, self.l1, self.l2);
            let z = z_for_levels(one_in(share), &gate, x, l1, l2, levels);
            ensure!(
                z < HIGHEST_Z,
                "--false-alarm {share}: there is no z for so few; --z may be up to 15.9998"
            );
            Ok(z)
        };
        Ok(Settings {
            bins,
            bin_width_ps,
            offset_mm,
            gate: self.gate,
            rule: self
                .detection
                .rule(Count::saturating(self.min_count.into()), z_for)?,
            sigma_bins: self.detection.sigma_bins,
            l1: self.l1,
            l2: self.l2,
            x: self.x,
            binning: (levels != BlockLevel::PIXEL).then_some(AdaptiveBinning {
                levels,
                patience: self.patience,
            }),
            tracking: self.tracking,
            echoes: EchoNumber::new(self.echoes).unwrap_or(EchoNumber::FIRST),
            echo_wait: self.echo_wait,
            one_hit_tdc: false,
            frame: None,
            seed,
        })
    }
}

fn gate(text: &str) -> Result<(u16, u16), String> {
    let bins = text.split_once("..").and_then(|(first, last)| {
        let bin = whole(0..=u16::MAX);
        Some((bin(first).ok()?, bin(last).ok()?))
    });
    bins.ok_or("must be FIRST..LAST, as 20..119".to_owned())
}

//! The options that say how pixels operate, the same for every command.

use std::str::FromStr;

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::engine::settings::{I24F8Number, Settings, U16F16Number};
use dtof_core::fixed::traits::Fixed;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{HIGHEST_Z, RangeGate};

use super::detection::Detection;

#[derive(Args)]
pub struct Operation {
    /// Only these bins may hold the peak, both inclusive [default: all]
    #[arg(long, value_name = "FIRST..LAST", value_parser = gate)]
    gate: Option<(u16, u16)>,
    #[command(flatten)]
    detection: Detection,
    /// Photons a reported peak, or the window around it, holds at least
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1023))]
    min_count: u16,
    /// The exposure a decision must exceed, in laser cycles
    #[arg(long, value_name = "N", default_value_t = 40)]
    l1: u16,
    /// The exposure at which a pixel starts over without an event, in laser cycles
    #[arg(long, value_name = "N", default_value_t = 2000)]
    l2: u16,
    /// Laser cycles between looks
    #[arg(long, value_name = "N", default_value_t = 4)]
    x: u16,
    /// A frame-based sensor instead, to compare with: every pixel reads its highest bin every N
    /// laser cycles, if that stands above the background at all
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..),
        conflicts_with_all = ["rule", "alpha", "window", "z", "false_one_in", "min_count", "l1", "l2", "x"])]
    frame: Option<u16>,
}

impl Operation {
    /// Whether frames are wanted, which a device does not read.
    pub fn reads_frames(&self) -> bool {
        self.frame.is_some()
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
        let z_for = |one_in| {
            // Only how many bins the gate leaves counts; a number of bins that cannot be is
            // refused by the engine.
            #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
            let last_bin = bins.clamp(8, 1024) as u16 - 1;
            let (first, last) = self.gate.unwrap_or((0, last_bin));
            let gate = RangeGate::<1024>::new(first, last)
                .with_context(|| format!("--gate {first}..{last} with {bins} bins"))?;
            let z = dtof_core::z_for(one_in, &gate, self.x, self.l1, self.l2);
            ensure!(
                z < HIGHEST_Z,
                "--false-one-in {one_in}: there is no z for so few; --z may be up to 15.9998"
            );
            Ok(z)
        };
        Ok(Settings {
            bins,
            bin_width_ps: U16F16Number(bin_width_ps),
            offset_mm: I24F8Number(offset_mm),
            gate: self.gate,
            rule: self.detection.rule(z_for)?,
            estimator: self.detection.estimator(),
            min_count: self.min_count,
            l1: self.l1,
            l2: self.l2,
            x: self.x,
            one_hit_tdc: false,
            frame: self.frame,
            seed,
        })
    }
}

/// A fixed-point number, rounded to the nearest.
pub fn number<T: FromStr + Fixed>(text: &str) -> Result<T, String> {
    let number = parsed::<T>(text)?;
    // Zero is meant only where zero is written.
    if number == T::ZERO && text.contains(|digit| matches!(digit, '1'..='9')) {
        return Err(format!(
            "is less than half of {}, the smallest step",
            T::DELTA
        ));
    }
    Ok(number)
}

fn parsed<T: FromStr + Fixed>(text: &str) -> Result<T, String> {
    text.parse()
        .map_err(|_| format!("must be a number from {} to {}", T::MIN, T::MAX))
}

fn gate(text: &str) -> Result<(u16, u16), String> {
    let bins = text
        .split_once("..")
        .and_then(|(first, last)| Some((first.parse().ok()?, last.parse().ok()?)));
    bins.ok_or("must be FIRST..LAST, as 20..119".to_owned())
}

//! How the pixels operate, in the units the command line uses.

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{AnyRule, PixelConfig, RangeGate, RangeScale};
use serde::Serialize;

use crate::engine::detection::{Estimator, Rule};

/// Everything an engine and the output need beside the photons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Bins of a histogram: a power of two from 8 to 1024.
    pub bins: usize,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16Number,
    /// Millimetres added to every range.
    pub offset_mm: I24F8Number,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// What decides whether a peak stands clear.
    #[serde(flatten)]
    pub rule: Rule,
    /// What finds its depth.
    #[serde(flatten)]
    pub estimator: Estimator,
    /// Photons a reported peak, or the window around it, holds at least.
    pub min_count: u16,
    /// The exposure a decision must exceed, in laser cycles.
    pub l1: u16,
    /// The exposure at which a pixel starts over without an event.
    pub l2: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// Whether the TDC takes one photon a laser cycle, so that events say when that
    /// makes for pile-up.
    pub one_hit_tdc: bool,
    /// A frame-based sensor instead: all pixels read their highest bin every so many
    /// laser cycles, and rule, minimum, L1, L2 and X mean nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u16>,
    /// Seed of every random number.
    pub seed: u64,
}

/// A fixed-point number that is written into JSON as a decimal one.
macro_rules! number {
    ($name:ident, $fixed:ty) => {
        #[doc = concat!("[`", stringify!($fixed), "`], shown as the number it stands for.")]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name(pub $fixed);

        impl Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_f64(self.0.to_num())
            }
        }
    };
}
number!(U4F12Number, U4F12);
number!(U8F8Number, U8F8);
number!(U16F16Number, U16F16);
number!(I24F8Number, I24F8);

impl Settings {
    /// As a configuration for `BINS` bins.
    ///
    /// # Errors
    /// The constraint the settings break.
    pub fn config<const BINS: usize>(&self) -> Result<PixelConfig<BINS, AnyRule>> {
        let gate = self.range_gate()?;
        ensure!(self.min_count >= 1, "--min-count must be at least 1");
        let rule = self.rule.with_minimum_count(self.min_count)?;
        PixelConfig::with_rule(rule)
            .x(self.x)
            .l1(self.l1)
            .l2(self.l2)
            .gate(gate)
            .estimator(self.estimator.in_core())
            .one_hit_tdc(self.one_hit_tdc)
            .build()
            .with_context(|| format!("--x {} --l1 {} --l2 {}", self.x, self.l1, self.l2))
    }

    /// The gate among `BINS` bins.
    ///
    /// # Errors
    /// If it ends past the last, or is too narrow.
    pub fn range_gate<const BINS: usize>(&self) -> Result<RangeGate<BINS>> {
        Ok(match self.gate {
            None => RangeGate::full(),
            Some((first, last)) => RangeGate::new(first, last)
                .with_context(|| format!("--gate {first}..{last} with {BINS} bins"))?,
        })
    }

    /// From bins to millimetres.
    ///
    /// # Errors
    /// The constraint the settings break.
    pub fn range_scale(&self) -> Result<RangeScale> {
        RangeScale::new(self.bin_width_ps.0, self.offset_mm.0).with_context(|| {
            format!(
                "--bin-width-ps {} --offset-mm {}",
                self.bin_width_ps.0, self.offset_mm.0
            )
        })
    }
}

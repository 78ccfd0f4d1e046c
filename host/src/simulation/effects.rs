//! Which effects are on, and what their numbers may be.

use std::ops::RangeInclusive;

use anyhow::{Context, Result, ensure};

use super::afterpulsing::Afterpulsing;
use super::cover_glass::CoverGlass;
use super::dead_time::DeadTime;
use super::hot_pixels::HotPixels;
use super::jitter::Jitter;
use super::second_echo::SecondEcho;
use super::tail::Tail;
use super::tdc::Tdc;

/// The most picoseconds an effect may last: 100 µs.
pub(super) const LONGEST_PS: f64 = 1e8;

/// What a share may be.
pub(super) const SHARE: RangeInclusive<f64> = 0.0..=1.0;

/// Avalanches that have an afterpulse: all of them would never end.
pub(super) const SHARE_OF_AFTERPULSES: RangeInclusive<f64> = 0.0..=0.9;

/// Every effect is off unless it is here. `docs/scenes.md` lists them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects {
    /// The pulse decays slowly.
    pub tail: Option<Tail>,
    /// Some of the signal comes from farther away.
    pub second_echo: Option<SecondEcho>,
    /// Light that never left the sensor.
    pub cover_glass: Option<CoverGlass>,
    /// Pixels with more background.
    pub hot_pixels: Option<HotPixels>,
    /// After an avalanche the SPAD is blind.
    pub dead_time: Option<DeadTime>,
    /// An avalanche may start another.
    pub afterpulsing: Option<Afterpulsing>,
    /// Times are not measured exactly.
    pub jitter: Option<Jitter>,
    /// The TDC takes so many photons a laser cycle.
    pub tdc: Option<Tdc>,
}

/// From picoseconds to bins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Bins of a histogram.
    pub bins: u16,
    /// Picoseconds a bin.
    pub bin_width_ps: f64,
    /// From one laser pulse to the next, in bins; at least `bins`.
    pub period: f64,
}

impl Effects {
    /// Is there one?
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }

    /// Does the TDC take one photon a laser cycle?
    #[must_use]
    pub fn one_hit_tdc(&self) -> bool {
        self.tdc.as_ref().is_some_and(|tdc| tdc.hits_per_cycle == 1)
    }

    /// Are all numbers in their ranges?
    ///
    /// # Errors
    /// The first that is not, named `[section] key`.
    pub fn check(&self) -> Result<()> {
        fn section<T>(name: &str, on: Option<&T>, check: fn(&T) -> Result<()>) -> Result<()> {
            on.map_or(Ok(()), check)
                .with_context(|| format!("[{name}]"))
        }
        section("tail", self.tail.as_ref(), Tail::check)?;
        section("second_echo", self.second_echo.as_ref(), SecondEcho::check)?;
        section("cover_glass", self.cover_glass.as_ref(), CoverGlass::check)?;
        section("hot_pixels", self.hot_pixels.as_ref(), HotPixels::check)?;
        section("dead_time", self.dead_time.as_ref(), DeadTime::check)?;
        section(
            "afterpulsing",
            self.afterpulsing.as_ref(),
            Afterpulsing::check,
        )?;
        section("jitter", self.jitter.as_ref(), Jitter::check)?;
        section("tdc", self.tdc.as_ref(), Tdc::check)
    }
}

/// Is `value` in `range`? Infinity and what is not a number never are.
///
/// # Errors
/// A line that names the key, the value and the range.
pub fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<()> {
    let (least, most) = (range.start(), range.end());
    ensure!(
        range.contains(&value),
        "{key} {value}: must be from {least} to {most}"
    );
    Ok(())
}

//! Which effects are on.

pub mod afterpulsing;
pub mod cover_glass;
pub mod dead_time;
pub mod hot_pixels;
pub mod jitter;
pub mod limits;
pub mod second_echo;
pub mod tail;
pub mod tdc;

use anyhow::{Context, Result};

use self::afterpulsing::Afterpulsing;
use self::cover_glass::CoverGlass;
use self::dead_time::DeadTime;
use self::hot_pixels::HotPixels;
use self::jitter::Jitter;
use self::second_echo::SecondEcho;
use self::tail::Tail;
use self::tdc::Tdc;

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

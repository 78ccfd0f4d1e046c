//! Which effects are on.

pub mod afterpulsing;
pub mod cover_glass;
pub mod dead_time;
pub mod hot_pixels;
pub mod jitter;
pub mod limits;
pub mod other_lidar;
pub mod second_echo;
pub mod tail;
pub mod tdc;

use anyhow::{Context, Result};

use self::afterpulsing::Afterpulsing;
use self::cover_glass::CoverGlass;
use self::dead_time::DeadTime;
use self::hot_pixels::HotPixels;
use self::jitter::Jitter;
use self::other_lidar::OtherLidar;
use self::second_echo::SecondEcho;
use self::tail::Tail;
use self::tdc::Tdc;

/// All effects are off by default. `docs/scenes.md` lists them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects {
    /// The pulse decays slowly.
    pub tail: Option<Tail>,
    /// Some of the signal comes from farther away.
    pub second_echo: Option<SecondEcho>,
    /// Laser light that never leaves the sensor.
    pub cover_glass: Option<CoverGlass>,
    /// The pulses of another LiDAR.
    pub other_lidar: Option<OtherLidar>,
    /// Pixels with more background.
    pub hot_pixels: Option<HotPixels>,
    /// After an avalanche the SPAD is blind.
    pub dead_time: Option<DeadTime>,
    /// An avalanche may start another.
    pub afterpulsing: Option<Afterpulsing>,
    /// Times are not measured exactly.
    pub jitter: Option<Jitter>,
    /// The TDC takes so many photons a laser cycle, or is blind after each.
    pub tdc: Option<Tdc>,
}

impl Effects {
    /// Whether an effect is on.
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }

    /// The dead time of the TDC in bins: [`u16::MAX`] if only the first photon of a laser cycle counts,
    /// 0 if it has none.
    #[must_use]
    pub fn tdc_dead_time(&self) -> u16 {
        self.tdc.as_ref().map_or(0, Tdc::dead_time)
    }

    /// Checks that all numbers are in their ranges.
    ///
    /// # Errors
    /// Names the first that is not as `[section] key`.
    pub fn check(&self) -> Result<()> {
        macro_rules! check {
            ($($effect:ident)+) => {
                $(if let Some(effect) = &self.$effect {
                    effect.check().context(concat!("[", stringify!($effect), "]"))?;
                })+
            };
        }
        check!(tail second_echo cover_glass other_lidar hot_pixels dead_time afterpulsing jitter tdc);
        Ok(())
    }
}

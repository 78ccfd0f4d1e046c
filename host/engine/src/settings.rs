//! The settings file: the sensor, how its pixels decide, their rays, and the run.
//! `docs/settings.md` lists the keys.
//!
//! A key of the file is an option of the command line with `_` for `-`, and a keyword of Python. An
//! option overrides the file. Everything has a default. An error names the option, or the file and
//! the key.

mod detection;
mod engine;
mod file;
mod resolve;
mod rows;
mod sections;
#[cfg(test)]
mod tests;

pub use detection::{DetectionSettings, EstimatorName, FALSE_ALARM, RuleName};
pub use engine::{AdaptiveBinning, DEFAULT_L2, Settings};
pub use file::{MARK, SettingsFile};
pub use sections::{DITHER_BINS, RaySettings, RunSettings, SensorSettings};

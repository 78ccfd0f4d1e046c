//! The settings file: what is known of a sensor, how its pixels decide, where they look, and
//! what a run was. `docs/settings.md` lists the keys.
//!
//! A key of the file is an option of the command line with `_` for `-`, and a keyword of Python. An
//! option overrides the file. What neither says has a default. An error names the option, or the
//! file and the key.

mod detection;
mod engine;
mod file;
mod resolve;
mod rows;
mod sections;

pub use detection::{Detection, EstimatorName, RuleName, share};
pub use engine::{AdaptiveBinning, Settings};
pub use file::{MARK, SettingsFile};
pub use sections::{Rays, Run, Sensor};

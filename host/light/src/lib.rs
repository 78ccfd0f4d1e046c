#![doc = include_str!("../README.md")]
//! ## The model of scenes
//!
//! Background photons are Poisson distributed and spread evenly over the bins;
//! signal photons are Poisson distributed and normally distributed around the
//! pulse position (Eq. 1 to 3, one object). A signal photon outside the
//! histogram is not detected.
//!
//! This is the plain model, used unless there are [`Effects`](effects::Effects). With effects, the
//! same photons from the same random numbers take a longer path:
//!
//! ```text
//! arrivals (f64, bins after the laser fires)
//!   → light      second echo, cover glass, pulse tail, hot pixels
//!   → SPAD       dead time, afterpulsing
//!   → TDC        jitter, hits a laser cycle
//!   → TDC codes
//! ```
//!
//! Each effect has its own random numbers: switching one on does not change the others.
//!
//! ## Laws
//!
//! | module | contents | source |
//! |---|---|---|
//! | [`rates`] | photons a bin | Eq. 1 to 3, 6 |
//! | [`gaussian`] | threshold, hit rate, true and false positive rate, limits of α, ROC | Eq. 4, 5, 7 to 11 |
//! | [`known_background`] | the same rates with Poisson counts | exact |
//! | [`looks::single_look`] | false alarms of one look with the quadrant background | exact |
//! | [`looks::repeated_looks`] | false alarms of an exposure | bounds, exact |
//! | [`looks::table`] | the probability between those bounds | simulation |
//! | [`looks::exposure`] | exposures, one look after the other | simulation |
//! | [`looks::detections`] | the time to a detection | simulation |
//! | [`bounds::likelihood_ratio`] | the fastest possible detection, with the scene known | exact |
//! | [`bounds::cramer_rao`] | the smallest error of a pulse's position | exact |
//! | [`counts`] | Poisson, normal and binomial laws, and what a dead time hides | exact |
//! | [`tune`] | settings for a required false-alarm rate | all of these |
//! | [`progress`] | how far a long calculation is | |

#![deny(clippy::print_stderr, clippy::print_stdout)]
#![forbid(unsafe_code)]

mod array;
pub mod bounds;
pub mod counts;
pub mod demo;
mod detector;
pub mod effects;
pub mod gaussian;
pub mod known_background;
pub mod looks;
mod pixel;
pub mod progress;
pub mod rates;
pub mod scene;
mod stream;
pub mod tune;

pub use self::array::{RatesFn, SimulatedArray};
pub use self::pixel::SimulatedPixel;

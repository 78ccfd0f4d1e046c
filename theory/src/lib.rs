#![doc = include_str!("../README.md")]
//! ## Modules
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
//! | [`random`] | random numbers of a pixel or a trial | |

#![forbid(unsafe_code)]

pub mod bounds;
pub mod counts;
pub mod gaussian;
pub mod known_background;
pub mod looks;
pub mod progress;
pub mod random;
pub mod rates;
pub mod tune;

//! The paper's performance analysis (section II-C) and what it leaves out.
//!
//! | module | what | source |
//! |---|---|---|
//! | [`rates`] | photons a bin | Eq. 1 to 3, 6 |
//! | [`gaussian`] | threshold, hit rate, true and false positive rate, limits of α, ROC | Eq. 4, 5, 7 to 11 |
//! | [`known_background`] | the same with Poisson counts | exact |
//! | [`single_look`] | false events of one look with the quadrant background | exact |
//! | [`repeated_looks`] | false events of an exposure | bounds, exact |
//! | [`table`] | what lies between the bounds | simulation |
//! | [`likelihood_ratio`] | the fastest a rule can be that knows the scene | exact |
//! | [`cramer_rao`] | the smallest error of a pulse's position | exact |
//! | [`binomial`] | intervals of a probability, from counts | exact |
//! | [`exposure`] | exposures, from look to look | simulation |
//! | [`likelihood_ratio`] | the fastest a rule can be that knows the scene | exact |
//! | [`cramer_rao`] | the smallest error of a pulse's position | exact |
//! | [`tune`] | settings for a wanted false event rate | all of these |
//!
//! Times are in bins from the start of bin 0, counts are mean photons, all in
//! `f64`. Nothing here is checked for sense: rates are finite and not negative,
//! probabilities lie strictly between 0 and 1 where an inverse is taken of them.

pub mod binomial;
pub mod cramer_rao;
pub mod detections;
pub mod exposure;
pub mod gaussian;
pub mod known_background;
pub mod likelihood_ratio;
pub mod normal;
pub mod poisson;
mod quadrature;
pub mod rates;
pub mod repeated_looks;
pub mod single_look;
pub mod table;
pub mod tune;

//! Section II-C: the performance analysis.

pub mod false_events;
pub mod gaussian_error;
pub mod hit_rate;
pub mod paper_setting;
pub mod roc;

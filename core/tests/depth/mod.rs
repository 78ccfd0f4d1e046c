//! Depth estimators and ranges.

mod centred_window;
mod centroid;
mod error;
mod formula;
mod left_out;
mod range_scale;
mod skew_window;

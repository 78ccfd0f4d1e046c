//! Depth estimators and ranges.

mod centred_window;
mod centroid;
mod error;
mod range_scale;

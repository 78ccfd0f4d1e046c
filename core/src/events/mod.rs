//! Results from the events of a pixel: running mean, dynamic depth, reflectivity.

mod dynamic_depth;
mod reflectivity;
mod running_mean;

pub use dynamic_depth::{
    DynamicDepthConfig, DynamicDepthEvent, DynamicDepthPixel, Polarity, Reference,
    ZeroThresholdError,
};
pub use reflectivity::Reflectivity;
pub use running_mean::RunningMean;

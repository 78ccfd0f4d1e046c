//! What comes of the events of a pixel.

mod dynamic_depth;
mod reflectivity;
mod running_mean;

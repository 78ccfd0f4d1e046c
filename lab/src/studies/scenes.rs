//! Sections III and IV-C: the scenes, and Table I.

pub mod depth_step;
pub mod dynamic_depth;
pub mod fan_motion;
pub mod hyperparameters;
pub mod latency;
pub(crate) mod mixed;
pub(crate) mod one_pixel;
pub mod radial_motion;
mod ranks;
pub mod static_scene;
pub(crate) mod systems;

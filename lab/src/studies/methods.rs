//! Beyond the paper: comparison with other methods.

pub mod depth_error;
pub mod event_depth;
pub mod false_rate;
pub mod passage;
pub mod time_to_detect;

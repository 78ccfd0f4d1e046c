//! What the paper does not have: other methods beside its own.

pub mod depth_error;
pub mod event_depth;
pub mod false_rate;
pub mod passage;
pub mod time_to_detect;

//! The sidecar beside the sensor: everything of the firmware that does not
//! depend on a board, so that it runs and is tested on any computer too.

#![no_std]

pub mod link;
pub mod sidecar;

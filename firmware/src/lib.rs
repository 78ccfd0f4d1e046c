//! The sidecar that sits beside a single-photon sensor: what its images have in
//! common, over hardware traits, so that all of it is built and tested on a host
//! as well.
//!
//! - [`sensor`]: drivers of the sensors.

#![no_std]
#![deny(unsafe_code)]

pub mod sensor;

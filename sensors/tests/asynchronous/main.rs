//! Drivers over embedded-hal-async. A program of its own, as the drivers in images are built without this feature.

/// It has more than these tests use.
#[allow(dead_code)]
#[path = "../common/mod.rs"]
mod common;
mod embassy;
mod off;
#[path = "../off.rs"]
mod off_as_blocking;
mod parts;
mod transfers;
mod wait;

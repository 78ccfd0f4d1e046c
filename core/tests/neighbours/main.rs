//! Pixels that confirm each other.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod false_alarms;
#[path = "../common/neighbours.rs"]
mod formula;
#[path = "../common/light.rs"]
mod light;
mod model;
mod narrow;
mod steps;
mod tables;
#[path = "../common/window.rs"]
mod window_formula;

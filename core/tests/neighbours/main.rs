//! Pixels that confirm each other.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod false_alarms;
mod model;
mod narrow;
mod steps;
mod tables;

//! Rules, thresholds, roots and peaks.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod any_rule;
mod average;
mod background;
mod common;
#[path = "../common/light.rs"]
mod light;
mod live;
#[path = "../common/live.rs"]
mod live_formula;
#[path = "../common/parallel.rs"]
mod parallel;
mod peak;
mod quadrant;
mod root;
mod shares;
mod threshold;
mod window;
#[path = "../common/window.rs"]
mod window_formula;
mod window_z;
mod window_z_tables;
mod without;

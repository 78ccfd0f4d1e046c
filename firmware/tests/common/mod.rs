//! What the tests of the sidecar share.

#![allow(dead_code, reason = "no test uses all of it")]

pub mod histograms;
pub mod host;
/// Mocked buses and pins.
#[path = "../../../sensors/tests/common/mod.rs"]
pub mod mocks;
pub mod plugged;
pub mod scene;
pub mod script;
pub mod session;
pub mod sharing;
pub mod wire;

//! What the tests of the sidecar share.

pub mod histograms;
pub mod host;
/// Mocked buses and pins of the drivers' own tests, which use more of them.
#[allow(dead_code, unused_imports, unused_macros)]
#[path = "../../../sensors/tests/common/mod.rs"]
pub mod mocks;
pub mod plug;
pub mod plugged;
pub mod scene;
pub mod script;
pub mod session;
pub mod sharing;
pub mod wire;

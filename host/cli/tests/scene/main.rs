//! `dtof simulate`: scene files, and events against what the pixels saw.

#[path = "../common/mod.rs"]
mod common;

mod depth;
mod echoes;
mod files;
mod refused;
mod truth;

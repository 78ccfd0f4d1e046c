//! `dtof replay`: recorded photons in, results out.

#[path = "../common/mod.rs"]
mod common;

mod captures;
mod recorded;
mod refused;

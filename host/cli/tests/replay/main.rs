//! `dtof replay`: recorded photons in, results out.

#[path = "../common/mod.rs"]
mod common;

mod arrays;
mod captures;
mod opened;
mod recorded;
mod refused;
mod speed;

//! `dtof replay`: recorded photons in, results out.

mod arrays;
mod captures;
mod opened;
mod recorded;
mod refused;
mod speed;

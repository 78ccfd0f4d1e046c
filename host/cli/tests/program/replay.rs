//! `dtof replay`: recorded photons in, results out.

mod arrays;
mod captures;
mod odd;
mod recorded;
mod refused;
mod speed;

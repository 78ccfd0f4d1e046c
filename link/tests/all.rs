//! One program for all tests: what they share is compiled once, and they run side by side.

mod common;
mod configuration;
mod dead_time;
mod endpoint;
mod histogram;
mod link_format;
mod tables;

//! Pixels that confirm each other.

mod false_alarms;
mod model;
mod narrow;
mod steps;
mod tables;

//! One program for all tests: what they share is compiled once, and they run side by side.

mod common;
mod dither;
mod many_bins;
mod nonsense;
mod off;
mod parts;
mod simulated;
mod software_i2c;
mod tdc7200;
mod tdc7200_time;
mod texts;
mod tmf8828;
mod tmf8829;
mod tmf882x;
mod tmf882x_errors;

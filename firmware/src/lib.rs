//! The sidecar: what runs on a microcontroller beside the sensor. A library
//! that also builds and is tested on the computer in front of you, and thin
//! images that put it onto a board (`src/bin`).
//!
//! ```text
//! dtof_sensors        photons and histograms, over embedded-hal
//!   ↓
//! sidecar::Sidecar    pixels, configuration, events
//!   ↕
//! dtof_link           frames, and messages that arrive once and in order
//!   ↕ embedded-io
//! serial::Serial      two queues between the interrupt handler and the main loop
//!   ↕ interrupts
//! board::Board        milliseconds, watchdog, sleep: all that differs between boards
//! ```

#![no_std]

#[cfg(test)]
extern crate std;

pub mod board;
pub mod self_test;
pub mod serial;
pub mod sidecar;

pub use dtof_sensors::photon_timer;

/// The laser of the Pico's image as it comes: 100 kHz, and pulses of two bins.
pub const DEFAULT_LASER: photon_timer::Settings = photon_timer::Settings {
    laser_hz: 100_000,
    pulse_ns: 16,
};

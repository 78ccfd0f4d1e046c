//! One program for all tests: what they share is compiled once, and they run side by side.

mod clocks;
mod common;
mod laser;
mod link_faults;
mod link_hour;
mod resets;
mod sensor_tmf8829_recorded;
mod sensor_tmf882x_recorded;
mod sidecar_blocks;
mod sidecar_dead_time;
mod sidecar_dither;
mod sidecar_histograms;
mod sidecar_neighbours;
mod sidecar_once_per_bin;
mod sidecar_orders;
mod sidecar_sensor;
mod sidecar_unpaced;
mod sidecar_whole_histograms;
mod status;
mod stuck;
mod wake_ups;

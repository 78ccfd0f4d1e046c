//! Beyond one pixel, one exposure and one peak: adaptive binning, neighbours, tracking, echoes.

pub mod binning_edges;
pub mod binning_rate;
pub mod binning_reports;
pub mod binning_scenes;
pub mod confirmed_depth;
pub mod counters;
pub mod dither;
pub mod echo_wait;
pub mod echoes;
mod light;
pub mod neighbours;
mod scene_file;
mod setting;
mod simulated_array;
pub mod tracking;

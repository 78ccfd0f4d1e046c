//! Beyond one pixel, one exposure and one peak: adaptive binning, tracking, echoes.

pub mod binning_edges;
pub mod binning_rate;
pub mod binning_reports;
pub mod echoes;
mod field;
pub mod tracking;

//! What histograms say: one file for each thing that is found.

pub mod background;
pub mod common;
pub mod glass;
pub mod half_widths;
pub mod limits;
pub mod observed;
pub mod offset;
pub mod peaks;
pub mod pile_up;
pub mod pixels;
pub mod pulse;
pub mod shape;

//! Findings from histograms, each in a file of its own.

pub mod background;
pub mod glass;
pub mod good_histograms;
pub mod half_widths;
pub mod observed;
pub mod offset;
pub mod peaks;
pub mod pile_up;
pub mod pixel_offsets;
pub mod pixels;
pub mod pulse;
pub mod shape;
pub mod significance;

//! What tests of more than one part share.

pub mod light;
pub mod live;
pub mod neighbours;
pub mod parallel;
pub mod window;

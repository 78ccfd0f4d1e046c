//! What tests of more than one part share.

pub mod light;
pub mod live;
pub mod parallel;
pub mod small;
pub mod window;

//! Pages to look at.

pub mod live;
pub mod report;

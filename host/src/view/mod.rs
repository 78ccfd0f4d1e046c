//! Pages to look at.

pub mod report;

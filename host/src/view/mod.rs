//! What people look at: charts, maps, the moving picture and the report.

pub mod chart;
pub mod palette;
pub mod picture;
pub mod report;
pub mod svg;

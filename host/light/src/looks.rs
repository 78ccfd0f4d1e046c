//! False alarms and detections of one look, and of the looks of an exposure.

pub mod detections;
pub mod exposure;
pub mod repeated_looks;
pub mod single_look;
pub mod table;

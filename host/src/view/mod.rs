//! What people look at.

pub mod report;

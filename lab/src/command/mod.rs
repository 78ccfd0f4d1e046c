//! One file per command.

pub mod figures;
pub mod sweep;

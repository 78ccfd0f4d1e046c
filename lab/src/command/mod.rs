//! One file a command.

pub mod figures;
pub mod sweep;

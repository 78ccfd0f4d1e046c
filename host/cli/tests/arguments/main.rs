//! Options of the command line: how they are read, and the files that they name.

#[path = "../common/mod.rs"]
mod common;

mod kept;
mod mistakes;
mod numbers;
mod rule;
mod settings;
mod tune;

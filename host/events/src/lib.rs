#![doc = include_str!("../README.md")]

pub mod aer_file;
pub mod changes;
pub mod dynamic;
pub mod echoes;
pub mod events_csv;
pub mod fixtures;
pub mod maps;
pub mod reports;
pub mod sample;

//! The output of events: tables, words, maps, a folder of results.

pub mod aer_file;
pub mod changes;
pub mod dynamic;
pub mod echoes;
pub mod events_csv;
#[cfg(test)]
pub(crate) mod fixtures;
pub mod maps;
pub mod output;
pub mod reports;
pub mod sample;
pub mod summary;

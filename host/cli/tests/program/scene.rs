//! `dtof simulate`: scene files, and events against what the pixels saw.

mod depth;
mod echoes;
mod files;
mod refused;
mod truth;

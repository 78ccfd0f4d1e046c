#![doc = include_str!("../README.md")]
//! ## Modules
//!
//! | module | what it has |
//! |---|---|
//! | [`chart`] | a chart whose title is its finding and whose curves carry their names |
//! | [`picture`] | a map: one value a pixel |
//! | [`palette`] | one look for one thing in all of them |
//! | [`svg`] | shapes and texts |

#![forbid(unsafe_code)]

pub mod chart;
pub mod palette;
pub mod picture;
pub mod svg;

#![doc = include_str!("../README.md")]
//! ## Modules
//!
//! | module | contents |
//! |---|---|
//! | [`chart`] | charts: the title states the finding, curves carry their names |
//! | [`picture`] | maps: one value per pixel |
//! | [`palette`] | colours and marks, the same in all pictures |
//! | [`svg`] | shapes and text |

#![forbid(unsafe_code)]

pub mod chart;
pub mod palette;
pub mod picture;
pub mod svg;

//! Charts and maps as SVG documents. They need nothing beside themselves, read well at
//! 400 pixels of width, in light and dark, and the same calls give the same bytes.
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

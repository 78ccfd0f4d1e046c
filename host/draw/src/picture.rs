//! Heat maps of one value per pixel as SVG documents.

mod axis;
mod draw;
mod layout;
mod map;
mod scale;
#[cfg(test)]
mod tests;

pub use draw::heat_map;
pub use map::Map;
pub use scale::{levels, span};

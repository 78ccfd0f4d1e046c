//! Charts as SVG documents: measured points are dots with confidence intervals, calculated
//! values are lines.
//!
//! The title states the finding. Each curve has its name at its end; names that would overlap
//! are moved apart. Axis labels never touch. Many curves are drawn as small multiples: panels
//! with the same axes.

mod draw;
mod names;
mod panel;
mod parts;
mod scale;
#[cfg(test)]
mod tests;

pub use draw::chart;
pub use parts::{Axis, Chart, Key, Panel, Point, Series, Style};

//! Charts as SVG documents: measured points are dots with confidence intervals, calculated
//! values are lines.
//!
//! The title states the finding. Each curve has its name at its end, or at the first place beside it
//! where the name touches nothing; a name without a place stands in a legend below the panels. Many
//! curves are drawn as small multiples: panels with the same axes.

mod draw;
mod names;
mod panel;
mod parts;
mod scale;
#[cfg(test)]
mod tests;

pub use draw::chart;
pub use parts::{Axis, Chart, Key, Panel, Point, Series, Style};

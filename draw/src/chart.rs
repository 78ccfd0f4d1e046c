//! Charts as SVG documents, all from one template: what was measured as dots with the
//! interval it lies in, what was worked out as lines.
//!
//! The title says what the chart shows. A curve has its name at its end, and names that
//! would collide are moved apart. Labels of an axis never touch. Many curves are drawn as
//! small multiples: panels with the same axes.

mod draw;
mod names;
mod panel;
mod parts;
mod scale;
#[cfg(test)]
mod tests;

pub use draw::chart;
pub use parts::{Axis, Chart, Key, Panel, Point, Series, Style};

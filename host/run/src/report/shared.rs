//! Parts of both the report and the live page: the style, and the modules of cloud, maps and plots.

pub use super::bundle::{Error, Module, bundle};

/// The style. It follows the colour scheme of the reader and the width of the window.
pub const STYLE: &str = include_str!("shared/page.css");

/// The modules, by their paths below `host`.
pub const MODULES: [Module; 15] = [
    module!("shared/array.js"),
    module!("shared/cloud.js"),
    module!("shared/colours.js"),
    module!("shared/dom.js"),
    module!("shared/histogram.js"),
    module!("shared/keys.js"),
    module!("shared/looks.js"),
    module!("shared/maps.js"),
    module!("shared/numbers.js"),
    module!("shared/pixel-events.js"),
    module!("shared/projection.js"),
    module!("shared/ranges.js"),
    module!("shared/squares.js"),
    module!("shared/turn.js"),
    module!("shared/turning.js"),
];

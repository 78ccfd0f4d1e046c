//! Parts of both the report and the live page: style, colours, and the scripts of cloud, maps and plots.

use dtof_draw::palette;

/// The style. It follows the colour scheme of the reader and the width of the window.
pub const STYLE: &str = include_str!("shared/page.css");

/// The script of a page: `data`, which defines what is drawn, then the shared parts, then `own`.
#[must_use]
pub fn script(data: &str, own: &[&str]) -> String {
    let before = [include_str!("shared/helpers.js"), data];
    let parts = [
        include_str!("shared/projection.js"),
        include_str!("shared/cloud.js"),
        include_str!("shared/turn.js"),
        include_str!("shared/maps.js"),
        include_str!("shared/histogram.js"),
        include_str!("shared/ranges.js"),
    ];
    [&before[..], &parts, own].concat().join("\n")
}

/// The colours of the 256 levels of a map, six hexadecimal digits each.
#[must_use]
pub fn colours() -> String {
    let colour = |level| {
        let [red, green, blue] = palette::level(level);
        format!("{red:02x}{green:02x}{blue:02x}")
    };
    (0..=u8::MAX).map(colour).collect()
}

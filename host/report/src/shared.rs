//! What the report and the live page share: the style, and the cloud, the maps and the plots.

/// Colours follow the reader's scheme, the columns the width of the window.
pub const STYLE: &str = include_str!("shared/page.css");

/// One script of a page: the shared parts, after `data` has defined what they draw, then `own`.
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

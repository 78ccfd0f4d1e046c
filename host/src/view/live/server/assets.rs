//! The files of the page. It shares maps, cloud and plots with the report.

use std::sync::LazyLock;

use dtof_draw::palette;

const HTML: &str = include_str!("../page/index.html");

const STYLE: &str = concat!(
    include_str!("../../shared/page.css"),
    include_str!("../page/live.css")
);

/// One script: what the report has first.
static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let colours: String = (0..=u8::MAX)
        .map(|level| {
            let [red, green, blue] = palette::level(level);
            format!("{red:02x}{green:02x}{blue:02x}")
        })
        .collect();
    let parts = [
        include_str!("../../shared/helpers.js"),
        include_str!("../page/state.js"),
        include_str!("../../shared/projection.js"),
        include_str!("../../shared/cloud.js"),
        include_str!("../../shared/turn.js"),
        include_str!("../../shared/maps.js"),
        include_str!("../../shared/histogram.js"),
        include_str!("../../shared/ranges.js"),
        include_str!("../page/chosen.js"),
        include_str!("../page/figures.js"),
        include_str!("../page/settings.js"),
        include_str!("../page/stream.js"),
        include_str!("../page/controls.js"),
    ];
    format!("const HEX = \"{colours}\";\n{}", parts.join("\n"))
});

/// The kind and the text of what is at `path`.
pub fn at(path: &str) -> Option<(&'static str, &'static str)> {
    Some(match path {
        "/" => ("text/html; charset=utf-8", HTML),
        "/page.css" => ("text/css; charset=utf-8", STYLE),
        "/page.js" => ("text/javascript; charset=utf-8", &SCRIPT),
        _ => return None,
    })
}

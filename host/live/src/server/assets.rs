//! The files of the page. It shares maps, cloud and plots with the report.

use std::sync::LazyLock;

use dtof_draw::palette;
use dtof_report::shared;

const HTML: &str = include_str!("../page/index.html");

static STYLE: LazyLock<String> =
    LazyLock::new(|| shared::STYLE.to_owned() + include_str!("../page/live.css"));

static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let colours: String = (0..=u8::MAX)
        .map(|level| {
            let [red, green, blue] = palette::level(level);
            format!("{red:02x}{green:02x}{blue:02x}")
        })
        .collect();
    let own = [
        include_str!("../page/chosen.js"),
        include_str!("../page/figures.js"),
        include_str!("../page/settings.js"),
        include_str!("../page/stream.js"),
        include_str!("../page/controls.js"),
    ];
    let script = shared::script(include_str!("../page/state.js"), &own);
    format!("const HEX = \"{colours}\";\n{script}")
});

/// The kind and the text of what is at `path`.
pub fn at(path: &str) -> Option<(&'static str, &'static str)> {
    Some(match path {
        "/" => ("text/html; charset=utf-8", HTML),
        "/page.css" => ("text/css; charset=utf-8", &STYLE),
        "/page.js" => ("text/javascript; charset=utf-8", &SCRIPT),
        _ => return None,
    })
}

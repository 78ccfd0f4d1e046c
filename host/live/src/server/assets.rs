//! The files of the page. It shares maps, cloud and plots with the report.

use std::sync::LazyLock;

use dtof_report::shared;

const HTML: &str = include_str!("../page/index.html");

static STYLE: LazyLock<String> =
    LazyLock::new(|| shared::STYLE.to_owned() + include_str!("../page/live.css"));

static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let own = [
        include_str!("../page/chosen.js"),
        include_str!("../page/figures.js"),
        include_str!("../page/settings.js"),
        include_str!("../page/stream.js"),
        include_str!("../page/controls.js"),
    ];
    let script = shared::script(include_str!("../page/state.js"), &own);
    format!("const HEX = \"{}\";\n{script}", shared::colours())
});

/// Content type and text of the file at `path`.
pub fn at(path: &str) -> Option<(&'static str, &'static str)> {
    Some(match path {
        "/" => ("text/html; charset=utf-8", HTML),
        "/page.css" => ("text/css; charset=utf-8", &STYLE),
        "/page.js" => ("text/javascript; charset=utf-8", &SCRIPT),
        _ => return None,
    })
}

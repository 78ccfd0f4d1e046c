//! The files of the page. It shares maps, cloud and plots with the report.

use std::sync::LazyLock;

use dtof_report::shared;

const HTML: &str = include_str!("../page/index.html");

static STYLE: LazyLock<String> =
    LazyLock::new(|| shared::STYLE.to_owned() + include_str!("../page/live.css"));

/// A JavaScript module of the page. Paths of modules begin at `host`.
macro_rules! module {
    ($name:literal) => {
        (
            concat!("live/src/page/", $name),
            include_str!(concat!("../page/", $name)),
        )
    };
}

const MODULES: [shared::Module; 11] = [
    module!("chosen.js"),
    module!("command.js"),
    module!("figures.js"),
    module!("form.js"),
    module!("main.js"),
    module!("notes.js"),
    module!("records.js"),
    module!("settings.js"),
    module!("shortcuts.js"),
    module!("state.js"),
    module!("stream.js"),
];

static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let modules = [&MODULES[..], &shared::MODULES].concat();
    let script = shared::bundle("live/src/page/main.js", &modules);
    script.expect("modules that fit together")
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

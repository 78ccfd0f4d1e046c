//! The files of the page. It shares maps, cloud and plots with the report.

use std::sync::LazyLock;

use dtof_run::report::shared;

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

const MODULES: [shared::Module; 12] = [
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
    module!("values.js"),
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

#[cfg(test)]
mod tests {
    use std::fmt::Display;
    use std::{env, fs};

    use dtof_data::options::keys::{Key, Kind};
    use dtof_engine::settings::{DetectionSettings, SensorSettings};

    /// The input of a key: names, or what a field for a number needs; that of one element if it is a list.
    fn input(key: &Key) -> String {
        let number =
            |min: &dyn Display, step| format!("{{ type: \"number\", min: {min}, step: {step} }}");
        match key.kind {
            Kind::Integer(first, _) | Kind::PowerOfTwo(first, _) => number(&first, "1"),
            Kind::Even(_) | Kind::Integers(_) => number(&0, "1"),
            Kind::Fixed(ends) => number(&ends()[0], "\"any\""),
            Kind::Real(first, _) => number(&first, "\"any\""),
            Kind::AboveZero(_) => number(&0, "\"any\""),
            Kind::OneOf(names) => {
                let names: Vec<&str> = names().iter().map(|[name, _]| *name).collect();
                format!("{names:?}")
            }
            kind => panic!("{}: a form has no input for {kind:?}", key.name),
        }
    }

    #[test]
    fn the_values_of_the_form_are_those_of_the_keys() {
        let form = include_str!("../page/form.js");
        let keys = || SensorSettings::KEYS.iter().chain(DetectionSettings::KEYS);
        let (_, fields) = form.split_once("FIELDS = [\n").unwrap();
        let (fields, _) = fields.split_once("].map(").unwrap();
        let mut lines = String::new();
        for name in fields.lines().map(|row| row.split('"').nth(3).unwrap()) {
            let key = keys().find(|key| key.name == name).expect(name);
            let line = format!("  {name}: {},\n", input(key));
            if !lines.contains(&line) {
                lines += &line;
            }
        }
        let made = format!(
            "// The values of settings, made from the tables of the options with DTOF_BLESS=1 cargo test -p dtof-live\n\n\
             /** By key: names, or what a field for a number needs. */\nexport const VALUES = {{\n{lines}}};\n"
        );
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/page/values.js");
        if env::var_os("DTOF_BLESS").is_some() {
            fs::write(path, &made).unwrap();
        }
        assert_eq!(fs::read_to_string(path).unwrap(), made);
    }
}

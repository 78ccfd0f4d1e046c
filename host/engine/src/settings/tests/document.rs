//! The tables of `docs/settings.md`.

use std::{env, fs};

use dtof_data::options::keys::Kind;
use dtof_data::options::{flag, option_name};

use toml::Table;

use super::*;

/// Keys that the document says more about.
const MORE: [(&str, &str); 8] = [
    ("offsets_mm", "offsets-of-pixels"),
    ("dead_time", "dead-time"),
    ("dither_bins", "dither"),
    ("dither_seed", "dither"),
    ("z", "z"),
    ("neighbours", "neighbours"),
    ("once_per_bin", "once-per-bin"),
    ("counter_bits", "counters-of-8-bits"),
];

/// What a key does, with what each of its names means.
fn meaning(key: &Key, help: &str) -> String {
    let mut text = help.replace("docs/export.md", "[export](export.md)");
    if let Kind::OneOf(names) = key.kind {
        let names = names().into_iter();
        let names = names.map(|[name, help]| {
            format!(
                "; `{name}`: {}",
                help.replacen(|_: char| true, &help[..1].to_lowercase(), 1)
            )
        });
        text += &names.collect::<String>();
    }
    let more = MORE.iter().find(|(name, _)| *name == key.name);
    text + &more.map_or(String::new(), |(_, place)| format!(" ([more](#{place}))"))
}

fn table(keys: &[Key]) -> String {
    let mut text = "| key | values | default | meaning |\n|---|---|---|---|\n".to_owned();
    for key in keys {
        let name = key.name;
        let other = match (key.value, option_name(name) == name) {
            ("", _) => " (no option)".to_owned(),
            (_, true) => String::new(),
            (_, false) => format!(" (`{}`)", flag(name)),
        };
        let (help, default) = key
            .help
            .strip_suffix(']')
            .and_then(|help| help.split_once(" [default: "))
            .unwrap_or(match key.kind {
                Kind::Switch => (key.help, "false"),
                _ => (key.help, ""),
            });
        let (values, meaning) = (key.kind.words(), meaning(key, help));
        text += &format!("| `{name}`{other} | {values} | {default} | {meaning} |\n");
    }
    text
}

/// Made with `DTOF_BLESS=1 cargo test -p dtof-engine document`.
#[test]
fn the_document_has_the_tables_of_the_keys() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/settings.md");
    let text = fs::read_to_string(path).unwrap();
    let mut made = text.clone();
    for (section, keys) in SECTIONS {
        let head = format!("## `[{section}]`\n\n");
        let start = made.find(&head).expect(section) + head.len();
        let length = made[start..].find("\n\n").unwrap_or(made.len() - start - 1) + 1;
        made.replace_range(start..start + length, &table(keys));
    }
    if env::var_os("DTOF_BLESS").is_some() {
        fs::write(path, made).unwrap();
    } else {
        assert!(text == made, "{path} has other tables");
    }
}

/// The range and the default that a help names are those of the table and of the settings.
#[test]
fn a_help_names_the_range_and_the_default_that_hold() {
    let file = SettingsFile::default();
    let settings = file.settings(128).unwrap();
    let written = Table::try_from(file.with_settings(&settings)).unwrap();
    let (mut ranges, mut defaults) = (0, 0);
    for (section, keys) in SECTIONS {
        for key in keys {
            let words: Vec<&str> = key
                .help
                .split([' ', ',', ']'])
                .map(|word| word.trim_end_matches('.'))
                .collect();
            for three in words.windows(3) {
                let [first, "to", last] = three else { continue };
                let is_range = [first, last].iter().all(|end| end.parse::<f64>().is_ok());
                if is_range && !matches!(key.kind, Kind::Numbers(_)) {
                    let values = key.kind.words();
                    assert!(values.ends_with(&format!("{first} to {last}")), "{key:?}");
                    ranges += 1;
                }
            }
            let default = key
                .help
                .split_once("[default: ")
                .map(|(_, default)| default);
            let default =
                default.and_then(|default| default.strip_suffix(']')?.parse::<f64>().ok());
            let value = written[section].get(key.name);
            if let (Some(default), Some(value)) = (default, value) {
                let value = value
                    .as_float()
                    .or(value.as_integer().map(|value| value as f64));
                assert_eq!(value, Some(default), "{key:?}");
                defaults += 1;
            }
        }
    }
    assert!(
        ranges >= 6 && defaults >= 6,
        "{ranges} ranges, {defaults} defaults"
    );
}

//! The tables of `docs/settings.md`.

use std::{env, fs};

use dtof_data::options::{flag, option_name};

use super::*;

fn table(keys: &[Key]) -> String {
    let mut text = "| key | default | meaning |\n|---|---|---|\n".to_owned();
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
            .unwrap_or((key.help, ""));
        text += &format!("| `{name}`{other} | {default} | {help} |\n");
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

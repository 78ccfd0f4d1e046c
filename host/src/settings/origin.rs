//! Which file has said a value, so that an error about it names the file and the key.

use std::path::{Path, PathBuf};

use anyhow::{Error, Result, anyhow};
use toml::{Table, Value};

use super::SettingsFile;

/// A settings file, and what it says.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    path: PathBuf,
    said: Table,
}

impl SettingsFile {
    /// The same, known to come from `path`.
    ///
    /// # Errors
    /// If a number is none.
    pub(super) fn with_origin(mut self, path: &Path) -> Result<Self> {
        let said = Table::try_from(&self)?;
        let path = path.to_owned();
        self.origin = Some(Origin { path, said });
        Ok(self)
    }

    /// Where the values of `other` come from that these settings do not say.
    pub(super) fn origin_of_rest(&self, other: &Self) -> Option<Origin> {
        let mut origin = other.origin.clone()?;
        let these = Table::try_from(self).ok()?;
        for (section, keys) in &mut origin.said {
            if let (Some(keys), Some(these)) = (keys.as_table_mut(), these.get(section)) {
                keys.retain(|key, _| these.get(key).is_none());
            }
        }
        Some(origin)
    }

    /// An error that names options. Where it is about a value that the file has said, it names
    /// the file, and the key instead of the option: the first option it names, and others that
    /// stand before their value of the file. Another error stays what it is.
    #[must_use]
    pub fn name_origin(&self, error: Error) -> Error {
        let (Some(origin), Ok(all)) = (&self.origin, Table::try_from(self)) else {
            return error;
        };
        let before = format!("{error:#}");
        let mut text = before.clone();
        for (section, keys) in &origin.said {
            for (key, value) in keys.as_table().into_iter().flatten() {
                if all.get(section).and_then(|keys| keys.get(key)) == Some(value) {
                    text = replaced(&text, &option(key), key, value);
                }
            }
        }
        if text == before {
            return error;
        }
        anyhow!("{}: {text}", origin.path.display())
    }
}

/// The option that says the same as a key.
fn option(key: &str) -> String {
    match key {
        "masked" => "--mask".to_owned(),
        _ => format!("--{}", key.replace('_', "-")),
    }
}

/// `text` with `key` for each `option` that stands by itself, if it is the first of all or stands
/// before `value`.
fn replaced(text: &str, option: &str, key: &str, value: &Value) -> String {
    let value = match value {
        Value::String(text) => text.clone(),
        value => value.to_string(),
    };
    let mut parts = text.split(option);
    let mut done = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let goes_on = |next: char| next.is_alphanumeric() || "-_./".contains(next);
        let is_option = done.is_empty() || done.ends_with(' ');
        let is_whole = is_option && !part.starts_with(goes_on);
        let next = part.split([' ', ':', ';']).nth(1).unwrap_or_default();
        let is_meant = next == value || !done.contains(" --") && !done.starts_with("--");
        done += if is_whole && is_meant { key } else { option };
        done += part;
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blamed(file: &str, options: &str, error: &str) -> String {
        let file = SettingsFile::parse(file).unwrap();
        let file = file.with_origin(Path::new("my.toml")).unwrap();
        let said = SettingsFile::parse(options).unwrap().or(file);
        format!("{:#}", said.name_origin(anyhow!("{error}")))
    }

    #[test]
    fn what_the_file_says_has_its_name_and_the_options_keep_theirs() {
        let file = "[sensor]\nmasked = [9]\n[detection]\nl1 = 4\nl2 = 3\nfalse_alarm = 0.01\necho_wait = 4";
        for (options, error, expected) in [
            (
                "",
                "--x 4 --l1 4 --l2 3: L2 must be more",
                "my.toml: --x 4 l1 4 l2 3: L2 must be more",
            ),
            (
                "detection.l1 = 2",
                "--x 4 --l1 2 --l2 3: L2 must be more",
                "my.toml: --x 4 --l1 2 l2 3: L2 must be more",
            ),
            ("detection.l2 = 2", "--l2 2: no", "--l2 2: no"),
            // The file and an option say the same.
            ("detection.l2 = 3", "--l2 3: no", "--l2 3: no"),
            // It is about what an option says.
            ("detection.x = 2", "--x is for --l2 4", "--x is for --l2 4"),
            ("", "--l2 is for --x", "my.toml: l2 is for --x"),
            ("", "--mask 9: no", "my.toml: masked 9: no"),
            (
                "",
                "a.npy: --false-alarm 0.01: no",
                "my.toml: a.npy: false_alarm 0.01: no",
            ),
            // What an option says takes the place of it.
            (
                "detection.z = 4",
                "--false-alarm 0.01",
                "--false-alarm 0.01",
            ),
            // Others that begin alike, and names of files.
            ("", "--echo-wait-more is none", "--echo-wait-more is none"),
            ("", "a--l2: no", "a--l2: no"),
            ("", "--l2.npy: no", "--l2.npy: no"),
        ] {
            assert_eq!(blamed(file, options, error), expected, "{options}");
        }
    }

    #[test]
    fn an_error_that_names_none_stays_what_it_is() {
        let file = SettingsFile::parse("detection.l2 = 3").unwrap();
        let file = file.with_origin(Path::new("my.toml")).unwrap();
        let error = std::io::Error::from(std::io::ErrorKind::BrokenPipe);
        assert!(file.name_origin(error.into()).is::<std::io::Error>());
    }
}

#![doc = include_str!("../README.md")]
//! ## An error that names another option
//!
//! Where a reason names another option it stands in backticks, with its key in a settings file: `false_alarm`.
//! Whoever prints the error puts the name in its place that its user knows, `--false-alarm`.
//!
//! ```
//! use dtof_options::{Refused, line};
//!
//! let refused = Refused::new("alpha", "is for the rules paper and average; see `false_alarm`");
//! let flag = |key: &str| format!("--{}", key.replace('_', "-"));
//! assert_eq!(
//!     line(&refused.into(), &flag),
//!     "--alpha is for the rules paper and average; see --false-alarm"
//! );
//! ```

#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod files;
pub mod numbers;
pub mod progress;
pub mod rows;

use std::collections::BTreeSet;
use std::error::Error;
use std::ffi::OsStr;
use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

/// Why an option is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The key of the option; none where an input is refused.
    pub key: Option<String>,
    /// Its value, if that is what is wrong.
    pub value: Option<String>,
    /// The reason. Other options stand in backticks.
    pub reason: String,
    /// The key is a name as its user wrote it.
    is_unknown: bool,
    /// The settings file that gave some of the options.
    file: Option<Box<GivenByFile>>,
}

/// The keys that a settings file gave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenByFile {
    /// The file.
    pub path: PathBuf,
    /// Its keys, less those that an option has overridden.
    pub keys: BTreeSet<String>,
}

impl Refused {
    /// The option `key` cannot stand here: the reason follows its name, as in "is for `rule` window".
    pub fn new(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            key: Some(key.into()),
            ..Self::input(reason)
        }
    }

    /// An input cannot be used. The reason names options that help.
    pub fn input(reason: impl Into<String>) -> Self {
        Self {
            key: None,
            value: None,
            reason: reason.into(),
            is_unknown: false,
            file: None,
        }
    }

    /// The option `key` cannot have `value`.
    pub fn value(key: impl Into<String>, value: impl Display, reason: impl Into<String>) -> Self {
        Self {
            value: Some(value.to_string()),
            ..Self::new(key, reason)
        }
    }

    /// There is no option of this `name`, which is as its user wrote it; there are `keys`.
    #[must_use]
    pub fn unknown<'a>(name: &str, keys: impl IntoIterator<Item = &'a str>) -> Self {
        let likeness = |known: &&str| strsim::jaro(known, name.trim_start_matches('-'));
        let alike = keys.into_iter().filter(|known| likeness(known) > 0.75);
        let nearest = alike.max_by(|one, other| likeness(one).total_cmp(&likeness(other)));
        let hint = nearest.map_or(String::new(), |known| format!("; is it `{known}`?"));
        Self {
            is_unknown: true,
            ..Self::new(name, format!("is unknown{hint}"))
        }
    }

    /// In one line, with every option as `name` has it, or as the settings file that gave it.
    #[must_use]
    pub fn line(&self, name: &dyn Fn(&str) -> String) -> String {
        let mut from_file = None;
        let mut named = |key: &str| {
            let file = self.file.as_deref().filter(|file| file.keys.contains(key));
            from_file = from_file.or(file);
            file.map_or_else(|| name(key), |_| key.to_owned())
        };
        let mut text = match (&self.key, &self.value) {
            (None, _) => String::new(),
            (Some(name), _) if self.is_unknown => {
                named(name);
                format!("{name} ")
            }
            (Some(key), None) => format!("{} ", named(key)),
            (Some(key), Some(value)) => format!("{} {}: ", named(key), shortened(value)),
        };
        for (at, part) in self.reason.split('`').enumerate() {
            match at % 2 {
                0 => text += part,
                _ if is_key(part) => text += &named(part),
                _ => text += &format!("`{part}`"),
            }
        }
        match from_file {
            None => text,
            Some(file) => format!("{}: {text}", file.path.display()),
        }
    }
}

impl Display for Refused {
    /// With keys as settings files have them.
    fn fmt(&self, formatter: &mut Formatter) -> fmt::Result {
        formatter.write_str(&self.line(&|key| key.to_owned()))
    }
}

impl Error for Refused {}

/// A list of many values is not printed whole.
fn shortened(value: &str) -> String {
    const MOST: usize = 60;
    match value.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// A name from outside for a reason: its backticks are none of a key.
#[must_use]
pub fn plain(name: impl Display) -> String {
    name.to_string().replace('`', "'")
}

fn is_key(text: &str) -> bool {
    let of_keys =
        |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
    text.chars().all(of_keys)
}

/// An error and what led to it in one line, with every option as `name` has it.
#[must_use]
pub fn line(error: &anyhow::Error, name: &dyn Fn(&str) -> String) -> String {
    let texts = error.chain().map(|cause| match cause.downcast_ref() {
        Some(refused) => Refused::line(refused, name),
        None => cause.to_string(),
    });
    texts.collect::<Vec<_>>().join(": ")
}

/// `error`, which names `file` where it is about a key that the file gave, unless it names one
/// already.
#[must_use]
pub fn blamed(mut error: anyhow::Error, file: Option<&GivenByFile>) -> anyhow::Error {
    if let Some(refused) = error.downcast_mut::<Refused>() {
        let file = file.cloned().map(Box::new);
        refused.file = refused.file.take().or(file);
    }
    error
}

/// The name of a key where options are given one by one: of a flag, less its dashes, and of a keyword.
#[must_use]
pub fn option_name(key: &str) -> &str {
    let other = OTHER_NAMES.iter().find(|(known, _)| *known == key);
    other.map_or(key, |(_, name)| name)
}

/// The options whose keys in a settings file are longer.
const OTHER_NAMES: [(&str, &str); 2] = [("masked", "mask"), ("field_of_view_degrees", "fov")];

/// What a job takes.
pub trait Options: Default {
    /// The keys of all of its options, in groups.
    const KEYS: &'static [&'static [&'static str]];

    /// Sets one of [`Self::KEYS`].
    ///
    /// # Errors
    /// Why it cannot be so.
    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String>;

    /// The place of a key that names a file, whose name need not be text.
    fn file(&mut self, _key: &str) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// Is called once all are set.
    ///
    /// # Errors
    /// An option that is missing, or that excludes another.
    fn check(&self) -> Result<(), Refused> {
        Ok(())
    }
}

/// The options that are given as [`option_name`]s and texts.
///
/// # Errors
/// The first that is wrong.
pub fn read<O: Options>(
    given: impl IntoIterator<Item = (impl AsRef<str>, impl AsRef<OsStr>)>,
) -> Result<O, Refused> {
    let mut options = O::default();
    for (name, value) in given {
        let (name, value) = (name.as_ref(), value.as_ref());
        let mut keys = O::KEYS.iter().copied().flatten().copied();
        let key = keys.find(|key| option_name(key) == name);
        let keys = O::KEYS
            .iter()
            .copied()
            .flatten()
            .map(|key| option_name(key));
        let key = key.ok_or_else(|| Refused::unknown(name, keys))?;
        if value.is_empty() {
            return Err(Refused::new(key, "needs a value"));
        }
        let refused = |reason| Refused::value(key, value.display(), reason);
        if let Some(file) = options.file(key) {
            *file = Some(path(value).map_err(refused)?);
            continue;
        }
        let text = value.to_str().ok_or("must be UTF-8".to_owned());
        text.and_then(|text| options.set(key, text))
            .map_err(refused)?;
    }
    options.check()?;
    Ok(options)
}

/// Values that are chosen by a name.
pub trait Named: Copy + 'static {
    /// Each with its name, and what it is.
    const NAMES: &'static [(&'static str, Self, &'static str)];
}

/// Reads a name.
///
/// # Errors
/// All names.
pub fn named<T: Named>(text: &str) -> Result<T, String> {
    let found = T::NAMES.iter().find(|(name, ..)| *name == text);
    found.map(|(_, value, _)| *value).ok_or_else(|| {
        let names: Vec<&str> = T::NAMES.iter().map(|(name, ..)| *name).collect();
        match names.split_last() {
            Some((last, names)) => format!("must be {} or {last}", names.join(", ")),
            None => String::new(),
        }
    })
}

/// Reads the name of a file or a folder. `-`, elsewhere standard input or output, is none.
///
/// # Errors
/// If it is `-`.
pub fn path(name: &OsStr) -> Result<PathBuf, String> {
    if name == "-" {
        return Err("standard input and output are not supported here; give a name".to_owned());
    }
    Ok(name.into())
}

/// Why [`Options::set`] refuses what is none of its keys.
pub const NO_OPTION: &str = "is no option here";

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    /// A closed output ends the program well: it is found below whatever a file is blamed for.
    #[test]
    fn an_error_of_another_kind_stays_what_it_is() {
        let file = GivenByFile {
            path: "my.toml".into(),
            keys: BTreeSet::from(["l2".to_owned()]),
        };
        let error = io::Error::from(io::ErrorKind::BrokenPipe);
        assert!(blamed(error.into(), Some(&file)).is::<io::Error>());
        let refused = blamed(Refused::new("l2", "is wrong").into(), Some(&file));
        assert_eq!(refused.to_string(), "my.toml: l2 is wrong");
    }
}

//! Options by key and text, numbers and tables as text, and files that appear whole: what the crates of `dtof` share.
//!
//! An option is a row of a table: its key, such as `laser_hz`, its values, its help. The program takes it as a flag, a settings file as a key, Python as a keyword
//! argument. All three set the same field through the same check, so a mistake is the same error. `Refused` is that error:
//! a key, a value and a reason. The caller replaces the key by the name that its user knows.
//!
//! ## Example
//!
//! ```rust
//! use dtof_data::options::keys::{Key, Reader, integer};
//! use dtof_data::options::{NO_OPTION, Options, read};
//!
//! const RATE: Reader<u32> = integer(1, 80_000_000);
//!
//! #[derive(Default)]
//! struct Laser {
//!     hz: Option<u32>,
//! }
//!
//! impl Options for Laser {
//!     const KEYS: &'static [&'static [Key]] =
//!         &[&[Key::new("laser_hz", RATE.kind, "HZ", "Laser cycles a second")]];
//!
//!     fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
//!         match key {
//!             "laser_hz" => self.hz = Some(RATE.read(text)?),
//!             _ => return Err(NO_OPTION.to_owned()),
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let laser: Laser = read([("laser_hz", "10e6")])?;
//! assert_eq!(laser.hz, Some(10_000_000));
//!
//! let refused = read::<Laser>([("laser_hz", "0")]).err().expect("a laser needs a rate");
//! let flag = |key: &str| format!("--{}", key.replace('_', "-"));
//! assert_eq!(refused.line(&flag), "--laser-hz 0: must be a whole number from 1 to 80000000");
//! # Ok::<(), dtof_data::options::Refused>(())
//! ```
//!
//! ## What it does not know
//!
//! - It parses no command line. Only the program `dtof` knows flags.
//! - It knows no photons and no sensor. Each crate names its own keys.
//! - Numbers are decimal, with or without an exponent: `0.5`, `10e6`. Hexadecimal digits and `_` are refused.
//! - The file name `-` is refused. Standard input and output are not supported.
//!
//! ## An error that names another option
//!
//! A reason names other options in backticks, by their keys in a settings file: `false_alarm`.
//! Whoever prints the error replaces a key with the name its user knows, such as `--false-alarm`.
//!
//! ```
//! use dtof_data::options::{Refused, flag, line};
//!
//! let refused = Refused::new("alpha", "is for the rules paper and average; see `false_alarm`");
//! assert_eq!(
//!     line(&refused.into(), &flag),
//!     "--alpha is for the rules paper and average; see --false-alarm"
//! );
//! ```

pub mod files;
pub mod keys;
pub mod numbers;
pub mod progress;
pub mod rows;

use std::collections::BTreeSet;
use std::error::Error;
use std::ffi::OsStr;
use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use keys::Key;

/// An error about an option or an input: a key, a value and a reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The key of the option; `None` if an input is refused.
    pub key: Option<String>,
    /// The value, if the value is wrong.
    pub value: Option<String>,
    /// The reason. Other options stand in backticks.
    pub reason: String,
    /// No option has this key; the user wrote it.
    is_unknown: bool,
    /// The settings file that set some of the options.
    file: Option<Box<KeysOfFile>>,
}

/// The keys that a settings file sets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeysOfFile {
    /// The path itself, with links resolved, or what else set the keys.
    pub path: PathBuf,
    /// Its keys, except those that an option has overridden.
    pub keys: BTreeSet<String>,
}

impl Refused {
    /// The option `key` cannot be used here. The reason follows its name, as in "is for `rule`
    /// window".
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
        let (value, mut reason) = (value.to_string(), reason.into());
        let number = value.trim_end_matches(char::is_alphabetic).trim_end();
        let has_unit = number.len() < value.len() && numbers::real(number).is_some();
        if has_unit
            && ["must be a number", "must be a whole"]
                .iter()
                .any(|text| reason.starts_with(text))
        {
            reason += "; write it without a unit";
        }
        Self {
            value: Some(value),
            ..Self::new(key, reason)
        }
    }

    /// No option is called `name`, as the user wrote it. Suggests the most similar of `keys`, if one is. A key of a
    /// settings file is unknown in its section, such as `[sensor]`.
    #[must_use]
    pub fn unknown<'a>(
        name: &str,
        section: Option<&str>,
        keys: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        let place = section.map_or(String::new(), |section| format!(" in [{section}]"));
        let nearest = most_similar(name, keys);
        let hint = nearest.map_or(String::new(), |key| format!("; is it `{key}`?"));
        Self {
            is_unknown: true,
            ..Self::new(name, format!("is unknown{place}{hint}"))
        }
    }

    /// The error in one line. `name` gives the name of each key, unless a settings file set it.
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
        text += &with_names(&self.reason, named);
        if let Some(file) = from_file {
            text = format!("{}: {text}", file.path.display());
        }
        // What a user or a file wrote may have several lines.
        rows::printable(&text)
    }
}

impl Display for Refused {
    /// Names keys as settings files do.
    fn fmt(&self, formatter: &mut Formatter) -> fmt::Result {
        formatter.write_str(&self.line(&|key| key.to_owned()))
    }
}

impl Error for Refused {}

/// The key that `name` probably stands for: one that `name` begins, or that begins with it, or else the one with the
/// fewest typing errors, at most two in five letters. Dashes, underscores and case make no difference.
fn most_similar<'a>(name: &str, keys: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |text: &str| text.to_ascii_lowercase().replace(['-', '_'], "");
    let name = plain(name);
    let distance = |key: &str| {
        let key = plain(key);
        let shorter = name.len().min(key.len());
        if shorter >= 2 && (key.starts_with(&name) || name.starts_with(&key)) {
            // Nearer than a typing error, and the nearer the less is missing.
            let missing = name.len().abs_diff(key.len());
            return Some((0, missing));
        }
        let errors = strsim::damerau_levenshtein(&name, &key);
        (5 * errors <= 2 * name.chars().count().max(key.len())).then_some((errors, 0))
    };
    let similar = keys
        .into_iter()
        .filter_map(|key| Some((distance(key)?, key)));
    similar.min().map(|(_, key)| key)
}

/// Long lists are cut off.
fn shortened(value: &str) -> String {
    const MOST: usize = 60;
    match value.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// Replaces the backticks of a name from outside, which would mark a key.
#[must_use]
pub fn plain(name: impl Display) -> String {
    name.to_string().replace('`', "'")
}

/// A text with the name that `name` gives to each key in backticks.
#[must_use]
pub fn with_names(text: &str, mut name: impl FnMut(&str) -> String) -> String {
    let named = |(at, part): (usize, &str)| match at % 2 {
        0 => part.to_owned(),
        _ if is_key(part) => name(part),
        _ => format!("`{part}`"),
    };
    text.split('`').enumerate().map(named).collect()
}

fn is_key(text: &str) -> bool {
    let is_key_letter =
        |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
    text.chars().all(is_key_letter)
}

/// An error and its causes in one line, with the name that `name` gives to each key.
#[must_use]
pub fn line(error: &anyhow::Error, name: &dyn Fn(&str) -> String) -> String {
    let texts = error.chain().map(|cause| match cause.downcast_ref() {
        Some(refused) => Refused::line(refused, name),
        None => cause.to_string(),
    });
    texts.collect::<Vec<_>>().join(": ")
}

/// Adds to `error` that `file` set the option it is about. Keeps a file that is already named.
#[must_use]
pub fn add_file_name(mut error: anyhow::Error, file: Option<&KeysOfFile>) -> anyhow::Error {
    if let Some(refused) = error.downcast_mut::<Refused>() {
        let file = file.cloned().map(Box::new);
        refused.file = refused.file.take().or(file);
    }
    error
}

/// The name of a key as a flag, without its dashes, and as a keyword of Python.
#[must_use]
pub fn option_name(key: &str) -> &str {
    let found = OTHER_NAMES.iter().find(|(other, _)| *other == key);
    found.map_or(key, |(_, name)| name)
}

/// The flag of a key. Other names, such as `<FILE>`, stay as they are.
#[must_use]
pub fn flag(key: &str) -> String {
    if !key.starts_with(char::is_alphabetic) {
        return key.to_owned();
    }
    format!("--{}", option_name(key).replace('_', "-"))
}

/// Options whose keys in a settings file are longer than their names.
const OTHER_NAMES: [(&str, &str); 2] = [("masked", "mask"), ("field_of_view_degrees", "fov")];

/// The options of a job.
pub trait Options: Default {
    /// The keys of all options, in groups.
    const KEYS: &'static [&'static [Key]];

    /// Sets one of [`Self::KEYS`].
    ///
    /// # Errors
    /// Says what the value must be, or returns [`NO_OPTION`] for another key.
    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String>;

    /// Where to put the path, if `key` names a file. Its name need not be UTF-8.
    fn file(&mut self, _key: &str) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// Checks the options together, once all are set.
    ///
    /// # Errors
    /// Fails if an option is missing or excludes another.
    fn check(&self) -> Result<(), Refused> {
        Ok(())
    }
}

/// Reads options given by [`option_name`] and text.
///
/// # Errors
/// Returns the first error.
pub fn read<O: Options>(
    given: impl IntoIterator<Item = (impl AsRef<str>, impl AsRef<OsStr>)>,
) -> Result<O, Refused> {
    let mut options = O::default();
    for (name, value) in given {
        let (name, value) = (name.as_ref(), value.as_ref());
        let keys = || O::KEYS.iter().copied().flatten().map(|key| key.name);
        let key = keys().find(|key| option_name(key) == name);
        let key = key.ok_or_else(|| Refused::unknown(name, None, keys().map(option_name)))?;
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

/// Values that have names.
pub trait Named: Copy + 'static {
    /// Each name with its value and its help.
    const NAMES: &'static [(&'static str, Self, &'static str)];
}

/// Defines an enum whose values have names. The doc comment of a value is its help.
///
/// ```
/// use dtof_data::named_values;
/// use dtof_data::options::named;
///
/// named_values! {
///     /// An end of a list.
///     #[derive(Debug, PartialEq)]
///     pub enum End {
///         /// The lowest bin
///         First = "first",
///         /// The highest bin
///         Last = "last",
///     }
/// }
/// assert_eq!(named("last"), Ok(End::Last));
/// assert_eq!(named::<End>("best").unwrap_err(), "must be first or last");
/// ```
#[macro_export]
macro_rules! named_values {
    (
        $(#[$of_enum:meta])*
        $visibility:vis enum $type:ident {
            $(#[doc = $help:literal] $(#[$of_value:meta])* $value:ident = $name:literal,)+
        }
    ) => {
        $(#[$of_enum])*
        #[derive(Clone, Copy)]
        $visibility enum $type {
            $(#[doc = $help] $(#[$of_value])* $value,)+
        }

        impl $crate::options::Named for $type {
            const NAMES: &'static [(&'static str, Self, &'static str)] =
                &[$(($name, Self::$value, $help.trim_ascii())),+];
        }
    };
}

/// Reads a name.
///
/// # Errors
/// Lists all names if `text` is none of them.
pub fn named<T: Named>(text: &str) -> Result<T, String> {
    let found = T::NAMES.iter().find(|(name, ..)| *name == text);
    found.map(|(_, value, _)| *value).ok_or_else(|| {
        let names: Vec<&str> = T::NAMES.iter().map(|(name, ..)| *name).collect();
        format!("must be {}", keys::any_of(&names))
    })
}

/// Reads the name of a file or a folder. `-`, which elsewhere means standard input or output, is
/// refused.
///
/// # Errors
/// Fails if it is `-` or empty.
pub fn path(name: &OsStr) -> Result<PathBuf, String> {
    if name == "-" {
        return Err("standard input and output are not supported here; give a name".to_owned());
    }
    if name.is_empty() {
        return Err("must be the name of a file or folder".to_owned());
    }
    Ok(name.into())
}

/// The reason why [`Options::set`] refuses a key that it does not have.
pub const NO_OPTION: &str = "is not an option here";

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_number_with_a_unit_is_refused_with_a_hint() {
        let reason = "must be a number above 0";
        for (value, hint) in [
            ("0.25ns", "; write it without a unit"),
            ("3 m", "; write it without a unit"),
            ("-3", ""),
            ("ns", ""),
            ("", ""),
        ] {
            let refused = Refused::value("bin_width_ps", value, reason);
            assert_eq!(refused.reason, format!("{reason}{hint}"), "{value}");
        }
    }

    #[test]
    fn only_what_is_probably_meant_is_suggested() {
        let keys = "input,bins,binning,bin_width_ps,columns,alpha,sigma_bins,l1,l2,x,z,mask,rule,min_count,gate,seed,\
                    neighbours,cycles,recorded_cycles,out,capture";
        for (name, expected) in [
            ("--in", Some("input")),
            ("--bin", Some("bins")),
            ("--alfa", Some("alpha")),
            ("colums", Some("columns")),
            ("Sigma-Bins", Some("sigma_bins")),
            ("sigma", Some("sigma_bins")),
            ("masked", Some("mask")),
            ("rules", Some("rule")),
            ("binwidthps", Some("bin_width_ps")),
            ("neighbors", Some("neighbours")),
            ("otu", Some("out")),
            ("l3", None),
            ("q", None),
            ("at", None),
            ("age", None),
            ("verbose", None),
            ("temperature", None),
            ("käse", None),
            ("", None),
        ] {
            assert_eq!(most_similar(name, keys.split(',')), expected, "{name}");
        }
    }

    /// The program ends without an error if its output is closed, so this error must be found below
    /// any context.
    #[test]
    fn an_error_of_another_kind_stays_what_it_is() {
        let file = KeysOfFile {
            path: "my.toml".into(),
            keys: BTreeSet::from(["l2".to_owned()]),
        };
        let error = io::Error::from(io::ErrorKind::BrokenPipe);
        assert!(add_file_name(error.into(), Some(&file)).is::<io::Error>());
        let refused = add_file_name(Refused::new("l2", "is wrong").into(), Some(&file));
        assert_eq!(refused.to_string(), "my.toml: l2 is wrong");
    }
}

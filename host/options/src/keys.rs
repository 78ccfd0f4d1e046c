//! The table of an option: its key, its values and its help. Flags, settings files, keywords of Python and documents
//! are made from it.

use std::fmt::Display;
use std::str::FromStr;

use dtof_core::fixed::traits::Fixed;

use crate::{Named, numbers};

/// An option.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Its key in a settings file.
    pub name: &'static str,
    /// Its values.
    pub kind: Kind,
    /// The name of the value in the help of the program.
    pub value: &'static str,
    /// What it does, its range and its default. Names of other options stand as flags.
    pub help: &'static str,
    /// The comment in a settings file.
    pub comment: &'static str,
}

/// The values of an option.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// A whole number from the first to the last.
    Integer(u64, u64),
    /// One of these whole numbers.
    Choice(&'static [u64]),
    /// A fixed-point number, between these ends.
    Fixed(fn() -> [String; 2]),
    /// Another number: its range in words.
    Real(&'static str),
    /// `true` or `false`; its flag needs no value.
    Switch,
    /// A flag without a value.
    Flag,
    /// `yes` or `no`.
    YesOrNo,
    /// A name, with its help.
    OneOf(fn() -> Vec<[&'static str; 2]>),
    /// Whole numbers: which, and an example in Python.
    Integers(&'static str),
    /// Numbers: which, and an example in Python.
    Numbers(&'static str),
    /// Names: which.
    Names(&'static str),
    /// A text.
    Text,
    /// A file.
    File,
    /// A settings file, or what stands for one.
    Settings,
}

impl Key {
    /// An option that no settings file has.
    #[must_use]
    pub const fn new(
        name: &'static str,
        kind: Kind,
        value: &'static str,
        help: &'static str,
    ) -> Self {
        Self {
            name,
            kind,
            value,
            help,
            comment: "",
        }
    }

    /// The option `name` of `keys`, for constants.
    ///
    /// # Panics
    /// Panics if there is none.
    #[must_use]
    pub const fn of(keys: &'static [Self], name: &str) -> Self {
        let mut at = 0;
        while at < keys.len() {
            if is_equal(keys[at].name.as_bytes(), name.as_bytes()) {
                return keys[at];
            }
            at += 1;
        }
        panic!("no option has this name");
    }

    /// The same with the help of another job.
    #[must_use]
    pub const fn with_help(self, help: &'static str) -> Self {
        Self { help, ..self }
    }
}

const fn is_equal(one: &[u8], other: &[u8]) -> bool {
    let mut at = 0;
    while at < one.len() && at < other.len() {
        if one[at] != other[at] {
            return false;
        }
        at += 1;
    }
    one.len() == other.len()
}

impl Kind {
    /// Whether a settings file has it as a list.
    #[must_use]
    pub const fn is_list(self) -> bool {
        matches!(self, Self::Integers(_) | Self::Numbers(_))
    }

    /// Whether a settings file has it in quotes.
    #[must_use]
    pub const fn is_text(self) -> bool {
        matches!(
            self,
            Self::OneOf(_) | Self::Names(_) | Self::Text | Self::File
        )
    }

    /// The kind and the range in words, for Python.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::Integer(first, last) => format!("whole number, {first} to {last}"),
            Self::Choice(numbers) => any_of(numbers),
            Self::Fixed(ends) => format!("number, {}", ends().join(" to ")),
            Self::Real(range) => format!("number{range}"),
            Self::Switch | Self::Flag | Self::YesOrNo => "True or False".to_owned(),
            Self::OneOf(names) => {
                let names: Vec<_> = names().iter().map(|[name, _]| *name).collect();
                any_of(&names)
            }
            Self::Integers(words) | Self::Numbers(words) | Self::Names(words) => words.to_owned(),
            Self::Text => "text".to_owned(),
            Self::File => "file".to_owned(),
            Self::Settings => {
                "file, text of several lines, dict of sections, or a result with settings"
                    .to_owned()
            }
        }
    }
}

/// Values as "8 or 10" or "paper, average or window".
pub(crate) fn any_of(values: &[impl Display]) -> String {
    let texts: Vec<String> = values.iter().map(ToString::to_string).collect();
    match texts.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    }
}

/// How the text of an option becomes a value.
pub struct Reader<T> {
    /// The values.
    pub kind: Kind,
    read: fn(Kind, &str) -> Result<T, String>,
}

impl<T> Reader<T> {
    /// Values of a kind that `read` takes.
    pub const fn new(kind: Kind, read: fn(Kind, &str) -> Result<T, String>) -> Self {
        Self { kind, read }
    }

    /// Reads a value.
    ///
    /// # Errors
    /// Says what it must be.
    pub fn read(&self, text: &str) -> Result<T, String> {
        (self.read)(self.kind, text)
    }
}

/// Whole numbers from the first to the last.
#[must_use]
pub const fn integer<T: TryFrom<u64>>(first: u64, last: u64) -> Reader<T> {
    Reader::new(Kind::Integer(first, last), |kind, text| {
        let Kind::Integer(first, last) = kind else {
            return Err(String::new());
        };
        let number = numbers::integer(first..=last)(text)?;
        T::try_from(number).map_err(|_| "is too large".to_owned())
    })
}

/// One of some whole numbers.
#[must_use]
pub const fn choice<T: TryFrom<u64>>(numbers: &'static [u64]) -> Reader<T> {
    Reader::new(Kind::Choice(numbers), |kind, text| {
        let numbers = match kind {
            Kind::Choice(numbers) => numbers,
            _ => &[],
        };
        let number = numbers::integer(0..=u64::MAX)(text).ok();
        let number = number.filter(|number| numbers.contains(number));
        let number = number.and_then(|number| T::try_from(number).ok());
        number.ok_or_else(|| format!("must be {}", any_of(numbers)))
    })
}

/// Fixed-point numbers.
#[must_use]
pub const fn fixed<T: Fixed + FromStr>() -> Reader<T> {
    Reader::new(
        Kind::Fixed(|| [T::MIN.to_string(), T::MAX.to_string()]),
        |_, text| numbers::fixed(text),
    )
}

/// `true` or `false`.
#[must_use]
pub const fn boolean() -> Reader<bool> {
    Reader::new(Kind::Switch, |_, text| numbers::boolean(text))
}

/// Names.
#[must_use]
pub const fn named<T: Named>() -> Reader<T> {
    Reader::new(Kind::OneOf(names::<T>), |_, text| crate::named(text))
}

/// The names that `T` has, with their help.
#[must_use]
pub fn names<T: Named>() -> Vec<[&'static str; 2]> {
    let names = T::NAMES.iter();
    names.map(|&(name, _, help)| [name, help]).collect()
}

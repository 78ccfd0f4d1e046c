//! The table of an option: its key, its values and its help. Flags, settings files, keywords of Python and documents
//! are made from it.

use std::fmt::Display;
use std::str::FromStr;

use dtof_core::fixed::traits::Fixed;

use crate::options::{Named, numbers};

/// An option.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Its key in a settings file.
    pub name: &'static str,
    /// Its values.
    pub kind: Kind,
    /// The name of the value in the help of the program.
    pub value: &'static str,
    /// What it does, its range and its default. Keys of other options stand in backticks.
    pub help: &'static str,
    /// The comment in a settings file.
    pub comment: &'static str,
}

/// The values of an option.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// A whole number from the first to the last.
    Integer(u64, u64),
    /// A power of two from the first to the last.
    PowerOfTwo(u64, u64),
    /// An even number up to this one.
    Even(u64),
    /// One of these whole numbers.
    Choice(&'static [u64]),
    /// A fixed-point number, between these ends.
    Fixed(fn() -> [String; 2]),
    /// A number from the first to the last.
    Real(f64, f64),
    /// A number above 0, up to this one.
    AboveZero(f64),
    /// `true` or `false`; its flag needs no value.
    Switch,
    /// A flag without a value.
    Flag,
    /// `yes` or `no`.
    YesOrNo,
    /// A name, with its help.
    OneOf(fn() -> Vec<[&'static str; 2]>),
    /// Whole numbers: which, and an example.
    Integers(&'static str),
    /// Numbers: which, and an example.
    Numbers(&'static str),
    /// The same, which may be below 0.
    SignedNumbers(&'static str),
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
        matches!(
            self,
            Self::Integers(_) | Self::Numbers(_) | Self::SignedNumbers(_)
        )
    }

    /// Whether a settings file has it in quotes.
    #[must_use]
    pub const fn is_text(self) -> bool {
        matches!(
            self,
            Self::OneOf(_) | Self::Names(_) | Self::Text | Self::File
        )
    }

    /// The kind and the range in words.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::Integer(first, last) => format!("whole number, {first} to {last}"),
            Self::PowerOfTwo(first, last) => format!("power of two, {first} to {last}"),
            Self::Even(last) => format!("even number, 0 to {last}"),
            Self::Choice(numbers) => any_of(numbers),
            Self::Fixed(ends) => format!("number, {}", ends().join(" to ")),
            Self::Real(first, last) => format!("number, {first} to {last}"),
            Self::AboveZero(f64::INFINITY) => "number above 0".to_owned(),
            Self::AboveZero(last) => format!("number above 0, at most {last}"),
            Self::Switch | Self::Flag | Self::YesOrNo => "true or false".to_owned(),
            Self::OneOf(names) => {
                let names: Vec<_> = names().iter().map(|[name, _]| *name).collect();
                any_of(&names)
            }
            Self::Integers(words)
            | Self::Numbers(words)
            | Self::SignedNumbers(words)
            | Self::Names(words) => words.to_owned(),
            Self::Text => "text".to_owned(),
            Self::File => "file".to_owned(),
            Self::Settings => "settings file".to_owned(),
        }
    }
}

impl Kind {
    /// Reads a number in the range of this kind.
    ///
    /// # Errors
    /// Says what the number must be.
    fn real(self, text: &str) -> Result<f64, String> {
        let is_in_range = |number: &f64| match self {
            Self::Real(first, last) => (first..=last).contains(number),
            Self::AboveZero(last) => *number > 0.0 && *number <= last,
            _ => true,
        };
        let number = numbers::real(text).filter(is_in_range);
        number.ok_or_else(|| match self {
            Self::Real(first, last) => format!("must be a number from {first} to {last}"),
            kind => format!("must be a {}", kind.words()),
        })
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

    /// [`Self::read`] as a function.
    pub fn parser(self) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync {
        let Self { kind, read } = self;
        move |text| read(kind, text)
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

/// Numbers of bins that a histogram can have.
#[must_use]
pub const fn bins() -> Reader<u16> {
    Reader::new(Kind::PowerOfTwo(8, 1024), |_, text| numbers::bins(text))
}

/// Numbers from the first to the last.
#[must_use]
pub const fn real(first: f64, last: f64) -> Reader<f64> {
    Reader::new(Kind::Real(first, last), Kind::real)
}

/// Numbers above 0, up to `last`.
#[must_use]
pub const fn above_zero(last: f64) -> Reader<f64> {
    Reader::new(Kind::AboveZero(last), Kind::real)
}

/// Numbers above 0.
pub const POSITIVE: Reader<f64> = above_zero(f64::INFINITY);

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

/// `yes` or `no`.
#[must_use]
pub const fn yes_or_no() -> Reader<bool> {
    Reader::new(Kind::YesOrNo, |_, text| match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("must be yes or no".to_owned()),
    })
}

/// Names.
#[must_use]
pub const fn named<T: Named>() -> Reader<T> {
    Reader::new(Kind::OneOf(names::<T>), |_, text| {
        crate::options::named(text)
    })
}

/// The names that `T` has, with their help.
#[must_use]
pub fn names<T: Named>() -> Vec<[&'static str; 2]> {
    let names = T::NAMES.iter();
    names.map(|&(name, _, help)| [name, help]).collect()
}

/// Defines options: the table of their keys, in the order in which they are written. Each has its type and its values,
/// the name of the value and the help for its flag, and its comment in a settings file, if it is in one.
///
/// ```
/// use dtof_data::options::keys::{above_zero, integer};
/// use dtof_data::option_table;
///
/// option_table! {
///     /// A laser.
///     #[derive(Default)]
///     pub struct Laser {
///         hz: u32 = integer(1, 80_000_000), "HZ", "Laser cycles a second";
///         sigma_ps: f64 = above_zero(1e6), "PS", "Standard deviation of the pulse";
///     }
/// }
/// let mut laser = Laser::default();
/// laser.set("hz", "10e6")?;
/// assert_eq!(laser.hz, Some(10_000_000));
/// assert_eq!(Laser::KEYS[1].help, "Standard deviation of the pulse");
/// # Ok::<(), String>(())
/// ```
#[macro_export]
macro_rules! option_table {
    (
        $(#[$of_options:meta])*
        pub struct $options:ident {$(
            $(#[$of_key:meta])*
            $key:ident: $type:ty = $values:expr, $value:literal, $help:literal $(, $comment:literal)?;
        )+}
    ) => {
        $(#[$of_options])*
        pub struct $options {
            $(#[doc = $help] $(#[$of_key])* pub $key: Option<$type>,)+
        }

        impl $options {
            /// The keys.
            pub const KEYS: &'static [$crate::options::keys::Key] = &[$({
                const VALUES: $crate::options::keys::Reader<$type> = $values;
                $crate::options::keys::Key {
                    name: stringify!($key),
                    kind: VALUES.kind,
                    value: $value,
                    help: $help,
                    comment: concat!($($comment)?),
                }
            }),+];

            /// Sets one of [`Self::KEYS`].
            ///
            /// # Errors
            /// Says what the value must be.
            pub fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
                match key {
                    $(stringify!($key) => {
                        const VALUES: $crate::options::keys::Reader<$type> = $values;
                        self.$key = Some(VALUES.read(text)?);
                    })+
                    _ => return Err($crate::options::NO_OPTION.to_owned()),
                }
                Ok(())
            }

            /// Each key of `self`, or that of `other` if `self` lacks it.
            #[must_use]
            pub fn first_of(self, other: Self) -> Self {
                Self { $($key: self.$key.or(other.$key)),+ }
            }
        }
    };
}

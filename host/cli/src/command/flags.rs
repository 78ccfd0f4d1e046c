//! The flags of jobs, from the tables of their options.

use std::ffi::{OsStr, OsString};

use clap::builder::{OsStringValueParser, PossibleValue, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use dtof_data::options::keys::{Key, Kind, names};
use dtof_data::options::{Named, Options, flag, named, option_name, with_names};

/// The options of a job, read from flags.
pub struct Flags<O>(pub O);

/// The names that a value may have, with their help.
type Names = Vec<[&'static str; 2]>;

/// The flag of an option.
fn arg(key: &Key) -> Arg {
    let arg = Arg::new(key.name)
        .long(flag(key.name)[2..].to_owned())
        .help(with_names(key.help, flag));
    let hinted = |names: Names| {
        arg.clone()
            .value_name(key.value)
            .value_parser(Hinted(names))
    };
    let plain = |names: &[&'static str]| names.iter().map(|name| [*name, ""]).collect();
    match key.kind {
        Kind::OneOf(names) => hinted(names()),
        Kind::YesOrNo => hinted(plain(&["yes", "no"])),
        Kind::Switch => hinted(plain(&["true", "false"]))
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value("true"),
        Kind::Flag => arg.action(ArgAction::SetTrue),
        // Numbers below 0 are values, and may be refused as such.
        Kind::Fixed(_) | Kind::SignedNumbers(_) => arg
            .value_name(key.value)
            .value_parser(OsStringValueParser::new().try_map(not_a_flag))
            .allow_hyphen_values(true),
        _ => arg
            .value_name(key.value)
            .value_parser(OsStringValueParser::new())
            .allow_negative_numbers(true),
    }
}

/// The value, unless it is the next flag.
fn not_a_flag(value: OsString) -> Result<OsString, &'static str> {
    match value.as_encoded_bytes().starts_with(b"--") {
        true => Err("is a flag, not a value"),
        false => Ok(value),
    }
}

/// The text of an option, if it is given.
fn text(key: &Key, matches: &ArgMatches) -> Option<OsString> {
    match key.kind {
        Kind::Flag => matches.get_flag(key.name).then(|| "true".into()),
        _ => matches.get_one(key.name).cloned(),
    }
}

/// Accepts any text; the help lists these names. The option refuses others later.
#[derive(Clone)]
struct Hinted(Names);

impl TypedValueParser for Hinted {
    type Value = OsString;

    fn parse_ref(&self, _: &Command, _: Option<&Arg>, value: &OsStr) -> Result<OsString, Error> {
        Ok(value.to_owned())
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let value = |&[name, help]: &[&'static str; 2]| match help {
            "" => PossibleValue::new(name),
            help => PossibleValue::new(name).help(help),
        };
        Some(Box::new(self.0.iter().map(value)))
    }
}

fn keys<O: Options>() -> impl Iterator<Item = &'static Key> {
    O::KEYS.iter().copied().flatten()
}

impl<O: Options> Args for Flags<O> {
    fn augment_args(command: Command) -> Command {
        command.args(keys::<O>().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: Options> FromArgMatches for Flags<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given =
            keys::<O>().filter_map(|key| Some((option_name(key.name), text(key, matches)?)));
        let refused = |refused: dtof_data::options::Refused| {
            Error::raw(ErrorKind::ValueValidation, refused.line(&flag))
        };
        dtof_data::options::read(given).map(Self).map_err(refused)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// A value of the program that is chosen by a name.
pub fn name<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    Hinted(names::<T>()).try_map(|text| named(&text.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_data::options::NO_OPTION;
    use dtof_run::export::ProjectionOptions;
    use dtof_run::given::Operation;
    use dtof_run::{calibrate, compare, replay, simulate, tune};

    /// Values of a kind: some that it takes, and some that it does not.
    fn tried(kind: Kind) -> [Vec<String>; 2] {
        let texts = |numbers: &[Option<u64>]| -> Vec<String> {
            numbers.iter().flatten().map(u64::to_string).collect()
        };
        match kind {
            Kind::Integer(first, last) | Kind::PowerOfTwo(first, last) => [
                texts(&[Some(first), Some(last)]),
                texts(&[first.checked_sub(1), last.checked_add(1)]),
            ],
            Kind::Even(last) => [
                texts(&[Some(0), Some(last)]),
                texts(&[Some(1), Some(last + 2)]),
            ],
            Kind::Choice(numbers) => {
                let past = numbers.iter().flat_map(|number| number.checked_add(1));
                let past = past.filter(|number| !numbers.contains(number));
                [
                    texts(&numbers.iter().copied().map(Some).collect::<Vec<_>>()),
                    texts(&past.map(Some).collect::<Vec<_>>()),
                ]
            }
            Kind::Real(first, last) => [
                vec![first.to_string(), last.to_string()],
                vec![(first - 1e-9).to_string(), (last + 1.0).to_string()],
            ],
            Kind::AboveZero(last) => [
                vec![last.min(1e300).to_string()],
                vec!["0".to_owned(), "-1".to_owned(), (last * 1.01).to_string()],
            ],
            Kind::Fixed(ends) => [ends().to_vec(), vec!["1e9".to_owned()]],
            Kind::Switch | Kind::Flag => [vec!["true".to_owned()], vec!["yes".to_owned()]],
            Kind::YesOrNo => [vec!["no".to_owned()], vec!["true".to_owned()]],
            Kind::OneOf(names) => [
                names().iter().map(|[name, _]| (*name).to_owned()).collect(),
                vec!["best of all".to_owned()],
            ],
            _ => [Vec::new(), Vec::new()],
        }
    }

    /// Each key is one that can be set, to what its kind says and no other. Its help names keys of the same job. It
    /// takes no flag for its value.
    fn keys_of<O: Options>() {
        let mut seen = Vec::new();
        let flags = || {
            Flags::<O>::augment_args(Command::new("job"))
                .arg(Arg::new("other").long("other").action(ArgAction::SetTrue))
        };
        for key in keys::<O>() {
            let _ = with_names(key.help, |other| {
                let is_key = other == "settings" || keys::<O>().any(|key| key.name == other);
                assert!(is_key, "{}: `{other}`", key.name);
                String::new()
            });
            let line = ["job".to_owned(), flag(key.name), "--other".to_owned()];
            let takes_none = matches!(key.kind, Kind::Flag | Kind::Switch);
            assert_eq!(
                flags().try_get_matches_from(line).is_ok(),
                takes_none,
                "{key:?}"
            );
            let set = |text: &str| O::default().set(key.name, text);
            let is_file = O::default().file(key.name).is_some();
            assert!(is_file || set("\0") != Err(NO_OPTION.to_owned()), "{key:?}");
            assert!(!seen.contains(&key.name), "{key:?}");
            seen.push(key.name);
            let [taken, refused] = tried(key.kind);
            for text in taken {
                assert_eq!(set(&text), Ok(()), "{text}: {key:?}");
            }
            for text in refused {
                assert!(set(&text).is_err(), "{text}: {key:?}");
            }
        }
        assert_eq!(O::default().set("sed", "5"), Err(NO_OPTION.to_owned()));
    }

    #[test]
    fn every_option_of_a_job_has_its_flag() {
        keys_of::<Operation>();
        keys_of::<ProjectionOptions>();
        keys_of::<replay::Options>();
        keys_of::<simulate::Options>();
        keys_of::<calibrate::Options>();
        keys_of::<compare::job::Options>();
        keys_of::<tune::Options>();
    }
}

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
        // Numbers below 0 are values, and are refused as such.
        Kind::Fixed(_) | Kind::Numbers(_) => arg
            .value_name(key.value)
            .value_parser(OsStringValueParser::new())
            .allow_hyphen_values(true),
        _ => arg
            .value_name(key.value)
            .value_parser(OsStringValueParser::new())
            .allow_negative_numbers(true),
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
    use dtof_export::ProjectionOptions;
    use dtof_run::given::Operation;
    use dtof_run::{calibrate, compare, replay, simulate, tune};

    /// Each key is one that can be set; a whole number has the ends of its range, and no other.
    fn keys_of<O: Options>() {
        let mut seen = Vec::new();
        for key in keys::<O>() {
            let set = |text: &str| O::default().set(key.name, text);
            let is_file = O::default().file(key.name).is_some();
            assert!(is_file || set("\0") != Err(NO_OPTION.to_owned()), "{key:?}");
            assert!(!seen.contains(&key.name), "{key:?}");
            seen.push(key.name);
            if let Kind::Integer(first, last) = key.kind {
                let [low, high] = [first, last].map(|end| set(&end.to_string()));
                // Some have further conditions, as a power of two.
                assert!(low.is_ok() && high.is_ok(), "{key:?}");
                let past = [first.checked_sub(1), last.checked_add(1)];
                for past in past.into_iter().flatten() {
                    assert!(set(&past.to_string()).is_err(), "{past}: {key:?}");
                }
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
        keys_of::<compare::Options>();
        keys_of::<tune::Options>();
    }
}

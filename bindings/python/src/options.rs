//! The keywords of each function, from the tables of the options.

use dtof_data::options::keys::{Key, Kind};
use dtof_data::options::{Options, option_name, with_names};
use dtof_run::export::ProjectionOptions;
use dtof_run::given::{DITHER, Operation};
use dtof_run::recording::RECORDING;
use dtof_run::{calibrate, compare, replay, simulate, tune};
use pyo3::prelude::*;

/// A keyword: its name, its type in Python, its values in words, and its help.
type Keyword = (&'static str, String, String, String);

/// The keywords of each function by the name of their type.
#[pyfunction]
pub fn keywords() -> Vec<(&'static str, Vec<Keyword>)> {
    let is_in = |keys: &[Key], key: &Key| keys.iter().any(|other| other.name == key.name);
    let loads = |key: &Key| is_in(RECORDING, key) || ["settings", "cycles"].contains(&key.name);
    vec![
        ("LoadOptions", of::<replay::Options>(loads)),
        ("ReplayOptions", of::<replay::Options>(|_| true)),
        ("SimulateOptions", of::<simulate::Options>(|_| true)),
        ("CalibrateOptions", of::<calibrate::Options>(|_| true)),
        ("CompareOptions", of::<compare::job::Options>(|_| true)),
        ("TuneOptions", of::<tune::Options>(|_| true)),
        // Pixels without a device have no laser.
        ("PixelOptions", of::<Operation>(|key| !is_in(DITHER, key))),
        ("PointsOptions", of::<ProjectionOptions>(|_| true)),
    ]
}

fn of<O: Options>(has: impl Fn(&Key) -> bool) -> Vec<Keyword> {
    let keys = O::KEYS.iter().copied().flatten().filter(|key| has(key));
    let keyword = |key: &Key| {
        let name = option_name(key.name);
        let help = with_names(key.help, |key| option_name(key).to_owned());
        (name, type_of(key.kind), words(key.kind), help)
    };
    keys.map(keyword).collect()
}

/// The values in Python's words.
fn words(kind: Kind) -> String {
    match kind {
        Kind::Switch | Kind::Flag | Kind::YesOrNo => "True or False".to_owned(),
        Kind::Settings => {
            "file, text of several lines, dict of sections, or a result with settings".to_owned()
        }
        kind => kind.words(),
    }
}

fn type_of(kind: Kind) -> String {
    match kind {
        Kind::Integer(..) | Kind::PowerOfTwo(..) | Kind::Even(_) | Kind::Choice(_) => "Integer",
        Kind::Fixed(_) | Kind::Real(..) | Kind::AboveZero(_) => "Number",
        Kind::Switch | Kind::Flag | Kind::YesOrNo => "Switch",
        Kind::Integers(_) => "Integers",
        Kind::Numbers(_) | Kind::SignedNumbers(_) => "Numbers",
        Kind::Names(_) => "Names",
        Kind::Text => "Text",
        Kind::File => "Path",
        Kind::Settings => "Settings",
        Kind::OneOf(names) => {
            let names: Vec<String> = names()
                .iter()
                .map(|[name, _]| format!("{name:?}"))
                .collect();
            return format!("Optional[Literal[{}]]", names.join(", "));
        }
    }
    .to_owned()
}

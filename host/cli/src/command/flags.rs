//! The flags of jobs: the only place where an option of the library gets a name, a value's name and help.

use std::ffi::{OsStr, OsString};

use clap::builder::{OsStringValueParser, PossibleValue, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use dtof::flag;
use dtof_engine::settings::{EstimatorName, RuleName};
use dtof_events::echoes::Echo;
use dtof_export::Projected;
use dtof_options::{Named, Options, named, option_name};
use dtof_run::given::Operation;
use dtof_run::{calibrate, compare, replay, simulate, tune};

/// Options of a job that flags give.
pub struct Flags<O>(pub O);

/// The flags of a job.
pub trait HasFlags: Options {
    /// In the order of the help.
    fn flags() -> Vec<Flag>;
}

/// A flag of an option.
#[derive(Clone, Copy)]
pub struct Flag {
    key: &'static str,
    value: Value,
    help: &'static str,
}

/// What follows a flag.
#[derive(Clone, Copy)]
enum Value {
    /// A text, called so in the help.
    Called(&'static str),
    /// The same, which may begin with a hyphen.
    Signed(&'static str),
    /// One of these names.
    OneOf(fn() -> Vec<PossibleValue>),
    /// Nothing.
    Switch,
    /// Nothing, or `=` and a text.
    Yes(&'static str),
}

use Value::{Called, OneOf, Signed, Switch, Yes};

/// A table of flags: key, what follows it, help.
macro_rules! flags {
    ($table:ident: $($key:ident $value:expr => $help:expr;)+) => {
        const $table: &[Flag] = &[$(Flag { key: stringify!($key), value: $value, help: $help }),+];
    };
}

/// The names that `T` has, with their help.
fn names<T: Named>() -> Vec<PossibleValue> {
    let names = T::NAMES.iter();
    names
        .map(|&(name, _, help)| PossibleValue::new(name).help(help))
        .collect()
}

fn true_or_false() -> Vec<PossibleValue> {
    ["true", "false"].map(PossibleValue::new).into()
}

fn yes_or_no() -> Vec<PossibleValue> {
    ["yes", "no"].map(PossibleValue::new).into()
}

impl Flag {
    fn arg(self) -> Arg {
        let arg = Arg::new(self.key)
            .long(flag(self.key)[2..].to_owned())
            .help(self.help);
        match self.value {
            Called(name) => arg
                .value_name(name)
                .value_parser(OsStringValueParser::new())
                .allow_negative_numbers(true),
            Signed(name) => arg
                .value_name(name)
                .value_parser(OsStringValueParser::new())
                .allow_hyphen_values(true),
            OneOf(names) => arg
                .value_name(self.key.to_ascii_uppercase())
                .value_parser(Hinted(names)),
            Switch => arg.action(ArgAction::SetTrue),
            Yes(name) => arg
                .value_name(name)
                .num_args(0..=1)
                .require_equals(true)
                .default_missing_value("true")
                .value_parser(Hinted(true_or_false)),
        }
    }

    fn text(self, matches: &ArgMatches) -> Option<OsString> {
        match self.value {
            Switch => matches.get_flag(self.key).then(|| "true".into()),
            _ => matches.get_one(self.key).cloned(),
        }
    }
}

/// Any text; the help names these. The option refuses others.
#[derive(Clone)]
struct Hinted(fn() -> Vec<PossibleValue>);

impl TypedValueParser for Hinted {
    type Value = OsString;

    fn parse_ref(&self, _: &Command, _: Option<&Arg>, value: &OsStr) -> Result<OsString, Error> {
        Ok(value.to_owned())
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new((self.0)().into_iter()))
    }
}

impl<O: HasFlags> Args for Flags<O> {
    fn augment_args(command: Command) -> Command {
        command.args(O::flags().into_iter().map(Flag::arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<O: HasFlags> FromArgMatches for Flags<O> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let flags = O::flags();
        let given = flags
            .iter()
            .filter_map(|flag| Some((option_name(flag.key), flag.text(matches)?)));
        let refused = |refused: dtof_options::Refused| {
            Error::raw(ErrorKind::ValueValidation, refused.line(&flag))
        };
        dtof_options::read(given).map(Self).map_err(refused)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// A value of the program that is chosen by a name.
pub fn name<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    Hinted(names::<T>).try_map(|text| named(&text.to_string_lossy()))
}

flags! {
    RECORDING:
    axes Called("AXIS,AXIS,...") => "Arrays of histograms: what each axis is, of captures, rows, columns \
        and bins [default: the last is bins, the one before columns, all others are rows]";
    array Called("NAME") => ".npz: the array to read [default: the only one]";
    columns Called("N") => "Photon lists: columns of the array, pixel = row × columns + column [default: \
        one row]";
    rebin Called("K") => "Add up so many neighbouring bins [default: 1]";
    bins Called("N") => "Bins to use, after --rebin, a power of two from 8 to 1024. Of histograms with more \
        the last are cut off [default: as many as there are, or the next power of two; 128 of photon lists]";
    bin_width_ps Signed("PS") => "Picoseconds a bin of the file, rounded to 1/65536 [default: 250; of logs \
        that of the sensor]";
    offset_mm Signed("MM") => "Millimetres added to every range, rounded to 1/256 [default: 0; of logs that \
        of the sensor]";
    photons_per_cycle Called("R") => "Histograms: photons a laser cycle in the brightest pixel of each \
        capture that is not masked [default: 1]";
    recorded_cycles Called("N") => "Histograms: laser cycles that each capture lasted";
    laser_hz Called("HZ") => "Laser cycles a second [default: not known]";
}

flags! {
    SENSOR:
    settings Called("FILE") => "A TOML file with settings, as every run writes one; options override it. \
        docs/settings.md lists its keys";
    gate Called("FIRST..LAST") => "Only these bins may hold the peak, both inclusive [default: all]";
    masked Called("PIXELS") => "Pixels that are left out, such as hot and dead ones, as 3,70";
    sigma_bins Signed("S") => "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. The \
        depth then comes from a window that suits it [default: the centroid of three bins]";
}

flags! {
    DETECTION:
    rule OneOf(names::<RuleName>) => "The rule that decides whether a peak stands clear of the background \
        [default: paper]";
    alpha Signed("ALPHA") => "Rules paper and average: standard deviations of the background a peak must \
        exceed it by, 0 to 255.996, rounded to 1/256 [default: 4]";
    window Signed("BINS") => "Window rule: bins in the window, 1 to 7 [default: as suits --sigma-bins]";
    z Signed("Z") => "Window rule: standard deviations of the background the photons in the window must \
        exceed it by, 0 to 15.9998, rounded to 1/4096";
    false_alarm Called("SHARE") => "Window rule, instead of --z: the share of exposures without a target \
        that may end with an event, at most 0.1 [default: 0.01]";
    estimator OneOf(names::<EstimatorName>) => "Where in its bins a peak lies [default: window if \
        --sigma-bins or --half-widths are known, else centroid]";
    half_widths Called("BEFORE,AFTER") => "How far the window that the depth comes from reaches before and \
        after its place, in bins: 1 to 4 each, rounded to 1/256. More after than before suits a pulse that \
        falls more slowly than it rises [default: both as suits --sigma-bins]";
    min_count Called("N") => "Photons a reported peak, or the window around it, holds at least [default: 5]";
    l1 Called("N") => "The exposure a decision must exceed, in laser cycles [default: 40]";
    l2 Called("N") => "The exposure at which a pixel starts over without an event, in laser cycles \
        [default: 2000]";
    x Called("N") => "Laser cycles between looks [default: 4]";
    binning Called("LEVELS") => "Adaptive binning: pixels that stay silent also count together, in blocks \
        of 2x2 pixels, from level 2 on 4x4 and at level 3 8x8 [default: 0]";
    patience Called("N") => "Adaptive binning: laser cycles without an event after which a pixel counts in \
        its block, too [default: 64]";
    tracking Yes("YES") => "Window rule: expect the next event of a pixel near its last, and spend half of \
        the false alarms there";
    echoes Called("N") => "Echoes that a pixel reports in an exposure, 1 to 4. From 2 on it goes on until \
        it has them all, or has waited for the next [default: 1]";
    echo_wait Called("TIMES") => "Two or more echoes: an exposure ends once it is so many times as long as \
        it was at its last echo [default: it goes on until L2]";
}

flags! {
    FRAME:
    frame Called("N") => "Simulate a frame-based sensor for comparison: every N laser cycles each pixel \
        reads its highest bin, if that stands above the background";
}

flags! {
    REPLAY:
    cycles Called("N") => "Replay only the first N laser cycles [default: 10000]";
    seed Called("N") => "Seed of the laser cycles that recorded photons are given [default: 1]";
}

flags! {
    ARRAY:
    array Called("COLUMNSxROWS") => "Macropixels of the array that looks at the scene [default: the file's]";
    laser_off Switch => "Without signal: photon-counts.svg is then a passive image";
}

flags! {
    SIMULATE:
    cycles Called("N") => "Laser cycles [default: the file's]";
    seed Called("N") => "Seed of the simulated photons [default: 1]";
}

flags! {
    CALIBRATE:
    target_mm Signed("MM") => "Distance of a flat target that most of the pixels see, in millimetres";
    glass OneOf(yes_or_no) => "Whether the nearest surface, where all pixels have it at the same bin, is a \
        cover glass";
    false_alarm Called("SHARE") => "The share of exposures without a target that may end with an event, at \
        most 0.1 [default: 0.01]";
    seed Called("N") => "Seed of what is simulated [default: 1]";
}

flags! {
    ACCURACY:
    within Called("MM") => "Millimetres that 68 % of the reports may be off at most [default: as frames of \
        L2]";
    false_alarm Called("SHARE") => "The share of exposures without a target that may end with an event, at \
        most 0.1 [default: 0.01]";
}

flags! {
    COMPARE:
    cycles Called("N") => "Laser cycles to use at most [default: 10000; the scene's]";
    seed Called("N") => "Seed of every random number [default: 1]";
}

flags! {
    TUNE:
    rule OneOf(names::<RuleName>) => "The rule to find settings for [default: paper]";
    background Called("B") => "Background photons a bin and laser cycle (B)";
    signal Called("A") => "Signal photons a laser cycle (A)";
    snr Called("SNR") => "Instead: the SNR of the whole exposure, N·A / √(N·B) with N = L2";
    sigma_bins Signed("BINS") => "Standard deviation of the pulse in bins";
    sigma_ps Called("PS") => "Instead: in picoseconds";
    bins Called("N") => "Bins of a histogram, a power of two from 8 to 1024 [default: 128]";
    bin_width_ps Signed("PS") => "Picoseconds a bin [default: 250]";
    false_alarm Called("SHARE") => "The share of exposures without a target that may end with an event \
        [default: 0.01]";
    false_alarms_per_second Called("RATE") => "Instead: the false alarms of a pixel a second";
    laser_hz Called("HZ") => "Laser cycles a second";
    l1 Called("N") => "The exposure a decision must exceed, in laser cycles [default: the one with the \
        shortest time to an event]";
    l2 Called("N") => "The exposure at which a pixel starts over without an event, in laser cycles \
        [default: 2000]";
    x Called("N") => "Laser cycles between looks [default: 4]";
    min_count Called("N") => "Photons a reported peak holds at least [default: 5]";
    binning Called("LEVELS") => "Window rule: the largest blocks of adaptive binning, which share the false \
        alarms with the pixels [default: 0]";
    seed Called("N") => "Seed of the simulated exposures [default: 1]";
}

flags! {
    DEVICE:
    bin_width_ps Signed("PS") => "Picoseconds a bin, rounded to 1/65536 [default: as the device says, 250 \
        if any will do]";
    offset_mm Signed("MM") => "Millimetres added to every range, rounded to 1/256 [default: as the device \
        says]";
}

flags! {
    PROJECTED:
    field_of_view_degrees Signed("HxV") => "The field of view in degrees from edge to edge [default: 60 \
        across the longer side, square pixels]";
    calibration Called("FILE") => "A direction and a range bias for each pixel, a TOML file; docs/export.md \
        has its keys";
    laser_hz Called("HZ") => "Laser cycles a second, for a file that does not say or is wrong [default: \
        what the file says, else 10000000 and a warning]";
    echo OneOf(names::<Echo>) => "Which echo of each exposure of a pixel or block, of depth events \
        [default: all]";
}

/// The tables of the flags of each job, in the order of its help.
macro_rules! has_flags {
    ($($job:ty: $($table:ident)+;)+) => {
        $(impl HasFlags for $job {
            fn flags() -> Vec<Flag> {
                [$($table),+].concat()
            }
        })+
    };
}

has_flags! {
    Projected: PROJECTED;
    Operation: DEVICE SENSOR DETECTION;
    replay::Options: RECORDING SENSOR DETECTION FRAME REPLAY;
    simulate::Options: ARRAY SENSOR DETECTION FRAME SIMULATE;
    calibrate::Options: RECORDING CALIBRATE;
    compare::Options: ACCURACY RECORDING SENSOR COMPARE;
    tune::Options: TUNE;
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_options::NO_OPTION;

    fn keys_of<O: HasFlags>() {
        let mut flags: Vec<&str> = O::flags().iter().map(|flag| flag.key).collect();
        let mut keys = O::KEYS.concat();
        for &key in &keys {
            let set = O::default().set(key, "\0");
            let is_file = O::default().file(key).is_some();
            assert!(is_file || set != Err(NO_OPTION.to_owned()), "{key}");
        }
        assert_eq!(O::default().set("sed", "5"), Err(NO_OPTION.to_owned()));
        flags.sort_unstable();
        keys.sort_unstable();
        assert_eq!(flags, keys);
    }

    #[test]
    fn every_option_of_a_job_has_its_flag() {
        keys_of::<Operation>();
        keys_of::<Projected>();
        keys_of::<replay::Options>();
        keys_of::<simulate::Options>();
        keys_of::<calibrate::Options>();
        keys_of::<compare::Options>();
        keys_of::<tune::Options>();
    }
}

//! The flags of jobs. Only this file gives the options of the libraries a flag and its help.

use std::ffi::{OsStr, OsString};

use clap::builder::{OsStringValueParser, PossibleValue, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use dtof_engine::settings::{EstimatorName, RuleName};
use dtof_events::echoes::Echo;
use dtof_export::ProjectionOptions;
use dtof_options::{Named, Options, flag, named, option_name};
use dtof_run::given::Operation;
use dtof_run::{calibrate, compare, replay, simulate, tune};

/// The options of a job, read from flags.
pub struct Flags<O>(pub O);

/// The flags of a job.
pub trait HasFlags: Options {
    /// The flags, in the order of the help.
    fn flags() -> Vec<Flag>;
}

/// The flag of an option.
#[derive(Clone, Copy)]
pub struct Flag {
    key: &'static str,
    value: Value,
    help: &'static str,
}

/// The value of a flag.
#[derive(Clone, Copy)]
enum Value {
    /// A text, with its name in the help.
    Text(&'static str),
    /// A text that may begin with a hyphen.
    Signed(&'static str),
    /// One of these names.
    OneOf(fn() -> Vec<PossibleValue>),
    /// No value.
    Switch,
    /// No value, or `=` and a text.
    Optional(&'static str),
}

use Value::{OneOf, Optional, Signed, Switch, Text};

/// A table of flags: key, value, help.
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
            Text(name) => arg
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
            Optional(name) => arg
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

/// Accepts any text; the help lists these names. The option refuses others later.
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
    axes Text("AXIS,AXIS,...") => "Arrays of histograms: meaning of each axis: captures, rows, columns or \
        bins [default: the last is bins, the one before columns, all others are rows]";
    array Text("NAME") => ".npz: name of the array [default: the only one]";
    capture Text("N") => "Arrays with captures, and logs: the capture or frame to use, counted from 0 [default: all]";
    columns Text("N") => "Photon lists: columns of the array, pixel = row × columns + column [default: \
        one row]";
    rebin Text("K") => "Number of neighbouring bins to add up [default: 1]";
    bins Text("N") => "Number of bins after --rebin, a power of two from 8 to 1024. Longer histograms lose \
        their last bins [default: the file's, or the next power of two; 128 for photon lists]";
    bin_width_ps Signed("PS") => "Width of a bin of the file in picoseconds, rounded to 1/65536 [default: \
        250; for logs the sensor's]";
    offset_mm Signed("MM") => "Millimetres added to every range, rounded to 1/256 [default: 0; for logs the \
        sensor's]";
    offsets_mm Signed("MM,MM,...") => "Millimetres added to --offset-mm for each pixel, in the order of the \
        addresses, rounded to 1/256 [default: 0]";
    photons_per_cycle Text("R") => "Histograms: photons a laser cycle in the brightest unmasked pixel of \
        each capture [default: 1]";
    recorded_cycles Text("N") => "Histograms: laser cycles of each capture";
    laser_hz Text("HZ") => "Laser cycles a second [default: unknown]";
}

flags! {
    SENSOR:
    settings Text("FILE") => "Settings file in TOML, such as every run writes; options override it. \
        docs/settings.md lists its keys";
    gate Text("FIRST..LAST") => "First and last bin that may hold the peak, as 20..119 [default: all bins]";
    masked Text("PIXELS") => "Pixels to leave out, such as hot and dead ones, as 3,70, beside those that are found; \
        none leaves out none";
    sigma_bins Signed("S") => "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. It \
        sets the window for the depth [default: the depth is the centroid of three bins]";
}

flags! {
    TDC:
    dead_time Text("BINS") => "Bins for which the TDC is blind after a photon, 0 to 65535. With all bins of a \
        histogram it takes the first photon of a laser cycle only. Fewer are for the window rule without \
        --binning [default: the sensor's, else 0]";
}

flags! {
    DITHER:
    dither_bins Text("BINS") => "Dither against other LiDARs: the longest laser cycle takes so many bins more \
        than the shortest, an even number up to 254; 0 is off [default: 128, or as many as the sensor can]";
    dither_seed Text("N") => "Seed of the random lengths of laser cycles [default: from the clock]";
}

flags! {
    DETECTION:
    rule OneOf(names::<RuleName>) => "Detection rule, which decides whether a peak is a target [default: paper]";
    alpha Signed("ALPHA") => "Rules paper and average: threshold above the background in its standard \
        deviations, 0 to 255.996, rounded to 1/256 [default: 4]";
    window Signed("BINS") => "Window rule: bins in the window, 1 to 7 [default: from --sigma-bins]";
    z Signed("Z") => "Window rule: threshold of the photons in the window above the background in its \
        standard deviations, 0 to 15.9998, rounded to 1/4096 [default: from --false-alarm]";
    false_alarm Text("SHARE") => "Window rule, instead of --z: share of exposures without a target that \
        end with an event, at most 0.1 [default: 0.01]";
    estimator OneOf(names::<EstimatorName>) => "Estimator of the position of a peak [default: window with \
        --sigma-bins or --half-widths, else centroid]";
    half_widths Text("BEFORE,AFTER") => "Estimator window: bins before and after its centre, 1 to 4 each, \
        rounded to 1/256. A longer part after suits a pulse that falls more slowly than it rises [default: \
        from --sigma-bins]";
    min_count Text("N") => "Fewest photons in a reported peak, or in the window around it [default: 5]";
    l1 Text("N") => "Shortest exposure: pixels decide after more than N laser cycles [default: 40]";
    l2 Text("N") => "Longest exposure: a pixel without an event starts over after N laser cycles \
        [default: 2000]";
    x Text("N") => "Laser cycles between two decisions [default: 4]";
    binning Text("LEVELS") => "Levels of adaptive binning, 0 to 3: pixels without events also count in \
        blocks, at level 1 of 2x2 pixels, at 2 of 4x4 and at 3 of 8x8 [default: 0]";
    patience Text("N") => "Adaptive binning: laser cycles without an event after which a pixel also counts \
        in its block [default: 64]";
    neighbours Text("N") => "Window rule: the 4 or 8 pixels around a pixel confirm what is not enough by itself. \
        For arrays, without --binning [default: 0]";
    tracking Optional("YES") => "Window rule: expect the next event of a pixel near its last, with a lower \
        threshold there and a higher one elsewhere";
    echoes Text("N") => "Most echoes of a pixel in an exposure, 1 to 4. With 2 or more the exposure goes \
        on until all are found or --echo-wait ends it [default: 1]";
    echo_wait Text("TIMES") => "Two or more echoes: an exposure ends at this multiple of its length at \
        the last echo [default: it ends at L2]";
    once_per_bin Optional("YES") => "Photons of one laser cycle in one bin count once, so that raindrops are \
        no targets. For photons, not for histograms";
    counter_bits Text("N") => "Bits of a pixel's counters, 8 or 10. With 8 an exposure ends without an event \
        once a counter passes 255. A device has one of both [default: 10]";
}

flags! {
    FRAME:
    frame Text("N") => "Simulate a frame-based sensor for comparison: every N laser cycles each pixel \
        reports its highest bin, if that is above the background";
    decide_once Optional("YES") => "Events are the decisions of depth.npy, one a pixel on all of its photons, instead \
        of asynchronous ones. Takes all laser cycles unless --cycles says less";
}

flags! {
    REPLAY:
    cycles Text("N") => "Laser cycles to replay at most [default: all of a photon list and with --decide-once, else 10000]";
    seed Text("N") => "Seed of the laser cycles that recorded photons get [default: 1]";
}

flags! {
    ARRAY:
    array Text("COLUMNSxROWS") => "Macropixels of the array [default: the file's]";
    laser_off Switch => "Simulate without signal: photon-counts.svg is then a passive image";
}

flags! {
    SIMULATE:
    cycles Text("N") => "Laser cycles to simulate [default: the file's]";
    seed Text("N") => "Seed of the simulated photons [default: 1]";
}

flags! {
    KNOWN:
    gate Text("FIRST..LAST") => "First and last bin that may hold the peak, as 20..119 [default: found]";
    masked Text("PIXELS") => "Pixels to leave out, as 3,70, beside hot and dead ones that are found; none leaves out none";
    once_per_bin Optional("YES") => "Photons of one laser cycle in one bin count once. For photons, not for histograms";
    sigma_bins Signed("S") => "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256 [default: \
        measured; without a peak that is bright enough that of --settings, else 1]";
}

flags! {
    CALIBRATE:
    target_mm Signed("MM") => "Distance in millimetres of a flat target that most pixels see: with --fov straight \
        ahead, as a tape measures it, else along the ray of the median pixel";
    false_alarm Text("SHARE") => "Share of exposures without a target that end with an event, at most 0.1 \
        [default: 0.01]";
    seed Text("N") => "Seed of the simulation [default: 1]";
}

flags! {
    SEARCH:
    glass OneOf(yes_or_no) => "Whether the nearest surface that most pixels see is a cover glass, which the gate then \
        leaves out [default: if all pixels have it at one place and half of them see something behind it]";
}

flags! {
    RAYS:
    field_of_view_degrees Signed("HxV") => "Field of view in degrees from edge to edge, so that a flat target \
        gives the offset of each pixel [default: unknown]";
    calibration Text("FILE") => "Instead of --fov: TOML file with a direction for each pixel; docs/export.md \
        lists its keys";
}

flags! {
    ACCURACY:
    within Text("MM") => "Largest error of 68 % of the reports in millimetres [default: that of the \
        longest frames]";
    false_alarm Text("SHARE") => "Share of exposures without a target that end with an event, at most 0.1 \
        [default: 0.01]";
}

flags! {
    COMPARE:
    once_per_bin Optional("YES") => "Also try photons of one laser cycle in one bin that count once. For \
        photons, not for histograms";
    cycles Text("N") => "Laser cycles to use at most [default: 10000 of a recording; the scene's]";
    seed Text("N") => "Seed of every random number [default: 1]";
}

flags! {
    TUNE:
    rule OneOf(names::<RuleName>) => "Detection rule to tune [default: paper]";
    background Text("B") => "Background photons a bin and laser cycle (B)";
    signal Text("A") => "Signal photons a laser cycle (A)";
    snr Text("SNR") => "Instead of --signal: SNR of the longest exposure, N·A / √(N·B) with N = L2";
    sigma_bins Signed("BINS") => "Standard deviation of the pulse in bins";
    sigma_ps Text("PS") => "Instead of --sigma-bins: standard deviation of the pulse in picoseconds";
    bins Text("N") => "Bins of a histogram, a power of two from 8 to 1024 [default: 128]";
    bin_width_ps Signed("PS") => "Width of a bin in picoseconds [default: 250]";
    false_alarm Text("SHARE") => "Share of exposures without a target that end with an event [default: 0.01]";
    false_alarms_per_second Text("RATE") => "Instead of --false-alarm: false alarms of a pixel a second";
    laser_hz Text("HZ") => "Laser cycles a second";
    l1 Text("N") => "Shortest exposure: pixels decide after more than N laser cycles [default: the one \
        with the shortest time to an event]";
    l2 Text("N") => "Longest exposure: a pixel without an event starts over after N laser cycles \
        [default: 2000]";
    x Text("N") => "Laser cycles between two decisions [default: 4]";
    min_count Text("N") => "Fewest photons in a reported peak [default: 5]";
    binning Text("LEVELS") => "Window rule: levels of adaptive binning, 0 to 3; pixels and blocks share the \
        false alarms [default: 0]";
    seed Text("N") => "Seed of the simulated exposures [default: 1]";
}

flags! {
    DEVICE:
    bin_width_ps Signed("PS") => "Width of a bin in picoseconds, rounded to 1/65536 [default: the device's, \
        or 250 if it has none]";
    offset_mm Signed("MM") => "Millimetres added to every range, rounded to 1/256 [default: the device's]";
    offsets_mm Signed("MM,MM,...") => "Millimetres added to --offset-mm for each pixel, in the order of the \
        addresses, rounded to 1/256 [default: 0]";
}

flags! {
    PROJECTION:
    field_of_view_degrees Signed("HxV") => "Field of view in degrees from edge to edge [default: 60 along \
        the longer side, with square pixels]";
    calibration Text("FILE") => "TOML file with a direction and a range bias for each pixel; docs/export.md \
        lists its keys";
    laser_hz Text("HZ") => "Laser cycles a second, if the file has none or is wrong [default: the file's, \
        else 10000000 with a warning]";
    echo OneOf(names::<Echo>) => "Depth events: echo of each exposure of a pixel or block [default: all; the \
        strongest with --one-per-pixel]";
    one_per_pixel Optional("YES") => "CSV, PCD and PLY: one point a pixel, at the depth of depth-events.npy, in \
        place of a point an event";
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
    ProjectionOptions: PROJECTION;
    Operation: DEVICE SENSOR TDC DITHER DETECTION;
    replay::Options: RECORDING SENSOR TDC DETECTION FRAME SEARCH REPLAY;
    simulate::Options: ARRAY SENSOR TDC DETECTION FRAME SIMULATE;
    calibrate::Options: RECORDING KNOWN TDC RAYS SEARCH CALIBRATE;
    compare::Options: ACCURACY RECORDING SENSOR TDC SEARCH COMPARE;
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
        keys_of::<ProjectionOptions>();
        keys_of::<replay::Options>();
        keys_of::<simulate::Options>();
        keys_of::<calibrate::Options>();
        keys_of::<compare::Options>();
        keys_of::<tune::Options>();
    }
}

//! `tune`: threshold and L1 for a rate of false alarms.

mod average;
mod window;

use std::fmt::Write as _;

use anyhow::Result;
use dtof_core::BlockLevel;
use dtof_engine::settings::{DetectionSettings, RuleName};
use dtof_options::keys::{Key, Kind};
use dtof_options::numbers::{MAX_INTEGER, bins, integer, positive, shortest};
use dtof_options::progress::{Progress, shared};
use dtof_options::rows::significant;
use dtof_options::{NO_OPTION, Refused, named};
use dtof_photons::MM_PER_PS;
use dtof_theory::gaussian;
use dtof_theory::looks::detections::Detections;
use dtof_theory::looks::table::Table;
use dtof_theory::progress as theory;
use dtof_theory::rates::{signal_for_snr, snr};
use dtof_theory::tune::{FalseAlarmLimit, Request, Source, tune};
use serde_json::json;

/// The options of `tune`.
#[derive(Clone, Debug)]
pub struct Options {
    /// The rule to find settings for
    pub rule: RuleName,
    /// Background photons a bin and laser cycle (B)
    pub background: Option<f64>,
    /// Signal photons a laser cycle (A)
    pub signal: Option<f64>,
    /// Instead: the SNR of the whole exposure, N·A / √(N·B) with N = L2
    pub snr: Option<f64>,
    /// Standard deviation of the pulse in bins
    pub sigma_bins: Option<f64>,
    /// Instead: in picoseconds
    pub sigma_ps: Option<f64>,
    /// Bins of a histogram, a power of two from 8 to 1024
    pub bins: u16,
    /// Picoseconds a bin
    pub bin_width_ps: f64,
    /// The share of exposures without a target that may end with an event [default: 0.01]
    pub false_alarm: Option<f64>,
    /// Instead: the false alarms of a pixel a second
    pub false_alarms_per_second: Option<f64>,
    /// Laser cycles a second
    pub laser_hz: Option<f64>,
    /// The exposure a decision must exceed, in laser cycles [default: the one with the shortest
    /// time to an event]
    pub l1: Option<u16>,
    /// The exposure at which a pixel starts over without an event, in laser cycles
    pub l2: u16,
    /// Laser cycles between looks
    pub x: u16,
    /// Photons a reported peak holds at least
    pub min_count: u16,
    /// Window rule: the largest blocks of adaptive binning, which share the false alarms with the
    /// pixels
    pub binning: u8,
    /// Seed of the simulated exposures
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            rule: RuleName::Paper,
            background: None,
            signal: None,
            snr: None,
            sigma_bins: None,
            sigma_ps: None,
            bins: 128,
            bin_width_ps: 250.0,
            false_alarm: None,
            false_alarms_per_second: None,
            laser_hz: None,
            l1: None,
            l2: 2000,
            x: 4,
            min_count: 5,
            binning: 0,
            seed: 1,
        }
    }
}

impl dtof_options::Options for Options {
    const KEYS: &'static [&'static [Key]] = &[&[
        Key::of(DetectionSettings::KEYS, "rule")
            .with_help("Detection rule to tune [default: paper]"),
        Key::new(
            "background",
            Kind::Real(" above 0"),
            "B",
            "Background photons a bin and laser cycle (B)",
        ),
        Key::new(
            "signal",
            Kind::Real(" above 0"),
            "A",
            "Signal photons a laser cycle (A)",
        ),
        Key::new(
            "snr",
            Kind::Real(" above 0"),
            "SNR",
            "Instead of --signal: SNR of the longest exposure, N·A / √(N·B) with N = L2",
        ),
        Key::new(
            "sigma_bins",
            Kind::Real(" above 0"),
            "BINS",
            "Standard deviation of the pulse in bins",
        ),
        Key::new(
            "sigma_ps",
            Kind::Real(" above 0"),
            "PS",
            "Instead of --sigma-bins: standard deviation of the pulse in picoseconds",
        ),
        Key::new(
            "bins",
            Kind::Integer(8, 1024),
            "N",
            "Bins of a histogram, a power of two from 8 to 1024 [default: 128]",
        ),
        Key::new(
            "bin_width_ps",
            Kind::Real(" above 0"),
            "PS",
            "Width of a bin in picoseconds [default: 250]",
        ),
        Key::new(
            "false_alarm",
            Kind::Real(" above 0"),
            "SHARE",
            "Share of exposures without a target that end with an event [default: 0.01]",
        ),
        Key::new(
            "false_alarms_per_second",
            Kind::Real(" above 0"),
            "RATE",
            "Instead of --false-alarm: false alarms of a pixel a second",
        ),
        Key::new(
            "laser_hz",
            Kind::Real(" above 0"),
            "HZ",
            "Laser cycles a second",
        ),
        Key::new(
            "l1",
            Kind::Integer(0, 65_535),
            "N",
            "Shortest exposure: pixels decide after more than N laser cycles [default: the one with the \
         shortest time to an event]",
        ),
        Key::new(
            "l2",
            Kind::Integer(1, 65_535),
            "N",
            "Longest exposure: a pixel without an event starts over after N laser cycles [default: 2000]",
        ),
        Key::new(
            "x",
            Kind::Integer(1, 65_535),
            "N",
            "Laser cycles between two decisions [default: 4]",
        ),
        Key::new(
            "min_count",
            Kind::Integer(1, 1023),
            "N",
            "Fewest photons in a reported peak [default: 5]",
        ),
        Key::new(
            "binning",
            Kind::Integer(0, BlockLevel::MAX.raw() as u64),
            "LEVELS",
            "Window rule: levels of adaptive binning, 0 to 3; pixels and blocks share the false alarms \
         [default: 0]",
        ),
        Key::new(
            "seed",
            Kind::Integer(0, MAX_INTEGER),
            "N",
            "Seed of the simulated exposures [default: 1]",
        ),
    ]];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        match key {
            "rule" => self.rule = named(text)?,
            "background" => self.background = Some(positive(text)?),
            "signal" => self.signal = Some(positive(text)?),
            "snr" => self.snr = Some(positive(text)?),
            "sigma_bins" => self.sigma_bins = Some(positive(text)?),
            "sigma_ps" => self.sigma_ps = Some(positive(text)?),
            "bins" => self.bins = bins(text)?,
            "bin_width_ps" => self.bin_width_ps = positive(text)?,
            "false_alarm" => self.false_alarm = Some(positive(text)?),
            "false_alarms_per_second" => self.false_alarms_per_second = Some(positive(text)?),
            "laser_hz" => self.laser_hz = Some(positive(text)?),
            "l1" => self.l1 = Some(integer(0..=u16::MAX)(text)?),
            "l2" => self.l2 = integer(1..=u16::MAX)(text)?,
            "x" => self.x = integer(1..=u16::MAX)(text)?,
            "min_count" => self.min_count = integer(1..=1023)(text)?,
            "binning" => self.binning = integer(0..=BlockLevel::MAX.raw())(text)?,
            "seed" => self.seed = integer(0..=MAX_INTEGER)(text)?,
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }

    fn check(&self) -> Result<(), Refused> {
        let needed = [
            ("`background`", self.background),
            ("`signal` or `snr`", self.signal.or(self.snr)),
            (
                "`sigma_bins` or `sigma_ps`",
                self.sigma_bins.or(self.sigma_ps),
            ),
        ];
        let missing = needed.iter().filter(|(_, value)| value.is_none());
        let missing: Vec<&str> = missing.map(|(keys, _)| *keys).collect();
        if missing.len() > 1 {
            let reason = format!("needed: {}", missing.join("; "));
            return Err(Refused::input(reason));
        }
        self.request().map(drop)
    }
}

/// The value of the one of two options that is given.
fn one_of<T>(
    (key, value): (&str, Option<T>),
    (other_key, other): (&str, Option<T>),
) -> Result<T, Refused> {
    if value.is_some() && other.is_some() {
        let reason = format!("cannot be used with `{key}`");
        return Err(Refused::new(other_key, reason));
    }
    let missing = || Refused::new(key, format!("is needed, or `{other_key}`"));
    value.or(other).ok_or_else(missing)
}

/// One result: its name in JSON, its value and the source of the value.
struct Line(&'static str, f64, String);

/// The settings that were found, and what to expect of them.
pub struct TuneResult {
    lines: Vec<Line>,
    /// The options for other commands.
    options: String,
}

/// Name in JSON, name for people, unit.
const NAMES: [(&str, &str, &str); 14] = [
    ("alpha", "α", ""),
    ("z", "z", ""),
    ("window", "window", "bins"),
    ("half_width", "depth from, ±", "bins"),
    ("l1", "L1", "laser cycles"),
    ("false_alarms", "false alarms", "an exposure"),
    ("at_least", "  at least", "an exposure"),
    ("at_most", "  at most", "an exposure"),
    ("cycles_to_event", "time to an event", "laser cycles"),
    ("seconds_to_event", "", "s"),
    ("detected", "exposures with one", ""),
    ("depth_error_mm", "depth error", "mm rms"),
    ("snr", "SNR at L2", ""),
    ("gaussian_alpha", "α by Eq. 11", ""),
];

impl Line {
    /// Name for people and unit.
    fn names(&self) -> (&'static str, &'static str) {
        let names = NAMES.iter().find(|names| names.0 == self.0);
        names.map_or((self.0, ""), |names| (names.1, names.2))
    }
}

impl Options {
    /// Finds the settings.
    ///
    /// # Errors
    /// Fails if options are missing or exclude each other, if no threshold has so few false alarms, or if
    /// `progress` ends the work.
    pub fn tune(&self, progress: &mut dyn Progress) -> Result<TuneResult> {
        let request = self.request()?;
        let progress = &shared(progress, "steps");
        let (lines, rule) = match self.rule {
            RuleName::Paper => self.paper(&request, progress)?,
            RuleName::Average => self.average(&request, progress)?,
            RuleName::Window => self.window(&request, progress)?,
        };
        // Without these options, `replay` would use other bins than the settings are for.
        let histogram = if (self.bins, self.bin_width_ps) == (128, 250.0) {
            String::new()
        } else {
            format!(" --bins {} --bin-width-ps {}", self.bins, self.bin_width_ps)
        };
        let options = format!(
            "{rule} --l2 {} --x {} --min-count {}{histogram}",
            self.l2, self.x, self.min_count
        );
        Ok(TuneResult { lines, options })
    }

    /// The same in the units of theory.
    fn request(&self) -> Result<Request, Refused> {
        let background = self.background;
        let background = background.ok_or_else(|| Refused::new("background", "is needed"))?;
        let by_snr = |snr| signal_for_snr(snr, background, self.l2.into());
        let signal = one_of(("signal", self.signal), ("snr", self.snr.map(by_snr)))?;
        let by_ps = self.sigma_ps.map(|ps| ps / self.bin_width_ps);
        let sigma = one_of(("sigma_bins", self.sigma_bins), ("sigma_ps", by_ps))?;
        let limit = match (
            self.false_alarm,
            self.false_alarms_per_second,
            self.laser_hz,
        ) {
            (Some(_), Some(_), _) => Err(Refused::new(
                "false_alarm",
                "cannot be used with `false_alarms_per_second`",
            )),
            (None, Some(_), None) => {
                Err(Refused::new("false_alarms_per_second", "needs `laser_hz`"))
            }
            (None, Some(per_second), Some(laser_hz)) => {
                Ok(FalseAlarmLimit::PerCycle(per_second / laser_hz))
            }
            (share, None, _) => Ok(FalseAlarmLimit::PerExposure(share.unwrap_or(0.01))),
        }?;
        if sigma > f64::from(self.bins) / 4.0 {
            let (sigma, bins) = (number(sigma), self.bins);
            let reason = format!("a pulse of σ = {sigma} bins does not fit {bins} bins");
            return Err(Refused::input(reason));
        }
        if self.binning > 0 && self.rule != RuleName::Window {
            return Err(Refused::new(
                "binning",
                "needs `rule` window here: only its z is shared with blocks",
            ));
        }
        Ok(Request {
            background,
            signal,
            sigma,
            bins: self.bins,
            minimum_count: self.min_count,
            x: self.x,
            l1: self.l1,
            l2: self.l2,
            limit,
            levels: BlockLevel::saturating(self.binning),
            seed: self.seed,
        })
    }

    /// α and L1, what to expect of them, and the options for them.
    fn paper(&self, request: &Request, progress: theory::Progress) -> Result<(Vec<Line>, String)> {
        let table = Table::load()?;
        let tuned = tune(request, &table, progress)?;
        let false_alarms = match tuned.source {
            Source::Table => format!("simulation: table, {} exposures a point", table.exposures),
            Source::TableAtMost => format!(
                "simulation: at most, the lowest value of the table, {} exposures a point",
                table.exposures
            ),
            Source::Bound => "formula: upper bound, single looks (exact) added up".to_owned(),
        };
        let exact = |what: &str| format!("formula: {what}, single look (exact)");
        let alpha = format!("lowest for these false alarms; {false_alarms}");
        let gaussian = gaussian::alpha_min(tuned.limit, u32::from(request.bins) - 1);
        let mut lines = vec![
            Line("alpha", tuned.alpha.to_num(), alpha),
            self.l1(tuned.l1, &tuned.detections),
            Line("false_alarms", tuned.false_alarms, false_alarms),
            Line("at_least", tuned.bounds.worst_look, exact("worst look")),
            Line("at_most", tuned.bounds.sum, exact("sum over looks")),
        ];
        lines.extend(self.expected(request, &tuned.detections));
        let source = "formula: Eq. 11, one look, background known; not for use";
        lines.push(Line("gaussian_alpha", gaussian, source.to_owned()));
        let alpha = shortest(tuned.alpha);
        let options = format!(
            "--rule paper --estimator centroid --alpha {alpha} --l1 {}",
            tuned.l1
        );
        Ok((lines, options))
    }

    fn simulated(&self, detections: &Detections) -> String {
        format!(
            "simulation: seed {}, {} exposures",
            self.seed, detections.exposures
        )
    }

    fn l1(&self, l1: u16, detections: &Detections) -> Line {
        let source = match self.l1 {
            Some(_) => "as given".to_owned(),
            None => format!("shortest time to an event; {}", self.simulated(detections)),
        };
        Line("l1", l1.into(), source)
    }

    /// The rate of false alarms, from `events` in `exposures`.
    #[allow(clippy::cast_precision_loss)]
    fn counted(&self, (exposures, events): (u64, u64)) -> Line {
        let blocks = match self.binning {
            0 => "",
            _ => "; blocks come to a third as many",
        };
        let source = format!(
            "simulation: seed {}, {events} events in {exposures} exposures without a target{blocks}",
            self.seed
        );
        Line("false_alarms", events as f64 / exposures as f64, source)
    }

    /// Time, depth error and SNR to expect, with any rule.
    fn expected(&self, request: &Request, detections: &Detections) -> Vec<Line> {
        let simulated = self.simulated(detections);
        let cycles = detections.cycles_to_event();
        let mut lines = vec![Line("cycles_to_event", cycles, simulated.clone())];
        if let Some(laser_hz) = self.laser_hz {
            lines.push(Line(
                "seconds_to_event",
                cycles / laser_hz,
                simulated.clone(),
            ));
        }
        let mm = detections.depth_error_bins() * self.bin_width_ps * MM_PER_PS;
        let at_l2 = snr(request.signal, request.background, request.l2.into());
        lines.extend([
            Line("detected", detections.detected(), simulated.clone()),
            Line("depth_error_mm", mm, simulated),
            Line("snr", at_l2, "formula: N·A/√(N·B)".to_owned()),
        ]);
        lines
    }
}

impl TuneResult {
    /// Results for programs: each with value, unit and source.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let fields = self.lines.iter().map(|line| {
            let Line(name, value, source) = line;
            let result = json!({ "value": value, "unit": line.names().1, "source": source });
            ((*name).to_owned(), result)
        });
        fields.collect::<serde_json::Map<_, _>>().into()
    }

    /// Results for people; the last line has the options for other commands.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for line in &self.lines {
            let Line(_, value, source) = line;
            let (name, unit) = line.names();
            let value = format!("{} {unit}", number(*value));
            let _ = writeln!(text, "{name:<18}  {value:<24}  {source}");
        }
        let _ = writeln!(text, "\n{}", self.options);
        text
    }

    /// The options for other commands, such as `--rule paper --estimator centroid --alpha 4.5 --l1 40`.
    #[must_use]
    pub fn options(&self) -> &str {
        &self.options
    }
}

/// A whole number as it is, another to four significant digits.
fn number(value: f64) -> String {
    if value == value.round() && value.abs() < 1e6 {
        format!("{value}")
    } else if (0.001..1e6).contains(&value) {
        significant(value, 4)
    } else {
        format!("{value:.3e}")
    }
}

//! `tune`: threshold and L1 for a rate of false alarms.

mod average;
mod window;

use std::fmt::Write as _;

use anyhow::Result;
use dtof_core::BlockLevel;
use dtof_data::option_table;
use dtof_data::options::Refused;
use dtof_data::options::keys::{Key, POSITIVE, above_zero, bins, integer, named};
use dtof_data::options::numbers::{MAX_INTEGER, shortest};
use dtof_data::options::progress::{Progress, shared};
use dtof_data::options::rows::significant;
use dtof_data::photons::MM_PER_PS;
use dtof_engine::settings::RuleName;
use dtof_light::gaussian;
use dtof_light::looks::detections::Detections;
use dtof_light::looks::table::Table;
use dtof_light::progress as theory;
use dtof_light::rates::{signal_for_snr, snr};
use dtof_light::tune::{FalseAlarmLimit, Request, Source, tune};
use dtof_link::Configuration;
use serde_json::json;

option_table! {
    /// The options of `tune`.
    #[derive(Clone, Debug, Default)]
    pub struct Options {
        rule: RuleName = named(), "RULE", "Detection rule to tune [default: paper]";
        background: f64 = POSITIVE, "B",
            "Background photons a bin and laser cycle (B)";
        signal: f64 = POSITIVE, "A",
            "Signal photons a laser cycle (A)";
        snr: f64 = POSITIVE, "SNR",
            "Instead of `signal`: SNR of the longest exposure, N·A / √(N·B) with N = L2";
        sigma_bins: f64 = POSITIVE, "BINS",
            "Standard deviation of the pulse in bins";
        sigma_ps: f64 = POSITIVE, "PS",
            "Instead of `sigma_bins`: standard deviation of the pulse in picoseconds";
        bins: u16 = bins(), "N",
            "Bins of a histogram, a power of two from 8 to 1024 [default: 128]";
        bin_width_ps: f64 = POSITIVE, "PS",
            "Width of a bin in picoseconds [default: 250]";
        false_alarm: f64 = above_zero(1.0), "SHARE",
            "Share of exposures without a target that end with an event [default: 0.01]";
        false_alarms_per_second: f64 = POSITIVE, "RATE",
            "Instead of `false_alarm`: false alarms of a pixel a second";
        laser_hz: f64 = POSITIVE, "HZ",
            "Laser cycles a second";
        l1: u16 = integer(0, 65_535), "N",
            "Shortest exposure: pixels decide after more than N laser cycles [default: the one with the \
             shortest time to an event]";
        l2: u16 = integer(1, 65_535), "N",
            "Longest exposure: a pixel without an event starts over after N laser cycles [default: 2000]";
        x: u16 = integer(1, 65_535), "N",
            "Laser cycles between two decisions [default: 4]";
        min_count: u16 = integer(1, 1023), "N",
            "Fewest photons in a reported peak [default: 5]";
        binning: u8 = integer(0, BlockLevel::MAX.raw() as u64), "LEVELS",
            "Window rule: levels of adaptive binning, 0 to 3; pixels and blocks share the false alarms \
             [default: 0]";
        seed: u64 = integer(0, MAX_INTEGER), "N",
            "Seed of the simulated exposures [default: 1]";
    }
}

impl dtof_data::options::Options for Options {
    const KEYS: &'static [&'static [Key]] = &[Self::KEYS];

    fn set(&mut self, key: &'static str, text: &str) -> Result<(), String> {
        self.set(key, text)
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

/// Bins of a histogram and picoseconds of a bin, unless options say otherwise.
const BINS: u16 = 128;
const WIDTH_PS: f64 = 250.0;

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
        let (lines, rule) = match self.rule() {
            RuleName::Paper => self.paper(&request, progress)?,
            RuleName::Average => self.average(&request, progress)?,
            RuleName::Window => self.window(&request, progress)?,
        };
        // Without these options, `replay` would use other bins than the settings are for.
        let histogram = match (request.bins, self.width_ps()) {
            (BINS, WIDTH_PS) => String::new(),
            (bins, width) => format!(" --bins {bins} --bin-width-ps {width}"),
        };
        let options = format!(
            "{rule} --l2 {} --x {} --min-count {}{histogram}",
            request.l2, request.x, request.minimum_count
        );
        Ok(TuneResult { lines, options })
    }

    fn rule(&self) -> RuleName {
        self.rule.unwrap_or(RuleName::Paper)
    }

    fn width_ps(&self) -> f64 {
        self.bin_width_ps.unwrap_or(WIDTH_PS)
    }

    /// The same in the units of theory.
    fn request(&self) -> Result<Request, Refused> {
        let background = self.background;
        let background = background.ok_or_else(|| Refused::new("background", "is needed"))?;
        let bins = self.bins.unwrap_or(BINS);
        let l2 = self.l2.unwrap_or(Configuration::DEFAULT.l2);
        let levels = BlockLevel::saturating(self.binning.unwrap_or(0));
        let by_snr = |snr| signal_for_snr(snr, background, l2.into());
        let signal = one_of(("signal", self.signal), ("snr", self.snr.map(by_snr)))?;
        let by_ps = self.sigma_ps.map(|ps| ps / self.width_ps());
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
        if sigma > f64::from(bins) / 4.0 {
            let sigma = number(sigma);
            let reason = format!("a pulse of σ = {sigma} bins does not fit {bins} bins");
            return Err(Refused::input(reason));
        }
        if levels != BlockLevel::PIXEL && self.rule() != RuleName::Window {
            return Err(Refused::new(
                "binning",
                "needs `rule` window here: only its z is shared with blocks",
            ));
        }
        Ok(Request {
            background,
            signal,
            sigma,
            bins,
            minimum_count: self.min_count.unwrap_or(5),
            x: self.x.unwrap_or(Configuration::DEFAULT.x),
            l1: self.l1,
            l2,
            limit,
            levels,
            seed: self.seed.unwrap_or(1),
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
            l1(request, tuned.l1, &tuned.detections),
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

    /// Time, depth error and SNR to expect, with any rule.
    fn expected(&self, request: &Request, detections: &Detections) -> Vec<Line> {
        let simulated = simulated(request, detections);
        let cycles = detections.cycles_to_event();
        let mut lines = vec![Line("cycles_to_event", cycles, simulated.clone())];
        if let Some(laser_hz) = self.laser_hz {
            lines.push(Line(
                "seconds_to_event",
                cycles / laser_hz,
                simulated.clone(),
            ));
        }
        let mm = detections.depth_error_bins() * self.width_ps() * MM_PER_PS;
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

/// Where a number that was simulated comes from.
fn simulated(request: &Request, detections: &Detections) -> String {
    let (seed, exposures) = (request.seed, detections.exposures);
    format!("simulation: seed {seed}, {exposures} exposures")
}

fn l1(request: &Request, l1: u16, detections: &Detections) -> Line {
    let source = match request.l1 {
        Some(_) => "as given".to_owned(),
        None => {
            let simulated = simulated(request, detections);
            format!("shortest time to an event; {simulated}")
        }
    };
    Line("l1", l1.into(), source)
}

/// The rate of false alarms, from `events` in `exposures`.
#[allow(clippy::cast_precision_loss)]
fn counted(request: &Request, (exposures, events): (u64, u64)) -> Line {
    let blocks = match request.levels {
        BlockLevel::PIXEL => "",
        _ => "; blocks come to a third as many",
    };
    let source = format!(
        "simulation: seed {}, {events} events in {exposures} exposures without a target{blocks}",
        request.seed
    );
    Line("false_alarms", events as f64 / exposures as f64, source)
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

#[cfg(test)]
mod tests;

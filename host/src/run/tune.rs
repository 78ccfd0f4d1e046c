//! The threshold and L1 for a wanted rate of false alarms.

mod average;
mod window;

use std::fmt::Write as _;

use crate::cli::arguments::{MOST_WHOLE, bins, positive, shortest, whole};
use crate::rows::significant;
use crate::settings::RuleName;
use crate::simulate::MM_PER_PS;
use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof_core::BlockLevel;
use dtof_theory::gaussian;
use dtof_theory::looks::detections::Detections;
use dtof_theory::looks::table::Table;
use dtof_theory::rates::{signal_for_snr, snr};
use dtof_theory::tune::{Request, Source, Wanted, tune};
use serde_json::json;

/// What settings are for.
#[derive(Args)]
#[group(skip)]
pub struct Options {
    /// The rule to find settings for
    #[arg(long, value_enum, default_value_t = RuleName::Paper)]
    rule: RuleName,
    /// Background photons a bin and laser cycle (B)
    #[arg(long, value_name = "B", value_parser = positive)]
    background: f64,
    /// Signal photons a laser cycle (A)
    #[arg(long, value_name = "A", value_parser = positive, required_unless_present = "snr")]
    signal: Option<f64>,
    /// Instead: the SNR of the whole exposure, N·A / √(N·B) with N = L2
    #[arg(long, value_name = "SNR", value_parser = positive, conflicts_with = "signal")]
    snr: Option<f64>,
    /// Standard deviation of the pulse in bins
    #[arg(long, value_name = "BINS", value_parser = positive, required_unless_present = "sigma_ps")]
    sigma_bins: Option<f64>,
    /// Instead: in picoseconds
    #[arg(long, value_name = "PS", value_parser = positive, conflicts_with = "sigma_bins")]
    sigma_ps: Option<f64>,
    /// Bins of a histogram, a power of two from 8 to 1024
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = bins)]
    bins: u16,
    /// Picoseconds a bin
    #[arg(long, value_name = "PS", default_value_t = 250.0, value_parser = positive)]
    bin_width_ps: f64,
    /// The share of exposures without a target that may end with an event [default: 0.01]
    #[arg(long, value_name = "SHARE", value_parser = positive, conflicts_with = "false_alarms_per_second")]
    false_alarm: Option<f64>,
    /// Instead: the false alarms of a pixel a second
    #[arg(long, value_name = "RATE", value_parser = positive, requires = "laser_hz")]
    false_alarms_per_second: Option<f64>,
    /// Laser cycles a second
    #[arg(long, value_name = "HZ", value_parser = positive)]
    laser_hz: Option<f64>,
    /// The exposure a decision must exceed, in laser cycles [default: the one with the shortest
    /// time to an event]
    #[arg(long, value_name = "N", value_parser = whole(0..=u16::MAX))]
    l1: Option<u16>,
    /// The exposure at which a pixel starts over without an event, in laser cycles
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = whole(1..=u16::MAX))]
    l2: u16,
    /// Laser cycles between looks
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole(1..=u16::MAX))]
    x: u16,
    /// Photons a reported peak holds at least
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole(1..=1023_u16))]
    min_count: u16,
    /// Window rule: the largest blocks of adaptive binning, which share the false alarms with the
    /// pixels
    #[arg(long, value_name = "LEVELS", default_value_t = 0, value_parser = whole(0..=BlockLevel::MAX.raw()))]
    binning: u8,
    /// Seed of the simulated exposures
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(0..=MOST_WHOLE))]
    seed: u64,
}

/// One result: its name in JSON, its value and where that comes from.
struct Line(&'static str, f64, String);

/// What was found.
pub struct Tuned {
    lines: Vec<Line>,
    /// The options that other commands take.
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
        let known = NAMES.iter().find(|names| names.0 == self.0);
        known.map_or((self.0, ""), |names| (names.1, names.2))
    }
}

impl Options {
    /// Finds them.
    ///
    /// # Errors
    /// If nothing suits what is asked for.
    pub fn tune(&self) -> Result<Tuned> {
        let request = self.request()?;
        let (lines, rule) = match self.rule {
            RuleName::Paper => self.paper(&request)?,
            RuleName::Average => self.average(&request)?,
            RuleName::Window => self.window(&request)?,
        };
        // Without them `replay` takes another histogram than these settings are for.
        let histogram = if (self.bins, self.bin_width_ps) == (128, 250.0) {
            String::new()
        } else {
            format!(" --bins {} --bin-width-ps {}", self.bins, self.bin_width_ps)
        };
        let options = format!(
            "{rule} --l2 {} --x {} --min-count {}{histogram}",
            self.l2, self.x, self.min_count
        );
        Ok(Tuned { lines, options })
    }

    fn request(&self) -> Result<Request> {
        let signal = match (self.signal, self.snr) {
            (Some(signal), _) => signal,
            (None, snr) => signal_for_snr(
                snr.context("--signal or --snr is needed")?,
                self.background,
                self.l2.into(),
            ),
        };
        let sigma = match (self.sigma_bins, self.sigma_ps) {
            (Some(bins), _) => bins,
            (None, ps) => ps.context("--sigma-bins or --sigma-ps is needed")? / self.bin_width_ps,
        };
        ensure!(
            sigma <= f64::from(self.bins) / 4.0,
            "a pulse of σ = {} bins does not fit {} bins",
            number(sigma),
            self.bins
        );
        ensure!(
            self.binning == 0 || self.rule == RuleName::Window,
            "--binning needs --rule window here: only its z is shared with blocks"
        );
        let wanted = match (self.false_alarms_per_second, self.laser_hz) {
            (Some(per_second), Some(laser_hz)) => Wanted::PerCycle(per_second / laser_hz),
            _ => Wanted::PerExposure(self.false_alarm.unwrap_or(0.01)),
        };
        Ok(Request {
            background: self.background,
            signal,
            sigma,
            bins: self.bins,
            minimum_count: self.min_count,
            x: self.x,
            l1: self.l1,
            l2: self.l2,
            wanted,
            levels: BlockLevel::saturating(self.binning),
            seed: self.seed,
        })
    }

    /// α, L1 and what to expect of them; the options for it.
    fn paper(&self, request: &Request) -> Result<(Vec<Line>, String)> {
        let table = Table::kept()?;
        let tuned = tune(request, &table)?;
        let false_alarms = match tuned.source {
            Source::Table => format!("simulation: table, {} exposures a point", table.exposures),
            Source::TableAtMost => format!(
                "simulation: at most, the least the table saw, {} exposures a point",
                table.exposures
            ),
            Source::Bound => "formula: upper bound, single looks (exact) added up".to_owned(),
        };
        let exact = |what: &str| format!("formula: {what}, single look (exact)");
        let alpha = format!("smallest for the false alarms wanted; {false_alarms}");
        let gaussian = gaussian::alpha_min(tuned.wanted, u32::from(request.bins) - 1);
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
        // As few digits as name it.
        let alpha = shortest(tuned.alpha);
        Ok((lines, format!("--alpha {alpha} --l1 {}", tuned.l1)))
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

    /// False alarms counted in so many exposures, of which so many have an event.
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

impl Tuned {
    /// For programs: each result with its value, unit and source.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let fields = self.lines.iter().map(|line| {
            let Line(name, value, source) = line;
            let result = json!({ "value": value, "unit": line.names().1, "source": source });
            ((*name).to_owned(), result)
        });
        fields.collect::<serde_json::Map<_, _>>().into()
    }

    /// For people; the last line is what other commands take.
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

    /// The options that other commands take, as `--alpha 4.5 --l1 40`.
    #[must_use]
    pub fn options(&self) -> &str {
        &self.options
    }
}

/// Whole numbers as they are, others to four significant digits.
fn number(value: f64) -> String {
    if value == value.round() && value.abs() < 1e6 {
        format!("{value}")
    } else if (0.001..1e6).contains(&value) {
        significant(value, 4)
    } else {
        format!("{value:.3e}")
    }
}

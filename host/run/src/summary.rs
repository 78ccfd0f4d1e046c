//! The summary of a run: `summary.json`, and the same on the terminal and in
//! the report.

use dtof_core::fixed::types::U8F8;
use dtof_core::{AnyRule, DepthEstimator, Statistics};
use serde::ser::Error as _;
use serde::{Serialize, Serializer};
use serde_json::json;

use crate::truth::AgainstTruth;
use dtof_data::options::rows::{Row, grouped};
use dtof_data::photons::source::PhotonSource;
use dtof_engine::settings::{Settings, SettingsFile};

/// Where depth comes from: one decision a pixel, on all photons.
pub(crate) const ALL_PHOTONS: &str = "all photons";

/// Every `summary.json` begins with it, less the version.
pub(crate) const MARK: &str = "\"program\": \"dtof ";

/// The totals that the terminal shows.
const BRIEF: [&str; 12] = [
    "bin width",
    "taken to have lasted",
    "photons",
    "photons not used",
    "depth events",
    "readings of frames",
    "pixels with depth",
    "dim targets",
    "too short for an event",
    "no event",
    "cover glass",
    "export with",
];

/// The content of `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// This program and its version.
    pub program: &'static str,
    /// The recording or the scene, if it was a file.
    pub input: Option<String>,
    /// Laser cycles a second of a simulated scene.
    pub laser_hz: Option<u64>,
    /// The field of view of a simulated scene: horizontal and vertical angle.
    pub field_of_view_degrees: Option<[f64; 2]>,
    /// The options that `dtof export` needs for the scene, if any.
    pub export_with: Option<String>,
    /// Laser cycles that recorded histograms were taken to have lasted: the
    /// shortest and the longest capture.
    pub recorded_cycles: Option<(u64, u64)>,
    /// Laser cycles.
    pub cycles: u64,
    /// Photons offered to the pixels: counted, saturated, rejected, gated out or repeated.
    pub photons: u64,
    /// Depth events.
    pub events: u64,
    /// Of these, those of blocks of pixels.
    pub events_of_blocks: u64,
    /// Of these, those that neighbours confirmed.
    pub events_confirmed: u64,
    /// Pixels of the recording or scene.
    pub pixels: usize,
    /// Pixels with at least one event.
    pub pixels_reporting: usize,
    /// Where the depth of a pixel comes from: all photons, events, or frames.
    pub depth_from: &'static str,
    /// Pixels with a depth.
    pub pixels_with_depth: usize,
    /// Photons in the excluded bins around an echo that was reported.
    pub held: u64,
    /// Photons with a TDC code past the last bin.
    pub rejected: u64,
    /// Photons that met a full counter.
    pub saturated: u64,
    /// Photons that met a full counter of a block; pixels have counted them.
    pub saturated_in_blocks: u64,
    /// Photons outside the range gate.
    pub gated_out: u64,
    /// Photons that did not count, as they were not the first of their bin in a laser cycle.
    pub repeated: u64,
    /// Photons of pixels that are left out.
    pub masked: u64,
    /// Decisions put off because the event before was not taken yet.
    pub deferred: u64,
    /// Exposures that reached L2 without an event; if pixels decide once, pixels without an event.
    pub expired: u64,
    /// Of these, exposures with a decision put off.
    pub expired_deferred: u64,
    /// Exposures that ended because a counter was full, so that bins could not be weighed by a dead
    /// time.
    pub ended_full: u64,
    /// Decisions where a bin was blind or had a photon in nearly all laser cycles, or on counts that
    /// contradict the dead time.
    pub blind_looks: u64,
    /// Recorded photons that were not replayed, as they lie after the last
    /// laser cycle.
    pub not_replayed: u64,
    /// How many times as bright crosstalk of the cover glass is as when it was calibrated, and how many
    /// times at least, if it is significantly brighter.
    pub cover_glass: Option<[f64; 2]>,
    /// Recorded photons in bins that were cut off.
    pub cut_off: u64,
    /// How the recording was preprocessed.
    #[serde(serialize_with = "named")]
    pub recording: Vec<Row>,
    /// What was found in the recording, if its settings come from there.
    #[serde(serialize_with = "named")]
    pub found: Vec<Row>,
    /// What was assumed about the recording, one a row, for people.
    #[serde(skip)]
    pub assumed: Vec<Row>,
    /// The options that find more dim targets, for people.
    #[serde(skip)]
    pub dim_targets: Option<String>,
    /// Warnings about the recording.
    pub warnings: Vec<String>,
    /// How the events of a simulated scene compare with it.
    pub against_truth: Option<AgainstTruth>,
    /// The settings of the pixels.
    #[serde(serialize_with = "settings")]
    pub settings: Settings,
}

/// Writes settings by their keys in a settings file, those with a default also where they have it, and the estimator
/// that follows from them.
fn settings<S: Serializer>(settings: &Settings, serializer: S) -> Result<S::Ok, S::Error> {
    let configuration = &settings.configuration;
    let mut keys = json!({
        "gate": null,
        "binning": 0,
        "tracking": false,
        "echoes": configuration.echoes.raw(),
        "echo_wait": null,
        "dead_time": settings.dead_time(),
        "once_per_bin": false,
        "counter_bits": settings.counter_bits,
    });
    let written = serde_json::to_value(SettingsFile::default().with_settings(settings));
    let written = written.map_err(S::Error::custom)?;
    let sections = written.as_object().into_iter().flatten();
    for (key, value) in sections.filter_map(|(_, keys)| keys.as_object()).flatten() {
        if !value.is_null() {
            keys[key] = value.clone();
        }
    }
    // Files have the fewest digits that are read as these numbers.
    let mut exact = |key: &str, number: f64| keys[key] = number.into();
    exact("bin_width_ps", configuration.bin_width_ps.to_num());
    exact("offset_mm", configuration.offset_mm.to_num());
    match &configuration.rule {
        AnyRule::Paper(rule) => exact("alpha", rule.threshold().alpha().to_num()),
        AnyRule::Average(rule) => exact("alpha", rule.threshold().alpha().to_num()),
        AnyRule::Window(rule) => exact("z", rule.z().to_num()),
    }
    if let Some(sigma) = settings.sigma_bins {
        exact("sigma_bins", sigma.to_num());
    }
    if let DepthEstimator::CentredWindow(window) = configuration.estimator
        && keys.get("half_widths").is_some()
    {
        keys["half_widths"] = json!([window.before(), window.after()].map(U8F8::to_num::<f64>));
    }
    let offsets = settings.offsets_mm.iter().map(|mm| mm.to_num::<f64>());
    if offsets.len() > 0 {
        keys["offsets_mm"] = offsets.collect();
    }
    if settings.dead_time() > 0 {
        keys["dead_time_from"] = match settings.is_dead_time_of_sensor {
            true => "sensor".into(),
            false => "settings".into(),
        };
    }
    if configuration.dither_bins > 0 {
        keys["dither_bins"] = configuration.dither_bins.into();
        keys["dither_seed"] = configuration.dither_seed.into();
    }
    keys["estimator"] = match configuration.estimator {
        DepthEstimator::Centroid3 => "centroid".into(),
        DepthEstimator::CentredWindow(_) => "centred-window".into(),
    };
    keys.serialize(serializer)
}

/// Writes rows as an object.
fn named<S: Serializer>(rows: &[Row], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(rows.iter().map(|(name, value)| (name, value)))
}

impl Summary {
    /// The summary of a run from the statistics of pixels and blocks.
    #[must_use]
    pub fn new(
        [statistics, blocks]: [Statistics; 2],
        source: &dyn PhotonSource,
        pixels_reporting: usize,
        settings: &Settings,
    ) -> Self {
        Self {
            program: concat!("dtof ", env!("CARGO_PKG_VERSION")),
            input: None,
            laser_hz: source.laser_hz(),
            field_of_view_degrees: None,
            export_with: None,
            recorded_cycles: source.recorded_cycles(),
            cycles: source.cycles(),
            photons: statistics.photons(),
            events: statistics.events + blocks.events,
            events_of_blocks: blocks.events,
            events_confirmed: 0,
            pixels: source.addresses().len(),
            pixels_reporting,
            depth_from: match settings.frame {
                Some(_) => "frames",
                None => "events",
            },
            pixels_with_depth: pixels_reporting,
            held: statistics.excluded,
            rejected: statistics.rejected,
            saturated: statistics.saturated,
            saturated_in_blocks: blocks.saturated,
            gated_out: statistics.gated_out,
            repeated: statistics.repeated,
            masked: source.masked(),
            deferred: statistics.deferred + blocks.deferred,
            expired: statistics.expired,
            expired_deferred: statistics.expired_deferred,
            ended_full: statistics.ended_full,
            blind_looks: statistics.blind_looks,
            not_replayed: source.not_replayed(),
            cover_glass: None,
            cut_off: 0,
            recording: Vec::new(),
            found: Vec::new(),
            assumed: Vec::new(),
            dim_targets: None,
            warnings: Vec::new(),
            against_truth: None,
            settings: settings.clone(),
        }
    }

    /// The totals, for the report.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let row = |name: &str, value: u64| (name.to_owned(), grouped(value));
        let mut rows = Vec::new();
        if let Some(input) = &self.input {
            rows.push(("input".to_owned(), input.clone()));
        }
        rows.extend(self.recording.iter().cloned());
        rows.extend(self.assumed.iter().cloned());
        if let Some((shortest, longest)) = self.recorded_cycles {
            let cycles = if shortest == longest {
                grouped(longest)
            } else {
                format!("{} to {}, by capture", grouped(shortest), grouped(longest))
            };
            rows.push((
                "taken to have lasted".to_owned(),
                format!("{cycles} laser cycles; --recorded-cycles gives another number"),
            ));
        }
        rows.push(row("laser cycles", self.cycles));
        rows.push(row("photons", self.photons));
        let not_used = self.not_used();
        if !not_used.is_empty() {
            rows.push(("photons not used".to_owned(), not_used.join(", ")));
        }
        let name = match self.settings.frame {
            None => "depth events",
            Some(_) => "readings of frames",
        };
        rows.push((name.to_owned(), self.events_of_pixels()));
        rows.push((
            "pixels with depth".to_owned(),
            format!("{} of {}", self.pixels_with_depth, self.pixels),
        ));
        if let Some(options) = &self.dim_targets {
            rows.push(("dim targets".to_owned(), options.clone()));
        }
        if self.settings.configuration.binning.is_some() {
            rows.push(row("events of blocks", self.events_of_blocks));
        }
        if self.settings.configuration.neighbours.is_some() && self.settings.frame.is_none() {
            rows.push(row(
                "events that neighbours confirmed",
                self.events_confirmed,
            ));
        }
        if self.settings.decide_once {
            rows.push(row("pixels without an event", self.expired));
        } else if self.settings.frame.is_none() {
            rows.push(row("exposures without an event", self.expired));
        }
        let first_decision = self.settings.first_decision();
        if self.cycles < first_decision {
            rows.push((
                "too short for an event".to_owned(),
                format!("the first decision comes after {first_decision} laser cycles"),
            ));
        }
        if self.events == 0 && self.photons > 0 && self.gated_out == self.photons {
            let why = "all photons are outside the range gate".to_owned();
            rows.push(("no event".to_owned(), why));
        }
        if self.events == 0 && self.photons == 0 && self.masked > 0 {
            let why = "all photons are of pixels left out".to_owned();
            rows.push(("no event".to_owned(), why));
        }
        if self.photons == 0 && self.masked == 0 && self.not_replayed > 0 {
            let why =
                "all photons come after the laser cycles that were replayed: --cycles N takes more";
            rows.push(("no event".to_owned(), why.to_owned()));
        }
        // Only what has occurred.
        let of_decisions = [
            ("decisions put off", self.deferred),
            ("exposures ended by a full counter", self.ended_full),
            (
                "decisions where bins were hardly ever live",
                self.blind_looks,
            ),
        ];
        let of_decisions = of_decisions.iter().filter(|(_, number)| *number > 0);
        rows.extend(of_decisions.map(|&(name, number)| row(name, number)));
        if let Some([times, least]) = self.cover_glass {
            let text = format!(
                "{times:.1} times as bright as when it was calibrated, at least {least:.1}: clean it"
            );
            rows.push(("cover glass".to_owned(), text));
        }
        let warnings = self.warnings.iter();
        rows.extend(warnings.map(|warning| ("warning".to_owned(), warning.clone())));
        if let Some(options) = &self.export_with {
            rows.push(("export with".to_owned(), options.clone()));
        }
        rows
    }

    /// How many events of how many pixels there are.
    fn events_of_pixels(&self) -> String {
        let mut text = format!(
            "{} from {} of {} pixels",
            grouped(self.events),
            self.pixels_reporting,
            self.pixels
        );
        if self.settings.configuration.binning.is_some() {
            text += ", by themselves or in a block";
        }
        if self.is_map_longer() {
            let recorded = self.recorded_cycles.map_or(0, |(_, longest)| longest);
            text += &format!(
                ", from {} of {} laser cycles: histograms have no time; --cycles N takes more",
                grouped(self.cycles),
                grouped(recorded)
            );
        }
        text
    }

    /// Whether the depth map is decided on photons that were not replayed.
    fn is_map_longer(&self) -> bool {
        let recorded = self.recorded_cycles.map_or(0, |(_, longest)| longest);
        self.depth_from == ALL_PHOTONS && self.cycles < recorded
    }

    /// The photons that did not count, by cause.
    fn not_used(&self) -> Vec<String> {
        // Others are for the depth map.
        let not_replayed = match self.is_map_longer() {
            true => 0,
            false => self.not_replayed,
        };
        let losses = [
            (self.gated_out, "outside the range gate"),
            (self.repeated, "after the first of a bin"),
            (self.masked, "of pixels left out"),
            (self.saturated, "lost to full counters"),
            (self.saturated_in_blocks, "lost to full counters of blocks"),
            (self.rejected, "with a code past the last bin"),
            (self.cut_off, "in bins cut off"),
            (not_replayed, "not replayed: --cycles N takes more"),
        ];
        let losses = losses.iter().filter(|(photons, _)| *photons > 0);
        let losses = losses.map(|(photons, cause)| format!("{} {cause}", grouped(*photons)));
        losses.collect()
    }

    /// The rows of [`Self::rows`] that the terminal shows; the report has all.
    #[must_use]
    pub fn brief(&self) -> Vec<Row> {
        let mut rows = self.rows();
        rows.retain(|(name, _)| BRIEF.contains(&name.as_str()));
        rows
    }
}

#[cfg(test)]
mod tests;

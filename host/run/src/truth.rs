//! Compares the events of a simulated scene, or the readings of frames, with the scene: each with the
//! surfaces that its pixel saw in that laser cycle. Memory does not grow with their number.

use std::ops::AddAssign;

use anyhow::Result;
use dtof_core::{Array, DepthEvent, EchoNumber};
use serde::Serialize;

use dtof_data::events::events_csv::range_mm;
use dtof_data::options::rows::{Row, bins, grouped};
use dtof_data::photons::ranges::Ranges;
use dtof_engine::settings::Settings;
use dtof_light::scene::{Hit, Scene};

/// An event is a false alarm if its range lies farther from the truth than this many bins.
pub const FALSE_BEYOND_BINS: f64 = 3.0;

/// Errors are counted in so many steps from 0 to [`FALSE_BEYOND_BINS`]: 1024 a bin.
const STEPS: usize = 3 * 1024;

/// False alarms look like crosstalk of a cover glass if there are at least so many in one place.
const GLASS_MIN_EVENTS: u64 = 10;
/// At least one in so many events must be such a false alarm.
const GLASS_ONE_IN: u64 = 100;
/// There must be this many times more of them than if all false alarms were evenly spread.
const GLASS_CONCENTRATION: u64 = 4;
/// The crosstalk ends after so many standard deviations of the pulse.
const GLASS_ENDS_SIGMA: f64 = 6.0;
/// The fewest bins of a range gate.
const MIN_GATE: usize = 8;

/// All events of a run against the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AgainstTruth {
    /// Pixels of the array.
    pub pixels: usize,
    /// The range at the end of the last bin.
    pub histogram_ends_mm: f64,
    /// [`FALSE_BEYOND_BINS`].
    pub false_beyond_bins: f64,
    /// Errors of all events.
    #[serde(flatten)]
    pub all: Errors,
    /// Errors surface by surface, and of pixels that see none.
    pub surfaces: Vec<SurfaceStats>,
    /// False alarms that look like crosstalk of a cover glass, if there are any.
    pub cover_glass: Option<CoverGlass>,
}

/// Events of pixels that saw one surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceStats {
    /// Name of the surface.
    pub name: String,
    /// Pixels with an event.
    pub pixels: usize,
    /// Laser cycle of the first event.
    pub first_cycle: Option<u64>,
    /// Errors of the events.
    #[serde(flatten)]
    pub errors: Errors,
    /// Pixels that see the surface beyond the last bin, at the start or the end of the run.
    pub pixels_beyond: usize,
}

/// False alarms and errors of events.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Number of events.
    pub events: u64,
    /// Number of false alarms among them, which do not count in the errors.
    pub false_alarms: u64,
    /// The share of false alarms.
    pub false_alarm_share: Option<f64>,
    /// Mean error: positive if events are too far away.
    pub bias_mm: Option<f64>,
    /// Root mean square of the error.
    pub rms_mm: Option<f64>,
    /// The 95th percentile of the absolute error, rounded up to 1/1024 bin.
    pub within_95_mm: Option<f64>,
}

/// False alarms in one place, nearer than every surface: probably crosstalk of a cover glass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoverGlass {
    /// First and last bin of these peaks.
    pub bins: (u16, u16),
    /// Number of these false alarms.
    pub false_alarms: u64,
    /// First and last bin of a range gate that excludes them.
    pub gate: (u16, u16),
}

impl AgainstTruth {
    /// Rows for people. `nouns` name one report of a pixel, and several.
    #[must_use]
    pub fn rows(&self, nouns: [&str; 2]) -> Vec<Row> {
        let mut rows = Vec::new();
        if self.surfaces.len() > 1 {
            rows.extend(self.all.rows("", nouns));
        }
        for surface in &self.surfaces {
            rows.extend(surface.rows(self, nouns));
        }
        if let Some(glass) = &self.cover_glass {
            let (first, last) = glass.bins;
            let (from, to) = glass.gate;
            rows.push((
                "like a cover glass".to_owned(),
                format!(
                    "{} false alarms in {}, before every surface: try --gate {from}..{to}",
                    grouped(glass.false_alarms),
                    bins(first.into(), last.into())
                ),
            ));
        }
        rows
    }
}

impl SurfaceStats {
    fn rows(&self, all: &AgainstTruth, nouns: [&str; 2]) -> Vec<Row> {
        let name = &self.name;
        let first = self.first_cycle.map_or("-".to_owned(), grouped);
        let mut rows = vec![(
            name.clone(),
            format!(
                "{} {} of {} pixels, the first in laser cycle {first}",
                grouped(self.errors.events),
                nouns[1],
                self.pixels,
            ),
        )];
        if self.pixels_beyond > 0 {
            rows.push((
                format!("{name}, beyond the last bin"),
                format!(
                    "{} of {} pixels at the start or the end: no photons from {:.0} mm on",
                    self.pixels_beyond, all.pixels, all.histogram_ends_mm
                ),
            ));
        }
        rows.extend(self.errors.rows(&format!("{name}, "), nouns));
        rows
    }
}

impl Errors {
    /// Rows whose names begin with `prefix`; none without events.
    fn rows(&self, prefix: &str, [_, several]: [&str; 2]) -> Vec<Row> {
        let Some(share) = self.false_alarm_share else {
            return Vec::new();
        };
        let mut rows = vec![(
            format!("{prefix}false alarms"),
            format!(
                "{} of {} {several} ({}), more than {FALSE_BEYOND_BINS} bins from the truth",
                grouped(self.false_alarms),
                grouped(self.events),
                percent(share),
            ),
        )];
        if let (Some(bias), Some(rms), Some(within)) =
            (self.bias_mm, self.rms_mm, self.within_95_mm)
        {
            rows.push((
                format!("{prefix}errors of the others"),
                format!("bias {bias:+.1} mm, rms {rms:.1} mm, 95 % within {within:.1} mm"),
            ));
        }
        rows
    }
}

/// A share in percent with two significant digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    match percent {
        0.0 => "0 %".to_owned(),
        ..0.01 => "less than 0.01 %".to_owned(),
        ..1.0 => format!("{percent:.2} %"),
        ..10.0 => format!("{percent:.1} %"),
        _ => format!("{percent:.0} %"),
    }
}

/// Compares events with a scene: counts and sums over the events so far.
pub struct SceneComparison<'a> {
    scene: &'a Scene,
    array: Array,
    ranges: Ranges,
    /// Distance from the first echo to the second, if pixels report several.
    behind_mm: Option<f64>,
    /// The first and the last bin that may hold the peak.
    first_bin: usize,
    last_bin: usize,
    /// One for each surface, and one for pixels that see none.
    tallies: Vec<Tally>,
    /// Number of false alarms with their peak in each bin.
    false_peaks: Vec<u64>,
}

/// Counts and sums over the events of one surface.
#[derive(Clone)]
struct Tally {
    /// For each pixel whether it has sent an event.
    has_sent: Vec<bool>,
    first_cycle: Option<u64>,
    events: u64,
    /// Sums of the errors in millimetres and of their squares, and a histogram of their size, all without
    /// false alarms.
    sum: f64,
    squares: f64,
    sizes: Vec<u64>,
}

impl<'a> SceneComparison<'a> {
    /// Begins to compare events with `scene`.
    ///
    /// # Errors
    /// Fails if the range scale is invalid, or if the scene has more pixels than addresses.
    pub fn new(scene: &'a Scene, settings: &Settings) -> Result<Self> {
        let (array, bins) = (scene.array()?, usize::from(scene.bins));
        let second_echo = scene.effects.second_echo.as_ref();
        let behind_mm = second_echo.map(|echo| echo.behind_mm);
        Ok(Self {
            scene,
            array,
            ranges: settings.ranges(array)?,
            behind_mm: behind_mm.filter(|_| settings.configuration.echoes > EchoNumber::FIRST),
            first_bin: settings.gate().map_or(0, |(first, _)| first.into()),
            last_bin: settings.gate().map_or(bins - 1, |(_, last)| last.into()),
            tallies: vec![Tally::new(array.pixels() as usize); scene.surfaces.len() + 1],
            false_peaks: vec![0; bins],
        })
    }

    /// Adds events.
    pub fn add(&mut self, events: &[DepthEvent]) {
        for event in events {
            let limit_mm = FALSE_BEYOND_BINS * self.scene.mm_per_bin();
            let (surface, right) = match self.found(event, limit_mm) {
                Some((surface, error)) => (surface, Some(error)),
                None => {
                    let view = self.scene.truth(event.pixel, event.cycle.raw());
                    let surface = view.map_or(self.scene.surfaces.len(), |view| view.surface);
                    self.tallies[surface].has_sent[usize::from(event.pixel.raw())] = true;
                    (surface, None)
                }
            };
            self.tallies[surface].add(event, right.map(|error| (error, error.abs() / limit_mm)));
            let bin = usize::from(event.peak_bin.raw());
            if let (None, Some(count)) = (right, self.false_peaks.get_mut(bin)) {
                *count += 1;
            }
        }
    }

    /// The surface of an event and its error, if that is at most `limit_mm`. The error of a block is the
    /// mean over its pixels that see a surface there.
    fn found(&mut self, event: &DepthEvent, limit_mm: f64) -> Option<(usize, f64)> {
        let range_mm = range_mm(event, &self.ranges);
        let (mut surface, mut sum, mut pixels) = (None, 0.0, 0.0);
        for pixel in self.array.pixels_of(event.pixel, event.level) {
            let [nearest, behind] = self.scene.hits(pixel, event.cycle.raw());
            let echo = nearest.zip(self.behind_mm).map(|(view, behind_mm)| Hit {
                range_mm: view.range_mm + behind_mm,
                ..view
            });
            let views = [nearest, echo, behind].into_iter().flatten();
            let errors = views.map(|view| (view.surface, range_mm - view.range_mm));
            let nearest = errors.min_by(|(_, one), (_, other)| one.abs().total_cmp(&other.abs()));
            if let Some((of, error)) = nearest.filter(|(_, error)| error.abs() <= limit_mm) {
                surface.get_or_insert(of);
                sum += error;
                pixels += 1.0;
                self.tallies[of].has_sent[usize::from(pixel.raw())] = true;
            }
        }
        Some((surface?, sum / pixels))
    }

    /// The result of a run of `cycles` laser cycles.
    #[must_use]
    pub fn finish(&self, cycles: u64) -> AgainstTruth {
        let step_mm = FALSE_BEYOND_BINS * self.scene.mm_per_bin() / STEPS as f64;
        let mut all = Tally::new(0);
        let mut surfaces = Vec::new();
        let names = self.scene.surfaces.iter().map(|surface| &*surface.name);
        for (index, name) in names.chain(["no surface"]).enumerate() {
            let tally = &self.tallies[index];
            all += tally;
            // Pixels that see nothing are listed only if they have events.
            if index < self.scene.surfaces.len() || tally.events > 0 {
                surfaces.push(SurfaceStats {
                    name: name.to_owned(),
                    pixels: tally.has_sent.iter().filter(|sent| **sent).count(),
                    first_cycle: tally.first_cycle,
                    errors: tally.errors(step_mm),
                    pixels_beyond: self.scene.pixels_beyond(index, cycles),
                });
            }
        }
        AgainstTruth {
            pixels: self.array.pixels() as usize,
            histogram_ends_mm: self.scene.end_mm(),
            false_beyond_bins: FALSE_BEYOND_BINS,
            all: all.errors(step_mm),
            surfaces,
            cover_glass: self.cover_glass(all.events, cycles),
        }
    }

    /// False alarms that look like crosstalk of a cover glass: more than half of all false alarms, within
    /// three bins, nearer than every surface.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "bins of a histogram"
    )]
    fn cover_glass(&self, events: u64, cycles: u64) -> Option<CoverGlass> {
        let false_alarms: u64 = self.false_peaks.iter().sum();
        let reach = FALSE_BEYOND_BINS as usize;
        let most = self.false_peaks.iter().max()?;
        let middle = self.false_peaks.iter().position(|count| count == most)?;
        let first = middle.saturating_sub(reach).max(self.first_bin);
        let last = (middle + reach).min(self.last_bin);
        let here: u64 = self.false_peaks.get(first..=last)?.iter().sum();
        let bins = self.last_bin + 1 - self.first_bin;
        let even = false_alarms * (last + 1 - first) as u64 / bins as u64;
        let is_glass = 2 * here > false_alarms
            && here >= GLASS_MIN_EVENTS
            && here >= events / GLASS_ONE_IN
            && here > GLASS_CONCENTRATION * even;
        // The gate begins after the crosstalk, but before the nearest surface.
        let sigma = self.scene.pulse_sigma_bins;
        let ends = middle as f64 + (GLASS_ENDS_SIGMA * sigma).ceil().max(FALSE_BEYOND_BINS);
        let surfaces = self.scene.surfaces.iter();
        let ranges = surfaces.map(|surface| self.scene.nearest_mm(surface, cycles));
        let nearest = ranges.fold(f64::INFINITY, f64::min) / self.scene.mm_per_bin();
        let gate = (ends + 1.0).min((nearest - FALSE_BEYOND_BINS).floor());
        let has_room = gate > last as f64 && gate + MIN_GATE as f64 <= self.last_bin as f64 + 1.0;
        (is_glass && has_room).then_some(CoverGlass {
            bins: (first as u16, last as u16),
            false_alarms: here,
            gate: (gate as u16, self.last_bin as u16),
        })
    }
}

impl Tally {
    fn new(addresses: usize) -> Self {
        Self {
            has_sent: vec![false; addresses],
            first_cycle: None,
            events: 0,
            sum: 0.0,
            squares: 0.0,
            sizes: vec![0; STEPS],
        }
    }

    /// Adds an event. `error` is in millimetres and as a share of the largest; false alarms have none.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to STEPS"
    )]
    fn add(&mut self, event: &DepthEvent, error: Option<(f64, f64)>) {
        self.first_cycle.get_or_insert(event.cycle.raw());
        self.events += 1;
        if let Some((error, size)) = error {
            self.sum += error;
            self.squares += error * error;
            self.sizes[((size * STEPS as f64) as usize).min(STEPS - 1)] += 1;
        }
    }

    fn errors(&self, step_mm: f64) -> Errors {
        let right: u64 = self.sizes.iter().sum();
        let false_alarms = self.events - right;
        let of = |sum: f64, count: u64| (count > 0).then(|| sum / count as f64);
        let mut so_far = 0;
        let within = self.sizes.iter().position(|count| {
            so_far += count;
            so_far > 0 && 20 * so_far >= 19 * right
        });
        Errors {
            events: self.events,
            false_alarms,
            false_alarm_share: of(false_alarms as f64, self.events),
            bias_mm: of(self.sum, right),
            rms_mm: of(self.squares, right).map(f64::sqrt),
            within_95_mm: within.map(|step| (step + 1) as f64 * step_mm),
        }
    }
}

impl AddAssign<&Self> for Tally {
    /// Adds all but pixels and times, which the total does not need.
    fn add_assign(&mut self, other: &Self) {
        self.events += other.events;
        self.sum += other.sum;
        self.squares += other.squares;
        for (sum, count) in self.sizes.iter_mut().zip(&other.sizes) {
            *sum += count;
        }
    }
}

//! How the events of a simulated scene compare with it: what `summary.json` has of that,
//! and the same for people.

use serde::Serialize;

use crate::rows::{Row, grouped};

/// An event is a false alarm if its range lies farther from the truth than this many bins.
pub const FALSE_BEYOND_BINS: f64 = 3.0;

/// All events of a run against the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AgainstTruth {
    /// Pixels of the array.
    pub pixels: usize,
    /// Where the last bin ends.
    pub histogram_ends_mm: f64,
    /// [`FALSE_BEYOND_BINS`].
    pub false_beyond_bins: f64,
    /// Of all events.
    #[serde(flatten)]
    pub all: Errors,
    /// Surface by surface, and events of pixels that see none.
    pub surfaces: Vec<OfSurface>,
    /// False alarms that look like the cover glass, if there are any.
    pub cover_glass: Option<CoverGlass>,
}

/// Events of pixels that saw one surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfSurface {
    /// Its name.
    pub name: String,
    /// Pixels with such an event.
    pub pixels: usize,
    /// The laser cycle of the first.
    pub first_cycle: Option<u64>,
    /// How they compare.
    #[serde(flatten)]
    pub errors: Errors,
    /// Pixels that see it beyond the last bin, at the start or the end of the run.
    pub pixels_beyond: usize,
}

/// How some events compare with the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// How many there are.
    pub events: u64,
    /// Of these, false alarms. They are left out of the errors.
    pub false_alarms: u64,
    /// The same as a share.
    pub false_alarm_share: Option<f64>,
    /// Mean error: positive if events are too far away.
    pub bias_mm: Option<f64>,
    /// Root mean square of the error.
    pub rms_mm: Option<f64>,
    /// 95 % of the errors are at most so large, rounded up to 1/1024 bin: that is how fine they
    /// are counted.
    pub within_95_mm: Option<f64>,
}

/// False alarms in one place, nearer than every surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoverGlass {
    /// First and last bin of their peaks.
    pub bins: (u16, u16),
    /// How many there are.
    pub false_alarms: u64,
    /// First and last bin of a range gate without them.
    pub gate: (u16, u16),
}

impl AgainstTruth {
    /// For people. The pixels' reports are `called` so: one of them, and several.
    #[must_use]
    pub fn rows(&self, called: [&str; 2]) -> Vec<Row> {
        let mut rows = Vec::new();
        if self.surfaces.len() > 1 {
            rows.extend(self.all.rows("", called));
        }
        for surface in &self.surfaces {
            rows.extend(surface.rows(self, called));
        }
        if let Some(glass) = &self.cover_glass {
            let (first, last) = glass.bins;
            let (from, to) = glass.gate;
            rows.push((
                "like a cover glass".to_owned(),
                format!(
                    "{} false alarms in bins {first} to {last}, before every surface: try \
                     --gate {from}..{to}",
                    grouped(glass.false_alarms)
                ),
            ));
        }
        rows
    }
}

impl OfSurface {
    fn rows(&self, of: &AgainstTruth, called: [&str; 2]) -> Vec<Row> {
        let name = &self.name;
        let first = self.first_cycle.map_or("-".to_owned(), grouped);
        let mut rows = vec![(
            name.clone(),
            format!(
                "{} {} of {} pixels, the first in laser cycle {first}",
                grouped(self.errors.events),
                called[1],
                self.pixels,
            ),
        )];
        if self.pixels_beyond > 0 {
            rows.push((
                format!("{name}, beyond the last bin"),
                format!(
                    "{} of {} pixels at the start or the end: no photons from {:.0} mm on",
                    self.pixels_beyond, of.pixels, of.histogram_ends_mm
                ),
            ));
        }
        rows.extend(self.errors.rows(&format!("{name}, "), called));
        rows
    }
}

impl Errors {
    /// Nothing if there are no events.
    fn rows(&self, of: &str, [_, several]: [&str; 2]) -> Vec<Row> {
        let Some(share) = self.false_alarm_share else {
            return Vec::new();
        };
        let mut rows = vec![(
            format!("{of}false alarms"),
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
                format!("{of}errors of the others"),
                format!("bias {bias:+.1} mm, rms {rms:.1} mm, 95 % within {within:.1} mm"),
            ));
        }
        rows
    }
}

/// A share with two digits that count.
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

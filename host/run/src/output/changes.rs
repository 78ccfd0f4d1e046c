//! Dynamic depth of a run: when the depth of its pixels has changed, and in which direction.
//!
//! The run has depth events. The dynamic-depth events that pixels would send instead (section III-E of
//! the paper) are drawn over time, as in its Fig. 17 and 18.

use anyhow::Result;
use dtof_core::DepthEvent;
use dtof_core::events::Polarity;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point, Series, Style, chart};
use dtof_draw::palette::{Colour, Mark, Pen};
use dtof_link::DynamicDepth;

use dtof_data::events::dynamic::DepthChanges;
use dtof_data::events::echoes::Echo;
use dtof_data::events::sample::Sample;
use dtof_data::options::Refused;
use dtof_data::options::rows::grouped;
use dtof_data::photons::ranges::Ranges;

/// The most changes of one direction that are drawn.
const MAX_DRAWN: usize = 4096;
/// The directions, each with its pen.
const DIRECTIONS: [(&str, Pen); 2] = [
    ("nearer", pen(Colour::Orange, Mark::Down)),
    ("farther", pen(Colour::Blue, Mark::Up)),
];

const fn pen(colour: Colour, mark: Mark) -> Pen {
    Pen { colour, mark }
}

/// The changes of all pixels.
#[derive(Clone, Debug)]
pub struct Changes {
    found: DepthChanges,
    ranges: Ranges,
    /// Depth events.
    events: u64,
    /// Of each direction, in the order of [`DIRECTIONS`].
    directions: [Sample; 2],
}

impl Changes {
    /// No changes yet.
    ///
    /// # Errors
    /// Fails if the threshold is too low.
    pub fn new(options: &DynamicDepth, ranges: Ranges) -> Result<Self> {
        let config = options.config(ranges.scale());
        let config = config.map_err(|error| {
            Refused::value("threshold_mm", options.threshold_mm, error.to_string())
        })?;
        Ok(Self {
            found: DepthChanges::new(config, Echo::All),
            ranges,
            events: 0,
            directions: [Sample::new(MAX_DRAWN), Sample::new(MAX_DRAWN)],
        })
    }

    /// Adds the next depth event, of a pixel or a block.
    pub fn add(&mut self, event: &DepthEvent) {
        self.events += 1;
        let Some(change) = self.found.observe(event) else {
            return;
        };
        let [nearer, farther] = &mut self.directions;
        let direction = match change.polarity() {
            Polarity::Nearer => nearer,
            Polarity::Farther => farther,
        };
        let range = self.ranges.of(change.pixel, change.level, change.position);
        direction.add(event, range.to_num());
    }

    /// The number of changes.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.directions.iter().map(Sample::seen).sum()
    }

    /// The picture and its caption; nothing without a change. `several` is the plural of event.
    ///
    /// # Errors
    /// Fails if it cannot be drawn.
    pub fn picture(&self, cycles: u64, several: &str) -> Result<Option<(String, String)>> {
        let dots = self.directions.each_ref().map(|direction| -> Vec<Point> {
            let events = direction.events();
            events
                .map(|event| Point::exact(thousands(event.cycle), event.range_mm))
                .collect()
        });
        let ranges = || dots.iter().flatten().map(|dot| dot.y);
        let (low, high) = ranges()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), range| {
                (low.min(range), high.max(range))
            });
        if low > high {
            return Ok(None);
        }
        let room = (0.05 * (high - low)).max(1.0);
        let key = DIRECTIONS.map(|(name, pen)| Key::new(pen, Style::Dots, name));
        let series = DIRECTIONS.into_iter().zip(dots);
        let series = series.map(|((_, pen), dots)| Series::unnamed(pen, Style::Dots, dots));
        let count = grouped(self.count());
        let svg = chart(&Chart {
            finding: format!("Dynamic depth: {count} changes"),
            holds: true,
            note: String::new(),
            x: Axis::linear("thousands of laser cycles").within(0.0, thousands(cycles)),
            y: Axis::linear("mean range after the change, mm").within(low - room, high + room),
            key: key.into(),
            columns: 1,
            panels: vec![Panel::only(
                series.filter(|series| !series.points.is_empty()).collect(),
            )],
        })?;
        let thinned = self.directions.iter().map(Sample::one_of).max();
        let shown = match thinned {
            Some(k) if k > 1 => format!(" At least one of {} is shown.", grouped(k)),
            _ => String::new(),
        };
        let caption = format!(
            "Dynamic depth: {count} changes in place of {} {several}. Each dot is a pixel whose mean depth \
             of three {several} has moved by more than the threshold.{shown}",
            grouped(self.events)
        );
        Ok(Some((svg, caption)))
    }
}

fn thousands(cycles: u64) -> f64 {
    cycles as f64 / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_data::events::fixtures::{event, ranges};

    /// A pixel that sees bin 40, then bin 10 from laser cycle 1000 on, then 40 again; one that
    /// stays.
    fn stepped(cycles: u64) -> Changes {
        let mut changes = Changes::new(&DynamicDepth::default(), ranges()).unwrap();
        for cycle in (0..cycles).step_by(50) {
            let bin = if (cycle / 1000).is_multiple_of(2) {
                40
            } else {
                10
            };
            changes.add(&event(0, cycle, bin));
            changes.add(&event(1, cycle, 40));
        }
        changes
    }

    /// The mean of three moves by ten bins, 375 mm, at each of three events.
    #[test]
    fn a_step_is_three_changes_in_its_direction() {
        let changes = stepped(3000);
        let seen = changes.directions.each_ref().map(Sample::seen);
        assert_eq!((seen, changes.count()), ([3, 3], 6));
        let cycles = |side: usize| changes.directions[side].events().map(|event| event.cycle);
        assert!(cycles(0).eq([1000, 1050, 1100]) && cycles(1).eq([2000, 2050, 2100]));
        let ranges: Vec<f64> = changes.directions[0]
            .events()
            .map(|event| event.range_mm)
            .collect();
        assert!(ranges.is_sorted_by(|a, b| a > b), "{ranges:?}");
        let (svg, caption) = changes.picture(3000, "events").unwrap().unwrap();
        assert!(svg.contains("nearer") && svg.contains("farther"));
        assert!(caption.starts_with("Dynamic depth: 6 changes in place of 120 events."));
        assert!(!caption.contains("At least"));
    }

    #[test]
    fn a_wall_has_no_picture_and_a_busy_scene_a_small_one() {
        assert!(stepped(1000).picture(1000, "events").unwrap().is_none());
        let changes = stepped(8_000_000);
        let (svg, caption) = changes.picture(8_000_000, "events").unwrap().unwrap();
        assert!(svg.len() < 1_500_000, "{}", svg.len());
        assert!(
            caption.ends_with(" At least one of 4 is shown."),
            "{caption}"
        );
    }
}

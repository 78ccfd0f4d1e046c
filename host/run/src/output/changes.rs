//! Dynamic depth of a run: when the depth of its pixels has changed, and to which side.
//!
//! The events are those of depth; what a pixel would send in their place (section III-E of
//! the paper) is drawn over time, as in its Fig. 17 and 18.

use anyhow::Result;
use dtof_core::{DepthEvent, Polarity, RangeScale};
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point, Series, Style, chart};
use dtof_draw::palette::{Colour, Mark, Pen};
use dtof_link::DynamicDepth;

use dtof_events::dynamic::DepthChanges;
use dtof_events::echoes::Echo;
use dtof_events::sample::Sample;
use dtof_options::Refused;
use dtof_options::rows::grouped;

/// Changes of one side that are drawn, at most.
const DRAWN: usize = 4096;
/// To either side: its name, and its pen.
const SIDES: [(&str, Pen); 2] = [
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
    scale: RangeScale,
    /// Depth events.
    events: u64,
    /// Of either side, as [`SIDES`].
    sides: [Sample; 2],
}

impl Changes {
    /// None yet.
    ///
    /// # Errors
    /// If the threshold is too low.
    pub fn new(options: &DynamicDepth, scale: RangeScale) -> Result<Self> {
        let config = options.config(&scale);
        let config = config.map_err(|error| {
            Refused::value("threshold_mm", options.threshold_mm, error.to_string())
        })?;
        Ok(Self {
            found: DepthChanges::new(config, Echo::All),
            scale,
            events: 0,
            sides: [Sample::new(DRAWN), Sample::new(DRAWN)],
        })
    }

    /// Takes the next depth event into account: of a pixel or a block, and of its echoes the
    /// first.
    pub fn add(&mut self, event: &DepthEvent) {
        self.events += 1;
        let Some(change) = self.found.observe(event) else {
            return;
        };
        let [nearer, farther] = &mut self.sides;
        let side = match change.polarity() {
            Polarity::Nearer => nearer,
            Polarity::Farther => farther,
        };
        side.add(event, self.scale.range(change.position).to_num());
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.sides.iter().map(Sample::seen).sum()
    }

    /// The picture and what is to be said of it; nothing without a change. What it is made
    /// from is called `several`.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn picture(&self, cycles: u64, several: &str) -> Result<Option<(String, String)>> {
        let dots = self.sides.each_ref().map(|side| -> Vec<Point> {
            let events = side.events();
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
        let key = SIDES.map(|(name, pen)| Key::new(pen, Style::Dots, name));
        let series = SIDES.into_iter().zip(dots);
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
        let thinned = self.sides.iter().map(Sample::one_of).max();
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
    use dtof_events::fixtures::{event, scale};

    /// A pixel that sees bin 40, then bin 10 from laser cycle 1000 on, then 40 again; one that
    /// stays.
    fn stepped(cycles: u64) -> Changes {
        let mut changes = Changes::new(&DynamicDepth::default(), scale()).unwrap();
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
    fn a_step_is_three_changes_of_its_side() {
        let changes = stepped(3000);
        let seen = changes.sides.each_ref().map(Sample::seen);
        assert_eq!((seen, changes.count()), ([3, 3], 6));
        let cycles = |side: usize| changes.sides[side].events().map(|event| event.cycle);
        assert!(cycles(0).eq([1000, 1050, 1100]) && cycles(1).eq([2000, 2050, 2100]));
        let ranges: Vec<f64> = changes.sides[0]
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

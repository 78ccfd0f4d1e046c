//! One pixel with dynamic depth, compared with the truth.

use std::collections::VecDeque;

use dtof_core::DepthEvent;
use dtof_core::events::{DynamicDepthConfig, DynamicDepthPixel, Polarity, Reference};

use crate::sweep::Tally;
use crate::sweep::mean::{add, add_value};

/// Events of a mean, as in the paper.
const MEAN_OF: usize = 3;
/// Laser cycles after a step within which it has to be found; steps closer to the end of the run
/// are left out.
const WITHIN: u64 = 20_000;

/// The laser cycles and signs of steps: the truth differs by more than `threshold_mm` from its
/// value at the previous step.
pub fn true_steps(truth: impl Iterator<Item = (u64, f64)>, threshold_mm: f64) -> Vec<(u64, i8)> {
    let mut reference = None;
    let mut steps = Vec::new();
    for (cycle, range_mm) in truth {
        let from = *reference.get_or_insert(range_mm);
        let moved: f64 = range_mm - from;
        if moved.abs() > threshold_mm {
            steps.push((cycle, if moved < 0.0 { -1 } else { 1 }));
            reference = Some(range_mm);
        }
    }
    steps
}

/// A dynamic depth event.
#[derive(Clone, Copy)]
struct Change {
    cycle: u64,
    /// 1 if farther, -1 if nearer.
    sign: i8,
    /// Whether the truth has moved in this direction by at least half the threshold meanwhile.
    is_true: bool,
}

/// The nearest and the farthest range.
#[derive(Clone, Copy)]
struct Extent {
    low: f64,
    high: f64,
}

impl Extent {
    fn of(extents: impl Iterator<Item = Self>) -> Option<Self> {
        extents.reduce(|a, b| Self {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
        })
    }
}

/// A pixel with its dynamic depth, and the true ranges it saw.
#[derive(Clone)]
pub struct ObservedPixel {
    config: DynamicDepthConfig,
    threshold_mm: f64,
    pixel: DynamicDepthPixel<MEAN_OF>,
    /// Extents in the exposures of the last events: those of the mean, and the previous one.
    recent: VecDeque<Extent>,
    /// The extent since the exposures of the mean reported last.
    since: Option<Extent>,
    changes: Vec<Change>,
    events: u64,
}

impl ObservedPixel {
    /// Before any event.
    pub fn new(config: DynamicDepthConfig, threshold_mm: f64) -> Self {
        Self {
            config,
            threshold_mm,
            pixel: DynamicDepthPixel::new(),
            recent: VecDeque::new(),
            since: None,
            changes: Vec::new(),
            events: 0,
        }
    }

    /// Adds an event of the pixel, with the true ranges at both ends of its exposure.
    pub fn observe(&mut self, event: &DepthEvent, [first, last]: [f64; 2]) {
        self.events += 1;
        let seen = Extent {
            low: first.min(last),
            high: first.max(last),
        };
        self.recent.push_back(seen);
        if self.recent.len() > MEAN_OF + 1 {
            self.recent.pop_front();
        }
        self.since = Extent::of(self.since.into_iter().chain([seen]));
        let Some(change) = self.pixel.observe(&self.config, event) else {
            return;
        };
        let newest = || self.recent.iter().rev().take(MEAN_OF).copied();
        let before = match self.config.reference() {
            Reference::Previous => Extent::of(self.recent.iter().copied()),
            Reference::Reported => self.since,
        };
        let (sign, moved) = match (change.polarity(), before.zip(Extent::of(newest()))) {
            (Polarity::Nearer, Some((before, now))) => (-1, before.high - now.low),
            (Polarity::Farther, Some((before, now))) => (1, now.high - before.low),
            (_, None) => return,
        };
        self.changes.push(Change {
            cycle: change.cycle.raw(),
            sign,
            is_true: moved > self.threshold_mm / 2.0,
        });
        self.since = Extent::of(newest());
    }

    /// Adds the pixel, its events and changes to the counts of `name`.
    pub fn add_counts(&self, tally: &mut Tally, name: &str) {
        add(tally, name, "pixels", 1);
        add(tally, name, "events", self.events);
        add(tally, name, "changes", self.changes.len() as u64);
    }

    /// Adds the changes, compared with the true `steps` of a run of `cycles` laser cycles, to the
    /// counts of `name`.
    pub fn add_steps(&self, tally: &mut Tally, name: &str, steps: &[(u64, i8)], cycles: u64) {
        let count = |amount: usize| amount as u64;
        add(tally, name, "changes", count(self.changes.len()));
        let is_false = self.changes.iter().filter(|change| !change.is_true);
        add(tally, name, "false", count(is_false.count()));
        for (index, &(at, sign)) in steps.iter().enumerate() {
            if at + WITHIN > cycles {
                break;
            }
            let from = at - early(steps, index);
            let next = steps.get(index + 1);
            let until = next.map_or(cycles, |next| next.0 - early(steps, index + 1));
            let until = until.min(at + WITHIN);
            let found = self.changes.iter().find(|change| {
                (from..until).contains(&change.cycle) && change.sign == sign && change.is_true
            });
            add(tally, name, "steps", 1);
            if let Some(found) = found {
                let delay = found.cycle.cast_signed() - at.cast_signed();
                add_value(tally, &format!("{name} delay"), delay);
            }
        }
    }
}

/// Laser cycles before a step from which it may be found. The mean of a slow motion is noisy and
/// may cross the threshold early, by up to half of the duration of the step. A step that changes
/// direction has no such margin.
fn early(steps: &[(u64, i8)], index: usize) -> u64 {
    let (at, sign) = steps[index];
    let (since, neighbour) = match index.checked_sub(1) {
        Some(before) => (steps[before].0, Some(&steps[before])),
        None => (0, steps.get(1)),
    };
    let goes_on = neighbour.is_some_and(|neighbour| neighbour.1 == sign);
    if goes_on { (at - since) / 2 } else { 0 }
}

#[cfg(test)]
mod tests {
    use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
    use dtof_core::{
        BinIndex, BlockLevel, Count, EchoNumber, Flags, LaserCycle, PixelAddress, RangeScale,
        SubBinOffset,
    };

    use super::*;

    /// A pixel of 250 ps bins that sees these bins, an event each 100 laser cycles.
    fn observed(bins: &[u16], truth: &[u16]) -> ObservedPixel {
        let scale = RangeScale::new(U16F16::from_num(250), I24F8::ZERO).unwrap();
        let threshold = U24F8::from_num(100);
        let config = DynamicDepthConfig::new(threshold, &scale, Reference::Previous).unwrap();
        let mut pixel = ObservedPixel::new(config, 100.0);
        for (cycle, (&bin, &truth)) in (1..).zip(bins.iter().zip(truth)) {
            let event = DepthEvent {
                pixel: PixelAddress::new(0),
                level: BlockLevel::PIXEL,
                echo: EchoNumber::FIRST,
                cycle: LaserCycle::new(cycle * 100),
                exposure: 44,
                peak_bin: BinIndex::saturating(bin),
                offset: SubBinOffset::CENTRE,
                peak_count: Count::saturating(9),
                background: Count::saturating(1),
                flags: Flags::NONE,
            };
            pixel.observe(&event, [f64::from(truth) * 37.474; 2]);
        }
        pixel
    }

    fn tallied(pixel: &ObservedPixel, steps: &[(u64, i8)]) -> Tally {
        let mut tally = Tally::new();
        pixel.add_steps(&mut tally, "a", steps, 100_000);
        pixel.add_counts(&mut tally, "a still");
        tally
    }

    #[test]
    fn a_step_is_found_after_its_delay_and_its_changes_are_true() {
        let bins: Vec<u16> = (0..20)
            .map(|index| if index < 10 { 20 } else { 40 })
            .collect();
        // The step is just after the tenth event.
        let tally = tallied(&observed(&bins, &bins), &[(1001, 1)]);
        assert_eq!((tally["a changes"], tally["a false"]), (3, 0));
        assert_eq!((tally["a steps"], tally["a delay values"]), (1, 1));
        assert_eq!(tally["a delay above 0"], 99);
        // A step in the other direction is not found.
        let tally = tallied(&observed(&bins, &bins), &[(1001, -1)]);
        assert_eq!((tally["a steps"], tally.get("a delay values")), (1, None));
    }

    #[test]
    fn a_false_event_makes_changes_to_both_sides_that_are_false() {
        let mut bins = vec![20; 20];
        bins[10] = 90;
        let tally = tallied(&observed(&bins, &[20; 20]), &[]);
        // It comes and goes.
        assert_eq!((tally["a changes"], tally["a false"]), (2, 2));
        assert_eq!((tally["a still pixels"], tally["a still changes"]), (1, 2));
        assert_eq!(tally["a still events"], 20);
    }

    #[test]
    fn steps_of_the_truth() {
        let truth = [0.0, 60.0, 101.0, 150.0, 201.0, 202.0, 50.0, 50.0];
        let steps = true_steps((0..).zip(truth), 100.0);
        assert_eq!(steps, [(2, 1), (5, 1), (6, -1)]);
    }
}

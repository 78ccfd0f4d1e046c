//! A rule with many thresholds, and the choice of one by its share of false alarms.

use super::Rule;
use crate::sweep::PointTally;

/// A rule with ascending thresholds.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// The rule.
    pub rule: Rule,
    /// Thresholds in equal steps of a power of two, so they are exact in every format.
    pub thresholds: Vec<f64>,
}

impl Ladder {
    /// Thresholds from `first` to `last`, in units of 1 / `steps`.
    #[must_use]
    pub fn new(rule: Rule, first: u32, last: u32, steps: u32) -> Self {
        let thresholds = first..=last;
        Self {
            rule,
            thresholds: thresholds
                .map(|step| f64::from(step) / f64::from(steps))
                .collect(),
        }
    }

    /// The name of the count `what` at threshold `index` in a tally.
    #[must_use]
    pub fn key(&self, index: usize, what: &str) -> String {
        format!("{} {} {what}", self.rule.name(), self.thresholds[index])
    }

    /// The threshold at which `share` of the exposures fire, from the counts `"false"` of `points`.
    /// Interpolated in the logarithm of the share; clamped to the first and the last threshold.
    #[must_use]
    pub fn calibrated(&self, points: &[&PointTally], share: f64) -> f64 {
        let exposures: u64 = points.iter().map(|point| point.count("exposures")).sum();
        let requested = (share * exposures as f64).ln();
        let found = |index: usize| {
            let key = self.key(index, "false");
            let count: u64 = points.iter().map(|point| point.count(&key)).sum();
            // Zero counts as one half.
            (count as f64).max(0.5).ln()
        };
        for index in 1..self.thresholds.len() {
            let (before, after) = (found(index - 1), found(index));
            if after <= requested {
                let between = if before > requested {
                    (before - requested) / (before - after)
                } else {
                    0.0
                };
                let [low, high] = [index - 1, index].map(|index| self.thresholds[index]);
                return low + between * (high - low);
            }
        }
        self.thresholds.last().copied().unwrap_or_default()
    }

    /// The index of the threshold nearest to `threshold`.
    #[must_use]
    pub fn nearest(&self, threshold: f64) -> usize {
        let above = self.thresholds.partition_point(|&at| at < threshold);
        let distance = |index: usize| {
            let at = self.thresholds.get(index);
            at.map_or(f64::INFINITY, |at| (at - threshold).abs())
        };
        let below = above.saturating_sub(1);
        if distance(below) < distance(above) {
            below
        } else {
            above
        }
    }

    /// `value` at `threshold`, interpolated linearly between its two neighbours.
    pub fn interpolated(&self, threshold: f64, value: impl Fn(usize) -> f64) -> f64 {
        let above = self.thresholds.partition_point(|&at| at < threshold);
        let above = above.clamp(1, self.thresholds.len() - 1);
        let [low, high] = [above - 1, above].map(|index| self.thresholds[index]);
        let part = ((threshold - low) / (high - low)).clamp(0.0, 1.0);
        value(above - 1) * (1.0 - part) + value(above) * part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Tally;

    #[test]
    fn the_threshold_of_a_share_lies_between_its_neighbours() {
        let ladder = Ladder::new(Rule::Window(2), 12, 14, 4);
        let mut tally = Tally::from([("exposures".to_owned(), 1000)]);
        for (index, count) in [1000, 100, 1].into_iter().enumerate() {
            tally.insert(ladder.key(index, "false"), count);
        }
        assert_eq!(ladder.key(1, "false"), "w2 3.25 false");
        let point = tally.into();
        let at = |share: f64| ladder.calibrated(&[&point], share);
        assert!((at(0.1) - 3.25).abs() < 1e-12);
        // Equal factors: 10 is halfway from 100 to 1.
        assert!((at(0.01) - 3.375).abs() < 1e-12);
        assert_eq!(at(1e-6), 3.5);
        let nearest = [0.0, 3.1, 3.2, 3.4, 9.0].map(|threshold| ladder.nearest(threshold));
        assert_eq!(nearest, [0, 0, 1, 2, 2]);
        let linear = ladder.interpolated(3.375, |index| [0.0, 4.0, 8.0][index]);
        assert!((linear - 6.0).abs() < 1e-12);
        assert_eq!(
            ladder.interpolated(9.0, |index| [0.0, 4.0, 8.0][index]),
            8.0
        );
    }
}

//! Parts of a sweep, and merging them.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::{Point, Study, Tally};
use dtof_data::options::files::{destination, temporary_file};

/// A point with the sum of its trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointTally {
    /// The parameters of the point.
    pub parameters: Point,
    /// The sum over the seeds of the part.
    pub tally: Tally,
}

#[cfg(test)]
impl From<Tally> for PointTally {
    fn from(tally: Tally) -> Self {
        let parameters = Point::new();
        Self { parameters, tally }
    }
}

impl PointTally {
    /// A parameter of the point.
    ///
    /// # Panics
    /// If the study has no such parameter.
    #[must_use]
    pub fn parameter(&self, name: &str) -> f64 {
        self.parameters[name]
    }

    /// A count of the tally; 0 if no trial has it.
    #[must_use]
    pub fn count(&self, name: &str) -> u64 {
        self.tally.get(name).copied().unwrap_or_default()
    }
}

/// The tallies of all points of a study over a set of seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    study: String,
    revision: u32,
    /// Half-open ranges: disjoint, ascending, not adjacent.
    seeds: Vec<(u64, u64)>,
    points: Vec<PointTally>,
}

impl Part {
    /// A part without seeds.
    #[must_use]
    pub fn empty(study: &Study) -> Self {
        let without_trials = |parameters| PointTally {
            parameters,
            tally: Tally::new(),
        };
        let points = (study.points)().into_iter();
        Self {
            study: study.name.to_owned(),
            revision: study.revision,
            seeds: Vec::new(),
            points: points.map(without_trials).collect(),
        }
    }

    /// The study's name.
    #[must_use]
    pub fn study(&self) -> &str {
        &self.study
    }

    /// The seeds of the part, as half-open ranges.
    #[must_use]
    pub fn seeds(&self) -> &[(u64, u64)] {
        &self.seeds
    }

    /// The number of seeds.
    #[must_use]
    pub fn seed_count(&self) -> u64 {
        let lengths = self.seeds.iter().map(|(first, end)| end - first);
        lengths.sum()
    }

    /// Every point of the grid, in the study's order.
    #[must_use]
    pub fn points(&self) -> &[PointTally] {
        &self.points
    }

    /// Adds the tallies of `seed`, one per point.
    pub(super) fn add_seed(&mut self, seed: u64, tallies: Vec<Tally>) -> Result<()> {
        let end = seed.checked_add(1).context("the last seed is too large")?;
        self.add_range((seed, end))?;
        for (point, tally) in self.points.iter_mut().zip(tallies) {
            add(&mut point.tally, &tally)?;
        }
        Ok(())
    }

    /// Adds another part of the same study.
    ///
    /// # Errors
    /// Fails if it is of another study, revision or grid, shares a seed, or a count would overflow.
    /// This part is then unchanged.
    pub fn add(&mut self, other: &Self) -> Result<()> {
        ensure!(
            (&self.study, self.revision) == (&other.study, other.revision),
            "{} (revision {}) cannot be added to {} (revision {})",
            other.study,
            other.revision,
            self.study,
            self.revision
        );
        let parameters = |point: &PointTally| point.parameters.clone();
        let [own, others] =
            [&self.points, &other.points].map(|points| points.iter().map(parameters));
        ensure!(own.eq(others), "{}: not the same points", self.study);
        // On a copy, so that an error leaves this part unchanged.
        let mut sum = self.clone();
        for &range in &other.seeds {
            sum.add_range(range)?;
        }
        for (point, other) in sum.points.iter_mut().zip(&other.points) {
            add(&mut point.tally, &other.tally)?;
        }
        *self = sum;
        Ok(())
    }

    /// Adds a range of seeds, which must be new.
    fn add_range(&mut self, (first, end): (u64, u64)) -> Result<()> {
        ensure!(first < end, "no seeds: {first}..{end}");
        let at = self.seeds.partition_point(|seeds| seeds.1 <= first);
        if let Some(shared) = self.seeds.get(at).filter(|next| next.0 < end) {
            bail!("seed {} would count twice", shared.0.max(first));
        }
        self.seeds.insert(at, (first, end));
        self.seeds.dedup_by(|next, before| {
            let touches = before.1 == next.0;
            if touches {
                before.1 = next.1;
            }
            touches
        });
        Ok(())
    }

    /// Reads a part.
    ///
    /// # Errors
    /// Fails if the file at `path` cannot be read or is not a part.
    pub fn load(path: &Path) -> Result<Self> {
        let name = || path.display().to_string();
        let text = fs::read_to_string(path).with_context(name)?;
        let read: Self = serde_json::from_str(&text).with_context(name)?;
        // Adding the ranges one by one validates them.
        let mut part = Self {
            seeds: Vec::new(),
            ..read.clone()
        };
        for range in read.seeds {
            part.add_range(range).with_context(name)?;
        }
        Ok(part)
    }

    /// The contents of the file: a line for each point.
    ///
    /// # Errors
    /// Fails if a parameter is not finite.
    pub fn to_json(&self) -> Result<String> {
        let points: Vec<String> = self
            .points
            .iter()
            .map(serde_json::to_string)
            .collect::<Result<_, _>>()?;
        Ok(format!(
            "{{\"study\":{},\"revision\":{},\"seeds\":{},\"points\":[\n{}\n]}}\n",
            serde_json::to_string(&self.study)?,
            self.revision,
            serde_json::to_string(&self.seeds)?,
            points.join(",\n")
        ))
    }

    /// Writes a temporary file and moves it to `path`, so that a part there is complete.
    ///
    /// # Errors
    /// Fails if the folder cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let name = || path.display().to_string();
        let place = destination(path, &[])?;
        let mut file = temporary_file(&place.folder, ".dtof-part-").with_context(name)?;
        let text = self.to_json().with_context(name)?;
        file.write_all(text.as_bytes()).with_context(name)?;
        file.persist(&place.file).with_context(name)?;
        Ok(())
    }
}

/// Adds counts by name.
fn add(sum: &mut Tally, more: &Tally) -> Result<()> {
    for (name, &count) in more {
        let sum = sum.entry(name.clone()).or_default();
        *sum = sum
            .checked_add(count)
            .with_context(|| format!("too many {name} for 64 bits"))?;
    }
    Ok(())
}

/// The sum of all parts at `paths`. `named` finds their study.
///
/// # Errors
/// Fails if a part cannot be read or does not fit; the message names it.
pub fn merge<P: AsRef<Path>>(
    paths: &[P],
    named: impl Fn(&str) -> Result<&'static Study>,
) -> Result<Part> {
    let mut sum: Option<Part> = None;
    for path in paths.iter().map(AsRef::as_ref) {
        let name = || path.display().to_string();
        let part = Part::load(path)?;
        let sum = match &mut sum {
            Some(sum) => sum,
            none => none.insert(Part::empty(named(&part.study).with_context(name)?)),
        };
        sum.add(&part).with_context(name)?;
    }
    sum.context("no parts")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::analysis::hit_rate;
    use crate::sweep::tally;

    fn part(seed: u64, count: u64) -> Part {
        let mut part = Part::empty(&hit_rate::STUDY);
        let tallies = vec![tally([("trials", count)]); part.points.len()];
        part.add_seed(seed, tallies).unwrap();
        part
    }

    #[test]
    fn a_part_that_does_not_fit_changes_nothing() {
        let mut sum = part(3, 1);
        let before = sum.clone();
        // One shares its second seed, the counts of the other overflow.
        let mut shares = part(1, 1);
        shares.add(&part(3, 1)).unwrap();
        for bad in [shares, part(4, u64::MAX)] {
            assert!(sum.add(&bad).is_err());
            assert_eq!(sum, before);
        }
        sum.add(&part(4, 1)).unwrap();
        assert_eq!(sum.seed_count(), 2);
    }
}

//! Crosstalk of the cover glass: the nearest peak, at the same bin in nearly all pixels and captures,
//! with surfaces behind it in many of them.
//!
//! A peak is common if groups of histograms share it. Groups are so large that its mean height shows in
//! each. In nine groups of ten the peak must have at least half of the median height, in groups along
//! rows, along columns, and of squares: a surface across all rows and one across all columns are in each column and in each row.
//! Its height is that above the bins before it, if there are enough: after pile-up every
//! near bin is above the mean background, in all pixels.
//!
//! The gate begins where crosstalk no longer matters: from that bin on, its photons in an exposure of L2
//! laser cycles are below half a standard deviation of the background.

use super::good_histograms::GoodHistograms;
use super::peaks::Peak;
use super::shape::{Fit, Window, best};
use super::significance::median;

/// Standard deviations with which a group shows the peak.
const CLEAR: f64 = 5.0;
/// The fewest groups, unless each is one histogram.
const GROUPS: usize = 8;
/// The share of groups that must have the peak.
const COMMON: f64 = 0.9;
/// With fewer histograms, crosstalk cannot be told from the nearer of two surfaces.
const SEVERAL: usize = 4;
/// At least this share of the histograms has a surface behind the crosstalk.
const BEHIND: f64 = 0.1;
/// A peak of all pixels together exceeds the background at least by this factor: backgrounds are no
/// flatter than that.
const EVEN: f64 = 1.02;
/// Crosstalk has a tail if the photons behind its Gaussian exceed it by this many standard deviations.
const TAIL: f64 = 5.0;

/// The nearest common peak.
#[derive(Clone, Debug, PartialEq)]
pub enum Nearest {
    /// No peak is common to all pixels.
    NotCommon,
    /// Crosstalk of a cover glass.
    Glass(Glass),
    /// A surface at this bin in all pixels: a wall or crosstalk. Nothing lies behind it, or there are
    /// very few histograms.
    WallOrGlass(usize),
    /// The user says that the peak at this bin is not crosstalk.
    Wall(usize),
}

impl Nearest {
    /// The crosstalk, if that is what the peak is.
    #[must_use]
    pub const fn glass(&self) -> Option<&Glass> {
        match self {
            Self::Glass(glass) => Some(glass),
            _ => None,
        }
    }
}

/// Crosstalk of the cover glass.
#[derive(Clone, Debug, PartialEq)]
pub struct Glass {
    /// Its highest bin.
    pub top: usize,
    /// The first bin from which on it does not matter; 0 if it never matters.
    pub end: usize,
    /// The 95 % interval of `end`.
    pub end_between: (usize, usize),
    /// Photons a laser cycle and pixel.
    pub photons: f64,
    /// The 95 % interval of `photons`.
    pub photons_between: (f64, f64),
    /// Photons a laser cycle and pixel of each bin from 0 on, as far as crosstalk shows.
    pub shape: Vec<f64>,
    /// Whether it has more photons behind its top than a Gaussian.
    pub has_tail: bool,
}

/// Finds the nearest common peak. `is_glass` is given if the user knows whether that is crosstalk;
/// `l2` are the laser cycles of an exposure.
#[must_use]
pub fn nearest(good: &GoodHistograms, is_glass: Option<bool>, l2: f64) -> Nearest {
    let Some(peak) = common(good) else {
        return Nearest::NotCommon;
    };
    if is_glass == Some(false) {
        return Nearest::Wall(peak.top);
    }
    if is_glass != Some(true) && !has_something_behind(good, &peak) {
        return Nearest::WallOrGlass(peak.top);
    }
    Nearest::Glass(glass(good, &peak, l2))
}

/// The nearest peak of all histograms together, if it is common.
fn common(good: &GoodHistograms) -> Option<Peak> {
    let (counts, background) = good.pooled();
    // The level may fall with the bins: the excess over it is put on its mean.
    let mean = background.iter().sum::<f64>() / background.len() as f64 * EVEN;
    let flat: Vec<f64> = counts
        .iter()
        .zip(&background)
        .map(|(count, background)| (count - background * EVEN + mean).max(0.0))
        .collect();
    let peaks = Peak::all(&flat, mean);
    let peak = *peaks.first()?;
    let lowest = lowest_before(&counts, mean, peak.top);
    let is_common = good.orders().iter().all(|order| {
        let share = share_with(good, order, peak.top, lowest);
        share.is_some_and(|share| share >= COMMON)
    });
    is_common.then_some(peak)
}

/// The middle of the three bins with the fewest photons before the peak at `top`. Bins that were not measured, with
/// less than half of the `background`, do not count. `None` if there are no three.
fn lowest_before(counts: &[f64], background: f64, top: usize) -> Option<usize> {
    let start = counts.iter().position(|&count| count >= background / 2.0)?;
    let before = counts.get(start..top.saturating_sub(1))?;
    let sums = before.windows(3).map(|bins| bins.iter().sum::<f64>());
    let lowest = sums.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
    lowest.map(|(first, _)| start + first + 1)
}

/// The share of groups along `order` that have at least half of the median height at `top`, above the three bins
/// about `lowest` or else above the background; `None` if groups would have to be so large that there are too few.
fn share_with(
    good: &GoodHistograms,
    order: &[usize],
    top: usize,
    lowest: Option<usize>,
) -> Option<f64> {
    let around = top.saturating_sub(1)..=(top + 1).min(good.bins() - 1);
    // Signal photons, laser cycles and photons that make noise.
    let of: Vec<[f64; 3]> = order
        .iter()
        .map(|&index| {
            let trace = &good.traces[index];
            let sum: f64 = trace.counts[around.clone()].iter().sum();
            let [below, noise] = match lowest {
                Some(bin) => {
                    let before = trace.counts[bin - 1..=bin + 1].iter().sum::<f64>();
                    [before, sum + before]
                }
                None => {
                    let below = around.clone().map(|bin| good.background(index, bin)).sum();
                    [below, sum.max(below)]
                }
            };
            [sum - below, trace.cycles, noise]
        })
        .collect();
    let sum = |rows: &[[f64; 3]], column: usize| rows.iter().map(|row| row[column]).sum::<f64>();
    let mut height = sum(&of, 0) / sum(&of, 1);
    let mut group = 0;
    // A few histograms may give the mean its height: then larger groups are needed for the median.
    loop {
        let each = of.len() as f64;
        let clear = height * sum(&of, 1) / each / (sum(&of, 2) / each).max(1e-9).sqrt();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let needed = (CLEAR / clear).powi(2).ceil().clamp(1.0, 1e9) as usize;
        if height <= 0.0 || (needed > 1 && needed * GROUPS > of.len()) {
            return None;
        }
        let is_shown = needed <= group;
        group = needed.max(group);
        let heights: Vec<f64> = of
            .chunks_exact(group)
            .map(|rows| sum(rows, 0) / sum(rows, 1))
            .collect();
        height = median(heights.iter().copied());
        if is_shown {
            let having = heights.iter().filter(|&&of| of >= height / 2.0).count();
            return Some(having as f64 / heights.len() as f64);
        }
    }
}

fn has_something_behind(good: &GoodHistograms, glass: &Peak) -> bool {
    if good.traces.len() < SEVERAL {
        return false;
    }
    let holds = |peak: &Peak| peak.is_near(glass.top);
    let all = good.traces.len() as f64;
    let behind = good.peaks.iter().filter(|peaks| {
        let mine = peaks.iter().position(holds);
        mine.is_some_and(|mine| peaks.len() > mine + 1)
    });
    if behind.count() as f64 >= BEHIND * all {
        return true;
    }
    // Too dim for single pixels: all of them together.
    let seen = good.peaks.iter().filter(|peaks| peaks.iter().any(holds));
    if seen.count() as f64 >= COMMON * all {
        return false;
    }
    let (counts, background) = good.pooled();
    let mean = background.iter().sum::<f64>() / background.len() as f64;
    let behind = Peak::all(&counts, mean * EVEN);
    behind.iter().any(|peak| peak.first > glass.last)
}

/// The crosstalk of all histograms together, bin by bin.
struct Template {
    /// Photons a laser cycle and their standard error, as far as enough histograms show them.
    rates: Vec<(f64, f64)>,
    /// Photons, background photons and laser cycles of each bin.
    sums: Vec<[f64; 3]>,
}

fn template(good: &GoodHistograms, glass: &Peak) -> Template {
    let mut sums = vec![[0.0; 3]; good.bins()];
    let mut all = 0.0;
    for (index, (trace, peaks)) in good.traces.iter().zip(&good.peaks).enumerate() {
        all += trace.cycles;
        let mut others = vec![false; good.bins()];
        for peak in peaks {
            if !peak.is_near(glass.top) {
                let last = (peak.last + 2).min(good.bins() - 1);
                others[peak.first.saturating_sub(2)..=last].fill(true);
            }
        }
        for (bin, sum) in sums.iter_mut().enumerate() {
            if !others[bin] {
                sum[0] += trace.counts[bin];
                sum[1] += good.background(index, bin);
                sum[2] += trace.cycles;
            }
        }
    }
    let seen = sums.iter().take_while(|sum| sum[2] >= 0.2 * all);
    let rates = seen.map(|[count, below, cycles]| {
        (
            (count - below) / cycles,
            count.max(*below).max(1.0).sqrt() / cycles,
        )
    });
    Template {
        rates: rates.collect(),
        sums,
    }
}

fn glass(good: &GoodHistograms, peak: &Peak, l2: f64) -> Glass {
    let template = template(good, peak);
    let rates = &template.rates;
    let matters = 0.5 * (good.rate / l2).sqrt();
    let (sigma, fit) = gaussian(&template, peak);
    let model = |bin: usize| {
        let bin = u32::try_from(bin).unwrap_or(u32::MAX);
        let share = dtof_theory::rates::bin_share(bin, fit.position, sigma);
        let cycles = template.sums[peak.top][2];
        fit.amplitude / cycles * share
    };
    let last = rates.len();
    let first_below = |from: usize, of: &dyn Fn(usize) -> f64| {
        let below = |bin: usize| (bin..(bin + 3).min(last)).all(|bin| of(bin) <= matters);
        (from..last).find(|&bin| below(bin)).unwrap_or(last)
    };
    let modelled = first_below(peak.top, &model);
    let has_tail = exceeds_model(rates, modelled, matters, &model);
    let rate = |bin: usize| smooth(rates, bin, peak.top);
    let (end, end_between) = if has_tail {
        let at = |by: f64| {
            first_below(peak.top, &|bin| {
                let (rate, error) = rate(bin);
                rate + by * error
            })
        };
        (at(0.0), (at(-2.0), at(2.0)))
    } else {
        let (low, high) = (0.9 * matters, 1.1 * matters);
        let at = |of: f64| {
            (peak.top..last)
                .find(|&bin| model(bin) <= of)
                .unwrap_or(last)
        };
        (modelled, (at(high), at(low)))
    };
    // No gate is needed if it never matters.
    let highest = if has_tail {
        rate(peak.top).0
    } else {
        (0..last).map(model).fold(0.0, f64::max)
    };
    let end = if highest > matters { end } else { 0 };
    let seen = if has_tail {
        end.max(end_between.1)
    } else {
        end + 2
    };
    let seen = seen.max(peak.last + 1).min(last);
    let of = rates[..seen].iter();
    let (photons, variance) = of.fold((0.0, 0.0), |sum, rate| {
        (sum.0 + rate.0, sum.1 + rate.1 * rate.1)
    });
    // The background may be off by 1 %.
    let error = 1.96 * variance.sqrt() + 0.01 * good.rate * seen as f64;
    Glass {
        top: peak.top,
        end,
        end_between,
        photons,
        photons_between: ((photons - error).max(0.0), photons + error),
        shape: rates[..seen].iter().map(|rate| rate.0.max(0.0)).collect(),
        has_tail,
    }
}

/// The Gaussian that fits the crosstalk: σ and fit.
fn gaussian(template: &Template, peak: &Peak) -> (f64, Fit) {
    // Counts are scaled to the laser cycles of the top bin.
    let [_, below, cycles] = template.sums[peak.top];
    let counts: Vec<f64> = template
        .sums
        .iter()
        .take(template.rates.len().max(peak.top + 1))
        .map(|sum| {
            if sum[2] > 0.0 {
                (sum[0] - sum[1]) * cycles / sum[2] + below
            } else {
                below
            }
        })
        .map(|count| count.max(0.0))
        .collect();
    let whole = (0, peak.top, counts.len() - 1);
    let window = [Window::new(&counts, below, cycles, whole)];
    let (sigma, fits) = best(&window);
    (sigma, fits[0])
}

/// Whether rates from `from` on exceed the model so much that it matters. Looks at groups of bins that
/// get longer.
fn exceeds_model(
    rates: &[(f64, f64)],
    from: usize,
    matters: f64,
    model: &dyn Fn(usize) -> f64,
) -> bool {
    let mut start = from + 1;
    let mut length = 1;
    while start + length <= rates.len() && start < from + 24 {
        let (mut above, mut variance) = (0.0, 0.0);
        for (bin, rate) in (start..).zip(&rates[start..start + length]) {
            above += rate.0 - model(bin);
            variance += rate.1 * rate.1;
        }
        if above < 0.25 * matters * length as f64 {
            return false;
        }
        if above > TAIL * variance.sqrt() {
            return true;
        }
        start += length;
        length += 1;
    }
    false
}

/// The rate of a bin and its error, averaged over its neighbours: an eighth of its distance from the top
/// on either side.
fn smooth(rates: &[(f64, f64)], bin: usize, top: usize) -> (f64, f64) {
    let reach = bin.saturating_sub(top) / 8;
    let (first, last) = (bin - reach, (bin + reach).min(rates.len() - 1));
    let of = &rates[first..=last];
    let bins = of.len() as f64;
    let variance: f64 = of.iter().map(|rate| rate.1 * rate.1).sum();
    (
        of.iter().map(|rate| rate.0).sum::<f64>() / bins,
        variance.sqrt() / bins,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::find::background::Level;
    use crate::find::observed::Trace;
    use dtof_core::Array;

    /// 32x16 pixels with a wall in bin 94, and so many photons in bin 51 by column and row, half as many beside it.
    fn top_with(photons: &dyn Fn(usize, usize) -> f64) -> Option<usize> {
        let traces: Vec<Trace> = (0..32 * 16)
            .map(|pixel| {
                let mut counts = vec![14.0; 128];
                counts[94] = 200.0;
                let photons = photons(pixel % 32, pixel / 32);
                for (bin, share) in [(50, 0.5), (51, 1.0), (52, 0.5)] {
                    counts[bin] += share * photons;
                }
                Trace {
                    pixel,
                    cycles: 4500.0,
                    counts,
                    truth_mm: None,
                }
            })
            .collect();
        let levels = traces.iter().map(|trace| Level::of(&trace.counts));
        let levels = levels.collect();
        let good = GoodHistograms::new(Array::new(32, 16).unwrap(), 0.003, traces, levels);
        nearest(&good, None, 2000.0).glass().map(|glass| glass.top)
    }

    /// A strip across all rows and one across all columns are in each column and in each row.
    #[test]
    fn strips_that_cross_are_no_glass() {
        let with = |is_strip: &dyn Fn(usize, usize) -> bool, other: f64| {
            // A few photons in every other pixel: so the median of single pixels is no help.
            top_with(&|column, row| match is_strip(column, row) {
                true => 90.0,
                false => other * ((column + row) % 2) as f64,
            })
        };
        let crossing = |column, row| column < 5 || (4..6).contains(&row);
        assert_eq!(with(&crossing, 8.0), None);
        assert_eq!(with(&crossing, 0.0), None);
        assert_eq!(with(&|column, _| column < 5, 0.0), None);
        assert_eq!(with(&|_, row| (4..6).contains(&row), 0.0), None);
        assert_eq!(with(&|_, _| true, 0.0), Some(51));
        assert_eq!(top_with(&|_, _| 5.0), Some(51));
    }
}

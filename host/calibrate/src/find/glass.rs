//! Crosstalk of the cover glass: the nearest peak, in the first quarter of the bins, at the same bin in nearly all pixels and
//! captures, from the start of the recording to its end, with surfaces behind it in at least half of them. A gate hides
//! what lies in it, so all of this is needed: a wall that fills the view has the same peak, and a pixel at its edge sees
//! past it.
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
use dtof_data::photons::recorded::ListTimes;

/// Standard deviations with which a group shows the peak.
const CLEAR: f64 = 5.0;
/// The fewest groups, unless each is one histogram.
const GROUPS: usize = 8;
/// The share of groups that must have the peak.
const COMMON: f64 = 0.9;
/// With fewer histograms, crosstalk cannot be told from the nearer of two surfaces.
const SEVERAL: usize = 4;
/// A cover glass is in the first part of the bins: farther away, a surface and what lies behind it are no glass.
const NEAR: f64 = 0.25;
/// At least this share of the histograms has a surface behind the crosstalk, and so many of them, or all.
const BEHIND: f64 = 0.5;
const BEHIND_IN: usize = 6;
/// Of so many histograms two must have it for a warning: that is no fault of a single pixel.
const MANY: usize = 16;
/// Peaks of a layer lie within so many bins. If this share of the histograms has it, and half of them a surface behind it,
/// it may be a cover glass that some pixels do not show, or not at the same place.
const LAYER_BINS: usize = 4;
const LAYER: f64 = 0.6;
/// Each quarter of a recording has so much of the photons of a surface that stays, to within this and five standard
/// deviations.
const STAYS: f64 = 0.25;
const STAYS_TO: f64 = 0.02;
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
    /// No crosstalk, at this bin: nothing lies behind it, or the user says so.
    Wall(usize),
    /// A wall or crosstalk.
    Unclear(Layer),
    /// A surface that all pixels see, but not all the time, with others behind it.
    Passing(Layer),
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

/// The nearest surfaces of histograms, within a few bins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// The bin where most pixels see it, or where it is brightest.
    pub bin: usize,
    /// The share of the histograms that have it.
    pub share: f64,
    /// The share of these that have another surface behind it.
    pub behind: f64,
}

/// Finds the nearest common peak. `is_glass` is given if the user knows whether that is crosstalk; `l2` are the laser cycles
/// of an exposure. `times` are those of a photon list.
#[must_use]
pub fn nearest(
    good: &GoodHistograms,
    is_glass: Option<bool>,
    times: Option<&ListTimes>,
    l2: f64,
) -> Nearest {
    let common = common(good);
    let as_glass = |peak: &Peak| Nearest::Glass(glass(good, peak, l2));
    let Some(peak) = common else {
        return match (is_glass, nearest_layer(&good.peaks)) {
            (Some(true), Some((peak, _))) => as_glass(&peak),
            (None, Some((_, layer))) if layer.share >= LAYER && layer.behind >= BEHIND => {
                Nearest::Unclear(layer)
            }
            _ => Nearest::NotCommon,
        };
    };
    match is_glass {
        Some(true) => return as_glass(&peak),
        Some(false) => return Nearest::Wall(peak.top),
        None => {}
    }
    let all = good.traces.len();
    let has_it = |peaks: &[Peak]| peaks.iter().any(|one| one.is_near(peak.top));
    // What fills the last bin may be all that came later.
    let has_more = |peaks: &[Peak]| {
        let is_behind = |one: &Peak| one.first > peak.last && one.last + 1 < good.bins();
        peaks.iter().any(is_behind)
    };
    let number = |is: &dyn Fn(&[Peak]) -> bool| good.peaks.iter().filter(|peaks| is(peaks)).count();
    let (having, behind) = (number(&has_it), number(&has_more));
    let both = number(&|peaks| has_it(peaks) && has_more(peaks));
    let is_few = both < 1 + usize::from(all >= MANY);
    let is_wall = is_few && !is_behind_of_all(good, &peak);
    // A dim one shows only in groups of histograms.
    let (having, with_more) = match having as f64 >= COMMON * all as f64 {
        true => (having, both),
        false => (all, behind),
    };
    let layer = Layer {
        bin: peak.top,
        share: having as f64 / all as f64,
        behind: with_more as f64 / having as f64,
    };
    let needed = BEHIND_IN.min(all).max(all.div_ceil(2));
    if times.is_some_and(|times| !stays(&times.quarters, &peak)) {
        match is_wall {
            true => Nearest::NotCommon,
            false => Nearest::Passing(layer),
        }
    } else if all >= SEVERAL && behind >= needed && (peak.top as f64) < NEAR * good.bins() as f64 {
        as_glass(&peak)
    } else {
        match is_wall {
            true => Nearest::Wall(peak.top),
            false => Nearest::Unclear(layer),
        }
    }
}

/// Where most histograms have their nearest peak, and that peak in the histogram that has it brightest.
fn nearest_layer(of: &[Vec<Peak>]) -> Option<(Peak, Layer)> {
    let mut nearest: Vec<(&Peak, bool)> = of
        .iter()
        .filter_map(|peaks| Some((peaks.first()?, peaks.len() > 1)))
        .collect();
    nearest.sort_by_key(|(peak, _)| peak.top);
    let within = |first: usize| {
        let from = nearest[first].0.top;
        let end = nearest.partition_point(|(peak, _)| peak.top <= from + LAYER_BINS);
        &nearest[first..end]
    };
    let most = (0..nearest.len()).map(within);
    let most = most.max_by_key(|layer| layer.len())?;
    let by_photons =
        |one: &&(&Peak, bool), other: &&(&Peak, bool)| one.0.photons.total_cmp(&other.0.photons);
    let (peak, _) = most.iter().max_by(by_photons)?;
    let behind = most.iter().filter(|(_, has_more)| *has_more).count();
    let layer = Layer {
        bin: peak.top,
        share: most.len() as f64 / of.len() as f64,
        behind: behind as f64 / most.len() as f64,
    };
    Some((**peak, layer))
}

/// Whether each quarter of the recording has its share of the peak.
fn stays(quarters: &[[u64; 4]], peak: &Peak) -> bool {
    let around = peak.top.saturating_sub(1)..=(peak.top + 1).min(quarters.len() - 1);
    let all = |bin: &[u64; 4]| bin.iter().sum::<u64>() as f64;
    let level = median(quarters.iter().map(all)) * around.clone().count() as f64;
    let photons = |of: usize| {
        quarters[around.clone()]
            .iter()
            .map(|bin| bin[of] as f64)
            .sum::<f64>()
    };
    let photons = [0, 1, 2, 3].map(photons);
    let signal = (photons.iter().sum::<f64>() - level).max(1.0);
    photons.iter().all(|photons| {
        let share = (photons - level / 4.0) / signal;
        (share - STAYS).abs() <= STAYS_TO + 5.0 * photons.sqrt() / signal
    })
}

/// Whether all pixels together have a surface behind the peak that single ones are too dim to show.
fn is_behind_of_all(good: &GoodHistograms, peak: &Peak) -> bool {
    let seen = |peaks: &&Vec<Peak>| peaks.iter().any(|one| one.is_near(peak.top));
    let seen = good.peaks.iter().filter(seen).count();
    if seen as f64 >= COMMON * good.traces.len() as f64 {
        return false;
    }
    let pooled = good.pooled();
    let mean = pooled.background.iter().sum::<f64>() / pooled.background.len() as f64;
    let behind = Peak::all(&pooled.robust, &pooled.live, mean * EVEN);
    behind.iter().any(|one| one.first > peak.last)
}

/// The nearest peak of all histograms together, if it is common.
fn common(good: &GoodHistograms) -> Option<Peak> {
    let pooled = good.pooled();
    let background = &pooled.background;
    // The level may fall with the bins: the excess over it is put on its mean.
    let mean = background.iter().sum::<f64>() / background.len() as f64 * EVEN;
    let flat: Vec<f64> = pooled
        .robust
        .iter()
        .zip(background)
        .map(|(count, background)| (count - background * EVEN + mean).max(0.0))
        .collect();
    let peaks = Peak::all(&flat, &pooled.live, mean);
    let peak = *peaks.first()?;
    let lowest = lowest_before(&pooled.robust, mean, peak.top);
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
            let [sum, noise] = trace.photons(around.clone());
            let [below, noise] = match lowest {
                Some(bin) => {
                    let [below, noise_below] = trace.photons(bin - 1..=bin + 1);
                    [below, noise + noise_below]
                }
                None => {
                    let below = around.clone().map(|bin| good.background(index, bin)).sum();
                    [below, noise.max(below)]
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

/// The crosstalk of all histograms together, bin by bin.
struct Template {
    /// Photons a laser cycle and their standard error, as far as enough histograms show them.
    rates: Vec<(f64, f64)>,
    /// Photons, background photons, laser cycles, and the variance of the photons, of each bin.
    sums: Vec<[f64; 4]>,
}

fn template(good: &GoodHistograms, glass: &Peak) -> Template {
    let mut sums = vec![[0.0; 4]; good.bins()];
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
                let [photons, variance] = trace.photons(bin..=bin);
                sum[0] += photons;
                sum[1] += good.background(index, bin);
                sum[2] += trace.cycles;
                sum[3] += variance;
            }
        }
    }
    let seen = sums.iter().take_while(|sum| sum[2] >= 0.2 * all);
    let rates = seen.map(|[count, below, cycles, variance]| {
        (
            (count - below) / cycles,
            variance.max(*below).max(1.0).sqrt() / cycles,
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
        let share = dtof_light::rates::bin_share(bin, fit.position, sigma);
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
    let [_, below, cycles, _] = template.sums[peak.top];
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
    let live = vec![1.0; counts.len()];
    let window = [Window::new((&counts, &live), below, cycles, whole)];
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

    /// 32x16 pixels with a wall in bin 94, and so many photons in bin 21 by column and row, half as many beside it.
    fn top_with(photons: &dyn Fn(usize, usize) -> f64) -> Option<usize> {
        let traces: Vec<Trace> = (0..32 * 16)
            .map(|pixel| {
                let mut counts = vec![14.0; 128];
                counts[94] = 200.0;
                let photons = photons(pixel % 32, pixel / 32);
                for (bin, share) in [(20, 0.5), (21, 1.0), (22, 0.5)] {
                    counts[bin] += share * photons;
                }
                Trace {
                    pixel,
                    cycles: 4500.0,
                    live: vec![1.0; 128],
                    counts,
                    truth_mm: None,
                }
            })
            .collect();
        let levels = traces
            .iter()
            .map(|trace| Level::of(&trace.counts, &trace.live));
        let levels = levels.collect();
        let good = GoodHistograms::new(Array::new(32, 16).unwrap(), 0.003, traces, levels);
        nearest(&good, None, None, 2000.0)
            .glass()
            .map(|glass| glass.top)
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
        assert_eq!(with(&|_, _| true, 0.0), Some(21));
        assert_eq!(top_with(&|_, _| 5.0), Some(21));
    }
}

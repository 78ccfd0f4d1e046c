//! The cover glass: the nearest peak, at the same bin in nearly all pixels and captures, with
//! something behind it in many.
//!
//! Whether a peak is common is decided in groups of histograms, so large that its mean height
//! shows in each of them. In nine groups of ten it must have at least half of the median height,
//! in groups along rows as well as along columns.
//!
//! A gate begins where the glass no longer matters: at the first bin from which on its photons in
//! an exposure of L2 laser cycles are below half a standard deviation of the background there.

use super::common::Scene;
use super::limits::median;
use super::peaks::Peak;
use super::shape::{Fit, Window, best};

/// Groups show the peak with so many standard deviations.
const CLEAR: f64 = 5.0;
/// There are at least so many groups, unless each is one histogram.
const GROUPS: usize = 8;
/// Of the groups so many must have it.
const COMMON: f64 = 0.9;
/// Fewer histograms do not tell a glass from the nearer of two surfaces.
const SEVERAL: usize = 4;
/// Something is behind it in at least this share of the histograms.
const BEHIND: f64 = 0.1;
/// Of the background, what a peak of all pixels together exceeds at least: backgrounds are not
/// even to better than that.
const EVEN: f64 = 1.02;
/// A Gaussian is not the whole glass if this many standard deviations are left behind it.
const LEFT: f64 = 5.0;

/// What the nearest common peak is.
#[derive(Clone, Debug, PartialEq)]
pub enum Nearest {
    /// No peak is common to all pixels.
    NotCommon,
    /// A cover glass.
    Glass(Glass),
    /// A surface at this bin in all pixels, with nothing behind or in very few histograms: a wall
    /// or a glass.
    WallOrGlass(usize),
    /// The user says that it is no glass.
    Wall(usize),
}

/// The cover glass.
#[derive(Clone, Debug, PartialEq)]
pub struct Glass {
    /// Its highest bin.
    pub top: usize,
    /// The first bin from which on it does not matter; 0 if it never does.
    pub end: usize,
    /// Between what that lies.
    pub end_between: (usize, usize),
    /// Photons a laser cycle and pixel.
    pub photons: f64,
    /// The 95 % interval of that.
    pub photons_between: (f64, f64),
    /// The same for each bin from 0 on, as far as it was seen.
    pub shape: Vec<f64>,
    /// Whether there is more behind it than a Gaussian pulse.
    pub has_tail: bool,
}

/// Looks for it. `told` is what the user says about the nearest common peak, `l2` the laser
/// cycles of an exposure.
#[must_use]
pub fn nearest(scene: &Scene, told: Option<bool>, l2: f64) -> Nearest {
    let Some(peak) = common(scene) else {
        return Nearest::NotCommon;
    };
    if told == Some(false) {
        return Nearest::Wall(peak.top);
    }
    if told != Some(true) && !has_something_behind(scene, &peak) {
        return Nearest::WallOrGlass(peak.top);
    }
    Nearest::Glass(glass(scene, &peak, l2))
}

/// The nearest peak of all histograms together, if it is common.
fn common(scene: &Scene) -> Option<Peak> {
    let (counts, background) = scene.pooled();
    // Peaks of a level that falls: what is above it, on top of its mean.
    let mean = background.iter().sum::<f64>() / background.len() as f64 * EVEN;
    let flat: Vec<f64> = counts
        .iter()
        .zip(&background)
        .map(|(count, background)| (count - background * EVEN + mean).max(0.0))
        .collect();
    let peaks = Peak::all(&flat, mean);
    let peak = *peaks.first()?;
    let is_common = scene.orders().iter().all(|order| {
        let share = share_with(scene, order, peak.top);
        share.is_some_and(|share| share >= COMMON)
    });
    is_common.then_some(peak)
}

/// The share of groups along `order` that have at least half of the median height at `top`;
/// `None` if that does not show in groups of which there are enough.
fn share_with(scene: &Scene, order: &[usize], top: usize) -> Option<f64> {
    let around = top.saturating_sub(1)..=(top + 1).min(scene.bins() - 1);
    // Photons above the background, laser cycles, and photons of all kinds.
    let of: Vec<[f64; 3]> = order
        .iter()
        .map(|&index| {
            let trace = &scene.traces[index];
            let sum: f64 = trace.counts[around.clone()].iter().sum();
            let below: f64 = around.clone().map(|bin| scene.background(index, bin)).sum();
            [sum - below, trace.cycles, sum.max(below)]
        })
        .collect();
    let sum = |rows: &[[f64; 3]], column: usize| rows.iter().map(|row| row[column]).sum::<f64>();
    let mut height = sum(&of, 0) / sum(&of, 1);
    let mut group = 0;
    // The mean height may be that of a few: then groups of their size do not show the median.
    loop {
        let each = of.len() as f64;
        let clear = height * sum(&of, 1) / each / (sum(&of, 2) / each).max(1e-9).sqrt();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let wanted = (CLEAR / clear).powi(2).ceil().clamp(1.0, 1e9) as usize;
        if height <= 0.0 || (wanted > 1 && wanted * GROUPS > of.len()) {
            return None;
        }
        let is_shown = wanted <= group;
        group = wanted.max(group);
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

fn has_something_behind(scene: &Scene, glass: &Peak) -> bool {
    if scene.traces.len() < SEVERAL {
        return false;
    }
    let holds = |peak: &Peak| peak.first <= glass.top + 1 && peak.last + 1 >= glass.top;
    let all = scene.traces.len() as f64;
    let behind = scene.peaks.iter().filter(|peaks| {
        let mine = peaks.iter().position(holds);
        mine.is_some_and(|mine| peaks.len() > mine + 1)
    });
    if behind.count() as f64 >= BEHIND * all {
        return true;
    }
    // Too dim for single pixels: all of them together.
    let seen = scene.peaks.iter().filter(|peaks| peaks.iter().any(holds));
    if seen.count() as f64 >= COMMON * all {
        return false;
    }
    let (counts, background) = scene.pooled();
    let mean = background.iter().sum::<f64>() / background.len() as f64;
    let behind = Peak::all(&counts, mean * EVEN);
    behind.iter().any(|peak| peak.first > glass.last)
}

/// What all histograms hold of the glass, bin by bin.
struct Template {
    /// Photons a laser cycle and their standard error, as far as enough histograms show it.
    rates: Vec<(f64, f64)>,
    /// Photons, background photons and laser cycles of each bin.
    sums: Vec<[f64; 3]>,
}

fn template(scene: &Scene, glass: &Peak) -> Template {
    let mut sums = vec![[0.0; 3]; scene.bins()];
    let mut all = 0.0;
    for (index, (trace, peaks)) in scene.traces.iter().zip(&scene.peaks).enumerate() {
        all += trace.cycles;
        let mut others = vec![false; scene.bins()];
        for peak in peaks {
            let is_glass = peak.first <= glass.top + 1 && peak.last + 1 >= glass.top;
            if !is_glass {
                let last = (peak.last + 2).min(scene.bins() - 1);
                others[peak.first.saturating_sub(2)..=last].fill(true);
            }
        }
        for (bin, sum) in sums.iter_mut().enumerate() {
            if !others[bin] {
                sum[0] += trace.counts[bin];
                sum[1] += scene.background(index, bin);
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

fn glass(scene: &Scene, peak: &Peak, l2: f64) -> Glass {
    let template = template(scene, peak);
    let rates = &template.rates;
    let matters = 0.5 * (scene.rate / l2).sqrt();
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
    let has_tail = is_left(rates, modelled, matters, &model);
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
    // Where it never matters no gate is needed.
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
    // One in a hundred is what the background may be off by.
    let error = 1.96 * variance.sqrt() + 0.01 * scene.rate * seen as f64;
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

/// The Gaussian that fits the top of the glass.
fn gaussian(template: &Template, peak: &Peak) -> (f64, Fit) {
    // As if all bins had the laser cycles of the top.
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

/// Whether rates from `from` on are more than the model's: in pieces that get longer, and so much
/// that it matters.
fn is_left(rates: &[(f64, f64)], from: usize, matters: f64, model: &dyn Fn(usize) -> f64) -> bool {
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
        if above > LEFT * variance.sqrt() {
            return true;
        }
        start += length;
        length += 1;
    }
    false
}

/// The rate of a bin, with as many others to either side as it is far from the top, divided by
/// eight.
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

//! Whether a recording is what a decision needs: photon counts over bins of time, with a flat background and pulses.
//!
//! | what is looked at | what it may be |
//! |---|---|
//! | many bins with the highest count | counters that were full |
//! | peaks that are whole with full counters added to some bins | counters that began again at 0 |
//! | how neighbouring bins scatter | what is no photon count |
//! | the level of eighths of the range | a background that is not flat |
//! | peaks of one bin at one place, where others are wider | no light that came back |
//! | the first and the last bins | a TDC whose range is shorter |
//! | bins that are empty between others | codes that a TDC never gives |
//! | photons a laser cycle | a wrong number of laser cycles |
//! | the brightest pixel, where they are not known | a pixel that says little of them |
//!
//! The first of the upper five that is found may be the cause of the others of them, and of what the search finds. The last
//! four stand by themselves.
//!
//! Decisions rest on the scatter of photon counts: what is no count has another one. Let three neighbouring bins hold a, b
//! and c photons, and n together. If their means lie on a straight line, each of the n photons adds 1, −2 or 1 to
//! a − 2b + c, with the mean 0 and the variance 2, so (a − 2b + c)² ÷ 2n has the mean 1, whatever n is. A bin that counts at
//! most once a laser cycle and is full in the share p of them scatters less, by 1 − p.

use std::collections::BTreeSet;
use std::ops::{Range, RangeInclusive};

use dtof_data::options::rows::{percent, two_digits};
use dtof_data::photons::warnings::greatest_divisor;

use super::find::good_histograms::GoodHistograms;
use super::find::observed::{Observed, Trace};
use super::find::significance::{is_surely_less, median, quantile};

/// A recording with more bins is judged by some of its histograms.
const BINS: usize = 1 << 18;
/// The most peaks of a histogram, one in so many bins.
const PEAKS: usize = 8;
const FOR_EACH: usize = 16;
/// So many bins before and after the highest bin of a peak belong to it in any case.
const REACH: usize = 3;
/// Fewer triples of bins do not tell. The mean of so many is off by 0.08.
const FEWEST: usize = 600;
/// From so many photons on a triple is nearly Gaussian. The median of the test then is as good as the mean, and a peak that
/// was not found does not move it. In the dark most photons are of such peaks.
const GAUSSIAN: f64 = 10.0;
/// The median of the square of a Gaussian number of variance 1.
const MEDIAN: f64 = 0.4549;
/// Its standard error, of one square.
const OF_MEDIAN: f64 = 2.3;
/// Photon counts have a mean between these.
const COUNTS: [f64; 2] = [0.7, 1.4];
/// So large a share of the bins has a cause: empty ones that photons would have filled, and full ones.
const MANY: f64 = 0.1;
/// Standard deviations that chance does not reach.
const SURE: f64 = 6.0;

/// How neighbouring bins scatter beside the peaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// The mean of (a − 2b + c)² ÷ 2n: 1 for photon counts.
    pub mean: f64,
    /// The standard error of the mean.
    pub error: f64,
    /// The median of the triples of many photons, over that of a Gaussian; the mean if most have few.
    pub median: f64,
    /// The mean of n, the photons of three bins.
    pub photons: f64,
    /// The number of triples.
    pub triples: usize,
}

impl Scatter {
    /// Of histograms with the same bins. Bins that are empty in all of them were not measured.
    #[must_use]
    pub fn of(histograms: &[&[f64]]) -> Self {
        Self::beside(histograms, &beside_peaks(histograms, line))
    }

    fn beside(histograms: &[&[f64]], is_beside: &[Vec<bool>]) -> Self {
        let (mut tests, mut bright, mut photons) = (Vec::new(), Vec::new(), 0.0);
        for (counts, is_beside) in histograms.iter().zip(is_beside) {
            for (bins, is_beside) in counts.windows(3).zip(is_beside.windows(3)) {
                let n: f64 = bins.iter().sum();
                if n > 0.0 && !is_beside.contains(&false) {
                    let bend = bins[0] - 2.0 * bins[1] + bins[2];
                    let test = bend * bend / (2.0 * n);
                    tests.push(test);
                    bright.extend((n >= GAUSSIAN).then_some(test));
                    photons += n;
                }
            }
        }
        let triples = tests.len();
        let each = triples.max(1) as f64;
        let mean = tests.iter().sum::<f64>() / each;
        let squares = tests.iter().map(|test| (test - mean).powi(2));
        Self {
            mean,
            error: squares.sum::<f64>().sqrt() / each,
            median: match 2 * bright.len() > triples {
                true => median(bright) / MEDIAN,
                false => mean,
            },
            photons: photons / each,
            triples,
        }
    }
}

/// The mean background in each bin that lies beside peaks in some of the histograms.
fn background(histograms: &[&[f64]]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0_usize); histograms.first().map_or(0, |counts| counts.len())];
    for (counts, is_beside) in histograms.iter().zip(beside_peaks(histograms, level)) {
        for ((sum, count), _) in sums
            .iter_mut()
            .zip(*counts)
            .zip(is_beside)
            .filter(|(_, is)| *is)
        {
            *sum = (sum.0 + count, sum.1 + 1);
        }
    }
    let mean = |(sum, number): (f64, usize)| sum / number as f64;
    sums.into_iter()
        .filter(|sum| 4 * sum.1 > histograms.len())
        .map(mean)
        .collect()
}

fn sum(histograms: &[&[f64]]) -> Vec<f64> {
    let mut sum = vec![0.0; histograms.first().map_or(0, |counts| counts.len())];
    for counts in histograms {
        for (sum, count) in sum.iter_mut().zip(*counts) {
            *sum += count;
        }
    }
    sum
}

/// Some of the histograms of a large recording.
fn some(traces: &[Trace]) -> impl Iterator<Item = &Trace> {
    let bins = traces.first().map_or(0, |trace| trace.counts.len());
    // Odd, so that it is not always the same column.
    traces.iter().step_by((traces.len() * bins / BINS) | 1)
}

/// For each bin of each histogram whether it was measured and lies beside the peaks.
fn beside_peaks(histograms: &[&[f64]], usual: Usual) -> Vec<Vec<bool>> {
    let is_measured: Vec<bool> = sum(histograms).iter().map(|&sum| sum > 0.0).collect();
    let of = |counts: &&[f64]| without_peaks(counts, is_measured.clone(), usual);
    histograms.iter().map(of).collect()
}

/// These bins without those of peaks. A peak reaches from its highest bin to where three bins together hold no more than
/// usual.
fn without_peaks(counts: &[f64], mut is_beside: Vec<bool>, usual: Usual) -> Vec<bool> {
    let all = counts.len();
    let around = |bin: usize| {
        counts[bin.saturating_sub(1)..(bin + 2).min(all)]
            .iter()
            .sum()
    };
    let sums: Vec<f64> = (0..all).map(around).collect();
    let usual = usual(&sums, &is_beside);
    let above = |bin: usize, sigmas: f64| sums[bin] - usual[bin] - sigmas * usual[bin].sqrt();
    let belongs: Vec<bool> = (0..all).map(|bin| above(bin, 2.0) > 0.0).collect();
    // In the dark a peak of a few photons is not seen, but is most of the photons.
    let mut stands: Vec<f64> = (0..all)
        .map(|bin| match usual[bin] < GAUSSIAN {
            true => sums[bin],
            false => above(bin, SURE),
        })
        .collect();
    for _ in 0..PEAKS.min((all / FOR_EACH).max(1)) {
        let top = (0..all).max_by(|&one, &other| stands[one].total_cmp(&stands[other]));
        let Some(top) = top.filter(|&top| stands[top] > 0.0) else {
            break;
        };
        let before = (0..top.saturating_sub(REACH)).rev();
        let first = top.saturating_sub(REACH) - before.take_while(|&bin| belongs[bin]).count();
        let after = (top + REACH + 1).min(all)..all;
        let end = after.start + after.take_while(|&bin| belongs[bin]).count();
        is_beside[first..end].fill(false);
        stands[first..end].fill(f64::NEG_INFINITY);
    }
    is_beside
}

/// What some bins usually hold, for each bin.
type Usual = fn(&[f64], &[bool]) -> Vec<f64>;

/// The median of the bins.
fn level(sums: &[f64], is_used: &[bool]) -> Vec<f64> {
    let used = sums.iter().zip(is_used).filter(|(_, is)| **is);
    vec![median(used.map(|(sum, _)| *sum)); sums.len()]
}

/// The straight line through the medians of eighths of some bins: the median of the slopes between two of them.
fn line(sums: &[f64], is_used: &[bool]) -> Vec<f64> {
    let length = sums.len().div_ceil(8).max(1);
    let parts = sums.chunks(length).zip(is_used.chunks(length)).enumerate();
    let medians: Vec<(f64, f64)> = parts
        .filter(|(_, (_, is_used))| is_used.contains(&true))
        .map(|(part, (sums, is_used))| {
            let used = sums.iter().zip(is_used).filter(|(_, is)| **is);
            (
                part as f64 * length as f64 + length as f64 / 2.0,
                median(used.map(|(sum, _)| *sum)),
            )
        })
        .collect();
    let pairs = medians
        .iter()
        .enumerate()
        .flat_map(|(at, one)| medians[..at].iter().map(move |other| (one, other)));
    let slope = median(pairs.map(|(one, other)| (one.1 - other.1) / (one.0 - other.0)));
    let start = median(medians.iter().map(|(bin, sum)| sum - slope * bin));
    (0..sums.len())
        .map(|bin| (start + slope * (bin as f64 + 0.5)).max(0.0))
        .collect()
}

/// What the counts beside the peaks are like.
struct Seen {
    /// The greatest number that divides all counts.
    divisor: u64,
    /// The least count above 0, and the highest.
    least: f64,
    highest: f64,
    /// The share of the bins that are empty and would not be, and of those that hold the highest count.
    empty: f64,
    full: f64,
}

impl Seen {
    fn new(histograms: &[&[f64]], is_beside: &[Vec<bool>]) -> Self {
        let counts = histograms.iter().copied().flatten().copied();
        let positive = counts.clone().filter(|&count| count > 0.0);
        let highest = counts.clone().fold(0.0, f64::max);
        let number = histograms.iter().map(|counts| counts.len()).sum::<usize>();
        let full = counts.filter(|&count| count >= highest).count();
        let (mut bins, mut empty, mut expected) = (0.0, 0.0, 0.0);
        for (counts, is_beside) in histograms.iter().zip(is_beside) {
            let beside = || counts.iter().zip(is_beside).filter(|(_, is)| **is);
            let all = beside().count() as f64;
            let mean = beside().map(|(count, _)| count).sum::<f64>() / all.max(1.0);
            bins += all;
            empty += beside().filter(|(count, _)| **count <= 0.0).count() as f64;
            expected += all * (-mean).exp();
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "counts"
        )]
        Self {
            divisor: positive.clone().fold(0, |divisor, count| match divisor {
                1 => 1,
                divisor => greatest_divisor(divisor, count as u64),
            }),
            least: positive.fold(f64::INFINITY, f64::min),
            highest,
            empty: (empty - expected) / f64::max(bins, 1.0),
            full: full as f64 / number.max(1) as f64,
        }
    }

    /// Why they scatter more. `is_alike` says that they do so in the same way in all histograms.
    fn more(&self, is_alike: bool) -> String {
        let Self { divisor, least, .. } = self;
        if *divisor > 1 {
            format!("All are multiples of {divisor}: save `counts // {divisor}`")
        } else if self.empty > MANY && *least > 2.0 {
            format!(
                "None is between 0 and {least}, so they were multiplied: save the counts as they were read"
            )
        } else if self.empty > MANY {
            format!(
                "{:.0} % of the bins are 0 and would not be, as if background was subtracted: save the counts as they were read",
                self.empty * 100.0
            )
        } else if is_alike {
            "All pixels have the same differences, so the bins are of unequal width: sum them to bins of equal width before \
             you save them"
                .to_owned()
        } else {
            "Counts were multiplied or corrected, or the bins of each pixel are of unequal width: save the counts as they were \
             read"
                .to_owned()
        }
    }

    /// Why they scatter less.
    fn less(&self, has_cycles: bool) -> String {
        if self.full > MANY {
            return format!(
                "{:.0} % of the bins hold {}, the most that they can: record less light, or with wider counters",
                self.full * 100.0,
                self.highest
            );
        }
        let once = match has_cycles {
            true => "",
            false => {
                ", or a bin counts once a laser cycle, and --recorded-cycles says how many there were"
            }
        };
        format!(
            "They were averaged, smoothed or divided, or are distances{once}. A decision needs the photons that were counted"
        )
    }
}

/// Why a recording holds no photon counts, if it does not: what was seen, what it means, and what helps. So many of the
/// decisions on a pixel without a target may be a `false_alarm`.
#[must_use]
pub(super) fn no_counts(traces: &[Trace], has_cycles: bool, false_alarm: f64) -> Option<String> {
    let histograms: Vec<&[f64]> = some(traces).map(|trace| &trace.counts[..]).collect();
    let is_beside = beside_peaks(&histograms, line);
    let scatter = Scatter::beside(&histograms, &is_beside);
    let is_bright = scatter.photons >= GAUSSIAN;
    let [least, most] = COUNTS;
    let error = 2.0 * scatter.error;
    // A few peaks, or edges of an image, make a mean large. The error of the median of a square is as for a Gaussian.
    let (low, high, low_error) = match is_bright {
        true => (
            scatter.mean.min(scatter.median),
            scatter.median,
            2.0 * OF_MEDIAN / (scatter.triples as f64).sqrt(),
        ),
        false => (scatter.mean, scatter.mean, error),
    };
    let (is_more, is_less) = (low - error > most, high + low_error < least);
    if scatter.triples < FEWEST || !is_more && !is_less {
        return None;
    }
    let seen = Seen::new(&histograms, &is_beside);
    let differ = |times: f64| {
        let times = if times < 10.0 {
            format!("{times:.2}")
        } else {
            format!("{times:.0}")
        };
        format!("the variance between neighbouring bins is {times} times that of photon counts")
    };
    if is_more {
        let pooled = Scatter::of(&[&sum(&histograms)]);
        let is_alike = histograms.len() > 1
            && pooled.median - 1.0 > (0.25 * histograms.len() as f64).max(3.0) * (low - 1.0);
        return Some(format!(
            "{}, so more than {} % of the pixels without a target may have a depth. {}",
            differ(low),
            percent(false_alarm),
            seen.more(is_alike)
        ));
    }
    let share = some(traces).map(|trace| scatter.photons / 3.0 / trace.cycles);
    let full = if has_cycles {
        median(share).min(1.0)
    } else {
        0.0
    };
    (high + low_error < least * (1.0 - full))
        .then(|| format!("{}. {}", differ(high), seen.less(has_cycles)))
}

/// What the counts say against the recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Audit {
    /// What makes the rest of what was found mean little.
    pub cause: Option<String>,
    /// What else looks wrong.
    pub others: Vec<String>,
}

/// "N % of the histograms".
fn of_histograms(some: usize, all: usize) -> String {
    let percent = (100.0 * some as f64 / all as f64).max(1.0);
    format!("{percent:.0} % of the histograms")
}

/// Counters that were full: the highest count in more bins than the counts just below it together.
pub(super) fn full_counters(traces: &[Trace]) -> Option<String> {
    /// Chance does not make so high a count the highest of several bins.
    const HIGH: f64 = 64.0;
    /// So many histograms are not full in exactly one bin each.
    const FEW: usize = 8;
    let counts = traces.iter().flat_map(|trace| &trace.counts);
    let highest = counts.copied().fold(0.0, f64::max);
    let below = highest - f64::min(highest / 32.0, 16.0);
    // Photons differ from pixel to pixel: what has the same neighbours is a copy.
    let (mut at, mut near, mut having, mut twice) = (BTreeSet::new(), BTreeSet::new(), 0, 0);
    for trace in traces {
        let counts = &trace.counts;
        for bin in (0..counts.len()).filter(|&bin| counts[bin] >= below) {
            let neighbours = [bin.checked_sub(1), Some(bin + 1)].map(|bin| {
                bin.and_then(|bin| counts.get(bin))
                    .map(|count| count.to_bits())
            });
            let set = if counts[bin] >= highest {
                &mut at
            } else {
                &mut near
            };
            set.insert(neighbours);
        }
        let times = counts.iter().filter(|&&count| count >= highest).count();
        having += usize::from(times > 0);
        twice += usize::from(times > 1);
    }
    let is_full =
        highest >= HIGH && at.len() > near.len() + 3 && having > 1 && 100 * having >= traces.len();
    if is_full && having == traces.len() && having > FEW && 50 * twice < having {
        return Some(format!(
            "the highest bin of each histogram has {highest}, so each was scaled, and these are no photon counts: save the \
             counts as they were read"
        ));
    }
    is_full.then(|| {
        format!(
            "{} have a bin of {highest} and none has more, so their counters were full and their peaks are cut off: \
             record less light, or with wider counters",
            of_histograms(having, traces.len())
        )
    })
}

/// Counters that began again at 0. In a peak the light of a bin, squared, is 1 to [`tears`]' `NARROWEST` times the product of
/// that of its neighbours. A peak that wrapped is torn, and is whole again with full counters added to some of its bins.
pub(super) fn wrapped_counters(traces: &[Trace]) -> Option<String> {
    /// Counters of 8, 10 and 12 bits. Of wider ones no real peak is so even that it tells.
    const FULL: [(u8, f64); 3] = [(8, 256.0), (10, 1024.0), (12, 4096.0)];
    /// How often a counter may begin again.
    const TURNS: usize = 4;
    /// [`tears`] of what is torn, and of what is whole but for chance.
    const TORN: f64 = 60.0;
    const WHOLE: f64 = 8.0;
    /// So large a share of the histograms is torn, and of these is whole with full counters.
    const SHARE: f64 = 0.1;
    const MENDED: f64 = 0.9;
    /// So many histograms tell.
    const TELL: usize = 64;
    let counts = traces.iter().flat_map(|trace| &trace.counts);
    let highest = counts.copied().fold(0.0, f64::max);
    let is_near = |(_, full): &(u8, f64)| (full / 2.0..*full).contains(&highest);
    let (bits, full) = FULL.into_iter().find(is_near)?;
    let as_counted = some(traces).map(|trace| (trace, tears(&trace.counts, full, 0)));
    let torn: Vec<(&Trace, f64)> = as_counted.filter(|torn| torn.1 > TORN).collect();
    let looked_at = || torn.iter().take(TELL);
    let is_whole = |(trace, _): &&(&Trace, f64)| tears(&trace.counts, full, TURNS) < WHOLE;
    let whole = looked_at().filter(is_whole).count();
    let all = some(traces).count();
    let has_wrapped = torn.len() > 1
        && torn.len() as f64 > SHARE * all as f64
        && whole as f64 > MENDED * looked_at().count() as f64;
    has_wrapped.then(|| {
        format!(
            "{} have a torn peak that is whole if some of its bins counted {full} more. If these are no surfaces a few bins apart, \
             counters of {bits} bits began again at 0: record less light, or with wider counters",
            of_histograms(torn.len(), all)
        )
    })
}

/// How far the bins around the highest are from one peak, if each may have `full` so many `turns` more: the sum of squares of
/// what they miss, in standard deviations.
fn tears(counts: &[f64], full: f64, turns: usize) -> f64 {
    /// So many bins before and after the highest.
    const REACH: usize = 10;
    /// For a Gaussian that ratio is `exp(1 / σ²)`. This is σ = 0.93 bins; narrower pulses look like parts of torn ones.
    const NARROWEST: f64 = 3.2;
    let top = (0..counts.len()).max_by(|&one, &other| counts[one].total_cmp(&counts[other]));
    let level = median(counts.iter().copied());
    let misses = |counts: [f64; 3]| {
        let [a, b, c] = counts.map(|count| (count - level).max(0.0));
        let [of_a, of_b, of_c] = counts.map(|count| count.max(1.0));
        let of_square = 4.0 * b * b * of_b + 2.0 * of_b * of_b;
        let of_product = c * c * of_a + a * a * of_c + of_a * of_c;
        let (square, product) = (b * b, a * c);
        let low = (product - square).max(0.0).powi(2) / (of_square + of_product);
        let high = (square - NARROWEST * product).max(0.0).powi(2)
            / (of_square + NARROWEST * NARROWEST * of_product);
        low + high
    };
    let turns = || (0..=turns).map(|turn| full * turn as f64);
    let Some(top) = top else { return 0.0 };
    let bins = &counts[top.saturating_sub(REACH)..(top + REACH + 1).min(counts.len())];
    // The least sum for each number of turns of the last two bins. The first and the last bin of all have none.
    let number = turns().count();
    let mut least = vec![vec![f64::INFINITY; number]; number];
    least[0].fill(0.0);
    for bins in bins.windows(3) {
        let mut next = vec![vec![f64::INFINITY; number]; number];
        for (at_a, a) in turns().enumerate() {
            for (at_b, b) in turns().enumerate() {
                for (at_c, c) in turns().enumerate() {
                    let sum = least[at_a][at_b] + misses([bins[0] + a, bins[1] + b, bins[2] + c]);
                    next[at_b][at_c] = sum.min(next[at_b][at_c]);
                }
            }
        }
        least = next;
    }
    least
        .iter()
        .map(|least| least[0])
        .fold(f64::INFINITY, f64::min)
}

/// A background that no single level describes: less than half of the eighths of the range are alike to within the standard
/// deviation of the photons in a window. A difference of that moves the threshold by as much.
pub(super) fn uneven_background(
    good: &GoodHistograms,
    gate: RangeInclusive<usize>,
    false_alarm: f64,
) -> Option<String> {
    const PARTS: usize = 8;
    /// A peak so many times as high may have a tail over so many parts.
    const BRIGHT: f64 = 4.0;
    const TAIL: usize = 3;
    /// The usual window.
    const WINDOW: f64 = 3.0;
    /// So many photons a bin, of so many pixels at most.
    const LEVEL: f64 = 10.0;
    const MOST_TOGETHER: f64 = 8.0;
    /// No background is more even.
    const EVEN: f64 = 0.02;
    /// A median of medians has a larger error than a mean.
    const OF_MEDIANS: f64 = 1.57;
    let (from, end) = (*gate.start(), good.bins().min(gate.end() + 1));
    let length = end.saturating_sub(from) / PARTS;
    if length < 3 {
        return None;
    }
    // A single photon must not matter: in dim recordings some pixels together.
    let level = median(good.levels.iter().map(|level| level.mean));
    let together = (LEVEL / level).ceil();
    if !(1.0..=MOST_TOGETHER).contains(&together) {
        return None;
    }
    // The median bin of each part over that of the range, and the median of that: a pulse is in few bins, and in few pixels in
    // the same ones. Behind bright peaks a TDC may have seen little.
    let mut parts = vec![Vec::new(); PARTS];
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to 8"
    )]
    let groups = good.traces.chunks_exact(together as usize);
    let step = (good.traces.len() * good.bins() / BINS) | 1;
    for traces in groups.step_by(step) {
        let sums: Vec<f64> = (0..end)
            .map(|bin| traces.iter().map(|trace| trace.counts[bin]).sum())
            .collect();
        let level = median(sums[from..].iter().copied());
        // Where the tail of the last bright bin ends.
        let mut tail = 0;
        let is_tail: Vec<bool> = (0..end)
            .map(|bin| {
                let is_tail = bin < tail;
                if sums[bin] > BRIGHT * level {
                    tail = bin + TAIL * length + 1;
                }
                is_tail
            })
            .collect();
        let is_seen =
            |&bin: &usize| !is_tail[bin] && traces.iter().all(|trace| trace.live[bin] >= 0.5);
        let seen = |bins: Range<usize>| -> Vec<f64> {
            bins.filter(is_seen).map(|bin| sums[bin]).collect()
        };
        for (at, shares) in parts.iter_mut().enumerate() {
            let bins = seen(from + at * length..from + (at + 1) * length);
            if level > 0.0 && 2 * bins.len() > length {
                shares.push(median(bins) / level);
            }
        }
    }
    let counts = level * together * length as f64;
    let part = |shares: Vec<f64>| {
        let error = SURE * OF_MEDIANS / (counts * shares.len() as f64).sqrt();
        (!shares.is_empty()).then(|| (median(shares), error))
    };
    let parts: Vec<(f64, f64)> = parts.into_iter().filter_map(part).collect();
    let same = EVEN.max(1.0 / (WINDOW * level).sqrt());
    let like = |&(share, _): &(f64, f64)| {
        let is_like = |other: &&(f64, f64)| (other.0 - share).abs() <= share * same.max(other.1);
        parts.iter().filter(is_like).count()
    };
    let most_alike = parts.iter().map(like).max()?;
    (2 * parts.len() >= PARTS && 2 * most_alike < parts.len()).then(|| {
        let shares = parts.iter().map(|part| part.0);
        let (least, most) = shares.fold((f64::INFINITY, 0.0), |(least, most), share| (share.min(least), share.max(most)));
        let round = |share: f64| (100.0 * share).round();
        format!(
            "the background is not flat: eighths of the range have {} to {} % of its median, so more than {} % of the pixels \
             without a target may have a depth",
            round(least),
            round(most),
            percent(false_alarm),
        )
    })
}

/// Peaks of a single bin at the same place, where others have at least three.
pub(super) fn spike(good: &GoodHistograms, gate: RangeInclusive<usize>) -> Option<String> {
    /// Fewer histograms may have a stuck bin of one pixel.
    const SHARE: f64 = 0.05;
    /// More bins are no spikes.
    const MOST: usize = 8;
    /// The bins beside a spike have less than this share of it together. A wide peak has as much in each.
    const BESIDE: f64 = 0.1;
    // Peaks that stand alone, the light of all of them and beside it, with its variance; and wide peaks.
    let mut spikes = vec![(0_usize, 0.0, 0.0, 0.0); good.bins()];
    let mut wide = vec![0_usize; good.bins()];
    for (index, peaks) in good.peaks.iter().enumerate() {
        let counts = &good.traces[index].counts;
        for peak in peaks.iter().filter(|peak| gate.contains(&peak.top)) {
            let background = good.background(index, peak.top);
            let above = |bin: Option<usize>| {
                let count = bin.and_then(|bin| counts.get(bin));
                count.map_or(0.0, |count| count - background)
            };
            let top = above(Some(peak.top));
            let beside = [peak.top.checked_sub(1), Some(peak.top + 1)].map(above);
            let noise = 3.0 * (background + 1.0).sqrt();
            if beside.iter().all(|light| *light > noise + BESIDE * top) {
                wide[peak.top] += 1;
            } else if beside.iter().all(|light| *light <= noise + BESIDE * top) {
                let [before, after] = beside;
                let (number, of, sum, variance) = &mut spikes[peak.top];
                *number += 1;
                *of += top;
                *sum += before + after;
                *variance += (before + after).max(0.0) + 2.0 * background + 1.0;
            }
        }
    }
    let all = good.traces.len();
    let is_often = |number: usize| number > 1 && number as f64 >= SHARE * all as f64;
    let is_narrow = |&(_, of, sum, variance): &(usize, f64, f64, f64)| {
        sum + 3.0 * variance.sqrt() < BESIDE * of
    };
    let is_spike = |bin: &usize| is_often(spikes[*bin].0) && is_narrow(&spikes[*bin]);
    let bins: Vec<usize> = (0..good.bins()).filter(is_spike).collect();
    // A narrow pulse has such peaks everywhere.
    let at = |bin: &usize| bins.contains(bin);
    let elsewhere: usize = (0..wide.len())
        .filter(|bin| !at(bin))
        .map(|bin| wide[bin])
        .sum();
    let others: usize = (0..spikes.len())
        .filter(|bin| !at(bin))
        .map(|bin| spikes[bin].0)
        .sum();
    let &bin = bins.iter().max_by_key(|&&bin| spikes[bin].0)?;
    if bins.len() > MOST || elsewhere <= 2 * others {
        return None;
    }
    let last = good.bins() - 1;
    let share = of_histograms(spikes[bin].0, all);
    let why = "narrower than the pulse, so it is no light that came back";
    let save = "leave it out when you save the recording";
    Some(match bins[..] {
        [bin @ 0..8] => format!(
            "{share} have a spike at bin {bin}, {why}: --gate {}..{last} leaves it out",
            bin + 1
        ),
        [bin] if bin + 8 > last => format!(
            "{share} have a spike at bin {bin}, {why}: --gate 0..{} leaves it out",
            bin - 1
        ),
        [bin] => format!(
            "{share} have a spike at bin {bin}, {why}: {save}, as with `counts[..., {bin}] = counts[..., {}]`",
            bin - 1
        ),
        _ => {
            let more = bins
                .iter()
                .filter(|&&other| other != bin)
                .map(usize::to_string);
            let more = more.collect::<Vec<_>>().join(", ");
            format!("{share} have a spike at bin {bin}, and others at {more}, {why}: {save}")
        }
    })
}

/// The first and the last bin of the range of the TDC, and a warning if bins beyond hold hardly anything. If they hold
/// nothing, nothing is lost. Whether laser cycles are known helps to tell the end from pile-up.
pub(super) fn range(traces: &[Trace], has_cycles: bool) -> (RangeInclusive<usize>, Option<String>) {
    /// Bins with a smaller share of the photons of the others are hardly filled. The one beside them is partly.
    const HARDLY: f64 = 0.2;
    const PARTLY: f64 = 0.8;
    /// By chance one in so many.
    const ONE_IN: f64 = 1e6;
    /// Else it is no range.
    const FEWEST_BINS: usize = 16;
    let bins = traces.first().map_or(0, |trace| trace.counts.len());
    let histograms: Vec<&[f64]> = traces.iter().map(|trace| &trace.counts[..]).collect();
    let sums = sum(&histograms);
    let some_histograms: Vec<&[f64]> = some(traces).map(|trace| &trace.counts[..]).collect();
    let is_filled = |sum: &f64| *sum > 0.0;
    let end = sums
        .iter()
        .rposition(is_filled)
        .map_or(bins, |last| last + 1);
    let start = sums.iter().position(is_filled).unwrap_or(0);
    let usual = median(background(&some_histograms)) * traces.len() as f64;
    if !is_surely_less(0.0, usual, ONE_IN) {
        return (0..=bins.saturating_sub(1), None);
    }
    let is_below = |bin: usize, share: f64| is_surely_less(sums[bin], share * usual, ONE_IN);
    // Its slope is no edge, and after a bright pulse it leaves few laser cycles.
    let is_pile_up = |end: usize| {
        let edge = &sums[end.saturating_sub(4)..end];
        let recorded =
            sums[..end].iter().sum::<f64>() / traces.iter().map(|trace| trace.cycles).sum::<f64>();
        let is_sharp = edge.iter().rev().take(2).any(|&sum| sum >= 0.5 * usual);
        !is_sharp
            || match has_cycles {
                // A TDC that takes one photon a laser cycle has no more.
                true => (0.5..1.05).contains(&recorded),
                false => edge.iter().any(|&sum| sum > 2.0 * usual),
            }
    };
    let is_hardly = |bin: &usize| is_below(*bin, HARDLY);
    let mut first = start + (start..end).take_while(is_hardly).count();
    let edge = end - (first..end).rev().take_while(is_hardly).count();
    if edge < first + FEWEST_BINS {
        return (0..=bins.saturating_sub(1), None);
    }
    let mut last = if is_pile_up(edge) { end - 1 } else { edge - 1 };
    let beyond = || sums[..first].iter().chain(&sums[last + 1..]);
    let lost: f64 = beyond().sum();
    let warning = (lost > 0.0).then(|| {
        let beyond = beyond().filter(|sum| is_filled(sum)).count();
        format!(
            "the {beyond} bins beyond {first}..{last} hold {:.1} % of the background of as many others: the range of the TDC \
             ends there, so the gate leaves them out; --gate 0..{} keeps them",
            100.0 * lost / beyond as f64 / usual,
            end - 1
        )
    });
    first += usize::from(first > 0 && is_below(first, PARTLY));
    last -= usize::from(last + 1 < bins && last > 0 && is_below(last, PARTLY));
    (first..=last, warning)
}

/// Codes that the TDC never gives: bins that are empty in all histograms, between some that are not. They would split a
/// background or a pulse, so they get what the bins beside them have.
pub(super) fn fill_missing_codes(traces: &mut [Trace]) -> Option<String> {
    /// Chance leaves a bin empty once in so many.
    const ONE_IN: f64 = 1e9;
    let sums = sum(&traces
        .iter()
        .map(|trace| &trace.counts[..])
        .collect::<Vec<_>>());
    // A pulse falls ever faster from bin to bin, down to the background, which most bins have or exceed. The TDC may begin
    // after the first bin, or end before the last.
    let is_counted = |sum: &f64| *sum > 0.0;
    let first = sums.iter().position(is_counted).unwrap_or(0);
    let end = sums.iter().rposition(is_counted).map_or(0, |last| last + 1);
    let dark = match 2 * (end - first) > sums.len() {
        true => quantile(sums[first..end].iter().copied(), 0.2),
        false => 0.0,
    };
    let goes_on = |end: usize, step: isize| {
        let at = |steps: isize| {
            let bin = end.checked_add_signed(steps * step)?;
            sums.get(bin).copied().filter(|&sum| sum > 0.0)
        };
        let (Some(sum), Some(beside)) = (at(0), at(1)) else {
            return sums[end];
        };
        let fall = (sum / beside).min(1.0);
        let before = at(2).map_or(1.0, |before| (beside / before).min(1.0));
        (sum * fall * (fall / before).min(1.0)).max(dark.min(sum))
    };
    let missing: Vec<(usize, [usize; 2])> = (1..sums.len().saturating_sub(1))
        .filter(|&bin| sums[bin] <= 0.0)
        .filter_map(|bin| {
            let before = sums[..bin].iter().rposition(|&sum| sum > 0.0)?;
            let after = bin + sums[bin..].iter().position(|&sum| sum > 0.0)?;
            let usual = f64::min(goes_on(before, -1), goes_on(after, 1));
            is_surely_less(0.0, usual, ONE_IN).then_some((bin, [before, after]))
        })
        .collect();
    for trace in traces {
        for (bin, beside) in &missing {
            trace.counts[*bin] = beside.map(|bin| trace.counts[bin]).iter().sum::<f64>() / 2.0;
        }
    }
    let (first, _) = missing.first()?;
    let which = match missing.len() {
        1 => format!("bin {first} is"),
        number => format!("{number} bins, the first of them {first}, are"),
    };
    Some(format!(
        "{which} empty in all histograms, between some that are not: the TDC never gives that code, and depths near it may be \
         off by a bin"
    ))
}

/// That a known number of laser cycles leaves far less light than any sensor is used with.
pub(super) fn hardly_any_light(brightest: f64, cycles: u64) -> Option<String> {
    /// Laser cycles for each photon of the brightest pixel.
    const MOST: f64 = 1e5;
    (brightest > 0.0 && brightest * MOST < cycles as f64).then(|| {
        format!(
            "the brightest pixel has a photon in {} laser cycles: --recorded-cycles is how many laser cycles each histogram \
             counted",
            two_digits(cycles as f64 / brightest)
        )
    })
}

/// That so few pixels are so much brighter than the others of their capture that their photons say little about how long it
/// lasted. `hot` ones say nothing.
pub(super) fn sets_the_length(observed: &Observed, hot: &[usize]) -> Option<String> {
    /// So many times as bright as all but one in so many pixels.
    const TIMES: f64 = 10.0;
    const ONE_IN: usize = 50;
    let pixels = observed.array.pixels() as usize;
    let mut bright = Vec::new();
    for capture in 0..observed.captures() {
        let numbers = capture * pixels..(capture + 1) * pixels;
        let used = numbers
            .filter(|number| !hot.contains(&(number % pixels)) && !observed.is_masked(*number));
        let mut photons: Vec<(f64, usize)> = used
            .map(|number| (observed.photons(number) as f64, number))
            .collect();
        photons.sort_by(|one, other| other.0.total_cmp(&one.0));
        if let Some(&(others, _)) = photons.get(photons.len().div_ceil(ONE_IN)) {
            let is_bright = |one: &&(f64, usize)| one.0 > TIMES * others;
            let found = photons.iter().take_while(is_bright);
            bright.extend(found.map(|&(photons, number)| (number, photons / others.max(1.0))));
        }
    }
    let so = "the others seem dim and may have no events: --recorded-cycles says how many laser cycles there were";
    match bright[..] {
        [] => None,
        [(pixel, times)] => Some(format!(
            "pixel {pixel} has {} times the photons of most others, and sets how long the recording is taken to have lasted, so \
             {so}, and --mask {pixel} leaves the pixel out",
            two_digits(times)
        )),
        _ => Some(format!(
            "{} histograms have more than {TIMES} times the photons of most others, and set how long the recording is taken to \
             have lasted, so {so}",
            bright.len()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::find::background::Level;
    use dtof_core::Array;
    use dtof_data::photons::histograms::Histograms;
    use dtof_light::rates::bin_share;
    use proptest::prelude::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, Poisson};
    use rand_pcg::Pcg64;

    const BINS: usize = 128;

    /// So many histograms with these means, each count changed by `change`.
    fn recorded(
        histograms: usize,
        means: &dyn Fn(usize, usize) -> f64,
        change: &dyn Fn(usize, f64) -> f64,
        seed: u64,
    ) -> Vec<Trace> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let mut count = |mean: f64| match mean > 0.0 {
            true => Poisson::new(mean).unwrap().sample(&mut rng),
            false => 0.0,
        };
        let trace = |pixel: usize| Trace {
            pixel,
            cycles: 1e9,
            counts: (0..BINS)
                .map(|bin| change(bin, count(means(pixel, bin))))
                .collect(),
            live: vec![1.0; BINS],
            truth_mm: None,
        };
        (0..histograms).map(trace).collect()
    }

    /// A background and some pulses.
    fn scene(background: f64, pulses: Vec<(f64, f64, f64)>) -> impl Fn(usize, usize) -> f64 {
        move |_, bin| {
            let of = |&(photons, place, sigma): &(f64, f64, f64)| {
                #[allow(clippy::cast_possible_truncation)]
                let share = bin_share(bin as u32, place, sigma);
                photons * share
            };
            background + pulses.iter().map(of).sum::<f64>()
        }
    }

    fn said(traces: &[Trace]) -> Option<String> {
        no_counts(traces, false, 0.01)
    }

    fn scatter(traces: &[Trace]) -> Scatter {
        Scatter::of(
            &traces
                .iter()
                .map(|trace| &trace.counts[..])
                .collect::<Vec<_>>(),
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever the light is: level, slope, pulses.
        #[test]
        fn photon_counts_are_counts(
            background in -7.0..10.0_f64,
            slope in 0.0..1.0_f64,
            pulses in prop::collection::vec((1.0..9.0_f64, 5.0..120.0, 0.2..2.5), 0..6),
            seed: u64,
        ) {
            let pulses = pulses.into_iter().map(|(photons, place, sigma)| (photons.exp(), place, sigma));
            let even = scene(0.0, pulses.collect());
            let level = |bin: usize| background.exp() * (1.0 - slope * bin as f64 / BINS as f64);
            let traces = recorded(16, &|pixel, bin| level(bin) + even(pixel, bin), &|_, n| n, seed);
            prop_assert_eq!(said(&traces), None, "{:?}", scatter(&traces));
        }

        /// Counts times a number scatter so many times as much. A few peaks of noise are left out.
        #[test]
        fn a_factor_is_found(factor in 2_u32..100, background in 1.0..200.0_f64, seed: u64) {
            let light = scene(background, vec![(300.0, 60.5, 1.0)]);
            let traces = recorded(32, &light, &|_, n| n * f64::from(factor), seed);
            let found = scatter(&traces).mean / f64::from(factor);
            prop_assert!((0.7..1.2).contains(&found), "{}", found);
            let says = said(&traces).unwrap();
            let cause = format!("All are multiples of {factor}: save `counts // {factor}`");
            prop_assert!(says.ends_with(&cause), "{}", says);
        }

        #[test]
        fn background_that_was_taken_off_is_found(background in 8.0..1000.0_f64, seed: u64) {
            let light = scene(background, vec![(3.0 * background, 60.5, 1.0)]);
            let traces = recorded(32, &light, &|_, n| (n - background.round()).max(0.0), seed);
            let says = said(&traces).unwrap();
            prop_assert!(says.contains(" % of the bins are 0 and would not be, as if background was subtracted"), "{} {}", background, says);
        }

        /// The same widths in all pixels, or others in each.
        #[test]
        fn bins_of_unequal_width_are_found(differ in 0.35..0.8_f64, background in 40.0..400.0_f64, each: bool, seed: u64) {
            let mut rng = Pcg64::seed_from_u64(seed);
            let widths: Vec<f64> = (0..32 * BINS)
                .map(|_| 1.0 + differ * rand_distr::Uniform::new(-1.0, 1.0).unwrap().sample(&mut rng))
                .collect();
            let width = |pixel: usize, bin: usize| widths[if each { pixel * BINS } else { 0 } + bin];
            let traces = recorded(32, &|pixel, bin| background * width(pixel, bin), &|_, n| n, seed);
            let says = said(&traces).unwrap();
            let cause = if each { "bins of each pixel are of unequal width" } else { "the bins are of unequal width" };
            prop_assert!(says.contains(cause), "{}", says);
        }

        /// Averages of `window` counts, or distances with a noise of a few millimetres.
        #[test]
        fn averages_and_distances_are_no_counts(window in 2_usize..8, background in 50.0..2000.0_f64, seed: u64) {
            let mut traces = recorded(32, &|_, _| background, &|_, n| n, seed);
            for trace in &mut traces {
                let mean = |at: usize| trace.counts[at..(at + window).min(BINS)].iter().sum::<f64>() / window as f64;
                trace.counts = (0..BINS - window).map(|at| mean(at).round()).collect();
            }
            prop_assert!(said(&traces).unwrap().contains("averaged, smoothed or divided, or are distances"));
            let depths = recorded(32, &|_, _| 9.0, &|_, n| background + n, seed);
            prop_assert!(said(&depths).unwrap().contains("averaged, smoothed or divided, or are distances"));
        }
    }

    /// A factor that is no whole number, also over so little background that many bins are empty.
    #[test]
    fn counts_that_were_multiplied_are_not_taken_for_others() {
        for background in [1.5, 20.0] {
            let light = scene(background, vec![(3000.0, 60.5, 1.0)]);
            let says = said(&recorded(256, &light, &|_, n| (10.5 * n).round(), 1)).unwrap();
            assert!(says.contains("ultiplied"), "{says}");
        }
    }

    /// Also of few pixels, of which bins are dead or were not measured.
    #[test]
    fn bins_that_are_alike_in_all_pixels_are_named() {
        let width = |bin: usize| [0.4, 1.6, 0.7, 1.3, 1.0][bin * bin % 11 % 5];
        let light = |_, bin: usize| {
            if bin < 40 || bin == 90 {
                0.0
            } else {
                60.0 * width(bin)
            }
        };
        let says = said(&recorded(16, &light, &|_, n| n, 1)).unwrap();
        assert!(says.contains("so the bins are of unequal width"), "{says}");
    }

    #[test]
    fn counters_that_are_full_are_named() {
        let says = said(&recorded(32, &|_, _| 250.0, &|_, n| n.min(255.0), 1)).unwrap();
        assert!(
            says.contains("% of the bins hold 255, the most that they can"),
            "{says}"
        );
    }

    #[test]
    fn too_few_bins_do_not_tell() {
        let light = scene(20.0, vec![]);
        let times_eight = |histograms| said(&recorded(histograms, &light, &|_, n| 8.0 * n, 1));
        assert_eq!(times_eight(4), None);
        assert!(times_eight(8).is_some());
        assert_eq!(said(&[]), None);
        assert_eq!(said(&recorded(100, &|_, _| 0.0, &|_, n| n, 1)), None);
    }

    /// A bin that counts once a laser cycle at most, in half of them.
    #[test]
    fn bins_that_are_often_full_scatter_less() {
        let mut rng = Pcg64::seed_from_u64(1);
        let half = rand_distr::Binomial::new(1000, 0.5).unwrap();
        let mut traces = recorded(32, &|_, _| 0.0, &|_, n| n, 1);
        for trace in &mut traces {
            trace.cycles = 1000.0;
            trace.counts.fill_with(|| half.sample(&mut rng) as f64);
        }
        assert!(
            said(&traces)
                .unwrap()
                .contains("or a bin counts once a laser cycle, and --recorded-cycles")
        );
        assert_eq!(no_counts(&traces, true, 0.01), None);
    }

    /// As [`AllHistograms`] has them, without a correction for pile-up.
    fn good(traces: Vec<Trace>) -> GoodHistograms {
        let levels = traces.iter();
        let levels = levels
            .map(|trace| Level::of(&trace.counts, &trace.live))
            .collect();
        let array = Array::new(u32::try_from(traces.len()).unwrap(), 1).unwrap();
        GoodHistograms::new(array, 0.01, traces, levels)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever is in the histograms.
        #[test]
        fn the_range_is_part_of_the_bins(
            histograms in (1_usize..40, 1_usize..6).prop_flat_map(|(bins, number)| {
                prop::collection::vec(prop::collection::vec(prop_oneof![Just(0_u32), 0..5_u32, 0..1_000_000_u32], bins), number)
            }),
            has_cycles: bool,
        ) {
            let traces: Vec<Trace> = histograms.iter().map(|counts| Trace {
                counts: counts.iter().map(|&count| count.into()).collect(),
                live: vec![1.0; counts.len()],
                ..recorded(1, &|_, _| 0.0, &|_, n| n, 1).remove(0)
            }).collect();
            let (range, warning) = range(&traces, has_cycles);
            let bins = histograms[0].len();
            prop_assert!(range.start() <= range.end() && *range.end() < bins, "{:?}", range);
            let lost = histograms.iter().flat_map(|counts| {
                counts[..*range.start()].iter().chain(&counts[range.end() + 1..])
            });
            let lost: u32 = lost.map(|&count| count.min(1)).sum();
            prop_assert!(warning.is_some() || lost as usize <= 2 * traces.len(), "{} {:?}", lost, range);
        }

        /// Bins that hold a twentieth of the others at one end; a half is no end.
        #[test]
        fn ends_that_are_hardly_filled_are_found(
            background in 60.0..1000.0_f64,
            bins in 1_usize..40,
            is_first: bool,
            share in 0.0..0.05_f64,
            place in 0.4..0.6_f64,
            seed: u64,
        ) {
            let light = scene(background, vec![(20.0 * background, place * 128.0, 1.0)]);
            let is_end = |bin: usize| if is_first { bin < bins } else { bin >= BINS - bins };
            let with = |share: f64| {
                let mean = |pixel: usize, bin: usize| light(pixel, bin) * if is_end(bin) { share } else { 1.0 };
                range(&recorded(16, &mean, &|_, n| n, seed), true)
            };
            let (found, warning) = with(share);
            let whole = if is_first { bins..=BINS - 1 } else { 0..=BINS - 1 - bins };
            prop_assert_eq!(found, whole);
            prop_assert!(warning.is_some() || share * background * (16 * bins) as f64 <= 30.0);
            prop_assert_eq!(with(0.5), (0..=BINS - 1, None));
        }

        /// The first photons of a wall: what is left behind it is no end of the range.
        #[test]
        fn what_pile_up_leaves_is_no_end(rate in 0.1..3.0_f64, signal in 1.0..5.0_f64, place in 20.0..110.0_f64, has_cycles: bool, seed: u64) {
            let light = scene(rate / BINS as f64, vec![(signal, place, 1.0)]);
            let mut left = 1.0;
            let shares: Vec<f64> = (0..BINS).map(|bin| {
                let before = left;
                left *= (-light(0, bin)).exp();
                before - left
            }).collect();
            let mut traces = recorded(16, &|_, bin| 20_000.0 * shares[bin], &|_, n| n, seed);
            traces.iter_mut().for_each(|trace| trace.cycles = 20_000.0);
            prop_assert_eq!(range(&traces, has_cycles).1, None);
        }

        /// Peaks up to four times what a counter of 8 bits holds; one that holds them is right.
        #[test]
        fn narrow_counters_are_found(
            background in 1.0..50.0_f64,
            highest in 350.0..1000.0_f64,
            place in 20.0..100.0_f64,
            sigma in 0.9..1.5_f64,
            seed: u64,
        ) {
            let with = |highest: f64, counted: &dyn Fn(f64) -> f64| {
                let light = scene(background, vec![(highest * 2.5 * sigma, place, sigma)]);
                full_counters(&recorded(16, &light, &|_, n| counted(n), seed))
            };
            let says = with(highest, &|n| n.min(255.0)).unwrap();
            prop_assert!(says.starts_with("100 % of the histograms have a bin of 255 and none has more"), "{}", says);
            prop_assert_eq!(with(highest, &|n| n), None);
        }

        /// A line or an exponential, against walls, targets and their tails.
        #[test]
        fn a_background_that_is_not_flat_is_found(
            background in 100.0..2000.0_f64,
            fall in 0.5..0.9_f64,
            is_curved: bool,
            tail in 0.3..2.0_f64,
            is_wall: bool,
            seed: u64,
        ) {
            let place = |pixel: usize| if is_wall { 60.0 } else { 20.0 + (37 * pixel % 90) as f64 };
            let pulse = |pixel: usize, bin: usize| {
                let light = |delay: i32| {
                    let share = bin_share(u32::try_from(bin).unwrap(), place(pixel) + f64::from(delay), 1.0);
                    30.0 * background.sqrt() * share * (-f64::from(delay) / tail).exp()
                };
                (0..20).map(light).sum::<f64>()
            };
            let falls = |bin: usize| {
                let along = bin as f64 / BINS as f64;
                if is_curved { (1.0 - fall).powf(along) } else { 1.0 - fall * along }
            };
            let with = |falls: &dyn Fn(usize) -> f64| {
                let mean = |pixel: usize, bin: usize| background * falls(bin) + pulse(pixel, bin);
                uneven_background(&good(recorded(48, &mean, &|_, n| n, seed)), 0..=BINS - 1, 0.01)
            };
            prop_assert_eq!(with(&|_| 1.0), None);
            let says = with(&falls).unwrap();
            prop_assert!(says.starts_with("the background is not flat"), "{}", says);
        }

        /// In a third of the histograms. A narrow pulse is one in all of them.
        #[test]
        fn spikes_are_found(background in 1.0..50.0_f64, bin in 0..BINS, seed: u64) {
            let signal = 25.0 * (5.0 * background).sqrt() + 50.0;
            let place = |pixel: usize| 20.5 + (37 * pixel % 90) as f64;
            let light = |sigma: f64, spike: f64| {
                let mean = move |pixel: usize, at: usize| {
                    let is_spike = at == bin && pixel.is_multiple_of(3);
                    background + signal * bin_share(u32::try_from(at).unwrap(), place(pixel), sigma)
                        + if is_spike { spike } else { 0.0 }
                };
                spike_of(mean, seed)
            };
            let says = light(1.0, 5.0 * signal).unwrap();
            let text = format!("have a spike at bin {bin}, narrower than the pulse");
            prop_assert!(says.contains(&text), "{}", says);
            prop_assert_eq!(light(1.0, 0.0), None);
            prop_assert_eq!(light(0.15, 0.0), None);
        }
    }

    /// One in each of some captures, at another bin each: none of them is a narrow pulse.
    #[test]
    fn spikes_at_several_bins_are_named_together() {
        let light = |bins: usize| {
            move |pixel: usize, at: usize| {
                let place = 20.5 + (37 * pixel % 90) as f64;
                let pulse = 300.0 * bin_share(u32::try_from(at).unwrap(), place, 1.0);
                let is_spike = (0..bins).any(|spike| at == 5 + 12 * spike && pixel % bins == spike);
                10.0 + pulse + if is_spike { 900.0 } else { 0.0 }
            }
        };
        let says = spike_of(light(4), 1).unwrap();
        let start = "25 % of the histograms have a spike at bin ";
        assert!(
            says.starts_with(start) && says.contains(", and others at "),
            "{says}"
        );
        for bin in [5, 17, 29, 41] {
            assert!(says.contains(&format!(" {bin}")), "{says}");
        }
        assert!(spike_of(light(8), 1).is_some());
        assert_eq!(spike_of(light(9), 1), None);
    }

    fn spike_of(mean: impl Fn(usize, usize) -> f64, seed: u64) -> Option<String> {
        spike(&good(recorded(48, &mean, &|_, n| n, seed)), 0..=BINS - 1)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Of 2 to 300 pixels, in one of up to three captures.
        #[test]
        fn pixels_that_set_the_length_are_named(
            pixels in 2_u32..300,
            captures in 1_usize..4,
            bright in 0_usize..900,
            times in 15_u64..10_000,
        ) {
            let all = captures * pixels as usize;
            let bright = bright % all;
            let with = |times: u64, hot: &[usize], masked: Option<&[u16]>| {
                let of = |number: usize| vec![if number == bright { times } else { 1 }; 16];
                let histograms = Histograms::of((0..all).map(of)).unwrap();
                sets_the_length(&Observed { masked, ..observed(pixels, &histograms) }, hot)
            };
            prop_assert_eq!(with(10, &[], None), None);
            prop_assert_eq!(with(times, &[bright % pixels as usize], None), None);
            prop_assert_eq!(with(times, &[], Some(&[u16::try_from(bright).unwrap()])), None);
            let says = with(times, &[], Some(&[])).unwrap();
            let start = format!("pixel {bright} has {} times", two_digits(times as f64));
            let end = format!("--mask {bright} leaves the pixel out");
            prop_assert!(says.starts_with(&start) && says.ends_with(&end), "{}", says);
        }
    }

    /// A peak that wraps in some pixels, and two surfaces close together that do not.
    #[test]
    fn counters_that_began_again_are_found() {
        let mut rng = Pcg64::seed_from_u64(7);
        let mut between = |low: f64, high: f64| {
            rand_distr::Uniform::new(low, high)
                .unwrap()
                .sample(&mut rng)
        };
        let (mut missed, mut wrong) = (0, 0);
        for (seed, bits) in (0..300).zip([8, 10, 12].into_iter().cycle()) {
            let full = 2_f64.powi(bits);
            let background = between(1.0, 40.0);
            let place = |pixel: usize| 40.0 + (pixel % 9) as f64 / 9.0;
            let peak = |light: f64, at: f64, sigma: f64, bin: usize| {
                light * 2.5 * sigma * bin_share(u32::try_from(bin).unwrap(), at, sigma)
            };
            let (highest, sigma) = (full * between(1.5, 4.0), between(0.9, 2.0));
            let wraps = |pixel: usize, bin: usize| {
                let light = highest * (0.5 + (pixel % 4) as f64 / 6.0);
                background + peak(light, place(pixel), sigma, bin)
            };
            let says = wrapped_counters(&recorded(32, &wraps, &|_, n| n % full, seed));
            let cause = format!("counters of {bits} bits began again at 0");
            missed += usize::from(!says.is_some_and(|says| says.contains(&cause)));
            let (sigma, share) = (between(0.3, 2.0), between(0.3, 1.0));
            let gap = sigma * between(2.0, 9.0);
            let bright = between(0.6, 0.95);
            let two = |pixel: usize, bin: usize| {
                let light = (full - background) * (bright - 0.2 * (pixel * 7 % 32) as f64 / 31.0);
                let behind = peak(light * share, place(pixel) + gap, sigma, bin);
                background + peak(light, place(pixel), sigma, bin) + behind
            };
            let two = recorded(32, &two, &|_, n| n.min(full - 1.0), seed);
            wrong += usize::from(wrapped_counters(&two).is_some());
        }
        assert!(missed == 0 && wrong <= 20, "{missed} missed, {wrong} wrong");
    }

    fn observed(pixels: u32, histograms: &Histograms) -> Observed<'_> {
        Observed::plain(Array::new(pixels, 1).unwrap(), histograms)
    }

    /// Leaving out one of them would not help.
    #[test]
    fn several_bright_pixels_are_counted() {
        let mut capture = vec![vec![1; 16]; 200];
        for bright in [3, 50, 51] {
            capture[bright].fill(40);
        }
        let histograms = Histograms::of(capture).unwrap();
        let says = sets_the_length(&observed(200, &histograms), &[]).unwrap();
        assert!(
            says.starts_with("3 histograms have more than 10 times the photons"),
            "{says}"
        );
        assert!(!says.contains("--mask"), "{says}");
    }

    /// Light of 100, 25 and 100 photons in the dark, by the formula.
    #[test]
    fn tears_are_squares_of_standard_deviations() {
        let mut counts = [0.0; 11];
        counts[4..7].copy_from_slice(&[100.0, 25.0, 100.0]);
        let valley = 9375.0_f64.powi(2) / (62_500.0 + 1250.0 + 2.0e6 + 10_000.0);
        let edge = 1e8 / (4e6 + 2e4 + 3.2 * 3.2 * (625.0 + 25.0));
        let found = tears(&counts, 256.0, 0);
        assert!((found - valley - 2.0 * edge).abs() < 1e-9, "{found}");
        // With 256 more the middle one is a peak, which is too narrow for the edges.
        assert!(tears(&counts, 256.0, 1) < found);
        assert_eq!(tears(&[1.0, 2.0], 256.0, 4), 0.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Up to three in a row, not at the ends, and not by chance.
        #[test]
        fn codes_that_a_tdc_never_gives_are_filled(
            background in 2.0..50.0_f64,
            first in 1_usize..120,
            number in 1_usize..4,
            seed: u64,
        ) {
            let is_missing = |bin: usize| (first..first + number).contains(&bin);
            let mean = |_, bin| if is_missing(bin) { 0.0 } else { background };
            let before = recorded(32, &mean, &|_, n| n, seed);
            let mut traces = before.clone();
            let says = fill_missing_codes(&mut traces).unwrap();
            prop_assert!(says.contains(&format!("{first}")), "{}", says);
            for (trace, before) in traces.iter().zip(&before) {
                let between = (before.counts[first - 1] + before.counts[first + number]) / 2.0;
                for bin in 0..BINS {
                    let expected = if is_missing(bin) { between } else { before.counts[bin] };
                    prop_assert!((trace.counts[bin] - expected).abs() < 1e-9);
                }
            }
            let mut ends = recorded(32, &|_, bin| if bin < first { 0.0 } else { background }, &|_, n| n, seed);
            prop_assert_eq!(fill_missing_codes(&mut ends), None);
            let mut dark = recorded(32, &|_, _| 0.1, &|_, n| n, seed);
            prop_assert_eq!(fill_missing_codes(&mut dark), None);
        }

        /// Nor where two pulses end.
        #[test]
        fn bins_between_pulses_are_no_missing_codes(
            light in 1e2..1e4_f64,
            sigma in 0.4..3.0_f64,
            place in 30.0..31.0_f64,
            apart in 4.0..40.0_f64,
            seed: u64,
        ) {
            let pulses = scene(0.0, vec![(light, place, sigma), (light, place + apart, sigma)]);
            let mut traces = recorded(16, &pulses, &|_, n| n, seed);
            prop_assert_eq!(fill_missing_codes(&mut traces), None);
        }

        /// A code that is missing beside a pulse is one if there is a background.
        #[test]
        fn codes_beside_a_pulse_are_filled(
            background in 2.0..50.0_f64,
            light in 1e2..1e4_f64,
            sigma in 0.4..1.5_f64,
            place in 60.0..61.0_f64,
            beside in 3_usize..8,
            begins in 0_usize..50,
            seed: u64,
        ) {
            let pulse = scene(background, vec![(light, place, sigma)]);
            let missing = 60 + beside;
            let mean = |pixel, bin| if bin == missing || bin < begins { 0.0 } else { pulse(pixel, bin) };
            let mut traces = recorded(32, &mean, &|_, n| n, seed);
            let says = fill_missing_codes(&mut traces).unwrap();
            prop_assert!(says.starts_with(&format!("bin {missing} is")), "{}", says);
        }
    }

    /// Scaled to the same highest count each, or full in some.
    #[test]
    fn histograms_that_were_scaled_are_named() {
        let light = scene(20.0, vec![(500.0, 60.5, 1.0)]);
        let mut traces = recorded(32, &light, &|_, n| n, 1);
        for trace in &mut traces {
            let highest = trace.counts.iter().copied().fold(0.0, f64::max);
            trace
                .counts
                .iter_mut()
                .for_each(|count| *count = (*count * 255.0 / highest).round());
        }
        let says = full_counters(&traces).unwrap();
        assert!(
            says.starts_with("the highest bin of each histogram has 255, so each was scaled"),
            "{says}"
        );
        traces[3].counts[5] = 254.0;
        traces[3]
            .counts
            .iter_mut()
            .for_each(|count| *count = count.min(254.0));
        assert!(
            full_counters(&traces)
                .unwrap()
                .contains("counters were full")
        );
    }

    /// Distances with edges between surfaces: their bends are rare, and large.
    #[test]
    fn a_depth_image_is_no_histogram() {
        let row =
            |row: usize, bin: usize| [1500.0, 2200.0, 1800.0, 2600.0][(row + bin / 9 * 7) % 4];
        let mut traces = recorded(48, &|_, _| 9.0, &|_, n| n, 1);
        for trace in &mut traces {
            for (bin, count) in trace.counts.iter_mut().enumerate() {
                *count += row(trace.pixel, bin);
            }
        }
        assert!(scatter(&traces).mean > 1.0, "{:?}", scatter(&traces));
        assert!(said(&traces).unwrap().contains("or are distances"));
    }

    /// One photon in 100,000 laser cycles is as dim as it gets.
    #[test]
    fn so_many_laser_cycles_leave_hardly_any_light() {
        assert_eq!(hardly_any_light(50.0, 5_000_000), None);
        let says = hardly_any_light(50.0, 5_000_001).unwrap();
        assert!(
            says.starts_with("the brightest pixel has a photon in 100,000 laser cycles"),
            "{says}"
        );
        assert_eq!(hardly_any_light(0.0, u64::MAX), None);
    }
}

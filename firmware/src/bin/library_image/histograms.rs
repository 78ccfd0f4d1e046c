//! Histograms of dtof-core, and the decisions on them.

use dtof_core::paper::{ComparatorTree, Threshold, centroid, quadrant_background};
use dtof_core::rule::{ExcludedBins, LiveCounts, Tracking, detect};
use dtof_core::{
    Count8, Count10, Count16, Count20, Count24, CounterWidth, DetectionRule, Histogram, Peak,
    Statistics, WindowRule,
};

use crate::values::{
    address, alpha, any_rule, average_rule, background_level, bin, byte, count, cycle, double,
    estimator, gate, half, keep, more, rule, some, values, window_rule, word,
};

pub fn all() {
    for_bins::<8>();
    for_bins::<128>();
    gates::<1024>();
    trees::<1024>();
    for_width::<1024, Count10>();
    for_width::<1024, Count20>();
}

fn for_bins<const BINS: usize>() {
    gates::<BINS>();
    trees::<BINS>();
    for_width::<BINS, Count8>();
    for_width::<BINS, Count10>();
    for_width::<BINS, Count16>();
    for_width::<BINS, Count24>();
}

fn for_width<const BINS: usize, W: CounterWidth>() {
    thresholds::<W>();
    histograms::<BINS, W>();
    excluded_bins::<BINS, W>();
    live_counts::<BINS, W>();
}

#[inline(never)]
fn gates<const BINS: usize>() {
    let gate = gate::<BINS>();
    keep((gate.first(), gate.last(), gate.contains(half())));
    keep(gate.quadrant_starts());
}

#[inline(never)]
fn trees<const BINS: usize>() {
    let tree = ComparatorTree::of(&values::<u16, BINS>(half));
    keep((tree.peak(), tree.quadrant_maxima()));
    let tree = ComparatorTree::of(&values::<u32, BINS>(word));
    keep((tree.peak(), tree.quadrant_maxima()));
}

#[inline(never)]
fn thresholds<W: CounterWidth>() {
    let threshold = Threshold::new(alpha(), count());
    keep((threshold.alpha(), threshold.minimum_count()));
    keep((any_rule().fits::<W>(), estimator().reach()));
    keep(WindowRule::width_for_pulse(alpha()));
    keep(*rule().threshold());
    keep(threshold.level::<W>(count()));
    keep(threshold.is_exceeded::<W>(count(), count()));
    keep(threshold.lowest_background::<W>(count()));
}

#[inline(never)]
fn histograms<const BINS: usize, W: CounterWidth>() {
    let gate = gate();
    let mut histogram = Histogram::<BINS, W>::new();
    while more() {
        histogram.add(half());
        histogram.add_batch(some(&values::<u16, 16>(half)));
        keep(histogram.add_frame(&values::<u8, BINS>(byte), &gate));
        keep(histogram.add_frame(&values::<u16, BINS>(half), &gate));
        keep(histogram.add_frame(&values::<u32, BINS>(word), &gate));
        keep((histogram.peak(), histogram.count(usize::from(half()))));
        let detection = detect(&histogram, &gate, &rule(), &estimator());
        keep(detection.map(|found| (found.position(), found.event(address(), cycle(), half()))));
        keep(detect(&histogram, &gate, &average_rule(), &estimator()));
        if let Some(rule) = window_rule() {
            keep(detect(&histogram, &gate, &rule, &estimator()));
        }

        // Another detection rule may ask about a peak of its own.
        let (bin, count) = (bin(), count());
        let peak = Peak { bin, count };
        keep(quadrant_background(histogram.counts(), &gate, peak.bin));
        keep(centroid(&histogram, &gate, peak, background_level()));
        keep(estimator().estimate(&histogram, &gate, peak, background_level()));
        if more() {
            histogram.clear();
        }
    }
    keep((histogram.total(), histogram.rejected()));
    keep((histogram.saturated(), histogram));
}

#[inline(never)]
fn excluded_bins<const BINS: usize, W: CounterWidth>() {
    let gate = gate::<BINS>();
    let mut histogram = Histogram::<BINS, W>::new();
    let mut excluded = ExcludedBins::new(byte());
    while more() {
        histogram.add_batch(some(&values::<u16, 16>(half)));
        excluded.push(bin());
        keep((
            excluded.echoes(),
            excluded.contains(half()),
            excluded.is_tail(bin()),
        ));
        keep((excluded.touches(half(), half()), excluded.bins_left(&gate)));
        keep(excluded.empty(&mut histogram));
        let (bin, count) = (bin(), count());
        let peak = Peak { bin, count };
        keep(rule().detect(&histogram, &gate, peak, &excluded));
        keep(average_rule().detect(&histogram, &gate, peak, &excluded));
        if let Some(rule) = window_rule() {
            keep(rule.detect(&histogram, &gate, peak, &excluded));
        }
    }
    keep(histogram);
}

/// Of a TDC with a dead time.
#[inline(never)]
fn live_counts<const BINS: usize, W: CounterWidth>() {
    let Some(rule) = window_rule() else {
        return;
    };
    let gate = gate::<BINS>();
    let mut histogram = Histogram::<BINS, W>::new();
    histogram.add_batch(some(&values::<u16, 16>(half)));
    let mut statistics = Statistics::default();
    statistics.add_photons_of(&histogram, word());
    keep(statistics);
    let mut excluded = ExcludedBins::new(byte());
    excluded.push(bin());
    let Some(counts) = LiveCounts::new(&histogram, &gate, &excluded, word(), half()) else {
        return;
    };
    keep((counts.live(half()), counts.brightest(half(), half())));
    keep(counts.is_left_out(double()));
    keep(rule.detect_live(&counts, more().then(bin)));
    keep(Tracking::new(rule, rule, half()).detect_live(&counts, bin()));
}

//! Single pixels of dtof-core.

use dtof_core::rule::z_for_levels;
use dtof_core::{
    AsyncPixel, Count8, Count10, Count16, Count20, Count24, CounterWidth, Detection, DetectionRule,
    EchoNumber, Histogram, OncePerBin, Statistics, WholeHistogram, z_for,
};

use crate::values::{
    address, any_rule, average_rule, byte, cycle, gate, half, keep, level, more, or_text, rule,
    settings, some, values, window_rule, word,
};

pub fn all() {
    for_bins::<8>();
    for_bins::<128>();
    pixels::<1024, Count10>();
    pixels::<1024, Count20>();
    once_per_bin::<8, 1>();
    once_per_bin::<128, 4>();
    once_per_bin::<1024, 32>();
}

fn for_bins<const BINS: usize>() {
    pixels::<BINS, Count8>();
    pixels::<BINS, Count10>();
    pixels::<BINS, Count16>();
    pixels::<BINS, Count24>();
}

#[inline(never)]
fn pixels<const BINS: usize, W: CounterWidth>() {
    keep(z_for::<BINS>(word(), &gate(), half(), half(), half()));
    keep(z_for_levels::<BINS>(
        word(),
        &gate(),
        half(),
        half(),
        half(),
        level(),
    ));
    pixels_with::<BINS, W, _>(rule());
    pixels_with::<BINS, W, _>(average_rule());
    if let Some(rule) = window_rule() {
        pixels_with::<BINS, W, _>(rule);
    }
    pixels_with::<BINS, W, _>(any_rule());
}

fn pixels_with<const BINS: usize, W: CounterWidth, R: DetectionRule>(rule: R) {
    let Some(mut config) = or_text(settings::<BINS, R>(rule).build()) else {
        return;
    };
    if more() {
        config = config.with_dead_time(half());
    }
    keep((config.x(), config.l1(), config.l2()));
    keep((*config.gate(), *config.rule(), *config.estimator()));
    keep((
        config.dead_time(),
        config.is_first_photon_only(),
        config.weighs_dead_time(),
        config.echoes(),
        config.echo_guard_bins(),
    ));
    keep(config.echo_wait());
    keep(
        config
            .tracking()
            .map(|tracking| (*tracking.near(), *tracking.far())),
    );
    let mut histogram = Histogram::<BINS, W>::new();
    histogram.add_batch(some(&values::<u16, 16>(half)));
    keep(config.add_frame(&mut histogram, &values::<u32, BINS>(word)));
    keep(
        config.detect_echoes(&mut histogram, word(), |echo, detection| {
            keep((echo, *detection));
        }),
    );
    let config = &config;
    let mut statistics = Statistics::default();
    let (mut whole, cycles) = (WholeHistogram::<BINS, W>::new(), u64::from(word()) << 8);
    let (bytes, halves) = (values::<u8, BINS>(byte), values::<u16, BINS>(half));
    let words = values::<u32, BINS>(word);
    let echo = |number: EchoNumber, detection: &Detection| keep((number, *detection));
    whole.decide(config, &bytes, cycles, &mut statistics, echo);
    whole.decide(config, &halves, cycles, &mut statistics, echo);
    whole.decide(config, &words, cycles, &mut statistics, echo);
    keep((*whole.gate(), whole.cycles(), whole.photons(config, &words)));
    let mut pixel = AsyncPixel::<BINS, W>::new(address());
    while more() {
        pixel.count(config, half());
        pixel.count_batch(config, some(&values::<u16, 16>(half)));
        pixel.count_frame(config, &values::<u16, BINS>(half));
        pixel.count_frame(config, &values::<u32, BINS>(word));
        keep(pixel.end_laser_cycle(config, &mut statistics, cycle()));
        let observed =
            pixel.end_laser_cycles_with(config, &mut statistics, cycle(), half(), |input| {
                keep((
                    input.histogram,
                    input.expected,
                    input.excluded,
                    input.cycles,
                ));
            });
        keep(observed);
        keep((pixel.has_event(), pixel.exposure()));
        if more() {
            keep(pixel.take_event());
        }
    }
    keep((pixel.address(), config.detect(pixel.histogram())));
    pixel.add_photons_to(&mut statistics);
    let mut sum = Statistics::default();
    sum += statistics;
    keep((sum, sum.photons()));
    keep(pixel.histogram().peak());
}

#[inline(never)]
fn once_per_bin<const BINS: usize, const WORDS: usize>() {
    let Some(config) = or_text(settings::<BINS, _>(any_rule()).build()) else {
        return;
    };
    let mut statistics = Statistics::default();
    let mut pixel = AsyncPixel::<BINS>::new(address());
    let mut bins = OncePerBin::<WORDS>::new();
    while more() {
        keep(bins.is_first(half()));
        let codes = values::<u16, 16>(half);
        pixel.count_once_per_bin(&config, &mut statistics, &mut bins, some(&codes));
        if more() {
            bins.end_laser_cycle();
        }
        keep(pixel.end_laser_cycles(&config, &mut statistics, cycle(), half()));
    }
    keep((pixel, statistics, OncePerBin::words(half().into())));
}

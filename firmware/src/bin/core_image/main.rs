//! The proof that `dtof-core` runs on a microcontroller as it says: an image
//! that uses all of it and links only if nothing in it can panic.
//!
//! The panic handler calls a function that exists nowhere, so one reachable
//! panic anywhere makes the linker refuse the image. What links is then searched
//! for floating point and allocation: `cargo xtask check-image` does both, with
//! `--all` for every target and profile.
//!
//! Every value comes from [`values::word`], about which the optimiser knows nothing, and
//! ends in [`values::keep`], so that nothing is worked out while compiling and nothing
//! is dropped. Each part below is a function of its own, whose name
//! `check-image` looks for in the image.
//!
//! The image is there to be linked and looked at, not to be run.

#![no_std]
#![no_main]

#[cfg(not(target_os = "none"))]
compile_error!("core-image is for targets without an operating system: cargo xtask check-image");

mod values;

use core::fmt::Write;
use core::panic::PanicInfo;
use core::ptr;

use dtof_core::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::events::{
    DynamicDepthConfig, DynamicDepthPixel, Reference, Reflectivity, RunningMean,
};
use dtof_core::paper::{ComparatorTree, Threshold, centroid, isqrt, quadrant_background};
use dtof_core::rule::{ExcludedBins, detect, z_for_levels};
use dtof_core::{
    AerDecoder, AerEncoder, AerWord, AnyRule, Array, AsyncPixel, BinIndex, BinPosition, BlockLevel,
    Count, Count8, Count10, Count16, Count24, CounterWidth, DetectionRule, EchoNumber, Flags,
    Histogram, Peak, RangeGate, Statistics, SubBinOffset, z_for,
};

use values::{
    Link, address, alpha, average_rule, background_level, bin, byte, change, count, cycle,
    distance, double, echo, estimator, event, flags, gate, half, keep, level, millimetres, more,
    or_text, position, rule, scale, settings, some, values, window_rule, word,
};

#[allow(unsafe_code, reason = "the linker knows the entry by this name")]
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    loop {
        units();
        roots();
        ranges();
        words();
        products();
        texts();
        for_bins::<8>();
        for_bins::<128>();
    }
}

fn for_bins<const BINS: usize>() {
    gates::<BINS>();
    trees::<BINS>();
    blocks::<BINS>();
    for_width::<BINS, Count8>();
    for_width::<BINS, Count10>();
    for_width::<BINS, Count16>();
    for_width::<BINS, Count24>();
}

fn for_width<const BINS: usize, W: CounterWidth>() {
    thresholds::<W>();
    histograms::<BINS, W>();
    excluded_bins::<BINS, W>();
    pixels::<BINS, W>();
}

#[inline(never)]
fn units() {
    keep((Count::new(word()), count()));
    keep((BinIndex::new(half()), bin()));
    keep(SubBinOffset::new(half().cast_signed()));
    keep(Flags::from_bits(byte()));
    keep((EchoNumber::new(byte()), echo(), echo().raw()));
    keep((BlockLevel::new(byte()), level(), level().pixels()));
    keep(flags().contains(flags()));
    keep(position().raw());
    keep(BinPosition::new(word().cast_signed()));
}

#[inline(never)]
fn roots() {
    keep(isqrt::<5>(word()));
    keep(isqrt::<8>(word()));
    keep(isqrt::<12>(word()));
    keep(isqrt::<16>(word()));
}

#[inline(never)]
fn ranges() {
    if let Some(scale) = scale() {
        keep((scale.range(position()), scale.range(event().position())));
        keep(scale.distance(word().cast_signed()));
        keep(scale.bins_of(distance()));
    }
}

/// The way out and the way back, the latter from bytes as a line may bring
/// them.
#[inline(never)]
fn words() {
    let mut encoder = AerEncoder::new();
    let mut decoder = AerDecoder::new();
    while more() {
        let (time, word) = encoder.encode(&event());
        keep((time.map(AerWord::to_le_bytes), word.to_le_bytes()));
        if let Some(change) = change() {
            let (time, word) = encoder.encode_dynamic_depth(&change);
            keep((time.map(AerWord::to_le_bytes), word.to_le_bytes()));
        }
        keep(decoder.decode(AerWord::from_le_bytes(values(byte))));
    }
    keep(AerWord::end(double(), word()).to_le_bytes());
}

/// The products of a pixel's events.
#[inline(never)]
fn products() {
    products_of::<1>();
    products_of::<3>();
    products_of::<10>();
    let mut reflectivity = Reflectivity::new();
    while more() {
        reflectivity.add(&event());
    }
    keep((reflectivity.events(), reflectivity.signal()));
    let range = millimetres();
    keep((reflectivity.of_events(range), reflectivity.of_signal(range)));
}

fn products_of<const N: usize>() {
    let reference = if more() {
        Reference::Previous
    } else {
        Reference::Reported
    };
    let config = scale().map(|scale| DynamicDepthConfig::new(distance(), &scale, reference));
    let Some(config) = config.and_then(or_text) else {
        return;
    };
    keep((config.threshold(), config.reference()));
    let mut pixel = DynamicDepthPixel::<N>::new();
    let mut mean = RunningMean::<N>::new();
    while more() {
        if let Some(change) = pixel.observe(&config, &event()) {
            keep((change.change(), change.polarity(), change));
        }
        mean.push(position());
        keep((mean.mean(), mean.len(), mean.is_empty(), mean.is_full()));
    }
    keep(pixel.recent().sum());
}

/// Every error and unit can be written out.
#[inline(never)]
fn texts() {
    keep(write!(Link, "{}", bin()));
    keep(write!(Link, "{}", count()));
    keep(write!(Link, "{}", flags()));
    keep(or_text(RangeGate::<8>::new(half(), half())));
    keep(or_text(settings::<8, _>(rule()).build()));
    keep(or_text(
        AerDecoder::new().decode(AerWord::from_le_bytes(values(byte))),
    ));
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

/// Arrays of any shape, pixels and first pixels of blocks that may lie in none.
#[inline(never)]
fn blocks<const BINS: usize>() {
    let Some(array) = Array::new(word(), word()) else {
        return;
    };
    keep((array.columns(), array.rows(), array.pixels()));
    keep((array.blocks(level()), array.block_of(address(), level())));
    let first = array.first_of(word(), level());
    array.pixels_of(first, level()).for_each(keep);
    array.pixels_of(address(), level()).for_each(keep);
    let Some(binning) = Binning::new(array, level()) else {
        return;
    };
    keep((binning.number_of_blocks(), BlockLink::NONE));
    let mut link = binning.link_of(address());
    let rule = window_rule().map_or(AnyRule::from(rule()), AnyRule::from);
    let rule = rule.of_blocks(level());
    let tracking = rule.tracking(&gate::<BINS>());
    let Some(config) = or_text(settings::<BINS, _>(rule).tracking(tracking).build()) else {
        return;
    };
    for place in binning.blocks() {
        let mut blocks = [Block::new(place)];
        let mut statistics = Statistics::default();
        while more() {
            count_in_blocks(&mut blocks, &link, &config, half());
            let (cycle, cycles) = (cycle(), half());
            let look =
                end_laser_cycles_of_blocks(&mut blocks, &config, &mut statistics, cycle, cycles);
            keep(look);
            link.tick(more());
            link.reported();
            keep(link.block());
            let [block] = &mut blocks;
            block.tick();
            keep((block.has_event(), block.take_event()));
            keep((block.pixel().level(), block.pixel().address()));
        }
        keep(statistics);
    }
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
    pixels_with::<BINS, W, _>(match window_rule() {
        Some(rule) => AnyRule::from(rule),
        None if more() => AnyRule::from(average_rule()),
        None => AnyRule::from(rule()),
    });
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
    let mut pixel = AsyncPixel::<BINS, W>::new(address());
    while more() {
        pixel.count(config, half());
        pixel.count_batch(config, some(&values::<u16, 16>(half)));
        pixel.count_frame(config, &values::<u16, BINS>(half));
        pixel.count_frame(config, &values::<u32, BINS>(word));
        keep(pixel.end_laser_cycle(config, &mut statistics, cycle()));
        keep(pixel.end_laser_cycles(config, &mut statistics, cycle(), half()));
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

#[allow(unsafe_code, reason = "what is declared here is never linked")]
// SAFETY: it exists nowhere, so that nothing calls it.
unsafe extern "C" {
    safe fn dtof_core_has_a_reachable_panic(info: *const ()) -> !;
}

/// Hands on what it is given, so that the place of a panic is still in the
/// image when `check-image` looks for it.
#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    dtof_core_has_a_reachable_panic(ptr::from_ref(info).cast())
}

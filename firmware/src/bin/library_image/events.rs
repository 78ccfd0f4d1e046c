//! Quantities of dtof-core, its words, and the results of events.

use core::fmt::Write;

use dtof_core::events::{
    DynamicDepthConfig, DynamicDepthPixel, Reference, Reflectivity, RunningMean,
};
use dtof_core::paper::isqrt;
use dtof_core::pixel_processor::{ProcessorEvent, ProcessorSettings};
use dtof_core::{
    AerDecoder, AerEncoder, AerWord, BinIndex, BinPosition, BlockLevel, Count, EchoNumber, Flags,
    RangeGate, SubBinOffset,
};

use crate::values::{
    Link, bin, byte, change, count, distance, double, echo, event, flags, half, keep, level,
    millimetres, more, or_text, position, rule, scale, settings, values, word,
};

pub fn all() {
    units();
    roots();
    ranges();
    words();
    products();
    texts();
    processor();
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

/// Settings for a pixel in programmable logic, and its events as its registers may have them.
#[inline(never)]
fn processor() {
    if let Some(config) = or_text(settings::<128, _>(rule()).build()) {
        keep(or_text(ProcessorSettings::of(&config)).map(|settings| settings.registers()));
    }
    let event = ProcessorEvent::from_registers(values(word));
    keep((event.word(), event.cycle()));
    keep(event.encode(&mut AerEncoder::new()));
    keep(or_text(event.depth_event()));
}

//! Where values come from, and where they go.

use core::array;
use core::fmt::{self, Write};
use core::hint::black_box;
use core::sync::atomic::AtomicU32;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::rule::{Tracking, background_from_count};
use dtof_core::{
    AnyRule, AverageRule, BinIndex, BinPosition, BlockLevel, CentredWindow, Count, DepthEstimator,
    DepthEvent, DetectionRule, EchoNumber, Flags, LaserCycle, PaperRule, PixelAddress, PixelConfig,
    PixelConfigBuilder, RangeGate, RangeScale, SubBinOffset, WindowRule,
};

/// Valid or not.
pub fn settings<const BINS: usize, R: DetectionRule>(rule: R) -> PixelConfigBuilder<BINS, R> {
    PixelConfig::with_rule(rule)
        .x(half())
        .l1(half())
        .l2(half())
        .gate(gate())
        .estimator(estimator())
        .dead_time(half())
        .tracking(more().then(|| Tracking::new(rule, rule, half())))
        .echoes(echo(), byte())
        .echo_wait(byte())
}

pub fn gate<const BINS: usize>() -> RangeGate<BINS> {
    RangeGate::new(half(), half()).unwrap_or(RangeGate::full())
}

pub fn scale() -> Option<RangeScale> {
    or_text(RangeScale::new(U16F16::from_bits(word()), millimetres()))
}

pub fn rule() -> PaperRule {
    PaperRule::new(alpha(), count())
}

pub fn average_rule() -> AverageRule {
    AverageRule::new(alpha(), count())
}

pub fn window_rule() -> Option<WindowRule> {
    let rule = WindowRule::new(byte(), U4F12::from_bits(half()), count());
    let rule = or_text(rule)?;
    keep((rule.width(), rule.z(), rule.minimum_count()));
    Some(rule)
}

pub fn any_rule() -> AnyRule {
    match window_rule() {
        Some(rule) => rule.into(),
        None if more() => average_rule().into(),
        None => rule().into(),
    }
}

pub fn estimator() -> DepthEstimator {
    let estimator = DepthEstimator::for_pulse(alpha());
    let window = if more() {
        CentredWindow::new(alpha())
    } else {
        CentredWindow::with_sides(alpha(), alpha())
    };
    match window {
        Some(window) => {
            keep((window.before(), window.after()));
            DepthEstimator::CentredWindow(window)
        }
        None if more() => estimator,
        None => DepthEstimator::Centroid3,
    }
}

/// A level with any fraction, or a whole one.
pub fn background_level() -> U24F8 {
    if more() {
        U24F8::from_bits(word())
    } else {
        background_from_count(count())
    }
}

pub fn event() -> DepthEvent {
    DepthEvent {
        pixel: address(),
        level: level(),
        echo: echo(),
        cycle: cycle(),
        exposure: half(),
        peak_bin: bin(),
        offset: offset(),
        peak_count: count(),
        background: count(),
        flags: flags(),
    }
}

/// Out of range as often as not.
pub fn change() -> Option<DynamicDepthEvent> {
    let position = BinPosition::new(word().cast_signed())?;
    DynamicDepthEvent::new(
        address(),
        level(),
        cycle(),
        position,
        word().cast_signed(),
        flags(),
    )
}

pub fn distance() -> U24F8 {
    U24F8::from_bits(word())
}

pub fn alpha() -> U8F8 {
    U8F8::from_bits(half())
}

pub fn millimetres() -> I24F8 {
    I24F8::from_bits(word().cast_signed())
}

pub fn position() -> BinPosition {
    BinPosition::of(bin(), offset())
}

pub fn offset() -> SubBinOffset {
    SubBinOffset::new(half().cast_signed()).unwrap_or(SubBinOffset::CENTRE)
}

pub fn flags() -> Flags {
    Flags::from_bits(byte()).unwrap_or(Flags::NONE) | Flags::CLIPPED
}

pub fn count() -> Count {
    Count::saturating(word())
}

pub fn bin() -> BinIndex {
    BinIndex::saturating(half())
}

pub fn address() -> PixelAddress {
    PixelAddress::new(half())
}

pub fn cycle() -> LaserCycle {
    LaserCycle::new(double())
}

/// Whether to go round again.
pub fn more() -> bool {
    word() != 0
}

/// The first of `all`: how many, the optimiser does not know either.
pub fn some<T>(all: &[T]) -> &[T] {
    all.get(..usize::from(half())).unwrap_or(all)
}

/// The same to change.
pub fn some_mut<T>(all: &mut [T]) -> &mut [T] {
    let end = usize::from(half()).min(all.len());
    all.get_mut(..end).unwrap_or_default()
}

pub fn one_of<T: Copy, const N: usize>(all: [T; N]) -> T {
    loop {
        if let Some(one) = all.get(usize::from(byte())) {
            return *one;
        }
    }
}

pub fn values<T, const N: usize>(one: fn() -> T) -> [T; N] {
    array::from_fn(|_| one())
}

pub fn level() -> BlockLevel {
    BlockLevel::saturating(byte())
}

pub fn echo() -> EchoNumber {
    EchoNumber::new(byte()).unwrap_or(EchoNumber::FIRST)
}

pub fn byte() -> u8 {
    let [byte, ..] = word().to_le_bytes();
    byte
}

pub fn half() -> u16 {
    let [low, high, ..] = word().to_le_bytes();
    u16::from_le_bytes([low, high])
}

pub fn double() -> u64 {
    u64::from(word()) << 32 | u64::from(word())
}

/// Where values come from.
static INPUT: AtomicU32 = AtomicU32::new(0);

/// Any value: a volatile read, as from a register that the hardware changes.
#[inline(never)]
pub fn word() -> u32 {
    #[allow(unsafe_code, reason = "only a volatile read is never optimised away")]
    // SAFETY: the pointer is to a static of this type, which nothing writes.
    unsafe {
        INPUT.as_ptr().read_volatile()
    }
}

/// Where values go: all of `value` has to be there, as something may look.
pub fn keep<T>(value: T) {
    black_box(value);
}

/// Without an error, which is written out.
pub fn or_text<T>(result: Result<T, impl fmt::Display>) -> Option<T> {
    result.map_err(|error| keep(write!(Link, "{error}"))).ok()
}

/// Takes text, or not.
pub struct Link;

impl Write for Link {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        keep(text);
        if more() { Ok(()) } else { Err(fmt::Error) }
    }
}

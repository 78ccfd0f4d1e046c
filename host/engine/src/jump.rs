//! Looks that decide nothing are skipped, so that laser cycles without photons cost nothing.
//!
//! Before L1 a look decides nothing. After a look without a peak, later ones find none either until a photon comes or
//! the exposure ends. A dead time is weighed by the laser cycles, so there this holds only of fewer photons than the
//! rule's minimum.

use dtof_core::{AnyRule, AsyncPixel, CounterWidth, PixelConfig};

/// Laser cycles from now on in which looks decide nothing, if no photon comes. `has_no_peak`: the last look found no
/// peak, and a later one does not without a photon.
pub fn idle_cycles<const BINS: usize, W: CounterWidth>(
    pixel: &AsyncPixel<BINS, W>,
    config: &PixelConfig<BINS, AnyRule>,
    has_no_peak: bool,
) -> u16 {
    let end = match has_no_peak {
        true => pixel.longest(config).saturating_sub(1),
        false => config.l1(),
    };
    end.max(config.l1()).saturating_sub(pixel.exposure())
}

/// Whether a look of a TDC with a dead time finds no peak, however many laser cycles pass: it has fewer photons than the
/// rule's minimum.
pub fn has_too_few_photons<const BINS: usize, W: CounterWidth>(
    pixel: &AsyncPixel<BINS, W>,
    config: &PixelConfig<BINS, AnyRule>,
) -> bool {
    let minimum = match config.rule() {
        AnyRule::Window(rule) => rule.minimum_count().raw(),
        AnyRule::Paper(_) | AnyRule::Average(_) => 0,
    };
    pixel.histogram().total() < minimum.max(1)
}

/// Laser cycles up to and with the first look after more than `idle` of them, `since_look` after the last look.
pub fn look_after(idle: u64, since_look: u16, x: u16) -> u64 {
    let (first, x) = (u64::from(x - since_look), u64::from(x));
    match idle.checked_sub(first) {
        Some(more) => first + more / x * x + x,
        None => first,
    }
}

/// `cycles` up to a look, or those up to the last look before the end of the `left` ones, or else all of these.
pub fn within(left: u16, cycles: u64, since_look: u16, x: u16) -> u16 {
    match u16::try_from(cycles) {
        Ok(cycles) if cycles <= left => cycles,
        _ => {
            let rest = after(since_look, left, x);
            if left > rest { left - rest } else { left }
        }
    }
}

/// Laser cycles since the last look, `cycles` later, with a look every `x`.
pub fn after(since_look: u16, cycles: u16, x: u16) -> u16 {
    let rest = (u32::from(since_look) + u32::from(cycles)) % u32::from(x);
    u16::try_from(rest).unwrap_or(0)
}

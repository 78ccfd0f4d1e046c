//! Reflectivity: how bright a surface is, whatever its distance.
//!
//! The light that returns from a surface falls with the square of its distance. So a count
//! times the square of the distance is the reflectivity, up to a factor that is the same for
//! all pixels (section III-B of the paper).
//!
//! - The paper counts events: [`Reflectivity::of_events`]. An event takes at least L1 laser
//!   cycles, so all bright surfaces look alike. For dark ones the number of events grows
//!   with the square of the brightness.
//! - Events also have the photons of the peak above the background, and the laser cycles of
//!   the exposure. Their ratio, over all events, is the signal a laser cycle:
//!   [`Reflectivity::of_signal`].
//!
//! Both are relative, and have these errors:
//!
//! - A part of the pulse lies outside the peak bin, more so if the pulse lies on an edge. A
//!   saturated peak counts too little.
//! - The paper's background is a maximum, so the signal above it reads low: at a background
//!   of 0.05 photons a bin and laser cycle and α = 4 by a quarter to a third for 0.05 signal
//!   photons, an eighth for 0.5 and almost nothing for 2. With a window rule it does not
//!   (`core/tests/events/reflectivity.rs`).
//! - Exposures without an event do not count, so pixels with many of them read high.
//! - Of an event that neighbours confirmed the photons are those of the window of the rule, which holds more of the
//!   pulse than its peak bin.
//! - Of a TDC with a dead time, [`Reflectivity::of_signal`] reads low behind early light: the peak
//!   was live in fewer laser cycles than the exposure has.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U48F16};
//! # use dtof_core::{
//! #     BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress,
//! #     SubBinOffset,
//! # };
//! use dtof_core::events::Reflectivity;
//! # let event = |cycle, exposure, peak| DepthEvent {
//! #     pixel: PixelAddress::new(0), level: BlockLevel::PIXEL, echo: EchoNumber::FIRST,
//! #     cycle: LaserCycle::new(cycle), exposure,
//! #     peak_bin: BinIndex::saturating(40), offset: SubBinOffset::CENTRE,
//! #     peak_count: Count::saturating(peak), background: Count::saturating(4),
//! #     flags: Flags::NONE,
//! # };
//! let mut pixel = Reflectivity::new();
//! pixel.add(&event(100, 40, 24)); // 20 of the signal in 40 laser cycles
//! pixel.add(&event(180, 80, 44)); // 40 in 80
//! let range = I24F8::from_num(1000); // mm
//! assert_eq!(pixel.of_events(range), 2_000_000); // 2 events × (1000 mm)²
//! assert_eq!(pixel.of_signal(range), U48F16::from_num(500_000)); // 0.5 a laser cycle × (1000 mm)²
//! ```

use fixed::types::{I24F8, U48F16};

use crate::event::DepthEvent;

/// The counts of the events of one pixel: 24 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reflectivity {
    events: u32,
    signal: u64,
    exposure: u64,
}

impl Reflectivity {
    /// Without events.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            events: 0,
            signal: 0,
            exposure: 0,
        }
    }

    /// Adds an event. The number of events saturates at 2³² − 1. Once the photons would exceed
    /// 2⁴⁸ − 1, neither they nor the laser cycles grow.
    #[inline]
    pub const fn add(&mut self, event: &DepthEvent) {
        self.events = self.events.saturating_add(1);
        let signal = event
            .peak_count
            .raw()
            .saturating_sub(event.background.raw());
        // 48 bits and 24.
        let signal = self.signal + signal as u64;
        if signal <= Self::MOST {
            self.signal = signal;
            self.exposure = self.exposure.saturating_add(event.exposure as u64);
        }
    }

    /// The number of events.
    #[must_use]
    pub const fn events(&self) -> u32 {
        self.events
    }

    /// Signal photons in the peak bin a laser cycle of the events' exposures, rounded
    /// down to 1/65536; 0 without events.
    #[inline]
    #[must_use]
    pub const fn signal(&self) -> U48F16 {
        match (self.signal << U48F16::FRAC_NBITS).checked_div(self.exposure) {
            Some(signal) => U48F16::from_bits(signal),
            None => U48F16::ZERO,
        }
    }

    /// The paper's reflectivity: the number of events times the square of the range in mm.
    /// Comparable between pixels that have counted equally long. Saturates at 64 bits, which
    /// 2³² events reach beyond 65 m.
    #[inline]
    #[must_use]
    pub const fn of_events(&self, range: I24F8) -> u64 {
        times_square(self.events as u64, range)
    }

    /// The signal a laser cycle times the square of the range in mm. Saturates at 2⁴⁸,
    /// which 1023 photons a laser cycle reach beyond 500 m.
    #[inline]
    #[must_use]
    pub const fn of_signal(&self, range: I24F8) -> U48F16 {
        U48F16::from_bits(times_square(self.signal().to_bits(), range))
    }

    const MOST: u64 = (1 << 48) - 1;
}

/// `value` times the square of the range in whole mm, limited to 64 bits.
const fn times_square(value: u64, range: I24F8) -> u64 {
    // 24 bits, their square 48.
    let millimetres = (range.to_bits().unsigned_abs() as u64 + (1 << 7)) >> 8;
    value.saturating_mul(millimetres * millimetres)
}

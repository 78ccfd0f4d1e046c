//! A simulated sensor. It draws random photons, to bring up a board with nothing attached and to
//! load it with known rates.
//!
//! In every laser cycle each pixel sees a Poisson count of photons. Each of them
//! is signal or background by their rates; a signal photon falls into the bins
//! of the pulse, a background photon into any bin. That is the same as two
//! independent Poisson counts. It computes in integers: every probability of a count is within 2⁻²⁶
//! of the exact one.
//!
//! The photons depend on the seed and the pixels alone: the n-th laser cycle is
//! the same whenever and however often the driver is polled. The time only decides
//! how many laser cycles are due; [`Simulated::without_clock`] ignores it.
//!
//! The example of the [crate] runs one.

mod poisson;
mod scene;

use core::convert::Infallible;
use core::fmt;
use core::num::NonZeroU16;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24, U16F16};
use rand_core::Rng;
use rand_pcg::Pcg32;

use crate::dither::Dither;
use crate::{PhotonSink, Polled, Sensor, SensorInfo};

pub use self::scene::scene;

use self::poisson::Poisson;

/// The stream of random numbers; any will do.
const STREAM: u64 = 0x6474_6f66;

/// The shape of the laser pulse.
#[derive(Clone, Copy, Debug)]
pub struct Pulse<'a>(&'a [U0F32]);

impl<'a> Pulse<'a> {
    /// The share of the photons in each bin of the pulse except the last, which
    /// takes the rest. Shares beyond a sum of 1 are ignored.
    #[must_use]
    pub const fn new(shares: &'a [U0F32]) -> Self {
        Self(shares)
    }

    /// Draws a bin, counted from the first of the pulse.
    fn draw(&self, random: &mut impl Rng) -> u16 {
        let mut rest = random.next_u32();
        let mut bin = 0;
        for share in self.0 {
            match rest.checked_sub(share.to_bits()) {
                Some(left) => rest = left,
                None => break,
            }
            bin += 1;
        }
        bin
    }
}

/// The photons of a pixel in a laser cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SimulatedPixel {
    address: PixelAddress,
    position: u16,
    photons: Poisson,
    /// The share of the signal, 32 fractional bits; 1 is 2³².
    signal: u64,
}

/// A pixel has more than 4 photons a laser cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct RateError;

impl fmt::Display for RateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // As a whole number: the text of a fraction could panic.
        let most = Poisson::MAX_MEAN.to_bits() >> U8F24::FRAC_NBITS;
        write!(f, "more than {most} photons a laser cycle in a pixel")
    }
}

impl core::error::Error for RateError {}

impl SimulatedPixel {
    /// The pulse starts in bin `position`; `signal` and `background` are mean
    /// photons a laser cycle, the latter over all bins.
    ///
    /// # Errors
    /// Returns [`RateError`] if they add up to more than 4.
    pub const fn new(
        address: PixelAddress,
        position: u16,
        signal: U8F24,
        background: U8F24,
    ) -> Result<Self, RateError> {
        let total = signal.saturating_add(background);
        let Some(photons) = Poisson::new(total) else {
            return Err(RateError);
        };
        let signal = ((signal.to_bits() as u64) << 32).checked_div(total.to_bits() as u64);
        let signal = match signal {
            Some(share) => share,
            None => 0,
        };
        Ok(Self {
            address,
            position,
            photons,
            signal,
        })
    }
}

/// The settings that all pixels share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// The seed of the random numbers.
    pub seed: u64,
    /// Bins the background falls into.
    pub bins: u16,
    /// The rate of the laser.
    pub cycles_per_second: u32,
    /// The most laser cycles of one poll. If more are due, the rest is skipped: a laser does not
    /// wait either.
    pub cycles_per_poll: NonZeroU16,
}

/// A simulated sensor.
#[derive(Clone, Debug)]
pub struct Simulated<'a> {
    pixels: &'a [SimulatedPixel],
    pulse: Pulse<'a>,
    settings: Settings,
    random: Pcg32,
    /// Between a start and a stop.
    is_started: bool,
    last_ms: Option<u32>,
    /// Thousandths of a laser cycle that are due.
    due: u64,
    skipped: u64,
}

impl<'a> Simulated<'a> {
    /// The first laser cycles are due a while after the first poll that follows [`Sensor::start`].
    #[must_use]
    pub fn new(pixels: &'a [SimulatedPixel], pulse: Pulse<'a>, settings: Settings) -> Self {
        Self {
            pixels,
            pulse,
            settings,
            random: Pcg32::new(settings.seed, STREAM),
            is_started: false,
            last_ms: None,
            due: 0,
            skipped: 0,
        }
    }

    /// The same photons without a clock: only [`Self::laser_cycles`] simulates, and the laser rate
    /// is unknown.
    #[must_use]
    pub const fn without_clock(mut self) -> Self {
        self.settings.cycles_per_second = 0;
        self
    }

    /// Laser cycles that were due but never simulated.
    #[must_use]
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Simulates the next laser cycles now, whatever the time. Returns [`Polled::Idle`] if `cycles`
    /// is 0.
    pub fn laser_cycles(&mut self, cycles: u16, sink: &mut impl PhotonSink) -> Polled {
        let pixels = self.pixels;
        // Laser cycles that have ended and are not reported yet.
        let mut over = 0;
        for _ in 0..cycles {
            for pixel in pixels {
                for _ in 0..pixel.photons.draw(&mut self.random) {
                    if over > 0 {
                        sink.end_laser_cycles(over);
                        over = 0;
                    }
                    let code = self.code(pixel);
                    sink.photon(pixel.address, code);
                }
            }
            over += 1;
        }
        if over > 0 {
            sink.end_laser_cycles(over);
            return Polled::Data;
        }
        Polled::Idle
    }

    /// Takes the whole laser cycles that are due.
    fn cycles(&mut self, now_ms: u32) -> u16 {
        let last_ms = self.last_ms.replace(now_ms).unwrap_or(now_ms);
        let elapsed = u64::from(now_ms.wrapping_sub(last_ms));
        self.due += elapsed * u64::from(self.settings.cycles_per_second);
        let due = self.due / 1000;
        self.due %= 1000;
        let most = self.settings.cycles_per_poll.get();
        let cycles = u16::try_from(due).unwrap_or(most).min(most);
        self.skipped = self.skipped.saturating_add(due - u64::from(cycles));
        cycles
    }

    #[allow(clippy::cast_possible_truncation, reason = "less than `bins`")]
    fn code(&mut self, pixel: &SimulatedPixel) -> u16 {
        if u64::from(self.random.next_u32()) < pixel.signal {
            let bin = self.pulse.draw(&mut self.random);
            return pixel.position.saturating_add(bin);
        }
        // From 0 to `bins - 1`: the upper part of a 32 × 16-bit product.
        let product = u64::from(self.random.next_u32()) * u64::from(self.settings.bins);
        (product >> 32) as u16
    }
}

impl Sensor for Simulated<'_> {
    type Error = Infallible;

    fn info(&self) -> SensorInfo {
        let addresses = self.pixels.iter().map(|pixel| pixel.address.raw());
        let pixels = addresses.max().map_or(0, |last| last.saturating_add(1));
        SensorInfo {
            laser_millihertz: 1000 * u64::from(self.settings.cycles_per_second),
            ..SensorInfo::new(pixels)
        }
    }

    fn start(&mut self, _: U16F16, _: Dither) {
        self.is_started = true;
        self.last_ms = None;
        self.due = 0;
    }

    fn stop(&mut self) {
        self.is_started = false;
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Infallible> {
        if !self.is_started {
            return Ok(Polled::Idle);
        }
        let cycles = self.cycles(now_ms);
        Ok(self.laser_cycles(cycles, sink))
    }
}

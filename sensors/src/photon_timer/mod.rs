//! A photon timer of shift registers: hardware fires the laser and samples a SPAD's pin at
//! every clock into memory, and this module finds the rising edges.
//!
//! It finds all photons of a laser cycle whose pulses, and the pauses between them, last a clock or
//! more. The processor's work is per laser cycle, not per sample.
//!
//! | clocks of a laser cycle | |
//! |---|---|
//! | 0 | the laser's pulse begins at its pin |
//! | 0 to 127 | bins 0 to 127 of [`BIN_PS`] |
//! | 128 to the next | not sampled: at least 8 clocks, see [`Config::unsampled_clocks`] |
//!
//! With [dither](Dither) the clocks from one laser pulse to the next are random; their mean is kept. The bins
//! begin with the laser's pulse in any case.
//!
//! Laser cycles whose samples are overwritten before they are read are lost. They are counted
//! ([`PhotonTimer::lost`]) and reported as an error. No laser cycle is read half old and half new.

mod config;
mod samples;

use core::error;
use core::fmt;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;

use crate::dither::Dither;
use crate::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

pub use self::config::{BINS, CLOCK_HZ, Config, ConfigError, Settings};
pub use self::samples::Samples;

/// The width of a bin, in picoseconds: a clock.
pub const BIN_PS: u16 = 8_000;

/// Laser cycles that are copied before a check for overwritten ones.
const BATCH: u32 = 16;
/// Batches of a poll.
const BATCHES: u32 = 8;

/// Hardware that fires a laser and fills a ring of memory with samples. Laser cycles are
/// numbered from 0 at the start on; after 2³² from 0 again.
pub trait Sampler {
    /// The number of last complete laser cycles whose samples are certainly in memory.
    const KEPT: u32;

    /// Begins with laser cycle 0. The range of `dither` is at most [`Config::most_dither`].
    fn start(&mut self, config: &Config, dither: Dither);
    /// Switches the laser off.
    fn stop(&mut self);
    /// How many laser cycles are complete.
    fn completed(&mut self) -> u32;
    /// The samples of a laser cycle; anything once they are overwritten.
    fn samples(&self, cycle: u32) -> Samples;
    /// Whether the memory took samples or gave the dither too slowly, so that samples came late.
    fn has_stalled(&self) -> bool;
}

/// The photons of one pixel. When it is dropped, the laser goes off.
#[derive(Debug)]
pub struct PhotonTimer<S: Sampler> {
    sampler: S,
    config: Config,
    dither: Dither,
    /// Between a start and a stop.
    is_started: bool,
    /// The laser fires. It starts after a pause of a whole laser cycle, so that no laser cycle is
    /// shorter than configured.
    fires: bool,
    /// The millisecond in which the laser went off, once known.
    off_since: Option<u32>,
    /// The laser cycle that is read next.
    next: u32,
    lost: u32,
    /// Samples copied from the ring: so many.
    batch: [Samples; BATCH as usize],
    copied: usize,
}

/// An error of a poll. The next poll goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error {
    /// This many laser cycles were overwritten before they were read.
    Lost(u32),
    /// Samples came late; those in memory are dropped.
    Stalled,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lost(cycles) => write!(
                f,
                "{cycles} laser cycles were overwritten before they were read"
            ),
            Self::Stalled => f.write_str("samples came late and are dropped"),
        }
    }
}

impl error::Error for Error {}

impl From<Error> for SensorFault {
    fn from(error: Error) -> Self {
        match error {
            Error::Lost(_) | Error::Stalled => Self::Data,
        }
    }
}

impl<S: Sampler> PhotonTimer<S> {
    /// A stopped timer.
    pub const fn new(sampler: S, config: Config) -> Self {
        Self {
            sampler,
            config,
            dither: Dither::OFF,
            is_started: false,
            fires: false,
            off_since: None,
            next: 0,
            lost: 0,
            batch: [Samples::DARK; BATCH as usize],
            copied: 0,
        }
    }

    /// Laser cycles that were overwritten before they were read, since the start. Neither they nor
    /// their photons count anywhere else.
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// Switches the laser off. The next poll after the pause starts it.
    fn rest(&mut self) {
        self.sampler.stop();
        (self.fires, self.off_since) = (false, None);
    }

    /// Copies the next complete laser cycles. Returns how many were lost before them, if any.
    fn copy(&mut self) -> Result<(), u32> {
        let waiting = self.sampler.completed().wrapping_sub(self.next).min(BATCH);
        self.copied = 0;
        for (place, count) in self.batch.iter_mut().zip(0..waiting) {
            *place = self.sampler.samples(self.next.wrapping_add(count));
            self.copied += 1;
        }
        // After reading: drop what was overwritten meanwhile.
        let age = self.sampler.completed().wrapping_sub(self.next);
        if age > S::KEPT {
            // With room for what comes until the next look.
            let lost = age - S::KEPT / 2;
            self.next = self.next.wrapping_add(lost);
            self.lost = self.lost.saturating_add(lost);
            return Err(lost);
        }
        self.next = self.next.wrapping_add(waiting);
        Ok(())
    }
}

/// Gives a batch to `sink`; laser cycles without a photon together.
fn give(batch: &[Samples], sink: &mut impl PhotonSink) {
    let mut ended = 0;
    for samples in batch {
        if !samples.is_dark() {
            if ended > 0 {
                sink.end_laser_cycles(ended);
                ended = 0;
            }
            samples.photons(|bin| sink.photon(PixelAddress::new(0), bin));
        }
        ended += 1;
    }
    if ended > 0 {
        sink.end_laser_cycles(ended);
    }
}

impl<S: Sampler> Sensor for PhotonTimer<S> {
    type Error = Error;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            bin_width: Some(U16F16::from_num(BIN_PS)),
            laser_millihertz: self.config.laser_millihertz(),
            most_dither: self.config.most_dither(),
            ..SensorInfo::new(1)
        }
    }

    fn start(&mut self, _: U16F16, dither: Dither) {
        self.dither = dither;
        self.is_started = true;
        self.rest();
    }

    fn stop(&mut self) {
        self.is_started = false;
        self.rest();
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Error> {
        if !self.fires {
            if !self.is_started {
                return Ok(Polled::Idle);
            }
            let since = *self.off_since.get_or_insert(now_ms);
            // The first of these milliseconds may be nearly over.
            if now_ms.wrapping_sub(since) <= self.config.period().div_ceil(CLOCK_HZ / 1000) {
                return Ok(Polled::Idle);
            }
            self.sampler.start(&self.config, self.dither);
            (self.fires, self.next) = (true, 0);
        }
        for round in 0..BATCHES {
            self.copy().map_err(Error::Lost)?;
            // After they were copied: those that came late are not to be looked at.
            if self.sampler.has_stalled() {
                self.rest();
                return Err(Error::Stalled);
            }
            give(self.batch.get(..self.copied).unwrap_or_default(), sink);
            if self.copied < self.batch.len() {
                let nothing = round == 0 && self.copied == 0;
                return Ok(if nothing { Polled::Idle } else { Polled::Data });
            }
        }
        Ok(Polled::Data)
    }
}

impl<S: Sampler> Drop for PhotonTimer<S> {
    fn drop(&mut self) {
        self.sampler.stop();
    }
}

#[cfg(test)]
mod tests;

//! A photon timer of shift registers: hardware fires the laser and samples a SPAD's pin at
//! every clock into memory, and this finds the rising edges.
//!
//! All photons of a laser cycle are found whose pulses are apart: a pulse has to be seen, so
//! that it lasts a clock or more, and so has the pause before the next. The processor works
//! a laser cycle, not a sample.
//!
//! | clocks of a laser cycle | |
//! |---|---|
//! | 0 | the laser's pulse begins at its pin |
//! | 0 to 127 | bins 0 to 127 of [`BIN_PS`] |
//! | 128 to the next | nobody looks: 5 at least, see [`Config::unsampled_clocks`] |
//!
//! Samples that are overwritten before they are read make lost laser cycles, which are
//! counted ([`PhotonTimer::lost`]) and an error. None is read half old and half new.

mod config;
mod samples;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::{About, PhotonSink, Polled, Sensor, SensorFault};
use heapless::Vec;

pub use self::config::{BINS, CLOCK_HZ, Config, ConfigError, Settings};
pub use self::samples::Samples;

/// The width of a bin, in picoseconds: a clock.
pub const BIN_PS: u16 = 8_000;

/// Laser cycles that are copied before it is seen whether they were still there.
const BATCH: u32 = 16;
/// Batches of a poll.
const BATCHES: u32 = 8;

/// Hardware that fires a laser and fills a ring of memory with samples. Laser cycles are
/// numbered from 0 at the start on; after 2³² from 0 again.
pub trait Sampler {
    /// Laser cycles whose samples are certainly in memory, of those that are complete.
    const KEPT: u32;

    /// Begins with laser cycle 0.
    fn start(&mut self, config: &Config);
    /// The laser rests.
    fn stop(&mut self);
    /// How many laser cycles are complete.
    fn completed(&mut self) -> u32;
    /// The samples of a laser cycle; anything once they are overwritten.
    fn samples(&self, cycle: u32) -> Samples;
    /// Whether the memory took samples too slowly, so that they came late.
    fn has_stalled(&self) -> bool;
}

/// The photons of one pixel.
#[derive(Debug)]
pub struct PhotonTimer<S> {
    sampler: S,
    config: Config,
    /// The laser fires. Before it starts it rests for a whole laser cycle, so that no start makes
    /// one shorter than was checked.
    fires: bool,
    /// The millisecond in which it has begun to rest, once that is known.
    rests_since: Option<u32>,
    /// The laser cycle that is read next.
    next: u32,
    lost: u32,
    /// What has been copied out of the ring.
    batch: Vec<Samples, { BATCH as usize }>,
}

/// A poll that went wrong. The next goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// So many laser cycles were overwritten before they were read.
    Lost(u32),
    /// Samples came late; all that are in memory are given up.
    Stalled,
}

impl From<Error> for SensorFault {
    fn from(error: Error) -> Self {
        match error {
            Error::Lost(_) | Error::Stalled => Self::Data,
        }
    }
}

impl<S: Sampler> PhotonTimer<S> {
    /// A timer that rests.
    pub const fn new(sampler: S, config: Config) -> Self {
        Self {
            sampler,
            config,
            fires: false,
            rests_since: None,
            next: 0,
            lost: 0,
            batch: Vec::new(),
        }
    }

    /// Laser cycles that were overwritten before they were read, since it was made. Their
    /// photons count nowhere; the laser cycles do not count either.
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// Lets the laser rest. The next poll that comes late enough starts it.
    fn rest(&mut self) {
        self.sampler.stop();
        (self.fires, self.rests_since) = (false, None);
    }

    /// Copies the next laser cycles that are complete. Says how many have been lost before
    /// them, if some have.
    fn copy(&mut self) -> Result<(), u32> {
        let waiting = self.sampler.completed().wrapping_sub(self.next).min(BATCH);
        self.batch.clear();
        for count in 0..waiting {
            let cycle = self.next.wrapping_add(count);
            // There is room: asked for above.
            let _ = self.batch.push(self.sampler.samples(cycle));
        }
        // After they were read: what was overwritten meanwhile is not to be looked at.
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
            samples.photons(|bin| sink.photon(PixelAddress(0), bin));
        }
        ended += 1;
    }
    if ended > 0 {
        sink.end_laser_cycles(ended);
    }
}

impl<S: Sampler> Sensor for PhotonTimer<S> {
    type Error = Error;

    fn about(&self) -> About {
        About {
            bin_width: Some(U16F16::from_num(BIN_PS)),
            offset: I24F8::ZERO,
            laser_millihertz: self.config.laser_millihertz(),
            ..About::new(1)
        }
    }

    fn start(&mut self, _: U16F16) {
        self.rest();
    }

    fn stop(&mut self) {
        self.rest();
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Error> {
        if !self.fires {
            let since = *self.rests_since.get_or_insert(now_ms);
            // The first of these milliseconds may be nearly over.
            if now_ms.wrapping_sub(since) <= self.config.period().div_ceil(CLOCK_HZ / 1000) {
                return Ok(Polled::Idle);
            }
            self.sampler.start(&self.config);
            (self.fires, self.next) = (true, 0);
        }
        for round in 0..BATCHES {
            self.copy().map_err(Error::Lost)?;
            // After they were copied: those that came late are not to be looked at.
            if self.sampler.has_stalled() {
                self.rest();
                return Err(Error::Stalled);
            }
            give(&self.batch, sink);
            if !self.batch.is_full() {
                let nothing = round == 0 && self.batch.is_empty();
                return Ok(if nothing { Polled::Idle } else { Polled::Data });
            }
        }
        Ok(Polled::Data)
    }
}

#[cfg(test)]
mod tests;

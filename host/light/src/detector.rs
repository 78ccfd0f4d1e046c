//! The path of a pixel's photons through all effects that are on.

use anyhow::Result;
use dtof_core::PixelAddress;
use rand_distr::{Distribution, Poisson, StandardUniform};
use rand_pcg::Pcg64;

use super::effects::Effects;
use super::effects::afterpulsing::Trap;
use super::effects::cover_glass::Crosstalk;
use super::effects::dead_time::Recharge;
use super::effects::jitter::TimingError;
use super::effects::limits::Timing;
use super::effects::other_lidar::{OtherLidar, OtherPulses};
use super::effects::second_echo::EchoDelay;
use super::effects::tail::TailDelay;
use super::effects::tdc::Tdc;
use super::stream::Stream;
use crate::rates::Rates;

/// A photon of the plain model.
pub(super) enum Arrival {
    /// In this bin, anywhere in it.
    Background(u16),
    /// At this position in bins, from the start of bin 0.
    Signal(f64),
}

/// The bin of a position within the histogram.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded down, within the bins"
)]
pub(super) fn code(position: f64) -> u16 {
    position as u16
}

/// The light, SPAD and TDC of one pixel. All times are in bins from the start of the laser cycle.
///
/// The background continues between the histogram and the next laser pulse. There it has no TDC
/// code, but blinds the SPAD. Signal photons before time 0 or after the next laser pulse are lost.
#[derive(Clone, Debug)]
pub(super) struct Detector {
    end: f64,
    period: f64,
    within_bin: Pcg64,
    second_echo: Option<EchoDelay>,
    cover_glass: Option<Crosstalk>,
    tail: Option<TailDelay>,
    other: Option<OtherPulses>,
    /// The additional background of a hot pixel.
    hot: Option<Background>,
    /// Background after the histogram, if it can change the histogram.
    gap: Option<Background>,
    recharge: Recharge,
    trap: Option<Trap>,
    jitter: Option<TimingError>,
    tdc: Tdc,
    /// Photons a laser cycle that effects add.
    added: f64,
    /// The most avalanches a photon.
    avalanches_each: f64,
    /// In this laser cycle: arrivals, and avalanches, which become measured times.
    times: Vec<f64>,
    avalanches: Vec<f64>,
}

impl Detector {
    pub(super) fn new(
        effects: &Effects,
        rates: &Rates,
        timing: &Timing,
        seed: u64,
        pixel: PixelAddress,
    ) -> Result<Self> {
        effects.check()?;
        let second_echo = effects.second_echo.as_ref();
        let cover_glass = effects.cover_glass.as_ref();
        let tail = effects.tail.as_ref();
        let dead_time = effects.dead_time.as_ref();
        let afterpulsing = effects.afterpulsing.as_ref();
        let jitter = effects.jitter.as_ref();
        let rng = |stream: Stream| stream.rng(seed, pixel);
        let end = f64::from(timing.bins);

        let mut hot_rng = rng(Stream::HotPixels);
        let multiple = match &effects.hot_pixels {
            Some(hot) if hot.is_hot(pixel, &mut hot_rng)? => hot.multiple,
            _ => 1.0,
        };
        let hot = Background::new((multiple - 1.0) * rates.background, 0.0, end, hot_rng)?;
        let timed = dead_time.is_some() || afterpulsing.is_some() || jitter.is_some();
        let gap_rate = if timed { multiple } else { 0.0 } * rates.background;
        let gap = Background::new(gap_rate, end, timing.period, rng(Stream::Gap))?;

        let other = effects.other_lidar.as_ref();
        let other_rate = other.map_or(0.0, OtherLidar::photons_per_cycle);
        let rate = |part: &Option<Background>| part.as_ref().map_or(0.0, |part| part.mean);
        let glass_rate = cover_glass.map_or(0.0, |glass| glass.signal);
        Ok(Self {
            end,
            period: timing.period,
            added: rate(&hot) + rate(&gap) + glass_rate + other_rate,
            avalanches_each: afterpulsing.map_or(1.0, |after| 1.0 / (1.0 - after.probability)),
            within_bin: rng(Stream::WithinBin),
            second_echo: second_echo
                .map(|echo| EchoDelay::new(echo, timing, rng(Stream::SecondEcho)))
                .transpose()?,
            cover_glass: cover_glass
                .map(|glass| Crosstalk::new(glass, rates.sigma, rng(Stream::CoverGlass)))
                .transpose()?,
            tail: tail
                .map(|tail| TailDelay::new(tail, rng(Stream::Tail)))
                .transpose()?,
            other: other
                .map(|other| OtherPulses::new(other, rates.sigma, timing, seed, pixel))
                .transpose()?,
            hot,
            gap,
            recharge: Recharge::new(dead_time, timing),
            trap: afterpulsing
                .map(|after| Trap::new(after, timing, rng(Stream::Afterpulsing)))
                .transpose()?,
            jitter: jitter
                .map(|jitter| TimingError::new(jitter, timing, rng(Stream::Jitter)))
                .transpose()?,
            tdc: effects.tdc.clone().unwrap_or_default(),
            times: Vec::new(),
            avalanches: Vec::new(),
        })
    }

    /// The most photons and afterpulses in a laser cycle, if the plain model has `plain` photons.
    pub(super) fn photons_per_cycle(&self, plain: f64) -> f64 {
        (plain + self.added) * self.avalanches_each
    }

    /// A laser cycle starts.
    pub(super) fn begin(&mut self) {
        let Self { times, tail, .. } = self;
        times.clear();
        if let Some(glass) = &mut self.cover_glass {
            glass.draw(|time| times.push(time + tail.as_mut().map_or(0.0, TailDelay::delay)));
        }
        if let Some(other) = &mut self.other {
            other.draw(|time| times.push(time));
        }
        for background in [&mut self.hot, &mut self.gap].into_iter().flatten() {
            background.draw(|time| times.push(time));
        }
    }

    /// A photon of the plain model, in any order.
    pub(super) fn arrive(&mut self, arrival: &Arrival) {
        self.times.push(match arrival {
            Arrival::Background(bin) => {
                let within: f64 = StandardUniform.sample(&mut self.within_bin);
                f64::from(*bin) + within
            }
            Arrival::Signal(position) => {
                let echo = self.second_echo.as_mut().map_or(0.0, EchoDelay::delay);
                position + echo + self.tail.as_mut().map_or(0.0, TailDelay::delay)
            }
        });
    }

    /// Ends the arrivals. Gives `photon` the TDC codes of this laser cycle, ascending.
    pub(super) fn finish(&mut self, photon: impl FnMut(u16)) {
        self.detect();
        if let Some(jitter) = &mut self.jitter {
            for time in &mut self.avalanches {
                *time = jitter.measured(*time, self.period);
            }
            self.avalanches.sort_unstable_by(f64::total_cmp);
        }
        let inside = self.avalanches.iter().filter(|time| **time < self.end);
        let codes = inside.map(|time| code(*time));
        self.tdc.hits(codes).for_each(photon);
    }

    /// Finds the photons and trapped charges that start an avalanche.
    fn detect(&mut self) {
        let period = self.period;
        self.times.retain(|time| (0.0..period).contains(time));
        self.times.sort_unstable_by(f64::total_cmp);
        self.avalanches.clear();
        let times = std::mem::take(&mut self.times);
        for arrival in times.iter().copied().chain([period]) {
            while let Some(release) = self.released_before(arrival) {
                self.avalanche(release);
            }
            if arrival < period {
                self.avalanche(arrival);
            }
        }
        self.times = times;
        self.recharge.end_laser_cycle(period);
        if let Some(trap) = &mut self.trap {
            trap.end_laser_cycle(period);
        }
    }

    fn released_before(&mut self, time: f64) -> Option<f64> {
        self.trap.as_mut()?.release_before(time)
    }

    /// Starts an avalanche at `time`, unless the SPAD is blind.
    fn avalanche(&mut self, time: f64) {
        if let Some(recharged) = self.recharge.avalanche(time) {
            self.avalanches.push(time);
            if let Some(trap) = &mut self.trap {
                trap.fill(recharged);
            }
        }
    }
}

/// Photons spread evenly over a part of the laser cycle.
#[derive(Clone, Debug)]
struct Background {
    photons: Poisson<f64>,
    /// Photons a laser cycle.
    mean: f64,
    from: f64,
    length: f64,
    rng: Pcg64,
}

impl Background {
    /// `rate` photons a bin; `None` without photons.
    fn new(rate: f64, from: f64, to: f64, rng: Pcg64) -> Result<Option<Self>> {
        let length = to - from;
        if rate * length <= 0.0 {
            return Ok(None);
        }
        Ok(Some(Self {
            photons: Poisson::new(rate * length)?,
            mean: rate * length,
            from,
            length,
            rng,
        }))
    }

    fn draw(&mut self, mut photon: impl FnMut(f64)) {
        let mut left = self.photons.sample(&mut self.rng);
        while left > 0.0 {
            left -= 1.0;
            let part: f64 = StandardUniform.sample(&mut self.rng);
            photon(self.from + part * self.length);
        }
    }
}

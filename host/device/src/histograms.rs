//! The histograms of all pixels of a device with a sensor, over many exposures.
//!
//! The pixels get the highest threshold, so that no event clears a histogram. The first exposures
//! are short and show how bright the brightest bin is. Later ones are as long as the counters allow.

use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule, PixelAddress};
use dtof_link::{FaultRecord, NoHistogram, Report, Source};

use super::assembly::HistogramAnswer;
use super::exposures::Exposures;
use super::{Client, HostTimeout, Stopped, Task};
use dtof_engine::settings::Settings;

/// Laser cycles between looks.
const X: u16 = 4;
/// Laser cycles of the first, the shortest and the longest exposures.
const FIRST: u16 = 64;
const SHORTEST: u16 = 16;
const LONGEST: u16 = 65_532;
/// Most photons that the brightest bin is expected to collect. A counter is full at 1023, twelve
/// standard deviations above.
const BRIGHTEST: f64 = 700.0;
/// Exposures are lengthened only by this factor or more.
const WORTH_IT: f64 = 1.5;
/// Longest time without new laser cycles.
const STALLED: Duration = Duration::from_secs(5);

/// Progress of a collection.
#[derive(Clone, Copy, Debug)]
pub struct SoFar {
    /// Time since the start.
    pub elapsed: Duration,
    /// Photons of the median pixel.
    pub photons: u64,
}

/// Collected histograms.
#[derive(Clone, Debug)]
pub struct Collected {
    /// Photons of each bin of each pixel.
    pub histograms: Vec<Vec<u64>>,
    /// Laser cycles of each pixel.
    pub cycles: Vec<u64>,
    /// Exposures that were left out for a full counter. Counted directly or by events, which only a
    /// full counter causes; the larger number.
    pub full: u64,
}

/// Collects histograms of `pixels` pixels, addresses 0 up, until `done` returns true; it is called
/// again and again. The bin width is that of `settings`. The sensor is off afterwards. It stops
/// sooner if this program is silent for `host_timeout`.
///
/// # Errors
/// Fails if the device refuses the configuration, disconnects, stops its sensor or measures nothing,
/// or if a pixel has no histogram at the end.
pub fn collect(
    client: &mut Client,
    settings: &Settings,
    pixels: u16,
    host_timeout: HostTimeout,
    mut done: impl FnMut(&SoFar) -> bool,
) -> Result<Collected> {
    let counter_bits = client.counter_bits()?;
    ensure!(
        counter_bits == 10,
        "the pixels of this device have counters of {counter_bits} bits: histograms to calibrate with need 10"
    );
    let mut exposures = Exposures::new(pixels, client.bins());
    let mut work = Collecting {
        client,
        settings,
        pixels,
        host_timeout,
        l2: FIRST,
        is_whole: false,
        events: 0,
        full: 0,
        first: Report::default(),
        started: Instant::now(),
        news: Instant::now(),
    };
    work.configure(Source::Sensor)?;
    work.first = work.check_running()?;
    while !work.round(&mut exposures, &mut done)? {
        work.adapt(&mut exposures)?;
    }
    exposures.close();
    work.check_running()?;
    work.configure(Source::Link)?;
    let events = if work.is_whole { 0 } else { work.events };
    let collected = Collected {
        histograms: exposures.sums().map(<[u64]>::to_vec).collect(),
        cycles: exposures.cycles().collect(),
        full: exposures.full().max(events),
    };
    if let Some(pixel) = collected.cycles.iter().position(|&cycles| cycles == 0) {
        ensure!(
            collected.full == 0,
            "pixel {pixel} has no histogram without a full counter: too much light"
        );
        bail!("no histogram of pixel {pixel} came in this time");
    }
    Ok(collected)
}

struct Collecting<'a> {
    client: &'a mut Client,
    settings: &'a Settings,
    pixels: u16,
    host_timeout: HostTimeout,
    l2: u16,
    /// The sensor itself counts histograms.
    is_whole: bool,
    /// Events so far. They mean nothing if the sensor counts histograms.
    events: u64,
    /// Exposures with a full counter so far.
    full: u64,
    /// The report at the start.
    first: Report,
    started: Instant,
    /// When the last new laser cycles arrived.
    news: Instant,
}

impl Collecting<'_> {
    fn configure(&mut self, source: Source) -> Result<()> {
        let highest = PaperRule::new(U8F8::MAX, Count::saturating(1023));
        let settings = self.settings.clone().with_bins(self.settings.bins);
        let settings = settings.configured(|device| {
            device.rule = highest.into();
            // The rule does not weigh bins, and no event is used.
            device.dead_time = Some(0);
            // Every photon is counted.
            device.once_per_bin = false;
            (device.x, device.l1, device.l2) = (X, X, self.l2);
        });
        let task = Task {
            settings: &settings,
            pixels: self.pixels,
            columns: self.pixels.into(),
            dynamic_depth: None,
            host_timeout: self.host_timeout,
        };
        self.client.configure(&task.configuration(source)?)?;
        self.news = Instant::now();
        Ok(())
    }

    /// The device's report. Fails if the sensor has stopped.
    fn check_running(&mut self) -> Result<Report> {
        let report = self.client.report()?;
        Stopped::check(&report, self.host_timeout)?;
        Ok(report)
    }

    /// Requests the histogram of every pixel once. Returns whether the collection is done.
    fn round(
        &mut self,
        exposures: &mut Exposures,
        done: &mut impl FnMut(&SoFar) -> bool,
    ) -> Result<bool> {
        let mut pixels = (0..self.pixels).map(PixelAddress::new);
        let mut next = pixels.next();
        while let Some(pixel) = next {
            let photons = exposures.median_photons();
            let Some(answer) = self.ask(pixel, photons, done)? else {
                return Ok(true);
            };
            self.events += self.client.take_events().len() as u64;
            match answer {
                Ok(histogram) => {
                    self.is_whole |= histogram.head.is_whole;
                    if exposures.add(histogram) {
                        self.news = Instant::now();
                    }
                    next = pixels.next();
                }
                // It is requested again.
                Err((_, NoHistogram::GivenUp | NoHistogram::Sensor)) => {}
                Err((pixel, none)) => bail!("no histogram of pixel {}: {none}", pixel.raw()),
            }
            self.check_news(true)?;
        }
        Ok(false)
    }

    /// The answer of a pixel; `None` if the collection is done before it comes.
    fn ask(
        &mut self,
        pixel: PixelAddress,
        photons: u64,
        done: &mut impl FnMut(&SoFar) -> bool,
    ) -> Result<Option<HistogramAnswer>> {
        let mut is_requested = false;
        loop {
            let elapsed = self.started.elapsed();
            if done(&SoFar { elapsed, photons }) {
                return Ok(None);
            }
            if !is_requested {
                self.client.request_histogram(pixel)?;
                is_requested = true;
            }
            if let Some(answer) = self.client.poll_histogram()? {
                return Ok(Some(answer));
            }
            self.check_news(false)?;
        }
    }

    /// Fails with the cause if nothing new has come for [`STALLED`].
    fn check_news(&mut self, answers: bool) -> Result<()> {
        if self.news.elapsed() < STALLED {
            return Ok(());
        }
        let report = self.check_running()?;
        let seconds = STALLED.as_secs();
        ensure!(
            answers || report.unknown == self.first.unknown,
            "the device does not know requests for histograms: its firmware is older than this program"
        );
        let errors = report.sensor_errors.wrapping_sub(self.first.sensor_errors);
        let last = FaultRecord::from_number(report.last_sensor_error);
        if let (1.., Some(fault)) = (errors, last) {
            bail!("no laser cycle for {seconds} seconds; sensor errors {errors} (last: {fault})");
        }
        ensure!(
            answers || self.is_whole,
            "the device does not answer a request for a histogram for {seconds} seconds"
        );
        bail!("no laser cycle for {seconds} seconds: is the laser on?");
    }

    /// Shortens exposures if a counter was full. Otherwise lengthens them as far as the counters
    /// allow, once there are enough laser cycles.
    fn adapt(&mut self, exposures: &mut Exposures) -> Result<()> {
        if self.is_whole {
            return Ok(());
        }
        // An event is sent if a counter was full between two looks.
        let full = exposures.full() + self.events;
        let l2 = if full > self.full {
            (self.l2 / 4).max(SHORTEST)
        } else {
            match exposures.brightest(self.l2) {
                Some(brightest) => longest(brightest).max(self.l2),
                None => self.l2,
            }
        };
        self.full = full;
        if l2 < self.l2 || f64::from(l2) >= WORTH_IT * f64::from(self.l2) {
            self.l2 = l2;
            exposures.close();
            // A sensor that has stopped is not restarted.
            self.check_running()?;
            self.configure(Source::Sensor)?;
        }
        Ok(())
    }
}

/// Laser cycles of the longest exposure with so many photons a laser cycle in the brightest bin.
fn longest(brightest: f64) -> u16 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cycles = (BRIGHTEST / brightest).min(LONGEST.into()) as u16;
    (cycles - cycles % X).max(SHORTEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_as_long_as_the_brightest_bin_allows() {
        assert_eq!(longest(0.0), LONGEST);
        assert_eq!(longest(1e-9), LONGEST);
        assert_eq!(longest(0.5), 1400);
        assert_eq!(longest(0.501), 1396);
        assert_eq!(longest(1000.0), SHORTEST);
        // They all have a look before their end.
        for l2 in [FIRST, SHORTEST, LONGEST] {
            assert!(l2.is_multiple_of(X) && l2 > 2 * X);
        }
    }
}

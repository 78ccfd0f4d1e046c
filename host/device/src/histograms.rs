//! The histograms of all pixels of a device with a sensor, over many exposures.
//!
//! Pixels are configured so that no event clears a histogram: the threshold is the highest there
//! is. The first exposures are short. They tell how bright the brightest bin is, and later ones are
//! as long as the counters allow.

use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule, PixelAddress};
use dtof_link::{FaultRecord, NoHistogram, Report, Source};

use super::assembly::HistogramAnswer;
use super::exposures::Exposures;
use super::{Client, HostTimeout, Stopped, configuration};
use dtof_engine::settings::Settings;

/// Laser cycles between looks.
const X: u16 = 4;
/// Laser cycles of the first exposures, of the shortest there may be, and of the longest.
const FIRST: u16 = 64;
const SHORTEST: u16 = 16;
const LONGEST: u16 = 65_532;
/// Photons that the brightest bin is to have, at most: a counter is full at 1023, twelve standard
/// deviations above it.
const BRIGHTEST: f64 = 700.0;
/// Exposures become longer only if by this factor.
const WORTH_IT: f64 = 1.5;
/// A device that gives nothing new for so long gives nothing.
const STALLED: Duration = Duration::from_secs(5);

/// How far it is.
#[derive(Clone, Copy, Debug)]
pub struct SoFar {
    /// Since it began.
    pub elapsed: Duration,
    /// Photons of the median pixel.
    pub photons: u64,
}

/// What was counted.
#[derive(Clone, Debug)]
pub struct Collected {
    /// Photons of each bin of each pixel.
    pub histograms: Vec<Vec<u64>>,
    /// Laser cycles of each pixel.
    pub cycles: Vec<u64>,
    /// Exposures with a full counter, which were left out: as they were seen, or as many as there
    /// were events, which only a full counter brings.
    pub full: u64,
}

/// Collects histograms of `pixels` pixels, addresses 0 up, until `done`, asked again and again,
/// says so. Bins are as wide as `settings` say. The sensor rests then. It stops sooner if this program
/// is silent for `host_timeout`.
///
/// # Errors
/// If the device refuses, is gone, stops its sensor or gives nothing, or a pixel has no histogram
/// when it is done.
pub fn collect(
    client: &mut Client,
    settings: &Settings,
    pixels: u16,
    host_timeout: HostTimeout,
    mut done: impl FnMut(&SoFar) -> bool,
) -> Result<Collected> {
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
    is_whole: bool,
    /// Of a sensor that gives whole histograms they mean nothing.
    events: u64,
    /// Exposures with a full counter that are known.
    full: u64,
    /// At the beginning.
    first: Report,
    started: Instant,
    /// When the last laser cycles came that are new.
    news: Instant,
}

impl Collecting<'_> {
    fn configure(&mut self, source: Source) -> Result<()> {
        let highest = PaperRule::new(U8F8::MAX, Count::saturating(1023));
        let settings = Settings {
            rule: highest.into(),
            gate: None,
            x: X,
            l1: X,
            l2: self.l2,
            ..self.settings.clone()
        };
        let columns = self.pixels.into();
        let wanted = configuration(
            &settings,
            self.pixels,
            columns,
            source,
            None,
            self.host_timeout,
        )?;
        self.client.configure(&wanted)?;
        self.news = Instant::now();
        Ok(())
    }

    /// A report of a sensor that runs.
    fn check_running(&mut self) -> Result<Report> {
        let report = self.client.report()?;
        Stopped::check(&report, self.host_timeout)?;
        Ok(report)
    }

    /// Asks every pixel once. Says whether that is all.
    fn round(
        &mut self,
        exposures: &mut Exposures,
        done: &mut impl FnMut(&SoFar) -> bool,
    ) -> Result<bool> {
        let mut pixels = (0..self.pixels).map(PixelAddress);
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
                // It is asked again.
                Err((_, NoHistogram::GivenUp | NoHistogram::Sensor)) => {}
                Err((pixel, none)) => bail!("no histogram of pixel {}: {none}", pixel.0),
            }
            self.check_news(true)?;
        }
        Ok(false)
    }

    /// The answer of a pixel; `None` if it is done before that comes.
    fn ask(
        &mut self,
        pixel: PixelAddress,
        photons: u64,
        done: &mut impl FnMut(&SoFar) -> bool,
    ) -> Result<Option<HistogramAnswer>> {
        let mut is_asked = false;
        loop {
            let elapsed = self.started.elapsed();
            if done(&SoFar { elapsed, photons }) {
                return Ok(None);
            }
            if !is_asked {
                self.client.request_histogram(pixel)?;
                is_asked = true;
            }
            if let Some(answer) = self.client.poll_histogram()? {
                return Ok(Some(answer));
            }
            self.check_news(false)?;
        }
    }

    /// Ends with what is wrong if nothing new has come for long.
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

    /// Makes exposures as long as the counters allow, once there are laser cycles enough to tell;
    /// or shorter if a counter was full.
    fn adapt(&mut self, exposures: &mut Exposures) -> Result<()> {
        if self.is_whole {
            return Ok(());
        }
        // An event leaves if a counter was full between two looks.
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
            // A sensor that has stopped is not started again.
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

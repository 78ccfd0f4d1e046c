#![doc = include_str!("../README.md")]
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod assembly;
mod client;
mod exposures;
pub mod histograms;
mod host_timeout;
pub mod monitor;
mod open;
mod port;
mod qemu;
pub mod setup;
mod stopped;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{Array, DepthEvent, PixelAddress, Statistics};
use dtof_link::endpoint::BODY_BYTES;
use dtof_link::{Configuration, DynamicDepth, Report, Source, Token, message};

pub use assembly::{HistogramAnswer, PixelHistogram};
pub use client::Client;
pub use host_timeout::HostTimeout;
pub use open::open;
pub use port::Port;
pub use setup::Setup;
pub use stopped::Stopped;

use dtof_data::events::aer_file::Event;
use dtof_data::options::Refused;
use dtof_data::photons::ranges::Ranges;
use dtof_data::photons::source::Slice;
use dtof_engine::Engine;
use dtof_engine::settings::Settings;

/// How the pixels of a device operate.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The settings of each pixel.
    pub settings: &'a Settings,
    /// Number of pixels, with addresses from 0.
    pub pixels: u16,
    /// Pixels in a row of the array.
    pub columns: u32,
    /// The device sends changes of depth in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
    /// The device stops its sensor once the host has been silent for so long.
    pub host_timeout: HostTimeout,
}

/// Checks that pixels of a device can have these settings.
///
/// # Errors
/// Fails if they ask for frames or for a single decision.
pub fn check_looks(settings: &Settings) -> Result<(), Refused> {
    let others = [
        ("frame", settings.frame.is_some()),
        ("decide_once", settings.decide_once),
    ];
    match others.iter().find(|(_, is_used)| *is_used) {
        Some((key, _)) => Err(Refused::new(
            *key,
            "is not for a device, which reports events",
        )),
        None => Ok(()),
    }
}

impl Task<'_> {
    /// From its events to millimetres.
    ///
    /// # Errors
    /// Fails if the settings break a constraint, or if there is not one offset for each pixel.
    pub fn ranges(&self) -> Result<Ranges> {
        let array = monitor::array(self.pixels, Some(self.columns));
        self.settings
            .ranges(array.context("the device has no pixels")?)
    }

    /// The configuration of a device that takes photons from `source`.
    ///
    /// # Errors
    /// Fails if the settings ask for frames or a single decision, or if the columns do not fit.
    pub fn configuration(&self, source: Source) -> Result<Configuration> {
        let settings = self.settings;
        check_looks(settings)?;
        // A laser that is not the device's is not its to dither. Without a dither the seed means nothing.
        let (dither_bins, dither_seed) = match (source, settings.configuration.dither_bins) {
            (Source::Link, _) | (_, 0) => (0, 0),
            (Source::Sensor, bins) => (bins, settings.configuration.dither_seed),
        };
        Ok(Configuration {
            dead_time: Some(settings.dead_time()),
            dither_bins,
            dither_seed,
            pixels: self.pixels,
            columns: u16::try_from(self.columns)?,
            source,
            dynamic_depth: self.dynamic_depth,
            host_timeout_ms: self.host_timeout.milliseconds(),
            ..settings.configuration
        })
    }
}

/// An engine that runs on a device: photons go out over the link, events come back.
pub struct DeviceEngine {
    client: Client,
    report: Report,
    /// Photons and laser cycles sent so far.
    sent: u64,
    cycles: u64,
}

impl DeviceEngine {
    /// Configures the device for the pixels `addresses`, which must be 0 up, and for photons from
    /// the link.
    ///
    /// # Errors
    /// Fails if the pixels or bins do not suit the device, or if it refuses the configuration.
    pub fn new(
        mut client: Client,
        settings: &Settings,
        array: Array,
        addresses: &[PixelAddress],
    ) -> Result<Self> {
        let consecutive = addresses
            .iter()
            .map(|address| address.raw())
            .eq((0..).take(addresses.len()));
        ensure!(consecutive, "a device has pixels 0 up, without gaps");
        ensure!(
            usize::from(client.bins()) == settings.bins,
            "the device has {} bins, not {}",
            client.bins(),
            settings.bins
        );
        setup::check_counter_bits(settings.counter_bits, client.counter_bits()?)?;
        let pixels = u16::try_from(addresses.len()).ok();
        let task = Task {
            settings,
            pixels: pixels.context("a device has at most 65,535 pixels")?,
            columns: array.columns(),
            dynamic_depth: None,
            host_timeout: HostTimeout::default(),
        };
        client.configure(&task.configuration(Source::Link)?)?;
        Ok(Self {
            client,
            report: Report::default(),
            sent: 0,
            cycles: 0,
        })
    }

    /// The device's report after the last slice.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }
}

impl Engine for DeviceEngine {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let cycles = slice.pixels.first().map_or(0, |pixel| pixel.cycles);
        if slice.pixels.iter().any(|pixel| pixel.cycles != cycles) {
            bail!("a device cannot replay pixels whose recordings end at different times");
        }
        let mut tokens = Tokens {
            client: &mut self.client,
            body: Vec::new(),
        };
        let photons = slice.pixels.iter().map(|pixel| &pixel.photons);
        let mut photons: Vec<_> = photons.map(|photons| photons.iter().peekable()).collect();
        for cycle in 0..cycles {
            let mut at = 0;
            for (pixel, photons) in photons.iter_mut().enumerate() {
                while let Some(photon) = photons.next_if(|photon| photon.cycle == cycle) {
                    at = tokens.photon(at, pixel, photon.code)?;
                }
            }
            tokens.push(Token::EndOfCycles { cycles: 1 })?;
        }
        tokens.flush()?;
        let events = self.client.synchronise()?.into_iter();
        let events = events.map(|event| match event {
            Event::Depth(event) => Ok(event),
            Event::DynamicDepth(_) => {
                bail!("the device sends changes of depth, which were not requested")
            }
        });
        let events = events.collect::<Result<_>>()?;
        self.report = self.client.report()?;
        self.cycles += u64::from(cycles);
        let photons = slice.pixels.iter().map(|pixel| pixel.photons.len());
        self.sent += photons.sum::<usize>() as u64;
        let accounted = self.report.statistics.photons();
        ensure!(
            accounted == self.sent && self.report.cycles == self.cycles,
            "the device accounts for {accounted} of {} photons and {} of {} laser cycles; it did not \
             understand {} messages",
            self.sent,
            self.report.cycles,
            self.cycles,
            self.report.unknown
        );
        Ok(events)
    }

    fn statistics(&self) -> [Statistics; 2] {
        [self.report.statistics, self.report.blocks]
    }
}

/// Packs tokens into photon messages.
struct Tokens<'a> {
    client: &'a mut Client,
    body: Vec<u8>,
}

impl Tokens<'_> {
    /// Adds a photon of `pixel`, where the current pixel is `at`. Returns the current pixel
    /// afterwards.
    fn photon(&mut self, mut at: usize, pixel: usize, code: u16) -> Result<usize> {
        // A photon takes at most three bytes and the advances from pixel 0, where a new message
        // begins.
        if self.body.len() + Token::MAX_BYTES + pixel.div_ceil(64) > BODY_BYTES {
            self.flush()?;
            at = 0;
        }
        while at < pixel {
            #[allow(clippy::cast_possible_truncation, reason = "at most 64")]
            let pixels = (pixel - at).min(64) as u8;
            self.push(Token::Advance { pixels })?;
            at += usize::from(pixels);
        }
        self.push(Token::Photon { code })?;
        Ok(at)
    }

    fn push(&mut self, token: Token) -> Result<()> {
        let token = token.to_bytes();
        if self.body.len() + token.len() > BODY_BYTES {
            self.flush()?;
        }
        self.body.extend(token);
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        self.client.send(message::PHOTONS, &self.body)?;
        self.body.clear();
        Ok(())
    }
}

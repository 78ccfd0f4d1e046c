//! A session with a device: events, reports, histograms and wishes, each in its turn.

use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, anyhow, ensure};
use dtof_core::PixelAddress;
use dtof_link::endpoint::LinkCounters;
use dtof_link::{Configuration, DynamicDepth, Refusal, Report, Source};

use super::{Answer, Command, Wish, Work, record, reply};
use crate::hub::Losses;
use dtof_device::monitor::losses::{Losses as Lost, since};
use dtof_device::monitor::{check_masked, leave_out_masked};
use dtof_device::setup::with_gate;
use dtof_device::{Client, HostTimeout, Setup, Stopped, configuration};
use dtof_engine::settings::{Rays, Run, Sensor, SettingsFile};
use dtof_photons::masked;

/// How often the device is asked what it does.
const REPORTS: Duration = Duration::from_millis(500);
/// How often it is asked for a histogram, of each pixel that is looked at in turn.
const HISTOGRAMS: Duration = Duration::from_millis(50);

/// What the command was given, and no page changes.
#[derive(Clone, Copy, Debug)]
pub struct Given {
    /// Pixels of the device, as many as it says if not given.
    pub pixels: Option<u16>,
    /// It is to send changes of depth in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
    /// It stops its sensor once this program has been silent for so long.
    pub host_timeout: HostTimeout,
}

/// A device that sends events.
pub struct Session<'a> {
    client: &'a mut Client,
    setup: Setup,
    given: Given,
    /// The sensor does not run any more, until settings are put in force.
    stopped: Option<Stopped>,
    /// The counts of both ends at the beginning.
    first: Report,
    here: LinkCounters,
    /// The report before, and when.
    last: (u64, Instant),
    asked: bool,
    reported: Instant,
    histogram: Option<Instant>,
    turn: usize,
}

impl<'a> Session<'a> {
    /// Puts settings in force; from now on events come.
    pub fn begin(
        client: &'a mut Client,
        said: SettingsFile,
        given: Given,
        work: &mut Work,
    ) -> Result<Self> {
        let setup = Setup::of(client, said, given.pixels)?;
        check_masked(&setup.settings)?;
        work.warn(&setup.warnings);
        let here = *client.counters();
        let mut session = Self {
            client,
            setup,
            given,
            stopped: None,
            first: Report::default(),
            here,
            last: (0, Instant::now()),
            asked: false,
            reported: Instant::now(),
            histogram: None,
            turn: 0,
        };
        session.configure(session.setup.clone(), work)?;
        session.first = session.client.report()?;
        work.hub.connection("live", "");
        let first = session.first;
        session.check_running(&first, work);
        Ok(session)
    }

    /// What was said, without what the device says.
    pub fn asked(&self) -> SettingsFile {
        self.setup.asked.clone()
    }

    /// Goes on until it is stopped: the device rests then.
    ///
    /// # Errors
    /// If the device is gone; says so if its sensor had stopped before.
    pub fn run(&mut self, work: &mut Work) -> Result<()> {
        let ended = self.go_on(work);
        // What has arrived before the device was gone, too.
        self.take(work);
        match self.stopped {
            Some(stopped) => ended.context(stopped),
            None => ended,
        }
    }

    /// Tells pages that the sensor has stopped.
    fn check_running(&mut self, report: &Report, work: &Work) {
        let Err(stopped) = Stopped::check(report, self.given.host_timeout) else {
            return;
        };
        if self.stopped.replace(stopped).is_none() {
            let reason = starts_again(&stopped.to_string());
            work.hub.connection("stopped", &reason);
            work.complain(&reason);
        }
    }

    fn go_on(&mut self, work: &mut Work) -> Result<()> {
        while !work.is_stopped() {
            if let Ok(command) = work.commands.try_recv() {
                self.fulfil(command, work)?;
            }
            if !self.asked && self.reported.elapsed() >= REPORTS {
                self.client.request_report()?;
                self.asked = true;
            }
            // A report that comes while a request waits for room would be in its way.
            let due = self.histogram.is_none_or(|at| at.elapsed() >= HISTOGRAMS);
            if due && !self.asked {
                self.ask_for_histogram(work)?;
            }
            self.exchange(work)?;
        }
        self.drain(work)?;
        let resting = self.configuration(&self.setup, Source::Link)?;
        let rested = self.client.configure(&resting);
        self.take(work);
        rested
    }

    /// Takes what has arrived.
    fn exchange(&mut self, work: &mut Work) -> Result<()> {
        let polled = self.client.poll_report();
        // What came before the device was gone, too.
        self.take(work);
        if let Some(report) = polled? {
            self.asked = false;
            self.reported = Instant::now();
            self.tell(&report, work);
        }
        while let Some(answer) = self.client.take_histogram() {
            self.histogram = Some(Instant::now());
            work.hub.histogram(&answer);
        }
        Ok(())
    }

    /// Waits for a report that is on its way.
    fn drain(&mut self, work: &mut Work) -> Result<()> {
        while self.asked {
            self.exchange(work)?;
        }
        Ok(())
    }

    fn ask_for_histogram(&mut self, work: &Work) -> Result<()> {
        let pixels = work.hub.watched();
        let is_there = |pixel: &&u16| **pixel < self.setup.pixels;
        let pixels: Vec<_> = pixels.iter().filter(is_there).collect();
        if pixels.is_empty() {
            return Ok(());
        }
        self.turn = (self.turn + 1) % pixels.len();
        // The next is asked for once this one has come: one is on its way at a time.
        self.histogram = Some(Instant::now() + Duration::from_secs(1 << 30));
        let pixel = PixelAddress(*pixels[self.turn]);
        self.client.request_histogram(pixel)
    }

    /// Records and shows the events that have arrived, but for those of masked pixels.
    fn take(&mut self, work: &mut Work) {
        let mut events = self.client.take_events();
        if events.is_empty() {
            return;
        }
        let masked = leave_out_masked(&mut events, &self.setup.settings);
        work.recorder.write(&events, &mut work.recorded);
        work.hub.events(&events, masked);
        work.tell_recorded();
    }

    fn tell(&mut self, report: &Report, work: &Work) {
        self.check_running(report, work);
        let photons = report.statistics.photons();
        let (before, at) = self.last;
        let seconds = at.elapsed().as_secs_f64().max(1e-3);
        let lost = Lost {
            first: &self.first,
            here: &since(self.client.counters(), &self.here),
        };
        work.hub.losses(Losses {
            cycles: report.cycles,
            photons,
            photon_rate: photons.saturating_sub(before) as f64 / seconds,
            counts: lost.counts(report).to_vec(),
            last_fault: lost.last_fault(report),
        });
        self.last = (photons, Instant::now());
    }

    fn fulfil(&mut self, command: Command, work: &mut Work) -> Result<()> {
        let done = match command.wish {
            Wish::Settings(text) => return self.change(&text, command.answer, work),
            Wish::Save => {
                let said = self.setup.said.with(&self.setup.settings);
                let folder = work.recorder.folder();
                let saved = self.client.exchange_during(|| folder.save(&said));
                saved.map(|path| format!("Saved as {}.", path.display()))
            }
            Wish::Record(on) => {
                let header = self.setup.header();
                let (recorder, recorded) = (&mut work.recorder, &mut work.recorded);
                let of = || record(recorder, recorded, on, Some(&header));
                let done = self.client.exchange_during(of);
                work.tell_recorded();
                done
            }
            Wish::Play(_) => Err(anyhow!("a device does not wait")),
        };
        reply(command.answer, done);
        Ok(())
    }

    /// Puts other settings in force, unless they are wrong or the device refuses them: then the old
    /// ones stay.
    fn change(&mut self, text: &str, answer: Answer, work: &mut Work) -> Result<()> {
        let setup = match self.changed_setup(text) {
            Ok(setup) => setup,
            Err(error) => {
                reply(answer, Err(error));
                return Ok(());
            }
        };
        self.drain(work)?;
        match self.configure(setup, work) {
            Ok(()) => {
                reply(answer, Ok("The settings are in force.".to_owned()));
                Ok(())
            }
            Err(error) if error.downcast_ref::<Refusal>().is_some() => {
                reply(answer, Err(error));
                Ok(())
            }
            Err(error) => {
                reply(answer, Err(anyhow!("{error:#}")));
                Err(error)
            }
        }
    }

    fn changed_setup(&self, text: &str) -> Result<Setup> {
        let [asked, said] = [&self.setup.asked, &self.setup.said];
        let [asked, said] = [Self::changed(asked, text)?, Self::changed(said, text)?];
        let bins = self.client.bins();
        let said = with_gate(said, self.setup.measured_bins, bins);
        ensure!(
            said.sensor.bins.is_none_or(|of| of == bins),
            "the device has {bins} bins"
        );
        let setup = Setup {
            settings: said.settings(bins.into())?,
            said,
            asked,
            ..self.setup.clone()
        };
        masked::check(&setup.settings.masked, setup.pixels.into())?;
        check_masked(&setup.settings)?;
        self.configuration(&setup, Source::Sensor)?;
        Ok(setup)
    }

    fn configuration(&self, setup: &Setup, source: Source) -> Result<Configuration> {
        let columns = setup.array.columns();
        let (depth, host_timeout) = (self.given.dynamic_depth, self.given.host_timeout);
        let (settings, pixels) = (&setup.settings, setup.pixels);
        configuration(settings, pixels, columns, source, depth, host_timeout)
    }

    /// Puts a setup in force. Events from before are taken as they were; a recording goes on in
    /// another file, as laser cycles begin at 0.
    fn configure(&mut self, mut setup: Setup, work: &mut Work) -> Result<()> {
        setup.began = SystemTime::now();
        let wanted = self.configuration(&setup, Source::Sensor)?;
        let configured = self.client.configure(&wanted);
        self.take(work);
        configured?;
        // A histogram that came meanwhile is one of before.
        while self.client.take_histogram().is_some() {
            self.histogram = None;
        }
        // A disk that is full is told to pages.
        let (recorder, recorded) = (&mut work.recorder, &mut work.recorded);
        let _ = self.client.exchange_during(|| recorder.end_file(recorded));
        work.hub.begin(&setup);
        work.recorder.resume(&setup.header(), &mut work.recorded);
        work.tell_recorded();
        self.last = (0, Instant::now());
        self.setup = setup;
        if self.stopped.take().is_some() {
            work.hub.connection("live", "");
        }
        Ok(())
    }

    /// What was said before, with what a page says in place of it.
    ///
    /// # Errors
    /// What is wrong with the text, or that something cannot change while the device runs.
    pub fn changed(before: &SettingsFile, text: &str) -> Result<SettingsFile> {
        let new = SettingsFile::parse(text)?;
        let changes = Sensor {
            gate: new.sensor.gate,
            masked: new.sensor.masked.clone(),
            sigma_bins: new.sensor.sigma_bins,
            one_hit_tdc: new.sensor.one_hit_tdc,
            ..Sensor::default()
        };
        ensure!(
            new.sensor == changes && new.rays == Rays::default() && new.run == Run::default(),
            "only gate, masked, sigma_bins, one_hit_tdc and the keys of [detection] can change while \
             the device runs"
        );
        Ok(SettingsFile {
            sensor: Sensor {
                gate: changes.gate,
                masked: changes.masked,
                sigma_bins: changes.sigma_bins,
                one_hit_tdc: changes.one_hit_tdc,
                ..before.sensor.clone()
            },
            detection: new.detection,
            rays: before.rays.clone(),
            run: before.run.clone(),
            file: None,
        })
    }
}

/// Why a sensor has stopped, and what a reader of the page can do.
pub fn starts_again(reason: &str) -> String {
    format!("{reason}; the button \"Put in force\" starts it again")
}

//! A session with a device: events, reports, histograms and commands in turn.

use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, anyhow, ensure};
use dtof_core::PixelAddress;
use dtof_link::endpoint::LinkCounters;
use dtof_link::{Configuration, Refusal, Report, Source};

use super::{Answer, Command, Device, FeedContext, PageRequest, reply};
use crate::hub::Losses;
use dtof_device::monitor::losses::{self, since};
use dtof_device::monitor::{check_masked, leave_out_masked};
use dtof_device::{Client, Setup, Stopped};
use dtof_engine::settings::{RaySettings, RunSettings, SensorSettings, SettingsFile};

/// Interval of the device's reports.
const REPORTS: Duration = Duration::from_millis(500);
/// Interval of histograms. The pixels that pages show take turns.
const HISTOGRAMS: Duration = Duration::from_millis(50);

/// A session with a device that sends events.
pub struct Session<'a> {
    client: &'a mut Client,
    setup: Setup,
    device: &'a Device,
    /// Set if the sensor has stopped. It starts again when settings are applied.
    stopped: Option<Stopped>,
    /// The counts of device and host when the settings were applied.
    first: Report,
    here: LinkCounters,
    /// Photons in the last report, and its time.
    last: (u64, Instant),
    /// A report was requested and has not arrived.
    awaits_report: bool,
    reported: Instant,
    histogram: Option<Instant>,
    turn: usize,
}

impl<'a> Session<'a> {
    /// Configures the device with the `requested` settings. Events come from now on.
    pub fn begin(
        client: &'a mut Client,
        device: &'a Device,
        requested: SettingsFile,
        context: &mut FeedContext,
    ) -> Result<Self> {
        let setup = Setup::of(client, requested, device.pixels)?;
        check_masked(&setup.settings)?;
        context.warn(&setup.warnings);
        let here = *client.counters();
        let mut session = Self {
            client,
            setup,
            device,
            stopped: None,
            first: Report::default(),
            here,
            last: (0, Instant::now()),
            awaits_report: false,
            reported: Instant::now(),
            histogram: None,
            turn: 0,
        };
        session.configure(session.setup.clone(), context)?;
        context.hub.set_connection("live", "");
        let first = session.first;
        session.check_running(&first, context);
        Ok(session)
    }

    /// The options, without the device's own values.
    pub fn requested(&self) -> SettingsFile {
        self.setup.requested.clone()
    }

    /// Runs until it is stopped, then stops the sensor.
    ///
    /// # Errors
    /// Fails if the device is gone. The error also says if its sensor had stopped before.
    pub fn run(&mut self, context: &mut FeedContext) -> Result<()> {
        let ended = self.go_on(context);
        // Events may have arrived before the device was gone.
        self.take_events(context);
        match self.stopped {
            Some(stopped) => ended.context(stopped),
            None => ended,
        }
    }

    /// Tells pages that the sensor has stopped.
    fn check_running(&mut self, report: &Report, context: &FeedContext) {
        let Err(stopped) = Stopped::check(report, self.device.host_timeout) else {
            return;
        };
        if self.stopped.replace(stopped).is_none() {
            let reason = with_restart_hint(&stopped.to_string());
            context.hub.set_connection("stopped", &reason);
            context.complain(&reason);
        }
    }

    fn go_on(&mut self, context: &mut FeedContext) -> Result<()> {
        while !context.is_stopped() {
            if let Ok(request) = context.requests.try_recv() {
                self.execute(request, context)?;
            }
            if !self.awaits_report && self.reported.elapsed() >= REPORTS {
                self.client.request_report()?;
                self.awaits_report = true;
            }
            // While a request waits for room in the window, a report would be unexpected.
            let due = self.histogram.is_none_or(|at| at.elapsed() >= HISTOGRAMS);
            if due && !self.awaits_report {
                self.request_histogram(context)?;
            }
            self.exchange(context)?;
        }
        if let Some(lost) = self.last_losses(context)? {
            context.complain(&format!("lost at the end: {lost}"));
        }
        let configuration = self.configuration(&self.setup, Source::Link)?;
        let stopped = self.client.configure(&configuration);
        self.take_events(context);
        stopped
    }

    /// Takes events, a report and histograms that have arrived.
    fn exchange(&mut self, context: &mut FeedContext) -> Result<()> {
        let polled = self.client.poll_report();
        // Events may have arrived before the device was gone.
        self.take_events(context);
        if let Some(report) = polled? {
            self.awaits_report = false;
            self.reported = Instant::now();
            self.show(&report, context);
        }
        while let Some(answer) = self.client.take_histogram() {
            self.histogram = Some(Instant::now());
            context.hub.add_histogram(&answer);
        }
        Ok(())
    }

    /// Waits for a requested report.
    fn drain(&mut self, context: &mut FeedContext) -> Result<()> {
        while self.awaits_report {
            self.exchange(context)?;
        }
        Ok(())
    }

    /// Shows the last report before the device is configured anew, which clears its counts. Returns the
    /// losses, if there are any.
    fn last_losses(&mut self, context: &mut FeedContext) -> Result<Option<String>> {
        self.drain(context)?;
        let report = self.client.report()?;
        self.take_events(context);
        self.show(&report, context);
        let here = &since(self.client.counters(), &self.here);
        let first = &self.first;
        let line = losses::Losses { first, here }.line(&report);
        Ok(line.strip_prefix(", ").map(str::to_owned))
    }

    fn request_histogram(&mut self, context: &FeedContext) -> Result<()> {
        let pixels = context.hub.watched();
        let exists = |pixel: &&u16| **pixel < self.setup.pixels;
        let pixels: Vec<_> = pixels.iter().filter(exists).collect();
        if pixels.is_empty() {
            return Ok(());
        }
        self.turn = (self.turn + 1) % pixels.len();
        // One request at a time: the next is sent after the answer to this one.
        self.histogram = Some(Instant::now() + Duration::from_secs(1 << 30));
        let pixel = PixelAddress::new(*pixels[self.turn]);
        self.client.request_histogram(pixel)
    }

    /// Records and shows the events that have arrived, except those of masked pixels.
    fn take_events(&mut self, context: &mut FeedContext) {
        let mut events = self.client.take_events();
        if events.is_empty() {
            return;
        }
        let masked = leave_out_masked(&mut events, &self.setup.settings);
        context.recorder.write(&events);
        context.hub.add_masked(masked);
        context.hub.add_events(&events);
        context.show_recording();
    }

    /// Shows rates and losses.
    fn show(&mut self, report: &Report, context: &FeedContext) {
        self.check_running(report, context);
        let photons = report.statistics.photons();
        let (before, at) = self.last;
        let seconds = at.elapsed().as_secs_f64().max(1e-3);
        let losses = losses::Losses {
            first: &self.first,
            here: &since(self.client.counters(), &self.here),
        };
        context.hub.set_losses(Losses {
            cycles: report.cycles,
            photons,
            photon_rate: photons.saturating_sub(before) as f64 / seconds,
            counts: losses.counts(report).to_vec(),
            last_fault: losses.last_fault(report),
        });
        self.last = (photons, Instant::now());
    }

    fn execute(&mut self, request: PageRequest, context: &mut FeedContext) -> Result<()> {
        let done = match request.command {
            Command::Settings(text) => return self.change(&text, request.answer, context),
            Command::Save => {
                let effective = self.setup.effective.with_settings(&self.setup.settings);
                let folder = context.recorder.folder();
                let saved = self.client.exchange_during(|| folder.save(&effective));
                saved.map(|path| format!("Saved as {}.", path.display()))
            }
            Command::Record(on) => {
                let setup = &self.setup;
                let recorder = &mut context.recorder;
                let done = self
                    .client
                    .exchange_during(|| recorder.switch(on, Some(setup)));
                context.show_recording();
                done
            }
            Command::Play(_) | Command::Seek(_) | Command::Speed(_) => {
                Err(anyhow!("a device cannot be paused"))
            }
        };
        context.reply(request.answer, done);
        Ok(())
    }

    /// Applies other settings. If they are wrong or the device refuses them, the old ones stay.
    fn change(&mut self, text: &str, answer: Answer, context: &mut FeedContext) -> Result<()> {
        let setup = match self.changed_setup(text) {
            Ok(setup) => setup,
            Err(error) => {
                reply(answer, Err(error));
                return Ok(());
            }
        };
        let lost = match self.last_losses(context) {
            Ok(lost) => lost,
            Err(error) => {
                reply(answer, Err(anyhow!("{error:#}")));
                return Err(error);
            }
        };
        match self.configure(setup, context) {
            Ok(()) => {
                let lost = lost.map_or(String::new(), |lost| format!(" Lost until then: {lost}."));
                reply(answer, Ok(format!("The settings are applied.{lost}")));
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
        let requested = Self::changed(&self.setup.requested, text)?;
        let setup = self.setup.with_requested(requested)?;
        check_masked(&setup.settings)?;
        self.configuration(&setup, Source::Sensor)?;
        Ok(setup)
    }

    fn configuration(&self, setup: &Setup, source: Source) -> Result<Configuration> {
        let device = self.device;
        let task = setup.task(device.dynamic_depth, device.host_timeout);
        task.configuration(source)
    }

    /// Applies a setup. Earlier events keep the old setup. A recording goes on in another file, as
    /// laser cycles begin at 0.
    fn configure(&mut self, mut setup: Setup, context: &mut FeedContext) -> Result<()> {
        setup.began = SystemTime::now();
        let configuration = self.configuration(&setup, Source::Sensor)?;
        let configured = self.client.configure(&configuration);
        self.take_events(context);
        configured?;
        // The counts of the link go on.
        self.here = *self.client.counters();
        self.first = self.client.report()?;
        // A histogram that came meanwhile belongs to the old setup.
        while self.client.take_histogram().is_some() {
            self.histogram = None;
        }
        // Pages show a failure of the recorder.
        let recorder = &mut context.recorder;
        let _ = self.client.exchange_during(|| recorder.end_file());
        context.hub.begin(&setup);
        context.recorder.resume(&setup);
        context.show_recording();
        self.last = (0, Instant::now());
        self.setup = setup;
        if self.stopped.take().is_some() {
            context.hub.set_connection("live", "");
        }
        Ok(())
    }

    /// The settings `before`, changed by the text of a page.
    ///
    /// # Errors
    /// Fails if the text is wrong, or changes something that cannot change while the device runs.
    pub fn changed(before: &SettingsFile, text: &str) -> Result<SettingsFile> {
        let mut new = SettingsFile::parse(text)?;
        let sensor = SensorSettings {
            gate: new.sensor.gate.take(),
            masked: new.sensor.masked.take(),
            sigma_bins: new.sensor.sigma_bins.take(),
            dead_time: new.sensor.dead_time.take(),
            ..before.sensor.clone()
        };
        ensure!(
            new.sensor == SensorSettings::default()
                && new.rays == RaySettings::default()
                && new.run == RunSettings::default(),
            "only gate, masked, sigma_bins, dead_time and the keys of [detection] can change while \
             the device runs"
        );
        Ok(SettingsFile {
            sensor,
            detection: new.detection,
            file: None,
            ..before.clone()
        })
    }
}

/// Why a sensor has stopped, and how a page restarts it.
pub fn with_restart_hint(reason: &str) -> String {
    format!("{reason}; the button \"Apply\" starts it again")
}

//! The source of events: a thread that takes events and executes commands.

mod device;
mod playback;
mod session;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;

use anyhow::{Result, anyhow};
use dtof_link::DynamicDepth;
use tokio::sync::oneshot;

pub use playback::Playback;

use super::Terminal;
use super::hub::{Hub, Kind};
use super::outputs::{Folder, Recorder};
use dtof_data::options::rows::printable;
use dtof_device::{HostTimeout, Port, Setup};
use dtof_engine::settings::SettingsFile;

/// Takes the answer: what was done, or why not, in a line.
pub type Answer = oneshot::Sender<Result<String, String>>;

/// A command of a page, and the channel of its answer.
pub struct PageRequest {
    pub command: Command,
    pub answer: Answer,
}

/// A command.
#[derive(Debug)]
pub enum Command {
    /// Apply settings, the text of a settings file.
    Settings(String),
    /// Write the current settings into a file.
    Save,
    /// Switch recording on or off.
    Record(bool),
    /// Play a recording, or pause it.
    Play(bool),
    /// Go to a place of a recording, in seconds from its start.
    Seek(f64),
    /// Play a recording so many times as fast.
    Speed(f64),
}

/// A device and its options.
pub struct Device {
    /// Its name, for display.
    pub name: String,
    /// Opens its port; called for each session.
    pub open: Box<dyn Fn() -> Result<Box<dyn Port>> + Send>,
    /// The options of the command line.
    pub requested: SettingsFile,
    /// Number of pixels; by default the device's own.
    pub pixels: Option<u16>,
    /// The device sends changes of depth in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
    /// The device stops its sensor once this program has been silent for so long.
    pub host_timeout: HostTimeout,
}

/// A source of events.
pub enum Feed {
    /// A device.
    Device(Box<Device>),
    /// A recording.
    Playback(Playback),
}

impl Feed {
    /// Its name, for display.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Device(device) => device.name.clone(),
            Self::Playback(playback) => playback.name(),
        }
    }

    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Device(_) => Kind::Device,
            Self::Playback(_) => Kind::Recording,
        }
    }

    /// Runs until `stop` is set.
    pub(super) fn run(
        self,
        hub: &Arc<Hub>,
        requests: &Receiver<PageRequest>,
        folder: Folder,
        stop: &AtomicBool,
        terminal: Terminal,
    ) -> Result<()> {
        let mut context = FeedContext {
            name: self.name(),
            warned: Vec::new(),
            hub,
            requests,
            stop,
            terminal,
            recorder: Recorder::new(folder),
        };
        let ended = match self {
            Self::Device(device) => device.run(&mut context),
            Self::Playback(playback) => {
                playback.run(&mut context);
                Ok(())
            }
        };
        let recorded = context.recorder.finish();
        ended.and(recorded)
    }
}

/// What a feed works with: the hub, requests of pages, the terminal and the recorder.
struct FeedContext<'a> {
    /// Name of the source, for display.
    name: String,
    /// Warnings that were printed.
    warned: Vec<String>,
    hub: &'a Hub,
    requests: &'a Receiver<PageRequest>,
    stop: &'a AtomicBool,
    terminal: Terminal,
    recorder: Recorder,
}

impl FeedContext<'_> {
    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Prints a line on standard error, with the name once.
    fn complain(&self, text: &str) {
        let text = text
            .strip_prefix(&format!("{}: ", self.name))
            .unwrap_or(text);
        (self.terminal.complain)(&printable(&format!("{}: {text}", self.name)));
    }

    /// Prints warnings on standard error, each once.
    fn warn(&mut self, warnings: &[String]) {
        for warning in warnings {
            if !self.warned.contains(warning) {
                let line = format!("warning: {}: {warning}", self.name);
                (self.terminal.complain)(&printable(&line));
                self.warned.push(warning.clone());
            }
        }
    }

    /// Switches recording on or off, and tells pages.
    fn record(&mut self, on: bool, setup: Option<&Setup>) -> Result<String> {
        let done = self.recorder.switch(on, setup);
        self.show_recording();
        done
    }

    /// Tells pages the status of the recorder.
    fn show_recording(&self) {
        self.hub.set_recording(self.recorder.status());
    }

    /// Answers a command, with every option as its flag.
    fn reply(&self, answer: Answer, result: Result<String>) {
        let flags = |error| anyhow!(dtof_data::options::line(&error, &self.terminal.name));
        reply(answer, result.map_err(flags));
    }
}

/// Answers a command, with every option as its key. A page that has gone does not read it.
fn reply(answer: Answer, result: Result<String>) {
    let _ = answer.send(result.map_err(|error| format!("{error:#}")));
}

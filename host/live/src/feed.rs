//! Where events come from: a thread that takes them, and commands.

mod device;
mod playback;
mod session;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;

use anyhow::Result;
use tokio::sync::oneshot;

pub use device::Device;
pub use playback::Playback;

use super::hub::{Hub, Kind};
use super::outputs::{Folder, Recorded, Recorder};
use super::terminal::Terminal;
use dtof_events::aer_file::Header;
use dtof_options::rows::{grouped, printable};

/// Where an answer goes: what was done, or why not, in a line.
pub type Answer = oneshot::Sender<Result<String, String>>;

/// A wish of a page.
pub struct Command {
    pub wish: Wish,
    pub answer: Answer,
}

/// What pages can wish for.
#[derive(Debug)]
pub enum Wish {
    /// Settings, in the form of a settings file.
    Settings(String),
    /// The settings in force into a file.
    Save,
    /// Record, or stop it.
    Record(bool),
    /// Play a recording, or pause it.
    Play(bool),
}

/// A source of events.
pub enum Feed {
    /// A device.
    Device(Box<Device>),
    /// A recording.
    Playback(Playback),
}

impl Feed {
    /// For people.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Device(device) => device.name.clone(),
            Self::Playback(playback) => playback.name(),
        }
    }

    /// Which kind it is.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Device(_) => Kind::Device,
            Self::Playback(_) => Kind::Recording,
        }
    }

    /// Runs until it is to `stop`.
    pub(super) fn run(
        self,
        hub: &Arc<Hub>,
        commands: &Receiver<Command>,
        folder: Folder,
        stop: &AtomicBool,
        terminal: Terminal,
    ) -> Result<()> {
        let mut work = Work {
            name: self.name(),
            warned: Vec::new(),
            hub,
            commands,
            stop,
            terminal,
            recorder: Recorder::new(folder),
            recorded: Recorded::default(),
        };
        let rests = match self {
            Self::Device(device) => device.run(&mut work),
            Self::Playback(playback) => {
                playback.run(&mut work);
                Ok(())
            }
        };
        // What was recorded is whole, also at the end.
        let kept = work.recorder.stop(&mut work.recorded);
        rests.and(kept)
    }
}

/// What a feed works with.
struct Work<'a> {
    /// Of the source, for people.
    name: String,
    /// Warnings that were told.
    warned: Vec<String>,
    hub: &'a Hub,
    commands: &'a Receiver<Command>,
    stop: &'a AtomicBool,
    terminal: Terminal,
    recorder: Recorder,
    recorded: Recorded,
}

impl Work<'_> {
    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A line on standard error.
    fn complain(&self, text: &str) {
        (self.terminal.complain)(&printable(&format!("{}: {text}", self.name)));
    }

    /// Warnings on standard error, each once.
    fn warn(&mut self, warnings: &[String]) {
        for warning in warnings {
            if !self.warned.contains(warning) {
                let line = format!("warning: {}: {warning}", self.name);
                (self.terminal.complain)(&printable(&line));
                self.warned.push(warning.clone());
            }
        }
    }

    /// Records events of a `header`, or stops it.
    fn wish_to_record(&mut self, on: bool, header: Option<&Header>) -> Result<String> {
        let done = record(&mut self.recorder, &mut self.recorded, on, header);
        self.tell_recorded();
        done
    }

    /// Tells pages how far the recording is.
    fn tell_recorded(&self) {
        self.hub.recorded(&self.recorded);
    }
}

/// Records events of a `header`, or stops it. The disk may take long.
fn record(
    recorder: &mut Recorder,
    recorded: &mut Recorded,
    on: bool,
    header: Option<&Header>,
) -> Result<String> {
    if on {
        recorder.start(header, recorded)?;
    } else {
        recorder.stop(recorded)?;
    }
    Ok(match (on, header) {
        (true, Some(_)) => format!("Recording into {}.", recorded.file),
        (true, None) => "Recording begins with the device.".to_owned(),
        (false, _) if recorded.file.is_empty() => "Nothing was recorded.".to_owned(),
        (false, _) => format!(
            "Saved {} events as {}.",
            grouped(recorded.events),
            recorded.file
        ),
    })
}

/// Answers a wish. A page that has gone does not read it.
fn reply(answer: Answer, result: Result<String>) {
    let _ = answer.send(result.map_err(|error| format!("{error:#}")));
}

//! The feed of a device: sessions one after the other, as long as somebody looks.

use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use anyhow::{Error, Result, anyhow};
use dtof_link::DynamicDepth;

use super::session::Session;
use super::{Command, Wish, Work, reply};
use crate::cli::complain;
use crate::device::{Client, Port};
use crate::rows::printable;
use crate::settings::SettingsFile;

/// A device that is gone is looked for so often.
const AGAIN: Duration = Duration::from_secs(1);
/// How often a wish to stop is seen meanwhile.
const SOON: Duration = Duration::from_millis(50);

/// A device, and how it is to operate.
pub struct Device {
    /// For people.
    pub name: String,
    /// Opens its port, again and again.
    pub open: Box<dyn Fn() -> Result<Box<dyn Port>> + Send>,
    /// What was said of it.
    pub said: SettingsFile,
    /// Its pixels, as many as it says if not said.
    pub pixels: Option<u16>,
    /// It is to send changes of depth in place of depth events.
    pub dynamic_depth: Option<DynamicDepth>,
}

impl Device {
    /// Until it is stopped.
    ///
    /// # Errors
    /// If the device does not rest then.
    pub(super) fn run(mut self, work: &mut Work) -> Result<()> {
        work.hub.said(&self.said);
        // Settings that a page wishes for while there is no device.
        let mut wished: Option<Command> = None;
        let mut told = String::new();
        while !work.is_stopped() {
            let ended = self.session(work, &mut wished);
            let kept = work.recorder.end_file(&mut work.recorded);
            work.tell_recorded();
            let Err(ended) = ended else { break };
            if work.is_stopped() {
                let name = self.name;
                return Err(ended.context(format!("{name}: it may still be running")));
            }
            let reason = match kept {
                Ok(()) => format!("{ended:#}"),
                Err(kept) => format!("{ended:#}; {kept:#}"),
            };
            if let Some(command) = wished.take() {
                reply(command.answer, Err(anyhow!("{reason}")));
            }
            work.hub.connection("gone", &reason);
            if told != reason {
                complain(&printable(&format!("{}: {reason}", self.name)));
                told.clone_from(&reason);
            }
            wished = self.wait(work, &reason);
        }
        Ok(())
    }

    /// One session: until it is stopped, or the device is gone.
    fn session(&mut self, work: &mut Work, wished: &mut Option<Command>) -> Result<()> {
        let said = match wished {
            Some(Command {
                wish: Wish::Settings(text),
                ..
            }) => Session::changed(&self.said, text)?,
            _ => self.said.clone(),
        };
        let mut client = Client::new((self.open)()?)?;
        let mut session = Session::begin(&mut client, said, self.pixels, self.dynamic_depth, work)
            .map_err(|error| self.said.name_origin(error))?;
        if let Some(command) = wished.take() {
            reply(command.answer, Ok("The settings are in force.".to_owned()));
        }
        let ended = session.run(work);
        self.said = session.asked();
        ended
    }

    /// Waits a while; gives settings that somebody wishes for meanwhile, which are tried at once.
    fn wait(&self, work: &mut Work, reason: &str) -> Option<Command> {
        let since = Instant::now();
        while since.elapsed() < AGAIN && !work.is_stopped() {
            let command = match work.commands.recv_timeout(SOON) {
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => {
                    std::thread::sleep(SOON);
                    continue;
                }
                Ok(command) => command,
            };
            match command.wish {
                Wish::Settings(_) => return Some(command),
                Wish::Record(on) => {
                    let done = work.wish_to_record(on, None);
                    reply(command.answer, done);
                }
                Wish::Save | Wish::Play(_) => reply(command.answer, Err(gone(reason))),
            }
        }
        None
    }
}

fn gone(reason: &str) -> Error {
    anyhow!("there is no device: {reason}")
}

//! The feed of a device: sessions one after the other, as long as somebody looks.

use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use dtof_link::DynamicDepth;

use super::session::{Given, Session, starts_again};
use super::{Command, Wish, Work, reply};
use dtof_device::{Client, HostTimeout, Port, Stopped};
use dtof_engine::settings::SettingsFile;

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
    /// It stops its sensor once this program has been silent for so long.
    pub host_timeout: HostTimeout,
}

/// What is known from one session to the next.
#[derive(Default)]
struct Sessions {
    /// Settings that a page puts in force while there is no session.
    wished: Option<Command>,
    /// A device has answered. Its sensor may have run, and may have stopped since for whatever
    /// reason: from now on only a page starts it.
    any: bool,
}

impl Device {
    /// Until it is stopped.
    ///
    /// # Errors
    /// If the device does not rest then.
    pub(super) fn run(mut self, work: &mut Work) -> Result<()> {
        work.hub.said(&self.said);
        let mut sessions = Sessions::default();
        let mut told = String::new();
        while !work.is_stopped() {
            let ended = self.session(work, &mut sessions);
            let kept = work.recorder.end_file(&mut work.recorded);
            work.tell_recorded();
            let Err(ended) = ended else { break };
            let stopped = ended.downcast_ref::<Stopped>().copied();
            if work.is_stopped() {
                let (name, timeout) = (self.name, self.host_timeout);
                return Err(ended.context(match stopped {
                    Some(_) => name,
                    None => format!("{name}: its sensor may run for {timeout} more"),
                }));
            }
            let of = |ended: String| match &kept {
                Ok(()) => ended,
                Err(kept) => format!("{ended}; {kept:#}"),
            };
            // The page shows keys, the terminal flags.
            let on_terminal = of(dtof_options::line(&ended, &work.terminal.name));
            let reason = of(format!("{ended:#}"));
            if let Some(command) = sessions.wished.take() {
                reply(command.answer, Err(anyhow!("{reason}")));
            }
            let state = if stopped.is_some() { "stopped" } else { "gone" };
            let hint = |reason: String| match sessions.any {
                true => starts_again(&reason),
                false => reason,
            };
            let (reason, on_terminal) = (hint(reason), hint(on_terminal));
            work.hub.connection(state, &reason);
            if told != on_terminal {
                work.complain(&on_terminal);
                told = on_terminal;
            }
            sessions.wished = self.wait(work, &reason, sessions.any);
        }
        Ok(())
    }

    /// One session: until it is stopped, or the device is gone.
    fn session(&mut self, work: &mut Work, sessions: &mut Sessions) -> Result<()> {
        let said = match &sessions.wished {
            Some(Command {
                wish: Wish::Settings(text),
                ..
            }) => Session::changed(&self.said, text)?,
            _ => self.said.clone(),
        };
        let given = Given {
            pixels: self.pixels,
            dynamic_depth: self.dynamic_depth,
            host_timeout: self.host_timeout,
        };
        let mut client = Client::new((self.open)()?)?;
        sessions.any = true;
        let mut session = Session::begin(&mut client, said, given, work)
            .map_err(|error| self.said.blame(error))?;
        if let Some(command) = sessions.wished.take() {
            reply(command.answer, Ok("The settings are in force.".to_owned()));
        }
        let ended = session.run(work);
        self.said = session.asked();
        ended
    }

    /// Waits a while, or as long as the sensor `is_off`; gives settings that a page puts in force
    /// meanwhile, which are tried at once.
    fn wait(&self, work: &mut Work, reason: &str, is_off: bool) -> Option<Command> {
        let since = Instant::now();
        while (is_off || since.elapsed() < AGAIN) && !work.is_stopped() {
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
                Wish::Save | Wish::Play(_) => {
                    let error = if is_off {
                        anyhow!("{reason}")
                    } else {
                        anyhow!("there is no device: {reason}")
                    };
                    reply(command.answer, Err(error));
                }
            }
        }
        None
    }
}

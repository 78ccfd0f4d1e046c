//! The feed of a device: one session after another.

use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};

use super::session::{Session, with_restart_hint};
use super::{Command, Device, FeedContext, PageRequest, reply};
use dtof_data::options::Refused;
use dtof_device::{Client, Stopped};
use dtof_link::Refusal;

/// Interval of attempts to reach a device that is gone.
const AGAIN: Duration = Duration::from_secs(1);
/// Interval of checks whether to stop meanwhile.
const SOON: Duration = Duration::from_millis(50);

/// State that outlives a session.
#[derive(Default)]
struct Sessions {
    /// Settings that a page has sent while there was no session.
    pending: Option<PageRequest>,
    /// A device has answered. Its sensor may have run and stopped, so from now on only a page starts
    /// it.
    any: bool,
}

impl Device {
    /// Runs until it is stopped.
    ///
    /// # Errors
    /// Fails if the sensor may still run then.
    pub(super) fn run(mut self, context: &mut FeedContext) -> Result<()> {
        context.hub.set_requested(&self.requested);
        let mut sessions = Sessions::default();
        let (mut printed, mut reason) = (String::new(), String::new());
        while !context.is_stopped() {
            let was_there = sessions.any;
            let ended = self.session(context, &mut sessions);
            let recorded = context.recorder.end_file();
            context.show_recording();
            let Err(ended) = ended else { break };
            let stopped = ended.downcast_ref::<Stopped>().copied();
            if context.is_stopped() {
                let (name, timeout) = (self.name, self.host_timeout);
                return Err(ended.context(match stopped {
                    Some(_) => name,
                    None => format!("{name}: its sensor may run for {timeout} more"),
                }));
            }
            if let Some(request) = sessions.pending.take() {
                reply(request.answer, Err(anyhow!("{ended:#}")));
                // Wrong settings change nothing, and are told to no other page.
                if was_there && (ended.is::<Refused>() || ended.is::<Refusal>()) {
                    sessions.pending = self.wait(context, &reason, true);
                    continue;
                }
            }
            let state = if stopped.is_some() { "stopped" } else { "gone" };
            let text = |mut reason: String| {
                if let Err(error) = &recorded {
                    reason += &format!("; {error:#}");
                }
                match sessions.any {
                    true => with_restart_hint(&reason),
                    false => reason,
                }
            };
            // The page shows keys, the terminal flags.
            reason = text(format!("{ended:#}"));
            let on_terminal = text(dtof_data::options::line(&ended, &context.terminal.name));
            context.hub.set_connection(state, &reason);
            if printed != on_terminal {
                context.complain(&on_terminal);
                printed = on_terminal;
            }
            sessions.pending = self.wait(context, &reason, sessions.any);
        }
        Ok(())
    }

    /// Runs one session, until it is stopped or the device is gone.
    fn session(&mut self, context: &mut FeedContext, sessions: &mut Sessions) -> Result<()> {
        let requested = match &sessions.pending {
            Some(PageRequest {
                command: Command::Settings(text),
                ..
            }) => Session::changed(&self.requested, text)?,
            _ => self.requested.clone(),
        };
        let mut client = Client::new((self.open)()?)?;
        sessions.any = true;
        let mut session = Session::begin(&mut client, self, requested, context)
            .map_err(|error| self.requested.add_file_name(error))?;
        if let Some(request) = sessions.pending.take() {
            reply(request.answer, Ok("The settings are applied.".to_owned()));
        }
        let ended = session.run(context);
        let requested = session.requested();
        self.requested = requested;
        ended
    }

    /// Waits a while, or as long as the sensor `is_off`. Returns settings that a page sends meanwhile.
    fn wait(&self, context: &mut FeedContext, reason: &str, is_off: bool) -> Option<PageRequest> {
        let since = Instant::now();
        while (is_off || since.elapsed() < AGAIN) && !context.is_stopped() {
            let request = match context.requests.recv_timeout(SOON) {
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => {
                    std::thread::sleep(SOON);
                    continue;
                }
                Ok(request) => request,
            };
            match request.command {
                Command::Settings(ref text) => match Session::changed(&self.requested, text) {
                    Ok(_) => return Some(request),
                    Err(error) => reply(request.answer, Err(error)),
                },
                Command::Record(on) => {
                    let done = context.record(on, None);
                    context.reply(request.answer, done);
                }
                Command::Save | Command::Play(_) | Command::Seek(_) | Command::Speed(_) => {
                    let error = if is_off {
                        anyhow!("{reason}")
                    } else {
                        anyhow!("there is no device: {reason}")
                    };
                    reply(request.answer, Err(error));
                }
            }
        }
        None
    }
}

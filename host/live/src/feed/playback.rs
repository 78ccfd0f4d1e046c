//! The feed of a recording, which is played at the rate of its laser.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, ensure};

use super::{Command, FeedContext, reply};
use crate::hub::Playhead;
use dtof_data::events::aer_file::{self, Event, Header, Reader};
use dtof_data::events::clock::LaserClock;

/// Interval of batches.
const EVERY: Duration = Duration::from_millis(20);
/// Most events in a batch.
const BATCH: usize = 65_536;

/// An AER file.
pub struct Playback {
    file: PathBuf,
    clock: LaserClock,
    /// A warning if the laser rate is not the file's.
    pub warning: Option<String>,
    speed: f64,
}

/// What playback does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    /// Waits for the first page.
    Waiting,
    Playing,
    Paused,
    Ended,
    /// Has met damage, or the file is gone.
    Failed,
}

/// A recording that is played.
struct Player<'a> {
    playback: &'a Playback,
    mode: Mode,
    reader: Reader<BufReader<File>>,
    /// The next event, which is not due yet.
    next: Option<Event>,
    playhead: Playhead,
}

impl Playback {
    /// Plays a file at `speed` times its own speed. `laser_hz` replaces the laser rate of the file. If neither gives it,
    /// the paper's is taken, with a warning.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if `laser_hz` is 0.
    pub fn new(file: PathBuf, laser_hz: Option<u64>, speed: f64) -> Result<Self> {
        let name = || file.display().to_string();
        let header = aer_file::open(&file).with_context(name)?.header().clone();
        header.ranges().with_context(name)?;
        let requested = laser_hz.map(LaserClock::new).transpose()?;
        let (clock, warning) = LaserClock::for_file(requested, &header);
        Ok(Self {
            clock,
            warning,
            file,
            speed,
        })
    }

    pub(super) fn name(&self) -> String {
        self.file.display().to_string()
    }

    pub(super) fn run(self, context: &mut FeedContext) {
        if let Err(error) = self.play(context) {
            let reason = format!("{}: {error:#}", self.name());
            context.complain(&format!("{error:#}"));
            context.hub.set_connection("failed", &reason);
            while !context.is_stopped() {
                if let Ok(request) = context.requests.recv_timeout(EVERY) {
                    reply(request.answer, Err(anyhow!("{reason}")));
                }
            }
        }
    }

    fn play(&self, context: &FeedContext) -> Result<()> {
        let mut player = Player::new(self, context)?;
        let mut turn = Instant::now();
        while !context.is_stopped() {
            while let Ok(request) = context.requests.try_recv() {
                reply(request.answer, player.execute(&request.command, context));
                turn = Instant::now();
            }
            let elapsed = turn.elapsed();
            turn = Instant::now();
            if player.mode == Mode::Waiting && context.hub.is_visited() {
                player.set_mode(Mode::Playing, "", context);
            }
            if player.mode == Mode::Playing {
                player.playhead.seconds += elapsed.as_secs_f64() * player.playhead.speed;
                player.send_due(context);
            }
            std::thread::sleep(EVERY);
        }
        Ok(())
    }
}

impl<'a> Player<'a> {
    /// Reads all of the file once for its length, up to its end or to where it is damaged.
    fn new(playback: &'a Playback, context: &FeedContext) -> Result<Self> {
        let mut reader = aer_file::open(&playback.file)?;
        let (mut last, mut all) = (0, 0);
        while let Ok(Some(event)) = reader.next_event() {
            last = event.cycle().raw();
            all += 1;
            if context.is_stopped() {
                break;
            }
        }
        let mut player = Self {
            playback,
            mode: Mode::Waiting,
            reader,
            next: None,
            playhead: Playhead {
                length: playback.clock.nanoseconds(last) as f64 / 1e9,
                all,
                speed: playback.speed,
                ..Playhead::default()
            },
        };
        player.rewind(context)?;
        Ok(player)
    }

    /// Goes to the start of the file.
    fn rewind(&mut self, context: &FeedContext) -> Result<()> {
        self.reader = aer_file::open(&self.playback.file)?;
        self.next = self.reader.next_event()?;
        (self.playhead.seconds, self.playhead.events) = (0.0, 0);
        context.hub.begin_recording(Header {
            laser_millihertz: self.playback.clock.millihertz(),
            ..self.reader.header().clone()
        });
        context.hub.set_playhead(self.playhead);
        Ok(())
    }

    fn set_mode(&mut self, mode: Mode, reason: &str, context: &FeedContext) {
        self.mode = mode;
        let state = match mode {
            Mode::Waiting => "opening",
            Mode::Playing => "playing",
            Mode::Paused => "paused",
            Mode::Ended => "ended",
            Mode::Failed => "failed",
        };
        context.hub.set_connection(state, reason);
    }

    fn fail(&mut self, error: &anyhow::Error, context: &FeedContext) {
        let reason = format!("{}: {error:#}", self.playback.name());
        context.complain(&format!("{error:#}"));
        self.set_mode(Mode::Failed, &reason, context);
    }

    /// Sends the events that are due. Ends after the last, or where the file is damaged.
    fn send_due(&mut self, context: &FeedContext) {
        let (mut batch, mut damage) = (Vec::new(), None);
        while let Some(event) = self.next {
            let seconds = self.playback.clock.nanoseconds(event.cycle().raw()) as f64 / 1e9;
            if seconds > self.playhead.seconds {
                break;
            }
            batch.push(event);
            self.next = self.reader.next_event().unwrap_or_else(|error| {
                damage = Some(error);
                None
            });
            if batch.len() == BATCH {
                // Reading is too slow for this speed, so playback time waits for it.
                self.playhead.seconds = seconds;
                break;
            }
        }
        if self.next.is_none() {
            self.playhead.seconds = self.playhead.length;
        }
        self.playhead.events += batch.len() as u64;
        context.hub.add_events(&batch);
        context.hub.set_playhead(self.playhead);
        match damage {
            Some(error) => self.fail(&error, context),
            None if self.next.is_none() => self.set_mode(Mode::Ended, "", context),
            None => {}
        }
    }

    /// Goes to a place in seconds: all events from the start to there are sent at once. A recording
    /// that was at its end plays from there.
    fn seek(&mut self, seconds: f64, context: &FeedContext) -> Result<()> {
        let mode = match self.mode {
            Mode::Ended | Mode::Failed => Mode::Playing,
            mode => mode,
        };
        if let Err(error) = self.rewind(context) {
            self.fail(&error, context);
            return Err(error);
        }
        self.set_mode(mode, "", context);
        while self.mode == mode && self.playhead.seconds < seconds && !context.is_stopped() {
            self.playhead.seconds = seconds;
            self.send_due(context);
        }
        context.hub.restart_rate();
        Ok(())
    }

    fn execute(&mut self, command: &Command, context: &FeedContext) -> Result<String> {
        match *command {
            Command::Play(true) if matches!(self.mode, Mode::Ended | Mode::Failed) => {
                self.seek(0.0, context)?;
                Ok("The recording is playing.".to_owned())
            }
            Command::Play(true) => {
                self.set_mode(Mode::Playing, "", context);
                Ok("The recording is playing.".to_owned())
            }
            Command::Play(false) => {
                self.set_mode(Mode::Paused, "", context);
                Ok("The recording is paused.".to_owned())
            }
            Command::Seek(seconds) => {
                self.seek(seconds, context)?;
                let Playhead {
                    seconds, length, ..
                } = self.playhead;
                Ok(match length < 0.01 {
                    true => format!("The recording is at {:.3} ms.", 1000.0 * seconds),
                    false => format!("The recording is at {seconds:.3} s."),
                })
            }
            Command::Speed(speed) => {
                ensure!(speed > 0.0, "the speed must be above 0");
                self.playhead.speed = speed;
                context.hub.set_playhead(self.playhead);
                Ok(format!("The recording plays {speed} times as fast."))
            }
            Command::Record(_) => Err(anyhow!("this is a recording already")),
            Command::Settings(_) | Command::Save => {
                Err(anyhow!("a recording has no settings to change"))
            }
        }
    }
}

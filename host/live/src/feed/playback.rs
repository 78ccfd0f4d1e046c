//! The feed of a recording, which is played at the rate of its laser.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};

use super::{Command, FeedContext, PageRequest, reply};
use dtof_events::aer_file::{self, Event, Header, Reader};
use dtof_events::clock::LaserClock;
use dtof_options::Refused;

/// Interval of batches.
const EVERY: Duration = Duration::from_millis(20);
/// Most events in a batch.
const BATCH: usize = 65_536;

/// An AER file.
pub struct Playback {
    file: PathBuf,
    clock: LaserClock,
    /// A warning if the given laser rate differs from the file's.
    pub warning: Option<String>,
    speed: f64,
}

/// The state of playback.
struct Position {
    reader: Reader<BufReader<File>>,
    /// The next event, which is not due yet.
    next: Option<Event>,
    /// Seconds of the recording that have been played.
    seconds: f64,
}

impl Playback {
    /// Plays a file at `speed` times its own speed. `laser_hz` replaces the laser rate of the file.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if neither it nor `laser_hz` gives the laser rate.
    pub fn new(file: PathBuf, laser_hz: Option<u64>, speed: f64) -> Result<Self> {
        let name = || file.display().to_string();
        let header = open(&file).with_context(name)?.reader.header().clone();
        header.ranges().with_context(name)?;
        let requested = laser_hz.map(LaserClock::new).transpose()?;
        let (clock, warning) =
            LaserClock::prefer(requested, LaserClock::from_header(&header), "the file");
        let unknown = || Refused::input("has no laser rate; give `laser_hz`");
        Ok(Self {
            clock: clock.ok_or_else(unknown).with_context(name)?,
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
            context.hub.set_connection("failed", &reason);
            while !context.is_stopped() {
                if let Ok(request) = context.requests.recv_timeout(EVERY) {
                    reply(request.answer, Err(anyhow!("{reason}")));
                }
            }
        }
    }

    /// The header of the file, with the laser rate of playback.
    fn header(&self, at: &Position) -> Header {
        Header {
            laser_millihertz: self.clock.millihertz(),
            ..at.reader.header().clone()
        }
    }

    fn play(&self, context: &mut FeedContext) -> Result<()> {
        let mut at = open(&self.file)?;
        context.hub.begin_recording(self.header(&at));
        context.hub.set_connection("playing", "");
        let (mut plays, mut turn) = (true, Instant::now());
        while !context.is_stopped() {
            while let Ok(request) = context.requests.try_recv() {
                self.execute(request, &mut plays, &mut at, context)?;
            }
            let elapsed = turn.elapsed();
            turn = Instant::now();
            if plays {
                if at.next.is_some() {
                    at.seconds += elapsed.as_secs_f64() * self.speed;
                    self.send_due(&mut at, context)?;
                }
                if at.next.is_none() {
                    plays = false;
                    context.hub.set_connection("ended", "");
                }
            }
            std::thread::sleep(EVERY);
        }
        Ok(())
    }

    /// Sends the events that are due.
    fn send_due(&self, at: &mut Position, context: &FeedContext) -> Result<()> {
        let mut batch = Vec::new();
        while let Some(event) = at.next {
            let seconds = self.clock.nanoseconds(event.cycle().raw()) as f64 / 1e9;
            if seconds > at.seconds {
                break;
            }
            batch.push(event);
            at.next = match at.reader.next_event() {
                Ok(next) => next,
                Err(error) => {
                    // Events before the damage are good.
                    context.hub.add_events(&batch);
                    return Err(error);
                }
            };
            if batch.len() == BATCH {
                // Reading is too slow for this speed, so playback time waits for it.
                at.seconds = seconds;
                break;
            }
        }
        context.hub.add_events(&batch);
        context.hub.set_seconds(at.seconds);
        Ok(())
    }

    fn execute(
        &self,
        request: PageRequest,
        plays: &mut bool,
        at: &mut Position,
        context: &FeedContext,
    ) -> Result<()> {
        let done = match request.command {
            Command::Play(on) => {
                if on && at.next.is_none() {
                    *at = open(&self.file)?;
                    context.hub.begin_recording(self.header(at));
                }
                *plays = on;
                let state = if on { "playing" } else { "paused" };
                context.hub.set_connection(state, "");
                Ok(format!("The recording is {state}."))
            }
            Command::Record(_) => Err(anyhow!("this is a recording already")),
            Command::Settings(_) | Command::Save => {
                Err(anyhow!("a recording has no settings to change"))
            }
        };
        reply(request.answer, done);
        Ok(())
    }
}

/// A file at its start.
fn open(file: &PathBuf) -> Result<Position> {
    let mut reader = aer_file::open(file)?;
    Ok(Position {
        next: reader.next_event()?,
        reader,
        seconds: 0.0,
    })
}

//! The feed of a recording, at the rate of its laser.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use dtof_core::RangeScale;

use super::{Command, Wish, Work, reply};
use dtof_events::aer_file::{Event, Header, Reader};
use dtof_events::clock::LaserClock;
use dtof_options::Refused;

/// How often events are handed on.
const EVERY: Duration = Duration::from_millis(20);
/// Events that are handed on at a time, at most.
const BATCH: usize = 65_536;

/// An AER file.
pub struct Playback {
    file: PathBuf,
    clock: LaserClock,
    /// What is not as the file says.
    pub warning: Option<String>,
    speed: f64,
}

/// Where it is.
struct Position {
    reader: Reader<BufReader<File>>,
    header: Header,
    /// Read, and not due yet.
    next: Option<Event>,
    /// Seconds of the recording that have been played.
    seconds: f64,
}

impl Playback {
    /// A file, so many times as fast as it was. `laser_hz` is that of the laser, if the file does
    /// not know, or is wrong.
    ///
    /// # Errors
    /// If there is no such file, or nobody knows the rate.
    pub fn new(file: PathBuf, laser_hz: Option<u64>, speed: f64) -> Result<Self> {
        let name = || file.display().to_string();
        let header = open(&file).with_context(name)?.header;
        RangeScale::new(header.bin_width_ps, header.offset_mm).with_context(name)?;
        let said = laser_hz.map(LaserClock::new).transpose()?;
        let (clock, warning) = LaserClock::known(said, LaserClock::of(&header), "the file");
        let unknown = || Refused::input("does not say how fast its laser was; say `laser_hz`");
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

    pub(super) fn run(self, work: &mut Work) {
        if let Err(error) = self.play(work) {
            let reason = format!("{}: {error:#}", self.name());
            work.hub.connection("failed", &reason);
            while !work.is_stopped() {
                if let Ok(command) = work.commands.recv_timeout(EVERY) {
                    reply(command.answer, Err(anyhow!("{reason}")));
                }
            }
        }
    }

    /// That of the file, with the rate at which it is played.
    fn header(&self, at: &Position) -> Header {
        Header {
            laser_millihertz: self.clock.millihertz(),
            ..at.header
        }
    }

    fn play(&self, work: &mut Work) -> Result<()> {
        let mut at = open(&self.file)?;
        work.hub.begin_recording(self.header(&at));
        work.hub.connection("playing", "");
        let (mut plays, mut turn) = (true, Instant::now());
        while !work.is_stopped() {
            while let Ok(command) = work.commands.try_recv() {
                self.fulfil(command, &mut plays, &mut at, work)?;
            }
            let elapsed = turn.elapsed();
            turn = Instant::now();
            if plays {
                if at.next.is_some() {
                    at.seconds += elapsed.as_secs_f64() * self.speed;
                    self.hand_on(&mut at, work)?;
                }
                if at.next.is_none() {
                    plays = false;
                    work.hub.connection("ended", "");
                }
            }
            std::thread::sleep(EVERY);
        }
        Ok(())
    }

    /// Hands on what is due.
    fn hand_on(&self, at: &mut Position, work: &Work) -> Result<()> {
        let mut batch = Vec::new();
        while let Some(event) = at.next {
            let seconds = self.clock.nanoseconds(event.cycle().0) as f64 / 1e9;
            if seconds > at.seconds {
                break;
            }
            batch.push(event);
            at.next = match at.reader.next_event() {
                Ok(next) => next,
                Err(error) => {
                    // What came before the damage is good.
                    work.hub.events(&batch, 0);
                    return Err(error);
                }
            };
            if batch.len() == BATCH {
                // What is read more slowly than it was is played as fast as it can be.
                at.seconds = seconds;
                break;
            }
        }
        work.hub.events(&batch, 0);
        work.hub.at(at.seconds);
        Ok(())
    }

    fn fulfil(
        &self,
        command: Command,
        plays: &mut bool,
        at: &mut Position,
        work: &Work,
    ) -> Result<()> {
        let done = match command.wish {
            Wish::Play(on) => {
                if on && at.next.is_none() {
                    *at = open(&self.file)?;
                    work.hub.begin_recording(self.header(at));
                }
                *plays = on;
                let state = if on { "playing" } else { "paused" };
                work.hub.connection(state, "");
                Ok(format!("The recording is {state}."))
            }
            Wish::Record(_) => Err(anyhow!("this is a recording already")),
            Wish::Settings(_) | Wish::Save => Err(anyhow!("a recording has no settings to change")),
        };
        reply(command.answer, done);
        Ok(())
    }
}

/// A file at its start.
fn open(file: &PathBuf) -> Result<Position> {
    let mut reader = Reader::new(BufReader::new(File::open(file)?))?;
    Ok(Position {
        header: *reader.header(),
        next: reader.next_event()?,
        reader,
        seconds: 0.0,
    })
}

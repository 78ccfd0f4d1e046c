//! What comes to the pixel processor, clock by clock.

use std::collections::VecDeque;
use std::sync::Arc;
use std::vec;

use anyhow::Result;
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule, PixelConfig, RangeGate};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::command::{Access, Command, register, register_values, settings};

/// Clocks without photons: for the settings before, for what is under way behind.
const REST: u64 = 3000;

/// Photons, and what else comes with them.
#[derive(Clone, Debug)]
pub struct Scene {
    pub name: String,
    pub pixels_log2: u32,
    pub config: PixelConfig<128>,
    /// Clocks of a laser cycle: the fewest and the most.
    pub clocks: [u64; 2],
    /// The chance that a clock has a photon, in 1/256; at 256 every clock has one.
    pub rate: u32,
    pub bins: Bins,
    /// Macropixels whose photons come.
    pub pixels: Pixels,
    /// The chance that the link takes a word in a clock, in 1/256.
    pub link: u32,
    pub events: Events,
    /// The testbench reads histograms beside, a register after so many clocks.
    pub reads: Option<u64>,
    /// If there are any, the processor is stopped and started again at random times, and has the
    /// next of these settings each time. Photons come meanwhile.
    pub restarts: Vec<PixelConfig<128>>,
    /// The most clocks from a start to the next stop. Every fourth time there are less than 64.
    pub longest_run: u32,
    /// The clocks with photons.
    pub length: u64,
    pub seed: u64,
}

/// Where in its bins a photon lies.
#[derive(Clone, Debug)]
pub enum Bins {
    /// So many of 256 come from a target, so many bins to both sides of its place at most.
    Target(u32, u16),
    /// As often in each bin as recorded histograms have it, of one macropixel after another.
    Recorded(Arc<Vec<Recorded>>),
}

/// A recorded histogram, as the photons up to each bin.
pub type Recorded = Vec<u64>;

/// Who takes the events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// The link, packed.
    Link,
    /// The testbench reads them: a register after so many clocks.
    Registers(u64),
    /// A program on the system's processor sees to everything.
    System,
}

impl Events {
    /// Whether the testbench reads and writes registers.
    pub const fn has_registers(self) -> bool {
        !matches!(self, Self::System)
    }
}

/// Whose photons come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// Of all, at random.
    All,
    /// Of all in turn, so that all fire at one look.
    InTurn,
    /// Of one until so many clocks have passed, then of the next.
    OneForLong(u64),
    /// Of all, and of some that there are not.
    Strays,
}

/// How the macropixels are configured.
pub fn config(
    [x, l1, l2]: [u16; 3],
    alpha: U8F8,
    minimum: u32,
    [first, last]: [u16; 2],
    takes_first_photon: bool,
) -> Result<PixelConfig<128>> {
    let rule = PaperRule::new(alpha, Count::saturating(minimum));
    let gate = RangeGate::new(first, last)?;
    let builder = PixelConfig::with_rule(rule).x(x).l1(l1).l2(l2).gate(gate);
    let dead_time = if takes_first_photon { u16::MAX } else { 0 };
    Ok(builder.dead_time(dead_time).build()?)
}

/// A clock that place and route reaches for 4 and 16 macropixels in the whole system, and nearly
/// for 64.
pub const MEGAHERTZ: f64 = 75.0;

/// Clocks of a laser cycle of 10 MHz at this clock: one or the other.
const CLOCKS: [u64; 2] = [7, 8];

impl Scene {
    /// A photon a clock, some of them from a target, and a link that always takes a word.
    pub fn new(name: &str, pixels_log2: u32, config: PixelConfig<128>) -> Self {
        Self {
            name: name.to_owned(),
            pixels_log2,
            config,
            clocks: CLOCKS,
            rate: 256,
            bins: Bins::Target(100, 1),
            pixels: Pixels::All,
            link: 256,
            events: Events::Link,
            reads: None,
            restarts: Vec::new(),
            longest_run: 8192,
            length: 0,
            seed: 1,
        }
    }

    /// What the registers hold in a run.
    pub fn register_values(&self, run: usize) -> Result<Vec<u32>> {
        let config = self.config_of(run);
        register_values(&config, self.events == Events::Link, self.pixels_log2)
    }

    /// The settings of a run; each restart begins the next.
    pub fn config_of(&self, run: usize) -> PixelConfig<128> {
        match self.place_of(run) {
            0 => self.config,
            place => self.restarts[place - 1],
        }
    }

    /// Which settings a run has: 0 the first ones, then those of the restarts, over and over.
    fn place_of(&self, run: usize) -> usize {
        let restart = run.checked_sub(1);
        restart.map_or(0, |restart| restart % self.restarts.len() + 1)
    }
}

/// The commands of a scene, each time the same.
pub struct Commands {
    scene: Scene,
    random: Pcg64Mcg,
    clock: u64,
    cycle_ends_at: u64,
    settings: vec::IntoIter<Access>,
    turn: u8,
    /// The registers' values of all settings, by [`Scene::place_of`].
    values: Vec<Vec<u32>>,
    run: usize,
    restart_at: u64,
    /// What a restart has still to do, and when.
    restart: VecDeque<(u64, Restart)>,
    /// Before this clock a program takes no event: it was interrupted by a restart.
    events_from: u64,
}

/// A step of a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Restart {
    Reset,
    Access(Access),
}

impl Commands {
    pub fn new(scene: &Scene) -> Result<Self> {
        let runs = 0..=scene.restarts.len();
        let values: Vec<_> = runs
            .map(|run| scene.register_values(run))
            .collect::<Result<_>>()?;
        let mut settings = settings(&values[0]);
        if !scene.events.has_registers() {
            settings.clear();
        }
        Ok(Self {
            scene: scene.clone(),
            random: Pcg64Mcg::seed_from_u64(scene.seed),
            clock: 0,
            cycle_ends_at: REST,
            settings: settings.into_iter(),
            turn: 0,
            values,
            run: 0,
            restart_at: REST + 1000,
            restart: VecDeque::new(),
            events_from: 0,
        })
    }

    fn chance(&mut self, of: u32) -> bool {
        self.random.next_u32() >> 24 < of
    }

    fn below(&mut self, end: u32) -> u32 {
        let product = u64::from(self.random.next_u32()) * u64::from(end);
        #[allow(clippy::cast_possible_truncation, reason = "below `end`")]
        let below = (product >> 32) as u32;
        below
    }

    /// Stops the processor in this clock and starts it again, as soon as can be or later. An access
    /// to the registers takes two clocks.
    fn plan_restart(&mut self, now: u64) {
        let before = &self.values[self.scene.place_of(self.run)];
        self.run += 1;
        let values = self.values[self.scene.place_of(self.run)].clone();
        let is_other = values != *before;
        let mut at = now;
        let mut then = |after: u64, step| {
            at += after;
            self.restart.push_back((at, step));
        };
        let is_reset = self.random.next_u32() >> 30 == 0;
        then(
            0,
            if is_reset {
                Restart::Reset
            } else {
                write(register::CONTROL, 0)
            },
        );
        let reads_counts = !is_reset && self.random.next_u32() >> 31 == 0;
        if reads_counts {
            for number in 0..register::COUNTS_LENGTH {
                let access = Access::Read(register::COUNTS + number);
                then(if number == 0 { 8 } else { 2 }, Restart::Access(access));
            }
        }
        let waits = match self.random.next_u32() >> 30 {
            0 => 0,
            _ => u64::from(self.random.next_u32() >> 26),
        };
        if waits > 0 {
            then(2 + waits, Restart::Access(Access::Read(register::CONTROL)));
        }
        if is_other || is_reset {
            for (address, &data) in (register::CONTROL..register::SIZE).zip(&values).skip(1) {
                then(2, write(address, data));
            }
        }
        then(2, write(register::CONTROL, values[0]));
        // Whether it runs yet; that it runs.
        then(2, Restart::Access(Access::Read(register::CONTROL)));
        let done = at;
        let longest = if self.random.next_u32() >> 30 == 0 {
            64
        } else {
            self.scene.longest_run
        };
        self.restart_at = done + 2 + u64::from(self.below(longest));
        if let Events::Registers(period) = self.scene.events {
            // Between two accesses, and then a look at the register first.
            self.restart_at = self.restart_at.next_multiple_of(period) + period / 2;
            self.events_from = (done + 2).next_multiple_of(9 * period);
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "few macropixels and bins")]
    fn photon(&mut self) -> (u8, u16) {
        let pixels = 1u32 << self.scene.pixels_log2;
        let pixel = match self.scene.pixels {
            Pixels::All => self.below(pixels) as u8,
            Pixels::InTurn => {
                self.turn = (self.turn + 1) % pixels as u8;
                self.turn
            }
            Pixels::OneForLong(clocks) => (self.clock / clocks % u64::from(pixels)) as u8,
            Pixels::Strays => self.below(pixels + pixels / 2) as u8,
        };
        (pixel, self.bin(pixel))
    }

    #[allow(clippy::cast_possible_truncation, reason = "few bins")]
    fn bin(&mut self, pixel: u8) -> u16 {
        let (signal, spread) = match &self.scene.bins {
            &Bins::Target(signal, spread) => (signal, spread),
            Bins::Recorded(histograms) => {
                let histogram = &histograms[usize::from(pixel) % histograms.len()];
                let all = histogram.last().copied().unwrap_or(0);
                let photon = (u64::from(self.random.next_u32()) * all) >> 32;
                return histogram.partition_point(|&up_to| up_to <= photon) as u16;
            }
        };
        if !self.chance(signal) {
            // Some past the last bin.
            let strays = self.scene.pixels == Pixels::Strays;
            return self.below(if strays { 140 } else { 128 }) as u16;
        }
        let off = self.below(2 * u32::from(spread) + 1) as u16;
        // The targets move slowly, so that each bin has its turn.
        let moved = (self.clock >> 14) as u16;
        let target = (u16::from(pixel) * 37 + moved + 64) & 127;
        (target + off).saturating_sub(spread).min(127)
    }
}

const fn write(address: u32, data: u32) -> Restart {
    Restart::Access(Access::Write(address, data))
}

impl Iterator for Commands {
    type Item = Command;

    fn next(&mut self) -> Option<Command> {
        let clock = self.clock;
        self.clock += 1;
        let end = REST + self.scene.length;
        if clock >= end + 2 * REST {
            return None;
        }
        let mut command = Command::default();
        if clock < REST {
            command.access = self.settings.next();
            return Some(command);
        }
        if clock < end {
            if self.scene.rate >= 256 || self.chance(self.scene.rate) {
                command.photon = Some(self.photon());
            }
            if clock == self.cycle_ends_at {
                command.cycle_ends = true;
                let [fewest, most] = self.scene.clocks;
                #[allow(clippy::cast_possible_truncation, reason = "few clocks")]
                let more = self.below((most - fewest + 1) as u32);
                self.cycle_ends_at += fewest + u64::from(more);
            }
            command.link_takes = self.scene.link >= 256 || self.chance(self.scene.link);
        } else {
            // The counts, when all has come to rest.
            command.link_takes = true;
            let after = clock - end;
            if self.scene.events.has_registers()
                && after >= REST
                && (after - REST).is_multiple_of(8)
                && after < REST + 8 * u64::from(register::COUNTS_LENGTH)
            {
                let number = u32::try_from((after - REST) / 8).ok()?;
                command.access = Some(Access::Read(register::COUNTS + number));
            }
        }
        if let Some(period) = self.scene.reads
            && clock < end
            && (clock - REST).is_multiple_of(period)
        {
            // Which eight bins, whether they are there, the eight.
            command.access = Some(match (clock - REST) / period % 6 {
                0 => {
                    let words = 16 << self.scene.pixels_log2;
                    Access::Write(register::HISTOGRAM, self.below(words))
                }
                number => Access::Read(register::HISTOGRAM + u32::try_from(number - 1).ok()?),
            });
        }
        if let Events::Registers(period) = self.scene.events
            && clock >= self.events_from
            && clock < end + REST * 9 / 10
        {
            // A look at the register, the seven words, and the end of it.
            let place = clock % (9 * period);
            if place.is_multiple_of(period) {
                let number = u32::try_from(place / period).ok()?;
                command.access = Some(match number {
                    8 => Access::Write(register::WAITING, 1),
                    number => Access::Read(register::WAITING + number),
                });
            }
        }
        if !self.scene.restarts.is_empty() {
            if clock == self.restart_at && clock < end - REST {
                self.plan_restart(clock);
            }
            if self.restart.front().is_some_and(|&(at, _)| at == clock) {
                match self.restart.pop_front() {
                    Some((_, Restart::Access(access))) => command.access = Some(access),
                    Some((_, Restart::Reset)) => command.reset = true,
                    None => {}
                }
            }
        }
        Some(command)
    }
}

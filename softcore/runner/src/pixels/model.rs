//! What the pixel processor has to do: `AsyncPixel`, fed with the same photons.

use std::collections::VecDeque;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::pixel_processor::ProcessorEvent;
use dtof_core::{
    AerEncoder, AerWord, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig, Statistics,
};

use super::command::{Access, Command, Report, register};
use super::reads::Reads;
use super::scene::{Events, Scene};

/// Looks whose events may wait.
const REMEMBERED: usize = 4096;

/// Clocks from the one in which a look begins to the one in which macropixel 0 decides; the others
/// follow, one a clock.
const DECISION: u64 = 17;

/// What was looked at, and what came of it.
#[derive(Clone, Debug, Default)]
pub struct ModelOutcome {
    pub photons: u64,
    pub cycles: u64,
    pub looks: u64,
    pub late: u64,
    /// Times that the program read eight bins of a histogram, which were compared.
    pub bins_read: u64,
    pub statistics: Statistics,
    /// Clocks from the end of the deciding laser cycle until the word of an event waited for
    /// the link, most often that of an event before it.
    pub latencies: Vec<u64>,
}

/// The macropixels, and what they wait for.
pub struct Model {
    scene: Scene,
    /// Times that it was started, after the first.
    run: usize,
    /// The clocks in which it runs: the first, one past the last. It is empty in the last one.
    starts_at: u64,
    stops_at: u64,
    emptied_at: u64,
    /// What came of the runs before.
    total: ModelOutcome,
    config: PixelConfig<128>,
    pixels: Vec<AsyncPixel<128>>,
    encoder: AerEncoder,
    clock: u64,
    since_look: u16,
    /// The clock of the last look, and the events that it brought.
    looked_at: u64,
    fired: u64,
    /// The counts of the last look, before each macropixel.
    before: Vec<Statistics>,
    strays: u64,
    /// What comes of this run.
    outcome: ModelOutcome,
    /// Words that the link has yet to take, and the clock in which the laser cycle ended that
    /// brought the event.
    words: VecDeque<(AerWord, Option<u64>)>,
    /// The laser cycles that looks ended, and the clocks.
    looked: VecDeque<(u64, u64)>,
    /// Events that the program is to take.
    taken: VecDeque<DepthEvent>,
    events: Events,
    /// What the registers of the settings hold.
    register_values: Vec<u32>,
    reads: Vec<u32>,
    counts: Vec<u32>,
    bins: Reads,
}

impl ModelOutcome {
    /// The photons, laser cycles, looks and statistics of both.
    fn add(&mut self, other: &Self) {
        self.photons += other.photons;
        self.cycles += other.cycles;
        self.looks += other.looks;
        self.late += other.late;
        self.statistics += other.statistics;
        self.latencies.extend(&other.latencies);
    }
}

impl Model {
    pub fn new(scene: &Scene) -> Result<Self> {
        Ok(Self {
            scene: scene.clone(),
            run: 0,
            starts_at: 0,
            stops_at: u64::MAX,
            emptied_at: 0,
            total: ModelOutcome::default(),
            register_values: scene.register_values()?,
            config: scene.config,
            pixels: pixels(scene),
            encoder: AerEncoder::new(),
            clock: 0,
            since_look: 0,
            looked_at: 0,
            fired: 0,
            before: Vec::new(),
            strays: 0,
            outcome: ModelOutcome::default(),
            words: VecDeque::new(),
            looked: VecDeque::new(),
            taken: VecDeque::new(),
            events: scene.events,
            reads: Vec::new(),
            counts: Vec::new(),
            bins: Reads::default(),
        })
    }

    /// The next clock; `reports` has what the simulation reported before a given clock.
    pub fn clock(
        &mut self,
        command: &Command,
        reports: &mut Reports<impl FnMut() -> Result<(u64, Report)>>,
    ) -> Result<()> {
        self.start_or_stop(command, reports)?;
        let runs = self.runs(self.clock);
        if let Some((pixel, code)) = command.photon.filter(|_| runs) {
            self.outcome.photons += 1;
            match self.pixels.get_mut(usize::from(pixel)) {
                Some(pixel) => pixel.count(&self.config, code),
                None => self.strays += 1,
            }
        }
        self.bins.clock(self.clock, command, &self.pixels);
        if command.cycle_ends && runs {
            self.outcome.cycles += 1;
        }
        // Where it is the last clock that runs, no look begins any more.
        if command.cycle_ends && runs && self.runs(self.clock + 1) {
            self.since_look = self.since_look.saturating_add(1);
            // The system has a register at its pins.
            let at = self.clock + 1 + u64::from(self.events == Events::System);
            let looks = self.apply_until(at, reports)?;
            let is_due = self.since_look >= self.config.x();
            ensure!(is_due || !looks, "clock {at}: a look that is not due");
            if looks {
                self.looked_at = at;
                self.look();
            } else if is_due {
                let longest = self.longest_look();
                ensure!(
                    at < self.looked_at + longest,
                    "clock {at}: no look, {longest} clocks after the last one"
                );
                self.outcome.late += 1;
            }
        }
        self.clock += 1;
        Ok(())
    }

    /// Whether it runs in a clock: photons of it count.
    const fn runs(&self, clock: u64) -> bool {
        self.starts_at <= clock && clock < self.stops_at
    }

    /// What the clock brings to the register that starts and stops.
    fn start_or_stop(
        &mut self,
        command: &Command,
        reports: &mut Reports<impl FnMut() -> Result<(u64, Report)>>,
    ) -> Result<()> {
        if self.scene.restarts.is_empty() {
            return Ok(());
        }
        // The next clock is the first of those in which it empties itself.
        let (now, empties) = (self.clock, self.pixels.len() as u64 + 1);
        if command.reset {
            self.stops_at = now + 1;
            self.emptied_at = self.stops_at + empties;
        }
        match command.access {
            Some(Access::Write(register::CONTROL, 0)) => {
                if self.runs(now + 1) {
                    self.emptied_at = now + 2 + empties;
                }
                self.stops_at = now + 2;
            }
            // The settings at the beginning, which come to rest before the photons, are no restart.
            Some(Access::Write(register::CONTROL, _)) if self.stops_at < u64::MAX => {
                while let Some((clock, report)) = reports.next_until(now)? {
                    self.apply(clock, report)?;
                }
                self.end_run()?;
                self.run += 1;
                self.config = self.scene.config_of(self.run);
                self.pixels = pixels(&self.scene);
                self.encoder = AerEncoder::new();
                self.since_look = 0;
                self.looked_at = 0;
                self.fired = 0;
                self.before.clear();
                self.words.clear();
                self.looked.clear();
                self.taken.clear();
                self.starts_at = self.emptied_at.max(now + 2);
                self.stops_at = u64::MAX;
            }
            _ => {}
        }
        Ok(())
    }

    /// Everything up to a look in clock `at`; whether there is one.
    fn apply_until(
        &mut self,
        at: u64,
        reports: &mut Reports<impl FnMut() -> Result<(u64, Report)>>,
    ) -> Result<bool> {
        while let Some((clock, report)) = reports.next_until(at)? {
            match report {
                Report::Look => {
                    ensure!(
                        clock == at,
                        "clock {clock}: a look without the end of a laser cycle"
                    );
                    return Ok(true);
                }
                _ => self.apply(clock, report)?,
            }
        }
        Ok(false)
    }

    /// Clocks that a look keeps the next one waiting at most.
    fn longest_look(&self) -> u64 {
        self.pixels.len() as u64 + self.fired + 18
    }

    fn look(&mut self) {
        let last = LaserCycle::new(self.outcome.cycles - 1);
        let passed = std::mem::take(&mut self.since_look);
        let events = self.outcome.statistics.events;
        self.before.clear();
        for pixel in &mut self.pixels {
            self.before.push(self.outcome.statistics);
            let _ =
                pixel.end_laser_cycles(&self.config, &mut self.outcome.statistics, last, passed);
        }
        self.fired = self.outcome.statistics.events - events;
        self.bins.look(self.clock, &self.pixels);
        self.outcome.looks += 1;
        self.looked.push_back((last.raw(), self.clock));
        if self.looked.len() > REMEMBERED {
            self.looked.pop_front();
        }
    }

    fn apply(&mut self, clock: u64, report: Report) -> Result<()> {
        match report {
            Report::Leaves(pixel) => {
                ensure!(clock < self.stops_at, "clock {clock}: an event leaves");
                let pixel = self
                    .pixels
                    .get_mut(usize::from(pixel))
                    .context("no such macropixel")?;
                let event = pixel.take_event();
                let event = event.with_context(|| format!("clock {clock}: no event waits"))?;
                if self.events == Events::Link || self.events == Events::System {
                    let (time, word) = self.encoder.encode(&event);
                    let mut looked = self.looked.iter().rev();
                    let looked = looked.find(|(cycle, _)| *cycle == event.cycle.raw());
                    let ended = looked.map(|&(_, clock)| clock);
                    let time = time.map(|time| (time, None));
                    self.words.extend(time.into_iter().chain([(word, ended)]));
                } else {
                    self.taken.push_back(event);
                    self.compare_reads(clock)?;
                }
            }
            Report::Word(word) => {
                ensure!(
                    clock <= self.stops_at,
                    "clock {clock}: a word after the stop"
                );
                let (expected, ended) = self.words.pop_front().unzip();
                ensure!(
                    expected == Some(word),
                    "clock {clock}: {word:x?}, not {expected:x?}"
                );
                let latency = ended.flatten().map(|ended| clock - ended);
                self.outcome.latencies.extend(latency);
            }
            Report::Read(address, data) if address >= register::COUNTS => self.counts.push(data),
            Report::Read(address, data) if address >= register::HISTOGRAM => {
                self.bins.read(clock, address, data)?;
            }
            Report::Read(address, data) if address <= register::SIZE => {
                let expected = self.register_values.get(usize::try_from(address)?).copied();
                // Whether it runs yet is in the model only where it is started again.
                let known = if address == 0 { 3 } else { u32::MAX };
                let (runs, is_told) = (self.runs(clock - 1), data >> 2 & 1 == 1);
                let was_stopped = self.run > 0 || self.stops_at < u64::MAX;
                if address == register::CONTROL && was_stopped {
                    ensure!(
                        runs == is_told,
                        "clock {clock}: it runs: {runs}, not {is_told}"
                    );
                } else {
                    ensure!(
                        expected == Some(data & known),
                        "clock {clock}: {data:x} in register {address}, not {expected:x?}"
                    );
                }
            }
            Report::Read(address, data) => {
                if address == register::WAITING {
                    self.reads.clear();
                }
                self.reads.push(data);
            }
            Report::Look | Report::End(_) => bail!("clock {clock}: {report:?}"),
        }
        Ok(())
    }

    /// The event that the program has read, as it is taken.
    fn compare_reads(&mut self, clock: u64) -> Result<()> {
        let event = self.taken.pop_front().context("no event")?;
        let &[1, a, b, c, d, e, f, g] = &*self.reads else {
            bail!("clock {clock}: an event is taken that was not read");
        };
        let read = ProcessorEvent::from_registers([a, b, c, d, e, f, g]);
        ensure!(
            read.word() == AerWord::depth_event(&event) && read.depth_event() == Ok(event),
            "clock {clock}: {event:?} is read as {:?}",
            read.depth_event()
        );
        Ok(())
    }

    /// What is left when all photons have come.
    pub fn end(
        mut self,
        reports: &mut Reports<impl FnMut() -> Result<(u64, Report)>>,
    ) -> Result<ModelOutcome> {
        loop {
            match reports.next()? {
                (_, Report::End(waits)) => {
                    ensure!(!waits && self.words.is_empty(), "words wait");
                    break;
                }
                (clock, report) => self.apply(clock, report)?,
            }
        }
        let waits = self.pixels.iter().find(|pixel| pixel.has_event());
        let waits = waits.map(AsyncPixel::address);
        ensure!(waits.is_none(), "the event of {waits:?} has not left");
        self.end_run()?;
        Ok(ModelOutcome {
            bins_read: self.bins.compared,
            ..self.total
        })
    }

    /// What is left when a run has ended, and its counts if the testbench has read them.
    fn end_run(&mut self) -> Result<()> {
        let mut all = self.outcome.statistics;
        // A stop ends the last look: what macropixels had not decided does not count.
        let decides_at = self.looked_at + DECISION;
        let decided = usize::try_from(self.stops_at.saturating_sub(decides_at))?;
        let seen = *self.before.get(decided).unwrap_or(&all);
        for pixel in &self.pixels {
            pixel.add_photons_to(&mut all);
        }
        let expected = [
            all.counted + all.saturated,
            seen.saturated,
            all.rejected,
            all.gated_out,
            self.strays,
            seen.events,
            seen.deferred,
            seen.expired,
            seen.expired_deferred,
            self.outcome.looks,
            self.outcome.late,
            self.outcome.cycles,
        ];
        let (pairs, _) = self.counts.as_chunks::<2>();
        let counts: Vec<u64> = pairs
            .iter()
            .map(|&[low, high]| u64::from(low) | u64::from(high) << 32)
            .collect();
        let is_read = self.stops_at == u64::MAX && self.events.has_registers();
        ensure!(
            counts.is_empty() && !is_read || counts == expected,
            "counts {counts:?}, not {expected:?}"
        );
        ensure!(
            all.photons() + self.strays == self.outcome.photons,
            "photons"
        );
        self.strays = 0;
        self.counts.clear();
        self.outcome.statistics = all;
        self.total.add(&std::mem::take(&mut self.outcome));
        Ok(())
    }
}

/// The macropixels, which have had no photon.
fn pixels(scene: &Scene) -> Vec<AsyncPixel<128>> {
    let pixel = |address| AsyncPixel::new(PixelAddress::new(address));
    (0..1 << scene.pixels_log2).map(pixel).collect()
}

/// What the simulation tells, one at a time.
pub struct Reports<F> {
    read: F,
    waiting: Option<(u64, Report)>,
}

impl<F: FnMut() -> Result<(u64, Report)>> Reports<F> {
    pub const fn new(read: F) -> Self {
        Self {
            read,
            waiting: None,
        }
    }

    pub fn next(&mut self) -> Result<(u64, Report)> {
        match self.waiting.take() {
            Some(reports) => Ok(reports),
            None => (self.read)(),
        }
    }

    /// The next before clock `at`, or in it: an event that leaves in the clock of a look leaves
    /// after it.
    fn next_until(&mut self, at: u64) -> Result<Option<(u64, Report)>> {
        let (clock, report) = self.next()?;
        let is_before = match report {
            Report::End(_) => false,
            Report::Leaves(_) => clock < at,
            _ => clock <= at,
        };
        if is_before {
            return Ok(Some((clock, report)));
        }
        self.waiting = Some((clock, report));
        Ok(None)
    }
}

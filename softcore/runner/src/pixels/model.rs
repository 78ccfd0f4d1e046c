//! What the pixel processor has to do: `AsyncPixel`, fed with the same photons.

use std::collections::VecDeque;
use std::io::{BufReader, BufWriter, Read, Write};
use std::mem;
use std::process::{self, Stdio};
use std::thread;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::pixel_processor::ProcessorEvent;
use dtof_core::{
    AerEncoder, AerWord, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig, Statistics,
};

use super::command::{Access, Command, Report, register};
use super::reads::Reads;
use super::scene::{Commands, Events, Scene};

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

/// Runs a scene in the simulation, and the same in `dtof-core`.
pub fn simulate(simulator: &mut process::Command, scene: &Scene) -> Result<ModelOutcome> {
    let mut child = simulator
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("the simulation does not start")?;
    let mut input = BufWriter::with_capacity(1 << 16, child.stdin.take().context("no input")?);
    let mut output = BufReader::with_capacity(1 << 16, child.stdout.take().context("no output")?);
    let commands = Commands::new(scene)?;
    let writer = thread::spawn(move || -> std::io::Result<()> {
        for command in commands {
            command.write(&mut input)?;
        }
        input.flush()
    });
    let mut model = Model::new(scene, &mut output)?;
    let outcome = Commands::new(scene)?
        .try_for_each(|command| model.clock(&command))
        .and_then(|()| model.end());
    if outcome.is_err() {
        // It may wait to be read.
        let _ = child.kill();
    }
    let written = writer.join();
    let status = child.wait()?;
    let outcome = outcome.with_context(|| scene.name.clone())?;
    ensure!(
        scene.reads.is_none() || outcome.bins_read > 0,
        "{}: no bins were compared",
        scene.name
    );
    ensure!(status.success(), "{}: the simulation fails", scene.name);
    ensure!(
        matches!(written, Ok(Ok(()))),
        "{}: commands are not read",
        scene.name
    );
    Ok(outcome)
}

/// The model of a scene, and what the simulation tells.
struct Model<R> {
    scene: Scene,
    reports: Reports<R>,
    clock: u64,
    /// Times that it was started, after the first.
    runs: usize,
    /// The clock by which it is empty after the last stop.
    emptied_at: u64,
    run: Run,
    /// What came of the runs before.
    total: ModelOutcome,
    /// What the registers of the settings hold.
    register_values: Vec<u32>,
    reads: Vec<u32>,
    counts: Vec<u32>,
    bins: Reads,
}

/// The macropixels from a start to the next, and what they wait for.
struct Run {
    /// The clocks in which it runs: the first, one past the last.
    starts_at: u64,
    stops_at: u64,
    config: PixelConfig<128>,
    pixels: Vec<AsyncPixel<128>>,
    encoder: AerEncoder,
    since_look: u16,
    /// The clock of the last look, and the events that it brought.
    looked_at: u64,
    fired: u64,
    /// The counts of the last look, before each macropixel.
    before: Vec<Statistics>,
    strays: u64,
    /// What comes of it.
    outcome: ModelOutcome,
    /// Words that the link has yet to take, and the clock in which the laser cycle ended that
    /// brought the event.
    words: VecDeque<(AerWord, Option<u64>)>,
    /// The laser cycles that looks ended, and the clocks.
    looked: VecDeque<(u64, u64)>,
    /// Events that the program is to take.
    taken: VecDeque<DepthEvent>,
}

impl Run {
    /// One that starts in a clock, with macropixels that have had no photon.
    fn new(scene: &Scene, number: usize, starts_at: u64) -> Self {
        let pixel = |address| AsyncPixel::new(PixelAddress::new(address));
        Self {
            starts_at,
            stops_at: u64::MAX,
            config: scene.config_of(number),
            pixels: (0..1 << scene.pixels_log2).map(pixel).collect(),
            encoder: AerEncoder::new(),
            since_look: 0,
            looked_at: 0,
            fired: 0,
            before: Vec::new(),
            strays: 0,
            outcome: ModelOutcome::default(),
            words: VecDeque::new(),
            looked: VecDeque::new(),
            taken: VecDeque::new(),
        }
    }

    /// Whether it runs in a clock: photons of it count.
    const fn has(&self, clock: u64) -> bool {
        self.starts_at <= clock && clock < self.stops_at
    }
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

impl<R: Read> Model<R> {
    fn new(scene: &Scene, simulation: R) -> Result<Self> {
        Ok(Self {
            scene: scene.clone(),
            reports: Reports {
                from: simulation,
                waiting: None,
            },
            clock: 0,
            runs: 0,
            emptied_at: 0,
            run: Run::new(scene, 0, 0),
            total: ModelOutcome::default(),
            register_values: scene.register_values(0)?,
            reads: Vec::new(),
            counts: Vec::new(),
            bins: Reads::default(),
        })
    }

    /// The next clock.
    fn clock(&mut self, command: &Command) -> Result<()> {
        self.start_or_stop(command)?;
        let (now, run) = (self.clock, &mut self.run);
        let runs = run.has(now);
        if let Some((pixel, code)) = command.photon.filter(|_| runs) {
            run.outcome.photons += 1;
            match run.pixels.get_mut(usize::from(pixel)) {
                Some(pixel) => pixel.count(&run.config, code),
                None => run.strays += 1,
            }
        }
        self.bins.clock(now, command, &run.pixels);
        if command.cycle_ends && runs {
            run.outcome.cycles += 1;
        }
        // Where it is the last clock that runs, no look begins any more.
        if command.cycle_ends && runs && run.has(now + 1) {
            run.since_look = run.since_look.saturating_add(1);
            let is_due = run.since_look >= run.config.x();
            // The system has a register at its pins.
            let at = now + 1 + u64::from(self.scene.events == Events::System);
            let looks = self.apply_until(at)?;
            ensure!(is_due || !looks, "clock {at}: a look that is not due");
            if looks {
                self.run.looked_at = at;
                self.look();
            } else if is_due {
                let longest = self.longest_look();
                ensure!(
                    at < self.run.looked_at + longest,
                    "clock {at}: no look, {longest} clocks after the last one"
                );
                self.run.outcome.late += 1;
            }
        }
        self.clock += 1;
        Ok(())
    }

    /// What the clock brings to the register that starts and stops.
    fn start_or_stop(&mut self, command: &Command) -> Result<()> {
        if self.scene.restarts.is_empty() {
            return Ok(());
        }
        let (now, run) = (self.clock, &mut self.run);
        // The next clock is the first of those in which it empties itself.
        let empties = run.pixels.len() as u64 + 1;
        if command.reset {
            run.stops_at = now + 1;
            self.emptied_at = run.stops_at + empties;
        }
        match command.access {
            Some(Access::Write(register::CONTROL, 0)) => {
                if run.has(now + 1) {
                    self.emptied_at = now + 2 + empties;
                }
                run.stops_at = now + 2;
            }
            // The settings at the beginning, which come to rest before the photons, are no restart.
            Some(Access::Write(register::CONTROL, _)) if run.stops_at < u64::MAX => {
                while let Some((clock, report)) = self.reports.next_until(now)? {
                    self.apply(clock, report)?;
                }
                self.end_run()?;
                self.runs += 1;
                let starts_at = self.emptied_at.max(now + 2);
                self.run = Run::new(&self.scene, self.runs, starts_at);
            }
            _ => {}
        }
        Ok(())
    }

    /// Everything up to a look in clock `at`; whether there is one.
    fn apply_until(&mut self, at: u64) -> Result<bool> {
        while let Some((clock, report)) = self.reports.next_until(at)? {
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
        self.run.pixels.len() as u64 + self.run.fired + 18
    }

    fn look(&mut self) {
        let run = &mut self.run;
        let last = LaserCycle::new(run.outcome.cycles - 1);
        let passed = mem::take(&mut run.since_look);
        let statistics = &mut run.outcome.statistics;
        let events = statistics.events;
        run.before.clear();
        for pixel in &mut run.pixels {
            run.before.push(*statistics);
            let _ = pixel.end_laser_cycles(&run.config, statistics, last, passed);
        }
        run.fired = statistics.events - events;
        self.bins.look(self.clock, &run.pixels);
        run.outcome.looks += 1;
        run.looked.push_back((last.raw(), self.clock));
        if run.looked.len() > REMEMBERED {
            run.looked.pop_front();
        }
    }

    fn apply(&mut self, clock: u64, report: Report) -> Result<()> {
        let run = &mut self.run;
        match report {
            Report::Leaves(pixel) => {
                ensure!(clock < run.stops_at, "clock {clock}: an event leaves");
                let pixel = run.pixels.get_mut(usize::from(pixel));
                let pixel = pixel.context("no such macropixel")?;
                let event = pixel.take_event();
                let event = event.with_context(|| format!("clock {clock}: no event waits"))?;
                if matches!(self.scene.events, Events::Link | Events::System) {
                    let (time, word) = run.encoder.encode(&event);
                    let mut looked = run.looked.iter().rev();
                    let looked = looked.find(|(cycle, _)| *cycle == event.cycle.raw());
                    let ended = looked.map(|&(_, clock)| clock);
                    let time = time.map(|time| (time, None));
                    run.words.extend(time.into_iter().chain([(word, ended)]));
                } else {
                    run.taken.push_back(event);
                    self.compare_reads(clock)?;
                }
            }
            Report::Word(word) => {
                ensure!(
                    clock <= run.stops_at,
                    "clock {clock}: a word after the stop"
                );
                let (expected, ended) = run.words.pop_front().unzip();
                ensure!(
                    expected == Some(word),
                    "clock {clock}: {word:x?}, not {expected:x?}"
                );
                let latency = ended.flatten().map(|ended| clock - ended);
                run.outcome.latencies.extend(latency);
            }
            Report::Read(address, data) if address >= register::COUNTS => self.counts.push(data),
            Report::Read(address, data) if address >= register::HISTOGRAM => {
                self.bins.read(clock, address, data)?;
            }
            Report::Read(address, data) if address <= register::SIZE => {
                let expected = self.register_values.get(usize::try_from(address)?).copied();
                // Whether it runs yet is in the model only where it is started again.
                let known = if address == 0 { 3 } else { u32::MAX };
                let (runs, is_told) = (run.has(clock - 1), data >> 2 & 1 == 1);
                let was_stopped = self.runs > 0 || run.stops_at < u64::MAX;
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
        let event = self.run.taken.pop_front().context("no event")?;
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
    fn end(mut self) -> Result<ModelOutcome> {
        loop {
            match self.reports.next()? {
                (_, Report::End(waits)) => {
                    ensure!(!waits && self.run.words.is_empty(), "words wait");
                    break;
                }
                (clock, report) => self.apply(clock, report)?,
            }
        }
        let waits = self.run.pixels.iter().find(|pixel| pixel.has_event());
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
        let run = &mut self.run;
        let mut all = run.outcome.statistics;
        // A stop ends the last look: what macropixels had not decided does not count.
        let decides_at = run.looked_at + DECISION;
        let decided = usize::try_from(run.stops_at.saturating_sub(decides_at))?;
        let seen = *run.before.get(decided).unwrap_or(&all);
        for pixel in &run.pixels {
            pixel.add_photons_to(&mut all);
        }
        let expected = [
            all.counted + all.saturated,
            seen.saturated,
            all.rejected,
            all.gated_out,
            run.strays,
            seen.events,
            seen.deferred,
            seen.expired,
            seen.expired_deferred,
            run.outcome.looks,
            run.outcome.late,
            run.outcome.cycles,
        ];
        let (pairs, _) = self.counts.as_chunks::<2>();
        let counts: Vec<u64> = pairs
            .iter()
            .map(|&[low, high]| u64::from(low) | u64::from(high) << 32)
            .collect();
        let is_read = run.stops_at == u64::MAX && self.scene.events.has_registers();
        ensure!(
            counts.is_empty() && !is_read || counts == expected,
            "counts {counts:?}, not {expected:?}"
        );
        ensure!(all.photons() + run.strays == run.outcome.photons, "photons");
        self.counts.clear();
        run.outcome.statistics = all;
        self.total.add(&run.outcome);
        Ok(())
    }
}

/// What the simulation tells, one at a time.
struct Reports<R> {
    from: R,
    waiting: Option<(u64, Report)>,
}

impl<R: Read> Reports<R> {
    fn next(&mut self) -> Result<(u64, Report)> {
        match self.waiting.take() {
            Some(report) => Ok(report),
            None => Report::read(&mut self.from),
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

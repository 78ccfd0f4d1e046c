//! Photons into the FIFO at the paper's setting: the highest rate a processor sustains,
//! and what comes of lower ones.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use dtof::simulation::{Rates, SimulatedPixel};
use dtof_softcore::stream::{BINS, FEW};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;

use super::events;
use super::memory::MACROPIXELS;
use super::program::Ran;
use super::rtl::{Laser, Simulator};
use super::table::Row;

/// Photons of a run at the highest rate, about, or as many as come in so many laser cycles. At
/// other rates a run has as many laser cycles.
const PHOTONS: u32 = 50_000;
const LONGEST: u32 = 4_000_000;
/// Of the photons of a macropixel, background included.
const SIGNAL: f64 = 0.5;
/// Macropixels that share a processor.
const PIXELS: u8 = 4;
/// Clock cycles of a laser cycle: a laser of 10 MHz, a processor of 100 MHz.
const CLOCKS: u64 = 10;
/// Rates are counted in so many photons a laser cycle, [`PER_PHOTON`] make one.
const UNIT: f64 = 1e-5;
const PER_PHOTON: u32 = 100_000;
/// The highest rate is known to a part of so many: a tenth of a run has 5000 photons, give or
/// take 1.4 %.
const PARTS: u32 = 25;
/// Of the highest rate, the rates whose looks and events are told: one part in so many.
const RATES: [u32; 3] = [1, 2, 4];

/// Of the runs in which events are certain: laser cycles, and photons of a macropixel a
/// laser cycle, all of them signal.
const CERTAIN: u32 = 1500;
const CERTAIN_RATE: u32 = PER_PHOTON / 50;

/// What a run came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sustained {
    /// Core and instruction set, with a comma between.
    pub core: String,
    /// Photons of all macropixels a laser cycle, in [`UNIT`].
    pub rate: u32,
    /// Laser cycles between two looks at a macropixel, in the mean, in tenths.
    pub between_looks: u64,
    pub photons: u64,
    pub events: u64,
    /// Exposures that reached L2 without one.
    pub expired: u64,
    /// The most words in the FIFO.
    pub fill: u64,
}

impl Sustained {
    pub const HEADER: &str = "core,isa,photons a laser cycle,laser cycles between looks,photons,events,expired,highest fill";

    /// Its line of the file.
    pub fn csv(&self) -> String {
        let Self {
            core,
            photons,
            events,
            expired,
            fill,
            ..
        } = self;
        let (rate, between) = (self.rate(), self.between_looks());
        format!("{core},{rate:.5},{between},{photons},{events},{expired},{fill}")
    }

    /// What a line of the file says.
    pub fn parse(line: &str) -> Option<Self> {
        let words: Vec<&str> = line.split(',').collect();
        let [core, isa, rate, between, photons, events, expired, fill] = words[..] else {
            return None;
        };
        let (whole, tenths) = between.split_once('.')?;
        let rate = rate.replacen('.', "", 1);
        Some(Self {
            core: format!("{core},{isa}"),
            rate: (rate.len() == 6).then(|| rate.parse().ok())??,
            between_looks: whole.parse::<u64>().ok()? * 10
                + (tenths.len() == 1).then(|| tenths.parse::<u64>().ok())??,
            photons: photons.parse().ok()?,
            events: events.parse().ok()?,
            expired: expired.parse().ok()?,
            fill: fill.parse().ok()?,
        })
    }

    /// Photons of all macropixels a laser cycle.
    pub fn rate(&self) -> f64 {
        f64::from(self.rate) * UNIT
    }

    /// Events of all macropixels a second, of ten million laser cycles.
    #[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
    pub fn events_a_second(&self) -> f64 {
        self.events as f64 / self.photons.max(1) as f64 * self.rate() * 1e7
    }

    /// Laser cycles between two looks at a macropixel, to be looked at.
    pub fn between_looks(&self) -> String {
        format!("{}.{}", self.between_looks / 10, self.between_looks % 10)
    }
}

/// Clock cycles that a processor takes.
#[derive(Clone, Copy, Debug)]
pub struct Cycles {
    /// For a photon alone.
    count: u64,
    /// For a look without an event.
    look: u64,
}

impl Cycles {
    /// As the bench counted them.
    pub fn of(rows: &[Row]) -> Option<Self> {
        let of = |operation| {
            let row = rows.iter().find(|row| row.operation == operation);
            row.map(|row| row.cycles / 100)
        };
        Some(Self {
            count: of("photon: AsyncPixel::count")?,
            look: of("decision: look; no event")?,
        })
    }
}

/// What the photons of a processor are tried with.
pub struct Trials<'a> {
    pub simulator: &'a Simulator,
    /// Of the image `stream-N`.
    pub image: &'a dyn Fn(u8) -> PathBuf,
    pub folder: &'a Path,
    pub core: &'a str,
    pub cycles: Cycles,
}

/// What they come to.
pub struct Found {
    pub sustained: Vec<Sustained>,
    /// Bytes of the stack with so many macropixels.
    pub stack: Vec<(u8, u64)>,
    /// Events and decisions put off with a link that is slow.
    pub slow: (u64, u64),
}

/// A run.
#[derive(Clone, Copy, Debug)]
struct Run {
    pixels: u8,
    /// Photons of all macropixels a laser cycle, in [`UNIT`], and the part that is signal.
    rate: u32,
    signal: f64,
    /// Laser cycles, and the clock cycles of each.
    length: u32,
    clocks: u64,
    /// Clock cycles until the link answers.
    wait: u64,
    /// Whether photons of a macropixel that there is not come as well.
    strays: bool,
}

impl Trials<'_> {
    /// The highest rate, found by halving, and what comes of parts of it; and runs in which
    /// events are certain, the last with a slow link and photons of macropixels that
    /// there are not.
    pub fn run(&self) -> Result<Found> {
        let at = |rate, length| Run {
            pixels: PIXELS,
            rate,
            signal: SIGNAL,
            length,
            clocks: CLOCKS,
            wait: 0,
            strays: false,
        };
        // More than that it cannot count.
        let most = u64::from(PER_PHOTON) * CLOCKS / self.cycles.count.max(1);
        let (mut held, mut failed) = (0, u32::try_from(most)?);
        while failed - held > (held / PARTS).max(1) {
            let rate = held.midpoint(failed);
            let (counted, _) = self.stream(&at(rate, cycles(rate)))?;
            if counted.is_sustained() {
                held = rate;
            } else {
                failed = rate;
            }
        }
        ensure!(held >= RATES[2], "no rate is sustained");
        let mut sustained = Vec::new();
        for part in RATES {
            let run = at(held / part, cycles(held));
            let (counted, photons) = self.stream(&run)?;
            ensure!(counted.is_sustained(), "a lower rate is not sustained");
            counted.check(&run, &photons)?;
            sustained.push(Sustained {
                core: self.core.to_owned(),
                rate: run.rate,
                between_looks: (counted.cycles * u64::from(PIXELS) * 10)
                    .div_ceil(counted.looks.max(1)),
                photons: counted.photons,
                events: counted.events,
                expired: counted.expired,
                fill: counted.fill,
            });
        }
        let mut stack = Vec::new();
        for pixels in MACROPIXELS {
            let counted = self.certain(pixels, false)?;
            stack.push((pixels, counted.stack));
        }
        let slow = self.certain(PIXELS, true)?;
        ensure!(slow.deferred > 0, "a slow link puts nothing off");
        Ok(Found {
            sustained,
            stack,
            slow: (slow.events, slow.deferred),
        })
    }

    /// A run with a laser so slow that every macropixel is looked at in time and fires, at its best with a
    /// link that takes as long for a word as a macropixel for some events.
    fn certain(&self, pixels: u8, is_slow: bool) -> Result<Counted> {
        // A look at each macropixel in 20 laser cycles.
        let clocks = (u64::from(pixels) * self.cycles.look / 20).max(CLOCKS);
        let run = Run {
            pixels,
            rate: CERTAIN_RATE * u32::from(pixels),
            signal: 1.0,
            length: CERTAIN,
            clocks,
            wait: if is_slow {
                clocks * u64::from(CERTAIN) / 4
            } else {
                0
            },
            strays: is_slow,
        };
        let (counted, photons) = self.stream(&run)?;
        counted.check(&run, &photons)?;
        ensure!(
            counted.lost == 0 && counted.events >= u64::from(pixels),
            "{run:?}: {} photons lost, {} events",
            counted.lost,
            counted.events
        );
        Ok(counted)
    }

    fn stream(&self, run: &Run) -> Result<(Counted, Photons)> {
        let photons = photons(run)?;
        let mut text = String::new();
        let mut strays = 0;
        for (index, Photon { cycle, pixel, code }) in photons.iter().enumerate() {
            writeln!(text, "{cycle} {pixel} {code}")?;
            if run.strays && index % 10 == 0 {
                writeln!(text, "{cycle} {} {code}", u8::MAX - pixel)?;
                strays += 1;
            }
        }
        let file = self.folder.join("photons.txt");
        fs::write(&file, text).with_context(|| file.display().to_string())?;
        let laser = Laser {
            photons: &file,
            clocks: run.clocks,
            wait: run.wait,
        };
        // The last photons take as long as the rest at most, and then the bit-serial
        // processor divides for each digit of the report; and words that are left wait.
        let limit = 2 * u64::from(run.length) * run.clocks + 50_000_000 + 10 * run.wait;
        let image = (self.image)(run.pixels);
        let ran = self.simulator.stream(&image, limit, &laser)?;
        let counted = Counted::read(&ran).with_context(|| format!("{run:?}\n{}", ran.said()))?;
        ensure!(
            counted.strays == strays,
            "{run:?}: {} strays of {strays}",
            counted.strays
        );
        Ok((counted, photons))
    }
}

/// Laser cycles of a run at the highest rate.
fn cycles(rate: u32) -> u32 {
    (PHOTONS * (PER_PHOTON / 10) / rate.max(2)).min(LONGEST / 10) * 10
}

/// A photon that is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photon {
    pub cycle: u32,
    pub pixel: u8,
    pub code: u16,
}

/// In the order of their laser cycles.
pub type Photons = Vec<Photon>;

/// The photons of a run.
fn photons(run: &Run) -> Result<Photons> {
    let bins = u16::try_from(BINS)?;
    let each = f64::from(run.rate) * UNIT / f64::from(run.pixels);
    let mut simulated = Vec::new();
    for pixel in 0..run.pixels {
        let rates = Rates {
            background: each * (1.0 - run.signal) / f64::from(bins),
            signal: each * run.signal,
            // Targets at four ranges.
            position: 20.5 + 25.0 * f64::from(pixel % 4),
            sigma: 0.5,
        };
        let random = Pcg64::seed_from_u64(pixel.into());
        simulated.push(SimulatedPixel::new(&rates, bins, random)?);
    }
    let mut photons = Vec::new();
    for cycle in 0..run.length {
        for (pixel, simulated) in (0..).zip(&mut simulated) {
            simulated.next_cycle(|code| photons.push(Photon { cycle, pixel, code }));
        }
    }
    Ok(photons)
}

/// What the testbench and the program say of a run.
struct Counted {
    cycles: u64,
    looks: u64,
    strays: u64,
    photons: u64,
    events: u64,
    expired: u64,
    deferred: u64,
    stack: u64,
    lost: u64,
    fill: u64,
    /// Of each part of the run.
    lowest: Vec<u64>,
    /// The event words over the link.
    words: Vec<u128>,
    /// The numbers of the marks.
    marks: Vec<u32>,
}

impl Counted {
    fn read(ran: &Ran) -> Result<Self> {
        ensure!(ran.code == Some(0), "the run fails: {:?}", ran.code);
        let mut from_fifo = ran.errors.lines().filter_map(|line| {
            let numbers = line.strip_prefix("fifo: ")?.split([' ', ',']);
            Some(numbers.filter_map(|word| word.parse().ok()).collect())
        });
        let mut fifo = || -> Vec<u64> { from_fifo.next().unwrap_or_default() };
        let [sent, lost, fill] = fifo()[..] else {
            anyhow::bail!("what of the photons?");
        };
        let [ended, 0] = fifo()[..] else {
            anyhow::bail!("laser cycles are lost");
        };
        let lowest = fifo();
        let named = |prefix: &str| {
            let mut lines = ran.output.lines();
            let line = lines.find_map(|line| line.strip_prefix(prefix));
            let words = line.with_context(|| format!("no `{prefix}`"))?.split(' ');
            let numbers = words.filter_map(|word| word.parse().ok());
            anyhow::Ok(numbers.collect::<Vec<u64>>())
        };
        let counts = named("cycles ")?;
        let [
            cycles,
            looks,
            losses,
            strays,
            photons,
            events,
            expired,
            deferred,
        ] = counts[..]
        else {
            anyhow::bail!("what does the program say?");
        };
        let [stack] = named("stack ")?[..] else {
            anyhow::bail!("no stack");
        };
        ensure!(cycles == ended, "{ended} laser cycles, {cycles} told");
        ensure!(
            photons + strays + lost == sent,
            "{sent} photons, {lost} lost, {photons} and {strays} out of the FIFO"
        );
        ensure!(
            (losses > 0) == (lost > 0),
            "{lost} photons lost, {losses} losses seen"
        );
        let words = ran
            .output
            .lines()
            .filter_map(|line| line.strip_prefix("event "));
        let words = words.map(|word| u128::from_str_radix(word, 16));
        let marks = ran.errors.lines().filter_map(|line| {
            let number = line.strip_prefix("mark ")?.split(' ').next();
            Some(number.unwrap_or_default().parse())
        });
        Ok(Self {
            cycles,
            looks,
            strays,
            photons,
            events,
            expired,
            deferred,
            stack,
            lost,
            fill,
            lowest,
            words: words.collect::<Result<_, _>>()?,
            marks: marks.collect::<Result<_, _>>()?,
        })
    }

    /// Whether no photon was lost, and the FIFO was as good as empty in every part of the
    /// run: what waits does not grow.
    fn is_sustained(&self) -> bool {
        self.lost == 0 && self.lowest.iter().all(|&fill| fill <= u64::from(FEW))
    }

    /// Whether the host decides the same from the same photons and looks.
    fn check(&self, run: &Run, photons: &[Photon]) -> Result<()> {
        let (decided, all) = events::decided(run.pixels, &self.marks, photons)?;
        events::compare(&events::decoded(&self.words)?, &decided)?;
        let [of_core, of_host] = [
            [self.photons, self.events, self.expired, self.deferred],
            [all.photons(), all.events, all.expired, all.deferred],
        ];
        ensure!(
            of_core == of_host,
            "{run:?}: photons, events, expired, deferred {of_core:?}, on the host {of_host:?}"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RUN: Run = Run {
        pixels: PIXELS,
        rate: 10_000,
        signal: SIGNAL,
        length: 500_000,
        clocks: CLOCKS,
        wait: 0,
        strays: false,
    };

    #[test]
    fn photons_come_in_order_and_as_many_as_asked() {
        assert_eq!(cycles(RUN.rate), RUN.length);
        let photons = photons(&RUN).unwrap();
        let mut last = 0;
        for photon in &photons {
            assert!(photon.cycle >= last && photon.cycle < RUN.length);
            last = photon.cycle;
        }
        // A Poisson count of mean 50,000; five standard deviations.
        assert!(photons.len().abs_diff(50_000) < 5 * 224);
    }

    #[test]
    fn a_line_of_the_file_is_read_as_it_is_written() {
        let sustained = Sustained {
            core: "serv,rv32i".to_owned(),
            rate: 12_345,
            between_looks: 987,
            photons: 3,
            events: 2,
            expired: 1,
            fill: 9,
        };
        let line = sustained.csv();
        assert_eq!(line, "serv,rv32i,0.12345,98.7,3,2,1,9");
        assert_eq!(Sustained::parse(&line), Some(sustained));
        assert_eq!(Sustained::parse("serv,rv32i,0.12,98.7,3,2,1,9"), None);
    }

    fn ran(output: &str, errors: &str) -> Ran {
        Ran {
            code: Some(0),
            timed_out: false,
            output: output.to_owned(),
            errors: errors.to_owned(),
        }
    }

    const OUTPUT: &str = "\
event 0000000000000000000000000000000f
cycles 30 looks 4 losses 0 strays 1 photons 9 events 1 expired 0 deferred 0
stack 400
";
    const ERRORS: &str = "\
exit 0x0 cycle 80 instructions 40
fifo: 10 photons, 0 lost, highest fill 3
fifo: 30 laser cycles, 0 lost
fifo: lowest fill of each tenth 0 0 0 0 0 0 0 0 1 0
";

    #[test]
    fn every_loss_is_noticed() {
        let counted = Counted::read(&ran(OUTPUT, ERRORS)).unwrap();
        assert!(counted.is_sustained() && counted.words == [15]);
        assert!(counted.check(&RUN, &[]).is_err());
        let grows = ERRORS.replace(" 1 0\n", " 1 2\n");
        assert!(!Counted::read(&ran(OUTPUT, &grows)).unwrap().is_sustained());
        let lost = ERRORS.replace("10 photons, 0 lost", "11 photons, 1 lost");
        let seen = OUTPUT.replace("losses 0", "losses 1");
        assert!(!Counted::read(&ran(&seen, &lost)).unwrap().is_sustained());

        for (output, errors) in [
            (OUTPUT, &*lost),
            (&seen, ERRORS),
            (OUTPUT, &ERRORS.replace("30 laser", "31 laser")),
            (OUTPUT, &ERRORS.replace("cycles, 0 lost", "cycles, 1 lost")),
            (OUTPUT, &ERRORS.replace("10 photons", "12 photons")),
            (&OUTPUT.replace("stack", ""), ERRORS),
            (&OUTPUT.replace("0f", "0g"), ERRORS),
            ("", ERRORS),
            (OUTPUT, ""),
        ] {
            assert!(
                Counted::read(&ran(output, errors)).is_err(),
                "{output}{errors}"
            );
        }
        let mut failed = ran(OUTPUT, ERRORS);
        failed.code = Some(2);
        assert!(Counted::read(&failed).is_err());
    }
}

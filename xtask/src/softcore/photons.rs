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
use super::program::Ran;
use super::rtl::{Laser, Simulator};

/// Photons of a run at the highest rate, about. At others a run has as many laser cycles.
const PHOTONS: u32 = 10_000;
/// Of the photons of a macropixel, background included.
const SIGNAL: f64 = 0.5;
/// Macropixels of a run, but for those that tell the stack.
pub const PIXELS: u8 = 4;
/// The highest rate tried: one photon a laser cycle, in [`UNIT`].
const MOST: u32 = 100_000;
/// Rates are counted in so many photons a laser cycle, [`PER_PHOTON`] make one.
const UNIT: f64 = 1e-5;
const PER_PHOTON: u32 = 100_000;
/// The highest rate is known to a part of so many.
const PARTS: u32 = 100;
/// Of the highest rate, the rates whose looks and events are told: one part in so many.
const RATES: [u32; 3] = [1, 2, 4];

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

    /// Laser cycles between two looks at a macropixel, to be looked at.
    pub fn between_looks(&self) -> String {
        format!("{}.{}", self.between_looks / 10, self.between_looks % 10)
    }
}

/// What the photons of a processor are tried with.
pub struct Trials<'a> {
    pub simulator: &'a Simulator,
    /// Of the image `stream-N`.
    pub image: &'a dyn Fn(u8) -> PathBuf,
    pub folder: &'a Path,
    pub core: &'a str,
}

/// What they come to.
pub struct Found {
    pub sustained: Vec<Sustained>,
    /// Bytes of the stack with so many macropixels.
    pub stack: Vec<(u8, u64)>,
    /// Events and decisions put off with a link that is slow.
    pub slow: (u64, u64),
}

impl Trials<'_> {
    /// The highest rate, found by halving, and what comes of parts of it. Half of it is also
    /// run with a slow link and photons of macropixels that there are not, and with one
    /// and 64 macropixels.
    pub fn run(&self) -> Result<Found> {
        let (mut held, mut failed) = (0, MOST + 1);
        while failed - held > (held / PARTS).max(1) {
            let rate = held.midpoint(failed);
            let (ran, _) = self.stream(PIXELS, rate, cycles(rate), 0)?;
            if ran.is_sustained() {
                held = rate;
            } else {
                failed = rate;
            }
        }
        ensure!(held >= RATES[2], "no rate is sustained");
        let length = cycles(held);
        let mut found = Found {
            sustained: Vec::new(),
            stack: Vec::new(),
            slow: (0, 0),
        };
        let mut stack = 0;
        for part in RATES {
            let rate = (held / part).max(1);
            let (ran, photons) = self.stream(PIXELS, rate, length, 0)?;
            ensure!(ran.is_sustained(), "a lower rate is not sustained");
            ran.check(&photons)?;
            stack = stack.max(ran.stack);
            found.sustained.push(Sustained {
                core: self.core.to_owned(),
                rate,
                between_looks: (ran.cycles * u64::from(PIXELS) * 10).div_ceil(ran.looks.max(1)),
                photons: ran.photons,
                events: ran.events,
                expired: ran.expired,
                fill: ran.fill,
            });
        }
        let half = (held / 2).max(1);
        for pixels in [1, PIXELS, 64] {
            if pixels != PIXELS {
                let (ran, photons) = self.stream(pixels, half, length, 0)?;
                ran.check(&photons)?;
                stack = ran.stack;
            }
            found.stack.push((pixels, stack));
        }
        // A tenth of the run for each word.
        let wait = u64::from(length);
        let (ran, photons) = self.stream(PIXELS, half, length, wait)?;
        ran.check(&photons)?;
        found.slow = (ran.events, ran.deferred);
        ensure!(
            ran.deferred > 0 || ran.events < 10,
            "{} events over a slow link, none of them late",
            ran.events
        );
        Ok(found)
    }

    /// A run of so many macropixels at a rate, over so many laser cycles, with a link that
    /// answers after `wait` clock cycles. Every hundredth photon is also sent for a
    /// macropixel that there is not, if the link is slow.
    fn stream(&self, pixels: u8, rate: u32, length: u32, wait: u64) -> Result<(Counted, Photons)> {
        let photons = photons(pixels, rate, length)?;
        let mut text = String::new();
        let mut strays = 0;
        for (index, Photon { cycle, pixel, code }) in photons.iter().enumerate() {
            writeln!(text, "{cycle} {pixel} {code}")?;
            if wait > 0 && index % 100 == 0 {
                writeln!(text, "{cycle} {} {code}", u8::MAX - pixel)?;
                strays += 1;
            }
        }
        let file = self.folder.join("photons.txt");
        fs::write(&file, text).with_context(|| file.display().to_string())?;
        let laser = Laser {
            photons: &file,
            wait,
        };
        // The last photons take as long as the rest at most, and then the bit-serial
        // processor divides for each digit of the report; and each word waits.
        let limit = 2 * u64::from(length) * Laser::CLOCKS + 50_000_000 + 100 * wait;
        let ran = self
            .simulator
            .stream(&(self.image)(pixels), limit, &laser)?;
        let counted = Counted::read(&ran).with_context(|| format!("{}{}", ran.output, ran.errors));
        let counted = counted.with_context(|| format!("{pixels} macropixels, rate {rate}"))?;
        ensure!(
            counted.strays == strays,
            "{} strays of {strays}",
            counted.strays
        );
        Ok((counted, photons))
    }
}

/// Laser cycles of a run at the highest rate.
fn cycles(rate: u32) -> u32 {
    PHOTONS * (PER_PHOTON / 10) / rate * 10
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

/// The photons of so many macropixels over so many laser cycles.
fn photons(pixels: u8, rate: u32, length: u32) -> Result<Photons> {
    let bins = u16::try_from(BINS)?;
    let each = f64::from(rate) * UNIT / f64::from(pixels);
    let mut simulated = Vec::new();
    for pixel in 0..pixels {
        let rates = Rates {
            background: each * (1.0 - SIGNAL) / f64::from(bins),
            signal: each * SIGNAL,
            // Targets at four ranges.
            position: 20.5 + 25.0 * f64::from(pixel % 4),
            sigma: 0.5,
        };
        let random = Pcg64::seed_from_u64(pixel.into());
        simulated.push(SimulatedPixel::new(&rates, bins, random)?);
    }
    let mut photons = Vec::new();
    for cycle in 0..length {
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
            anyhow::bail!("what is this of the photons?");
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
        })
    }

    /// Whether no photon was lost, and the FIFO was as good as empty in every part of the
    /// run: what waits does not grow.
    fn is_sustained(&self) -> bool {
        self.lost == 0 && self.lowest.iter().all(|&fill| fill <= u64::from(FEW))
    }

    /// Whether the words over the link are what the host makes of the same photons.
    fn check(&self, photons: &[Photon]) -> Result<()> {
        let events = events::check(&self.words, photons)?;
        ensure!(
            events == self.events,
            "{events} events over the link, {} decided",
            self.events
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_come_in_order_and_as_many_as_asked() {
        let photons = photons(PIXELS, 10_000, cycles(10_000)).unwrap();
        let mut last = 0;
        for photon in &photons {
            assert!(photon.cycle >= last && photon.cycle < cycles(10_000));
            last = photon.cycle;
        }
        // A Poisson count of mean 10,000; five standard deviations.
        assert!(photons.len().abs_diff(10_000) < 5 * 100);
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
        assert!(counted.check(&[]).is_err());
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

//! Photons into the FIFO at the paper's setting: the highest rate a processor sustains,
//! and what comes of lower ones.

mod counted;
mod events;
mod photons;
pub mod sustained;

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

use crate::folder;
use crate::image::Images;
use crate::memory::MACROPIXELS;
use crate::rtl::Simulator;
use crate::table::Row;
use counted::Counted;
use photons::{PER_PHOTON, Photon, Photons, photons};
use sustained::SustainedRate;

/// Photons of a run at the highest rate, about, or as many as come in so many laser cycles. At
/// other rates a run has as many laser cycles.
const PHOTONS: u32 = 50_000;
const LONGEST: u32 = 4_000_000;
/// The share of signal among the photons of a macropixel.
const SIGNAL: f64 = 0.5;
/// Macropixels that share a processor.
const PIXELS: u8 = 4;
/// Clock cycles of a laser cycle: a laser of 10 MHz, a processor of 100 MHz.
const CLOCKS: u64 = 10;
/// The highest rate is known to a part of so many: a tenth of a run has 5000 photons, give or
/// take 1.4 %.
const PARTS: u32 = 25;
/// The rates whose looks and events are told, as divisors of the highest rate.
const RATES: [u32; 3] = [1, 2, 4];

/// Runs in which events are certain: their laser cycles, and the photons of a macropixel a
/// laser cycle, all of them signal.
const CERTAIN: u32 = 1500;
const CERTAIN_RATE: u32 = PER_PHOTON / 50;

/// The results of the trials.
pub struct Found {
    pub sustained: Vec<SustainedRate>,
    /// Bytes of the stack with so many macropixels.
    pub stack: Vec<(u8, u64)>,
    /// Events and decisions put off with a link that is slow.
    pub slow: (u64, u64),
}

/// A run.
#[derive(Clone, Copy, Debug)]
struct Run {
    pixels: u8,
    /// Photons of all macropixels a laser cycle, [`PER_PHOTON`] for one, and the part that is signal.
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

/// What photons are tried on.
struct Trials<'a> {
    simulator: &'a Simulator,
    images: &'a Images,
    /// The file of the photons.
    file: PathBuf,
    /// Clock cycles of a look without an event.
    look: u64,
}

/// The highest rate, found by halving, and what comes of parts of it; and runs in which
/// events are certain, the last with a slow link and photons of macropixels that
/// there are not. The bench has found the `rows` of the core.
pub fn run(simulator: &Simulator, images: &Images, core: &str, rows: &[Row]) -> Result<Found> {
    let cycles_of = |operation| {
        let row = rows.iter().find(|row| row.operation == operation);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "few, and not negative"
        )]
        let cycles = row.map(|row| row.cycles as u64);
        cycles.with_context(|| format!("no row `{operation}`"))
    };
    let trials = Trials {
        simulator,
        images,
        file: folder("")?.join("photons.txt"),
        look: cycles_of("decision: look; no event")?,
    };
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
    let most = u64::from(PER_PHOTON) * CLOCKS / cycles_of("photon: AsyncPixel::count")?.max(1);
    let (mut highest, mut failed) = (0, u32::try_from(most)?);
    while failed - highest > (highest / PARTS).max(1) {
        let rate = highest.midpoint(failed);
        let (counted, _) = trials.stream(&at(rate, cycles(rate)))?;
        if counted.is_sustained() {
            highest = rate;
        } else {
            failed = rate;
        }
    }
    ensure!(highest >= RATES[2], "no rate is sustained");
    let mut sustained = Vec::new();
    for part in RATES {
        let run = at(highest / part, cycles(highest));
        let counted = trials.checked(&run)?;
        ensure!(counted.is_sustained(), "a lower rate is not sustained");
        let tenths = counted.cycles * u64::from(PIXELS) * 10;
        sustained.push(SustainedRate {
            core: core.to_owned(),
            rate: run.rate,
            between_looks: tenths.div_ceil(counted.looks.max(1)) as f64 / 10.0,
            photons: counted.photons,
            events: counted.events,
            expired: counted.expired,
            fill: counted.fill,
        });
    }
    let mut stack = Vec::new();
    for pixels in MACROPIXELS {
        let counted = trials.certain(pixels, false)?;
        stack.push((pixels, counted.stack));
    }
    let slow = trials.certain(PIXELS, true)?;
    ensure!(slow.deferred > 0, "a slow link puts nothing off");
    Ok(Found {
        sustained,
        stack,
        slow: (slow.events, slow.deferred),
    })
}

impl Trials<'_> {
    /// A run with a laser so slow that every macropixel is looked at in time and fires; or
    /// would, if `is_slow`, for a link that takes a quarter of the run for a word.
    fn certain(&self, pixels: u8, is_slow: bool) -> Result<Counted> {
        // A look at each macropixel in 20 laser cycles.
        let clocks = (u64::from(pixels) * self.look / 20).max(CLOCKS);
        let run = Run {
            pixels,
            rate: CERTAIN_RATE * u32::from(pixels),
            signal: 1.0,
            length: CERTAIN,
            clocks,
            wait: u64::from(is_slow) * clocks * u64::from(CERTAIN) / 4,
            strays: is_slow,
        };
        let counted = self.checked(&run)?;
        let Counted { lost, events, .. } = counted;
        ensure!(
            lost == 0 && events >= u64::from(pixels),
            "{run:?}: {lost} photons lost, {events} events"
        );
        Ok(counted)
    }

    /// A run in which the host decides the same.
    fn checked(&self, run: &Run) -> Result<Counted> {
        let (counted, photons) = self.stream(run)?;
        let checked = counted.check(run.pixels, &photons);
        checked.with_context(|| format!("{run:?}"))?;
        Ok(counted)
    }

    fn stream(&self, run: &Run) -> Result<(Counted, Photons)> {
        let photons = photons(run.pixels, run.rate, run.signal, run.length)?;
        let mut text = String::new();
        let mut strays = 0;
        for (index, Photon { cycle, pixel, code }) in photons.iter().enumerate() {
            writeln!(text, "{cycle} {pixel} {code}")?;
            if run.strays && index % 10 == 0 {
                writeln!(text, "{cycle} {} {code}", u8::MAX - pixel)?;
                strays += 1;
            }
        }
        let file = &self.file;
        fs::write(file, text).with_context(|| file.display().to_string())?;
        // The last photons take as long as the rest at most, and then the bit-serial
        // processor divides for each digit of the report; and words that are left wait.
        let limit = 2 * u64::from(run.length) * run.clocks + 50_000_000 + 10 * run.wait;
        let image = self.images.flat(&format!("stream-{}", run.pixels));
        let link = [run.clocks, run.wait];
        let ran = self.simulator.stream(&image, limit, file, link)?;
        let counted = Counted::read(&ran).with_context(|| format!("{run:?}\n{}", ran.output()))?;
        let found = counted.strays;
        ensure!(found == strays, "{run:?}: {found} strays of {strays}");
        Ok((counted, photons))
    }
}

/// Laser cycles of a run at the highest rate.
fn cycles(rate: u32) -> u32 {
    (PHOTONS * (PER_PHOTON / 10) / rate.max(2)).min(LONGEST / 10) * 10
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_its_photons_or_its_length() {
        assert_eq!(cycles(PER_PHOTON / 10), 10 * PHOTONS);
        assert_eq!(cycles(100), LONGEST);
        assert_eq!(cycles(0), LONGEST);
    }
}

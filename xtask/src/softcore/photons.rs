//! Photons into the FIFO at the paper's setting: the highest rate a processor sustains.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use dtof::simulation::{Rates, SimulatedPixel};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;

use super::program::Ran;
use super::rtl::Simulator;

/// Photons of a run, about: many times those that the FIFO holds, which are 256 with as
/// many ends of laser cycles.
const PHOTONS: u32 = 10_000;
/// Clock cycles of a laser cycle: a laser of 10 MHz, a processor of 100 MHz.
pub const CLOCKS: u64 = 10;
/// Of the photons of a macropixel, background included.
const SIGNAL: f64 = 0.5;
const PIXELS: u8 = 4;
const BINS: u16 = 128;
/// The highest rate tried: one photon a laser cycle, in [`UNIT`].
const MOST: u32 = 10_000;
/// Rates are counted in so many photons a laser cycle, [`PER_PHOTON`] make one.
const UNIT: f64 = 1e-4;
const PER_PHOTON: u32 = 10_000;

/// What comes of a rate that a processor sustains.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sustained {
    /// Photons of the four macropixels a laser cycle, in [`UNIT`].
    pub rate: u32,
    /// Laser cycles, photons, looks, events, the most words in the FIFO.
    pub cycles: u64,
    pub photons: u64,
    pub looks: u64,
    pub events: u64,
    pub fill: u64,
    /// Bytes of the stack used.
    pub stack: u64,
}

impl Sustained {
    /// As the file has it, without the core.
    pub const HEADER: &str =
        "core,isa,photons a laser cycle,laser cycles between looks,photons,events,highest fill";

    /// One line of the file.
    pub fn csv(&self, core: &str) -> String {
        let Self {
            photons,
            events,
            fill,
            ..
        } = self;
        let (rate, between) = (self.rate(), self.between_looks());
        format!("{core},{rate:.4},{between:.1},{photons},{events},{fill}")
    }

    /// Photons of the four macropixels a laser cycle.
    pub fn rate(&self) -> f64 {
        f64::from(self.rate) * UNIT
    }

    /// Laser cycles between two looks at a macropixel, in the mean.
    #[allow(clippy::cast_precision_loss, reason = "few laser cycles and looks")]
    pub fn between_looks(&self) -> f64 {
        self.cycles as f64 * f64::from(PIXELS) / self.looks as f64
    }
}

/// The highest rate, found by halving, and what comes of half of it, which leaves the
/// processor time for looks.
pub fn sustained(simulator: &Simulator, image: &Path, folder: &Path) -> Result<[Sustained; 2]> {
    let try_rate = |rate: u32| -> Result<Option<Sustained>> {
        let file = folder.join("photons.txt");
        fs::write(&file, photons(rate)?).with_context(|| file.display().to_string())?;
        // The last photons take as long as the rest at most, and then the bit-serial
        // processor divides for each digit of the report.
        let limit = 2 * u64::from(cycles(rate)) * CLOCKS + 50_000_000;
        let ran = simulator.run(image, limit, Some(&file))?;
        read(rate, &ran)
    };
    let mut best = None;
    let (mut held, mut failed) = (0, MOST + 1);
    while failed - held > 1 {
        let rate = held.midpoint(failed);
        match try_rate(rate)? {
            Some(sustained) => (best, held) = (Some(sustained), rate),
            None => failed = rate,
        }
    }
    let best = best.context("photons are lost at the lowest rate")?;
    let half = try_rate((held / 2).max(1))?.context("photons are lost at half the rate")?;
    Ok([best, half])
}

/// Laser cycles of a run.
fn cycles(rate: u32) -> u32 {
    PHOTONS * PER_PHOTON / rate
}

/// The lines `laser cycle, macropixel, TDC code` of a rate.
fn photons(rate: u32) -> Result<String> {
    let mut lines = String::new();
    let each = f64::from(rate) * UNIT / f64::from(PIXELS);
    let mut pixels = Vec::new();
    for pixel in 0..PIXELS {
        let rates = Rates {
            background: each * (1.0 - SIGNAL) / f64::from(BINS),
            signal: each * SIGNAL,
            // Targets at four ranges.
            position: 20.5 + 25.0 * f64::from(pixel),
            sigma: 0.5,
        };
        let random = Pcg64::seed_from_u64(pixel.into());
        pixels.push(SimulatedPixel::new(&rates, BINS, random)?);
    }
    for cycle in 0..cycles(rate) {
        for (pixel, photons) in pixels.iter_mut().enumerate() {
            photons.next_cycle(|code| {
                let _ = writeln!(lines, "{cycle} {pixel} {code}");
            });
        }
    }
    Ok(lines)
}

/// What a run came to; `None` if it lost photons.
fn read(rate: u32, ran: &Ran) -> Result<Option<Sustained>> {
    let said = || format!("{}{}", ran.output, ran.errors);
    let words = |prefix: &str, text: &str| -> Option<Vec<u64>> {
        let line = text.lines().find(|line| line.starts_with(prefix))?;
        let words = line.split([' ', ',']);
        Some(words.filter_map(|word| word.parse().ok()).collect())
    };
    let fifo = words("fifo: ", &ran.errors).with_context(said)?;
    let [sent, lost, fill] = fifo[..] else {
        anyhow::bail!("what is this of the FIFO?\n{}", said());
    };
    if lost > 0 {
        return Ok(None);
    }
    ensure!(ran.code == Some(0), "the run fails\n{}", said());
    let counts = words("cycles ", &ran.output).with_context(said)?;
    let [cycles, looks, 0, photons, events, _] = counts[..] else {
        anyhow::bail!("what does the program say?\n{}", said());
    };
    ensure!(
        photons == sent,
        "{sent} photons in the FIFO, {photons} out of it"
    );
    let words_sent = ran.output.matches("event ").count() as u64;
    ensure!(
        words_sent >= events,
        "{events} events, {words_sent} words at the link"
    );
    let stack = words("stack ", &ran.output).with_context(said)?;
    Ok(Some(Sustained {
        rate,
        cycles,
        photons,
        looks,
        events,
        fill,
        stack: *stack.first().with_context(said)?,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_come_in_order_and_as_many_as_asked() {
        let lines = photons(1000).unwrap();
        let mut last = 0;
        for line in lines.lines() {
            let cycle: u32 = line.split(' ').next().unwrap().parse().unwrap();
            assert!(cycle >= last && cycle < cycles(1000));
            last = cycle;
        }
        // A Poisson count of mean 10,000; five standard deviations.
        assert!(lines.lines().count().abs_diff(10_000) < 5 * 100);
    }
}

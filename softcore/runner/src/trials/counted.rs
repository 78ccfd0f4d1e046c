//! The counts of a run, and whether they are right.

use anyhow::{Context, Result, ensure};
use dtof_softcore::stream::FEW;

use super::events;
use super::photons::Photon;
use crate::program::ProgramRun;
use crate::table;

/// The report of the testbench and the program on a run.
pub struct Counted {
    pub cycles: u64,
    pub looks: u64,
    pub strays: u64,
    pub photons: u64,
    pub events: u64,
    pub expired: u64,
    pub deferred: u64,
    pub stack: u64,
    pub lost: u64,
    pub fill: u64,
    /// The lowest fill of the FIFO in each part of the run.
    pub lowest: Vec<u64>,
    /// The event words over the link.
    pub words: Vec<u128>,
    /// The numbers of the marks.
    pub marks: Vec<u32>,
}

impl Counted {
    /// # Errors
    /// If the run failed, or does not add up.
    pub fn read(ran: &ProgramRun) -> Result<Self> {
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
        let count = |name: &str| {
            let mut words = ran.output.split_whitespace();
            words.find(|&word| word == name);
            let count = words.next().and_then(|count| count.parse::<u64>().ok());
            count.with_context(|| format!("the program does not say how many {name}"))
        };
        let (cycles, losses) = (count("cycles")?, count("losses")?);
        let (strays, photons) = (count("strays")?, count("photons")?);
        ensure!(cycles == ended, "{ended} laser cycles, {cycles} told");
        ensure!(
            photons + strays + lost == sent,
            "{sent} photons, {lost} lost, {photons} and {strays} out of the FIFO"
        );
        ensure!(
            (losses > 0) == (lost > 0),
            "{lost} photons lost, {losses} losses seen"
        );
        let words = ran.output.lines();
        let words = words.filter_map(|line| line.strip_prefix("event "));
        let words = words.map(|word| u128::from_str_radix(word, 16));
        let marks = table::marks(&ran.errors).map(|mark| anyhow::Ok(u32::try_from(mark?.0)?));
        Ok(Self {
            cycles,
            looks: count("looks")?,
            strays,
            photons,
            events: count("events")?,
            expired: count("expired")?,
            deferred: count("deferred")?,
            stack: count("stack")?,
            lost,
            fill,
            lowest,
            words: words.collect::<Result<_, _>>()?,
            marks: marks.collect::<Result<_>>()?,
        })
    }

    /// Whether no photon was lost, and the FIFO was as good as empty in every part of the
    /// run: what waits does not grow.
    pub fn is_sustained(&self) -> bool {
        self.lost == 0 && self.lowest.iter().all(|&fill| fill <= u64::from(FEW))
    }

    /// Whether the host decides the same from the same photons and looks.
    pub fn check(&self, pixels: u8, photons: &[Photon]) -> Result<()> {
        let (decided, all) = events::decided(pixels, &self.marks, photons)?;
        events::compare(&events::decoded(&self.words)?, &decided)?;
        let [of_core, of_host] = [
            [self.photons, self.events, self.expired, self.deferred],
            [all.photons(), all.events, all.expired, all.deferred],
        ];
        ensure!(
            of_core == of_host,
            "photons, events, expired, deferred {of_core:?}, on the host {of_host:?}"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let read = |output: &str, errors: &str| Counted::read(&ProgramRun::success(output, errors));
        let counted = read(OUTPUT, ERRORS).unwrap();
        assert!(counted.is_sustained() && counted.words == [15]);
        assert!(counted.check(4, &[]).is_err());
        let grows = ERRORS.replace(" 1 0\n", " 1 2\n");
        assert!(!read(OUTPUT, &grows).unwrap().is_sustained());
        let lost = ERRORS.replace("10 photons, 0 lost", "11 photons, 1 lost");
        let seen = OUTPUT.replace("losses 0", "losses 1");
        assert!(!read(&seen, &lost).unwrap().is_sustained());

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
            assert!(read(output, errors).is_err(), "{output}{errors}");
        }
        let mut failed = ProgramRun::success(OUTPUT, ERRORS);
        failed.code = Some(2);
        assert!(Counted::read(&failed).is_err());
    }
}

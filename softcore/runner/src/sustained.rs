//! A rate that a processor sustains, as the file has it.

use crate::photons::UNIT;

/// The results of a run at one rate.
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

    /// Reads a line of the file.
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

#[cfg(test)]
mod tests {
    use super::*;

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
}

//! What was simulated, as the files have it.

use crate::line::Column::{self, Name, Percent, Unchecked};
use crate::line::Line;

/// A scene in which the pixel processor did what `dtof-core` does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Proof {
    pub scene: String,
    pub macropixels: u32,
    pub photons: u64,
    pub cycles: u64,
    pub looks: u64,
    /// Laser cycles at whose end a look was due, but the last one was under way.
    pub late: u64,
    pub events: u64,
    pub deferred: u64,
    pub expired: u64,
    /// Photons that met a full counter.
    pub full: u64,
}

impl Line for Proof {
    const FILE: &str = "docs/results/bench/pixels.csv";
    const HEADER: &str = "scene,macropixels,photons,laser cycles,looks,late,events,put off,exposures without an event,photons in full counters";
    // The same bits from the same seed.
    const COLUMNS: &[Column] = &[Name; 10];

    fn csv(&self) -> String {
        let scene = self.scene.replace(',', ";");
        let macropixels = self.macropixels;
        let numbers = [
            self.photons,
            self.cycles,
            self.looks,
            self.late,
            self.events,
            self.deferred,
            self.expired,
            self.full,
        ];
        let numbers = numbers.map(|number| number.to_string()).join(",");
        format!("{scene},{macropixels},{numbers}")
    }

    fn of(words: &[&str]) -> Option<Self> {
        let &[scene, macropixels, ref numbers @ ..] = words else {
            return None;
        };
        let numbers: Option<Vec<u64>> = numbers.iter().map(|word| word.parse().ok()).collect();
        let &[
            photons,
            cycles,
            looks,
            late,
            events,
            deferred,
            expired,
            full,
        ] = &*numbers?
        else {
            return None;
        };
        Some(Self {
            scene: scene.replace(';', ","),
            macropixels: macropixels.parse().ok()?,
            photons,
            cycles,
            looks,
            late,
            events,
            deferred,
            expired,
            full,
        })
    }
}

/// Clocks from the end of the laser cycle that brings an event to REQ at the AER port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// Who packs the events.
    pub packer: String,
    /// Of 1000 clocks, those with a photon.
    pub photons: u64,
    pub clocks: u64,
    pub events: u64,
    pub late: u64,
    pub deferred: u64,
    /// What half of the events, 99 %, 99.9 % and all do not exceed.
    pub within: [u64; 4],
}

impl Line for Latency {
    const FILE: &str = "docs/results/bench/pixels-latency.csv";
    const HEADER: &str =
        "packed by,photons in 1000 clocks,clocks,events,late,put off,median,99 %,99.9 %,all";
    // What the program takes moves with its place in the cache.
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Name,
        Percent(5.0),
        Name,
        Unchecked,
        Percent(10.0),
        Percent(10.0),
        Unchecked,
        Unchecked,
    ];

    fn csv(&self) -> String {
        let numbers = [
            self.photons,
            self.clocks,
            self.events,
            self.late,
            self.deferred,
        ];
        let numbers = numbers.into_iter().chain(self.within);
        let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
        format!("{},{}", self.packer, numbers.join(","))
    }

    fn of(words: &[&str]) -> Option<Self> {
        let (packer, numbers) = words.split_first()?;
        let numbers: Option<Vec<u64>> = numbers.iter().map(|word| word.parse().ok()).collect();
        let &[
            photons,
            clocks,
            events,
            late,
            deferred,
            median,
            most,
            nearly,
            all,
        ] = &*numbers?
        else {
            return None;
        };
        Some(Self {
            packer: (*packer).to_owned(),
            photons,
            clocks,
            events,
            late,
            deferred,
            within: [median, most, nearly, all],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_files_is_read_as_it_is_written() {
        let line = "one; two,4,1,2,3,4,5,6,7,8";
        assert_eq!(Proof::parse(line).unwrap().csv(), line);
        assert_eq!(Proof::parse("one,4,1,2,3,4,5,6,7"), None);
        let line = "the program,500,1,2,3,4,5,6,7,8";
        assert_eq!(Latency::parse(line).unwrap().csv(), line);
        assert_eq!(Latency::parse("the program,500,1,2,3,4,5,6,7"), None);
    }
}

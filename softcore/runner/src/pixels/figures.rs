//! What was simulated, as the files and the page have it.

use std::fmt::Write as _;

use super::model::ModelOutcome;
use super::scene::MEGAHERTZ;
use crate::files::Column::{self, Name, Percent, Unchecked};
use crate::files::Line;

/// The page but for its tables, each of which stands where its name is in braces.
const PAGE: &str = include_str!("../../pixels.md");

pub const DOCUMENT: &str = "docs/results/bench/pixels.md";

/// A scene in which the pixel processor did what `dtof-core` does.
pub struct Simulated {
    pub scene: String,
    pub macropixels: u32,
    pub outcome: ModelOutcome,
}

impl Line for Simulated {
    const FILE: &str = "docs/results/bench/pixels.csv";
    const HEADER: &str = "scene,macropixels,photons,laser cycles,looks,late,events,put off,exposures without an event,photons in full counters";
    // The same bits from the same seed.
    const COLUMNS: &[Column] = &[Name; 10];

    fn csv(&self) -> String {
        let ModelOutcome {
            photons,
            cycles,
            looks,
            ..
        } = self.outcome;
        let (scene, results) = (self.scene.replace(',', ";"), self.results().join(","));
        format!(
            "{scene},{},{photons},{cycles},{looks},{results}",
            self.macropixels
        )
    }
}

impl Simulated {
    /// What files and page have last: late looks, events, decisions put off, exposures without an
    /// event, photons that met a full counter.
    fn results(&self) -> [String; 5] {
        let of = self.outcome.statistics;
        let late = self.outcome.late;
        [late, of.events, of.deferred, of.expired, of.saturated].map(|count| count.to_string())
    }
}

/// Clocks from the end of the laser cycle that brings an event to REQ at the AER port.
pub struct Latency {
    /// Who packs the events.
    pub packer: &'static str,
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
}

/// The whole file.
pub fn page(simulated: &[Simulated], latencies: &[Latency]) -> String {
    let (mut scenes, mut times) = (String::new(), String::new());
    for row in simulated {
        let of = &row.outcome;
        let between = of.cycles as f64 / of.looks.max(1) as f64;
        let _ = writeln!(
            scenes,
            "| {} | {} | {} | {between:.2} | {} | {} |",
            row.scene,
            row.macropixels,
            of.photons,
            of.looks,
            row.results().join(" | ")
        );
    }
    for row in latencies {
        let rate = row.photons as f64 / 1e3 * MEGAHERTZ;
        let events = row.events as f64 / row.clocks as f64 * MEGAHERTZ * 1e3;
        let micros = row
            .within
            .map(|clocks| format!("{:.2}", clocks as f64 / MEGAHERTZ));
        let _ = writeln!(
            times,
            "| {} | {rate:.1} | {events:.1} | {} | {} | {} | {} |",
            row.packer,
            row.events,
            row.late,
            row.deferred,
            micros.join(" | ")
        );
    }
    let photons: u64 = simulated.iter().map(|row| row.outcome.photons).sum();
    PAGE.replace("{photons}", &photons.to_string())
        .replace("{megahertz}", &MEGAHERTZ.to_string())
        .replace("{scenes}\n", &scenes)
        .replace("{latencies}\n", &times)
}

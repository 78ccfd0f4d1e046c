//! `docs/results/bench/pixels.md`: the figures of the files as tables.

use std::fmt::Write as _;

use super::row::{Latency, Proof};
use super::system::MEGAHERTZ;

/// The page but for its tables, each of which stands where its name is in braces.
const PAGE: &str = include_str!("../../pixels.md");

pub const DOCUMENT: &str = "docs/results/bench/pixels.md";

/// The whole file.
pub fn text(proofs: &[Proof], latencies: &[Latency]) -> String {
    let (mut scenes, mut times) = (String::new(), String::new());
    for row in proofs {
        let between = row.cycles as f64 / row.looks.max(1) as f64;
        let _ = writeln!(
            scenes,
            "| {} | {} | {} | {between:.2} | {} | {} | {} | {} | {} | {} |",
            row.scene,
            row.macropixels,
            row.photons,
            row.looks,
            row.late,
            row.events,
            row.deferred,
            row.expired,
            row.full
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
    let photons: u64 = proofs.iter().map(|row| row.photons).sum();
    PAGE.replace("{photons}", &photons.to_string())
        .replace("{megahertz}", &MEGAHERTZ.to_string())
        .replace("{scenes}\n", &scenes)
        .replace("{latencies}\n", &times)
}

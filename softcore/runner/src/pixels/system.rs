//! How long an event takes in the whole system, from the end of the laser cycle that decides to
//! REQ at the AER port.

use std::process::Command;

use anyhow::{Context, Result, ensure};
use dtof_softcore::stream;

use super::figures::Latency;
use super::model::{ModelOutcome, simulate};
use super::scene::{Events, Scene};
use crate::image::Images;
use crate::rtl::{package_folder, verilate};

/// The program that leaves packing to the hardware.
const HARDWARE: &str = "pixels-hardware";

/// A program for the system, and who packs.
const PROGRAMS: [(&str, &str); 2] = [
    (HARDWARE, "the pixel processor"),
    ("pixels-program", "the program"),
];

/// Clocks until REQ of an event of macropixel 0, packed by the hardware, with nothing before it:
/// `docs/softcore.md`.
const SOONEST: u64 = 41;

/// Photons a clock, in 1/256.
const RATES: [u32; 6] = [4, 8, 16, 32, 64, 256];

/// Clocks of a run.
const LENGTH: u64 = 1_000_000;

/// The chance that a slow receiver raises or lowers ACK in a clock, in 1/256.
const SLOW: u32 = 8;

/// Runs the system at several rates of photons, `length` clocks each.
pub fn measure() -> Result<Vec<Latency>> {
    let processor = package_folder("vexriscv")?;
    // Its RAM and its macropixels are those it has by itself.
    let simulator = verilate("system", "system", &processor, &[])?;
    let images = Images::build("rv32im", false)?;
    let mut all = Vec::new();
    for (program, packer) in PROGRAMS {
        let words = images.words(program);
        let run = |rate: u32, link| -> Result<(Scene, ModelOutcome)> {
            let scene = Scene {
                name: format!("the system, {rate}/256 photons a clock, events packed by {packer}"),
                rate,
                link,
                events: Events::System,
                length: LENGTH,
                seed: rate.into(),
                ..Scene::new("", 2, stream::config()?)
            };
            let mut command = Command::new(&simulator);
            command.arg(format!("+ram={}", words.display()));
            let outcome = simulate(&mut command, &scene)?;
            Ok((scene, outcome))
        };
        for rate in RATES {
            let (scene, mut outcome) = run(rate, 256)?;
            outcome.latencies.sort_unstable();
            let sorted = &outcome.latencies;
            let soonest = sorted.first().copied();
            ensure!(
                program != HARDWARE || soonest == Some(SOONEST),
                "{}: {soonest:?} clocks at least",
                scene.name
            );
            let within = |share: usize| {
                let place = (sorted.len() * share).div_ceil(1000);
                let latency = sorted.get(place.saturating_sub(1));
                latency
                    .copied()
                    .with_context(|| format!("{}: no events", scene.name))
            };
            let latency = Latency {
                packer,
                photons: u64::from(rate) * 1000 / 256,
                clocks: LENGTH,
                events: sorted.len() as u64,
                late: outcome.late,
                deferred: outcome.statistics.deferred,
                within: [within(500)?, within(990)?, within(999)?, within(1000)?],
            };
            println!(
                "{}: {} events as dtof-core, 99 % within {} clocks",
                scene.name, latency.events, latency.within[1]
            );
            all.push(latency);
        }
        let (scene, outcome) = run(256, SLOW)?;
        let (events, at_once) = (outcome.latencies.len() as u64, all.last());
        ensure!(
            at_once.is_some_and(|at_once| (1..at_once.events).contains(&events)),
            "{}: {events} events although ACK is slow",
            scene.name
        );
        println!(
            "{}, ACK at random: {events} events as dtof-core",
            scene.name
        );
    }
    Ok(all)
}

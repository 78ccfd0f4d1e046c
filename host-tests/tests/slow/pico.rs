//! Runs the images of the Pico in rp2040js. Needs Node.js and npm, which installs rp2040js.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow pico -- --nocapture
//! ```

use std::collections::BTreeSet;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::{U8F8, U16F16};
use dtof_core::{Array, Count, PaperRule, PixelAddress};
use dtof_data::photons::source::{Photon, PixelPhotons, Slice};
use dtof_device::{Client, HostTimeout, Task};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_link::{FaultRecord, Report, Source};
use dtof_sensors::dither::Dither;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use crate::boards::{decides_alike, once_per_bin, settings, with_all, with_dead_time};
use crate::rp2040::{Laser, NODE, NPM, Rp2040, image, install, run, write_edges};
use crate::{enabled, root, stack, target_folder};

/// The SPAD's pin.
const SPAD: u8 = 3;
const BINS: u32 = 128;
/// Nanoseconds of a bin.
const BIN_NS: u64 = 8;
/// The length of the SPAD's pulse: two samples, whenever it begins.
const PULSE_NS: u64 = 16;

#[test]
fn pico_decides_as_this_computer_and_keeps_to_its_stack() -> Result<()> {
    let Some(_alone) = enabled("the Pico in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let of_core = run(&image(&["self-test"], None)?)?;
    let expected = std::fs::read(root().join("firmware/self-test.out"))?;
    ensure!(
        of_core.success && of_core.output == expected,
        "differs from firmware/self-test.out"
    );
    ensure!(of_core.stack <= stack::MOST, "{of_core:?}");

    let sidecar = image(&[], None)?;
    let mut used = Vec::new();
    for (settings, cycles, over_usb) in [
        (settings(), 500, false),
        (with_all(), 500, false),
        (with_dead_time(), 500, false),
        (once_per_bin(), 300, false),
        (settings(), 200, true),
    ] {
        let mut board = if over_usb {
            Rp2040::start_with_usb(&sidecar)?
        } else {
            Rp2040::start(&sidecar, None)?
        };
        let client = Client::new(board.connect()?)?;
        let decided = decides_alike(client, &settings, Array::new(8, 8).unwrap(), cycles)?;
        let done = board.stop()?;
        println!("{decided}; {done:?}");
        used.push(done.stack);
    }
    stack::check(&sidecar, &used)
}

/// The bins of the photons of laser cycles, in order, and far enough apart for the timer.
type Cycles = Vec<Vec<u16>>;

/// `hits` photons per laser cycle over all bins. In every second laser cycle one of them comes from a
/// target at `target`.
fn photons(hits: usize, target: u16, cycles: usize, random: &mut Pcg32) -> Cycles {
    let mut below = |limit: u32| {
        let scaled = (u64::from(random.next_u32()) * u64::from(limit)) >> 32;
        u16::try_from(scaled).unwrap_or_default()
    };
    let mut cycle = || {
        let mut bins = BTreeSet::new();
        if below(2) == 0 {
            bins.insert(target);
        }
        while bins.len() < hits {
            let bin = below(BINS);
            let near = bins.range(bin.saturating_sub(3)..=bin + 3).next();
            if near.is_none() {
                bins.insert(bin);
            }
        }
        bins.into_iter().collect()
    };
    (0..cycles).map(|_| cycle()).collect()
}

/// The edges of the SPAD's pulses in laser cycles of `period_ns`, each somewhere in its bin. Every 16th
/// laser cycle also has pulses that do not count: one after the last bin, and one that begins before
/// bin 0 if the first bins are free.
fn edges(cycles: &Cycles, period_ns: u64, random: &mut Pcg32) -> Vec<(u64, u8, bool)> {
    dithered_edges(cycles, period_ns, Dither::OFF, random)
}

/// The same with laser cycles of random lengths.
fn dithered_edges(
    cycles: &Cycles,
    period_ns: u64,
    dither: Dither,
    random: &mut Pcg32,
) -> Vec<(u64, u8, bool)> {
    let mut edges = Vec::new();
    let shortest = period_ns - BIN_NS * u64::from(dither.range() / 2);
    let mut start = 0;
    let mut pulse = |from: u64| edges.extend([(from, SPAD, true), (from + PULSE_NS, SPAD, false)]);
    for ((number, cycle), added) in (0u64..).zip(cycles).zip(dither.added()) {
        if number % 16 == 7 && cycle.first().is_none_or(|&bin| bin > 5) {
            pulse(start - BIN_NS);
        }
        for &bin in cycle {
            pulse(start + BIN_NS * u64::from(bin) + u64::from(random.next_u32() % 8));
        }
        if number % 16 == 9 && shortest > 1120 {
            pulse(start + 1048);
        }
        start += shortest + BIN_NS * u64::from(added);
    }
    edges
}

fn counts(cycles: &Cycles) -> Vec<u32> {
    let mut counts = vec![0; BINS as usize];
    for &bin in cycles.iter().flatten() {
        counts[usize::from(bin)] += 1;
    }
    counts
}

/// An image that senses edges, and its host.
struct Timer {
    board: Rp2040,
    client: Client,
}

impl Timer {
    fn start(image: &Path, edges: &[(u64, u8, bool)], settings: &Settings) -> Result<Self> {
        let path = target_folder().join("pico-edges.txt");
        write_edges(&path, edges)?;
        let mut board = Rp2040::start(image, Some(&path))?;
        let mut client = Client::new(board.connect()?)?;
        let about = client.sensor()?.context("no sensor")?;
        ensure!(about.bin_width == Some(U16F16::from_num(BIN_NS * 1000)));
        let task = Task {
            settings,
            pixels: 1,
            columns: 1,
            dynamic_depth: None,
            host_timeout: HostTimeout::default(),
        };
        client.configure(&task.configuration(Source::Sensor)?)?;
        Ok(Self { board, client })
    }

    /// Waits until the given number of laser cycles have ended.
    fn wait(&mut self, cycles: u64) -> Result<Report> {
        let start = Instant::now();
        loop {
            let report = self.client.report()?;
            if report.cycles >= cycles {
                return Ok(report);
            }
            ensure!(
                start.elapsed() < Duration::from_secs(60),
                "{cycles} laser cycles take too long: {report:?}"
            );
            // Each request takes time from the laser cycles. On a busy computer the emulator is slower, so
            // requests come less often.
            thread::sleep((start.elapsed() / 4).max(Duration::from_millis(50)));
        }
    }

    /// The histogram of the exposure so far.
    fn histogram(&mut self) -> Result<Vec<u32>> {
        self.client.request_histogram(PixelAddress::new(0))?;
        loop {
            if let Some(answer) = self.client.poll_histogram()? {
                let histogram = answer.ok().context("no histogram")?;
                return Ok(histogram.counts);
            }
        }
    }
}

/// Settings without a decision within the laser cycles of a test.
fn gathers() -> Settings {
    senses().configured(|array| {
        array.l1 = 60_000;
        array.l2 = 65_000;
    })
}

pub fn senses() -> Settings {
    settings().configured(|array| {
        array.bin_width_ps = U16F16::from_num(BIN_NS * 1000);
        array.rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into();
    })
}

#[test]
fn pico_times_all_photons_of_a_laser_cycle() -> Result<()> {
    let Some(_alone) = enabled("the Pico's photon timer in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    const PERIOD_NS: u64 = 10_000;
    const TARGET: u16 = 90;
    for hits in 1..=6 {
        let mut random = Pcg32::seed_from_u64(hits as u64);
        let cycles = photons(hits, TARGET, 1000, &mut random);
        let edges = edges(&cycles, PERIOD_NS, &mut random);

        let mut timer = Timer::start(&image, &edges, &gathers())?;
        let report = timer.wait(1100)?;
        let found = timer.histogram()?;
        let expected = counts(&cycles);
        ensure!(
            found == expected,
            "{hits} a laser cycle: {found:?}, not {expected:?}"
        );
        ensure!(report.sensor_errors == 0 && report.statistics.rejected == 0);
        let done = timer.board.stop()?;
        ensure!(done.laser.pulses >= report.cycles, "{done:?}");

        // All hits show the target. In a TDC with one hit, six photons per laser cycle hide it behind early ones.
        let highest = |counts: &[u32]| (0..128).max_by_key(|&bin| counts[bin]).unwrap_or_default();
        ensure!(highest(&found) == usize::from(TARGET));
        let first: Cycles = cycles.iter().map(|cycle| cycle[..1].to_vec()).collect();
        let of_first = highest(&counts(&first));
        println!(
            "{hits} photons a laser cycle: highest bin {TARGET}, of the first ones {of_first}"
        );
        ensure!((of_first == usize::from(TARGET)) == (hits < 4));

        let [found, expected] = events(&image, &senses(), &cycles, &edges)?;
        ensure!(!expected.is_empty() && found == expected, "other events");
        println!("{} events, each as on this computer", found.len());
    }
    Ok(())
}

#[test]
fn pico_dithers_its_laser_and_decides_as_this_computer() -> Result<()> {
    let Some(_alone) = enabled("the Pico's dither in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    const PERIOD_NS: u64 = 10_000;
    for (range, seed) in [(128, 7), (2, 1), (254, u64::MAX), (0, 5)] {
        let mut random = Pcg32::seed_from_u64(seed);
        let cycles = photons(3, 90, 1500, &mut random);
        let dither = Dither::new(range, seed)?;
        let edges = dithered_edges(&cycles, PERIOD_NS, dither, &mut random);
        let with_dither = |settings: Settings| {
            settings.configured(|array| {
                array.dither_bins = range;
                array.dither_seed = seed;
            })
        };

        let mut timer = Timer::start(&image, &edges, &with_dither(gathers()))?;
        let report = timer.wait(1600)?;
        let found = timer.histogram()?;
        ensure!(found == counts(&cycles), "{range}: {found:?}");
        ensure!(report.sensor_errors == 0 && report.statistics.rejected == 0);
        let done = timer.board.stop()?;
        check_intervals(&done.laser, PERIOD_NS, dither)?;

        let settings = with_dither(senses());
        let [found, expected] = events(&image, &settings, &cycles, &edges)?;
        ensure!(
            !expected.is_empty() && found == expected,
            "{range}: other events"
        );
        println!(
            "dither of {range} bins: {} events, each as on this computer, {} pulses",
            found.len(),
            done.laser.pulses
        );
    }
    Ok(())
}

/// One state machine waits for its dither: it would sample at wrong times from then on.
#[test]
fn pico_starts_its_timer_again_when_a_state_machine_was_late() -> Result<()> {
    let Some(_alone) = enabled("the Pico's late dither in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    let image = image(&["photon-timer"], None)?;
    let mut board = Rp2040::start_with_fault(&image, "starve", 5.0, 1)?;
    let mut client = Client::new(board.connect()?)?;
    let settings = gathers().configured(|array| {
        array.dither_bins = 128;
        array.dither_seed = 7;
    });
    let task = Task {
        settings: &settings,
        pixels: 1,
        columns: 1,
        dynamic_depth: None,
        host_timeout: HostTimeout::default(),
    };
    client.configure(&task.configuration(Source::Sensor)?)?;
    let mut timer = Timer { board, client };
    let report = timer.wait(1500)?;
    ensure!(report.sensor_errors == 1, "{report:?}");
    drop(timer.client);
    let done = timer.board.stop()?;
    ensure!(done.planted_ms.is_some(), "no state machine was late");
    println!("late once, started again, {} pulses", done.laser.pulses);
    Ok(())
}

/// The times from pulse to pulse are uniform: none is shorter or longer than the range allows, their mean is
/// that without dither, and no length is rare or frequent.
fn check_intervals(laser: &Laser, period_ns: u64, dither: Dither) -> Result<()> {
    ensure!(laser.longest_ns == 16, "{laser:?}");
    let half = BIN_NS * u64::from(dither.range()) / 2;
    let lengths = u64::from(dither.range()) + 1;
    let total: u64 = laser.intervals.values().sum();
    // The last pulse may not have ended.
    ensure!(total + 1 == laser.pulses && total > 1500, "{laser:?}");
    let (shortest, longest) = (period_ns - half, period_ns + half);
    let expected = total as f64 / lengths as f64;
    let (mut sum, mut squares) = (0, 0.0);
    for length in (shortest..=longest).filter(|length| (length - shortest).is_multiple_of(BIN_NS)) {
        let count = laser.intervals.get(&length).copied().unwrap_or(0);
        sum += count;
        squares += (count as f64 - expected).powi(2) / expected;
    }
    ensure!(sum == total, "of another length: {laser:?}");
    // All lengths come again after 1,024 laser cycles, so that a deviation of one round is that of all: chi-square
    // has a mean of the rounds times its degrees of freedom. Each length and its mirror image come as often.
    let (freedom, rounds) = (lengths as f64 - 1.0, total.div_ceil(1024) as f64);
    ensure!(
        squares <= rounds * (freedom + 5.0 * (4.0 * freedom).sqrt()),
        "chi-square {squares} of {freedom} in {rounds} rounds: {laser:?}"
    );
    Ok(())
}

/// The events of the board and of this computer for the same photons.
fn events(
    image: &Path,
    settings: &Settings,
    cycles: &Cycles,
    edges: &[(u64, u8, bool)],
) -> Result<[Vec<dtof_core::DepthEvent>; 2]> {
    let mut timer = Timer::start(image, edges, settings)?;
    // An exposure ends with as many dark laser cycles.
    let all = u16::try_from(cycles.len())? + settings.configuration.l2 + 10;
    let report = timer.wait(all.into())?;
    ensure!(report.statistics.deferred == 0 && report.sensor_errors == 0);
    let found = timer.client.synchronise()?;
    timer.board.stop()?;

    let array = Array::new(1, 1).unwrap();
    let mut engine = host_engine(settings, array, &[PixelAddress::new(0)])?;
    let photons = (0..)
        .zip(cycles)
        .flat_map(|(cycle, bins)| bins.iter().map(move |&code| Photon { cycle, code }));
    let expected = engine.run(&Slice {
        first_cycle: 0,
        pixels: vec![PixelPhotons {
            cycles: all,
            photons: photons.collect(),
        }],
    })?;
    let found = found.into_iter().map(|event| match event {
        dtof_data::events::aer_file::Event::Depth(event) => Ok(event),
        other => anyhow::bail!("{other:?}"),
    });
    Ok([found.collect::<Result<_>>()?, expected])
}

#[test]
fn pico_keeps_up_with_a_laser_and_counts_what_it_loses() -> Result<()> {
    let Some(_alone) = enabled("the Pico's highest rates in rp2040js", &[NODE, NPM]) else {
        return Ok(());
    };
    install()?;
    // The rates of docs/boards.md, with the dither that a host asks for, and one that is too high. Its pulse is
    // the shortest, for the limits of the laser.
    for (hits, laser_hz, pulse_ns, range, keeps_up) in [
        (1, 138_889, 100, 128, true),
        (3, 100_000, 100, 128, true),
        (6, 78_125, 100, 128, true),
        (6, 800_000, 16, 0, false),
    ] {
        let image = image(&["photon-timer"], Some((laser_hz, pulse_ns)))?;
        let mut random = Pcg32::seed_from_u64(1);
        let cycles = photons(hits, 90, 5000, &mut random);
        let period = BIN_NS * u64::from((125_000_000 + laser_hz / 2) / laser_hz);
        let dither = Dither::new(range, 3)?;
        let settings = senses().configured(|array| {
            array.dither_bins = range;
            array.dither_seed = dither.seed();
        });
        let edges = dithered_edges(&cycles, period, dither, &mut random);
        let mut timer = Timer::start(&image, &edges, &settings)?;
        let report = timer.wait(if keeps_up { 5000 } else { 2000 })?;
        let done = timer.board.stop()?;
        println!("{hits} photons, {laser_hz} laser cycles a second: {report:?}; {done:?}");
        ensure!((report.sensor_errors == 0) == keeps_up, "{report:?}");
        if !keeps_up {
            let fault = FaultRecord::from_number(report.last_sensor_error);
            ensure!(fault == Some(FaultRecord::Data));
        }
    }
    Ok(())
}

//! An emulated device generates photons as fast as it can and finds events in them. This computer
//! generates the same photons and must find the same events and counts.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --release --package dtof-host-tests --test slow soak -- --ignored --nocapture
//! ```

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use dtof_core::fixed::types::U4F12;
use dtof_core::{Array, Count, Flags, Neighbours, PixelAddress, WindowRule};
use dtof_data::events::aer_file::Event;
use dtof_device::{Client, HostTimeout, Task};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_link::endpoint::LinkCounters;
use dtof_link::{Report, Source};
use dtof_sensors::{PhotonSink, Polled, simulated};

use crate::boards::{once_per_bin, settings, with_all, with_dead_time};
use crate::emulator::{Board, Emulator, QEMU};
use crate::sensed::Photons;
use crate::{enabled, stack};

const BOARD: Board = Board::Mps2An386;
/// The pixels of the simulated scene.
const ARRAY: Array = Array::new(4, 4).unwrap();
const PIXELS: u16 = 16;
/// Laser cycles per slice on this computer.
const SLICE: u16 = 10_000;
/// How often the device is asked for its progress.
const EVERY: Duration = Duration::from_millis(200);
/// A device without a photon for this time has stopped.
const PATIENCE: Duration = Duration::from_secs(60);

/// The name of `with_all`.
const ALL: &str = "windows, blocks, tracking, two echoes";

/// The results of a device.
struct Sensed {
    events: Vec<Event>,
    report: Report,
    here: LinkCounters,
    length: Duration,
    stack: u64,
}

/// The device generates and processes the photons of the given number of laser cycles.
fn on_device(image: &Path, settings: &Settings, cycles: u64) -> Result<Sensed> {
    let mut emulator = Emulator::start(BOARD, image, &[&format!("unpaced={cycles}")])?;
    let mut client = Client::new(emulator.connect()?)?;
    let start = Instant::now();
    let configure = |client: &mut Client, source| {
        let task = Task {
            settings,
            pixels: PIXELS,
            columns: ARRAY.columns(),
            dynamic_depth: None,
            host_timeout: HostTimeout::default(),
        };
        client.configure(&task.configuration(source)?)
    };
    configure(&mut client, Source::Sensor)?;
    let (mut events, mut last) = (Vec::new(), client.report()?);
    let (mut length, mut moved) = (None, Instant::now());
    loop {
        let since = Instant::now();
        while since.elapsed() < EVERY {
            ensure!(
                client.poll_report()?.is_none(),
                "a report without a request"
            );
            events.append(&mut client.take_events());
        }
        let report = client.report()?;
        events.append(&mut client.take_events());
        if report.cycles == cycles {
            length.get_or_insert_with(|| start.elapsed());
            // Events may have waited in their slots since the report before.
            if (report.statistics, report.blocks) == (last.statistics, last.blocks) {
                break;
            }
        }
        if report.cycles > last.cycles {
            moved = Instant::now();
        }
        ensure!(
            moved.elapsed() < PATIENCE,
            "the device stops after {} of {cycles} laser cycles",
            report.cycles
        );
        last = report;
    }
    // After the answer there are no more events.
    configure(&mut client, Source::Link)?;
    ensure!(client.take_events().is_empty(), "events past the last");
    Ok(Sensed {
        events,
        report: last,
        here: *client.counters(),
        length: length.unwrap_or_default(),
        stack: emulator.stop()?,
    })
}

/// Fails unless this computer gets the same results from the photons of `sensor`.
fn compare(
    sensed: &Sensed,
    settings: &Settings,
    mut sensor: impl FnMut(u16, &mut Photons) -> Polled,
) -> Result<()> {
    let addresses: Vec<_> = (0..PIXELS).map(PixelAddress::new).collect();
    let mut engine = host_engine(settings, ARRAY, &addresses)?;
    let mut sent = sensed.events.iter();
    let (mut cycle, cycles) = (0, sensed.report.cycles);
    let mut made = 0;
    while cycle < cycles {
        let length = u16::try_from(cycles - cycle).unwrap_or(SLICE).min(SLICE);
        let mut photons = Photons::new(PIXELS);
        sensor(length, &mut photons);
        let slice = photons.slice(cycle);
        made += slice
            .pixels
            .iter()
            .map(|pixel| pixel.photons.len() as u64)
            .sum::<u64>();
        for event in engine.run(&slice)? {
            let expected = Event::Depth(event);
            let sent = sent.next().with_context(|| {
                let number = sensed.events.len();
                format!("the device sends {number} events, the next should be {expected:?}")
            })?;
            ensure!(
                *sent == expected,
                "the device sends {sent:?}, not {expected:?}"
            );
        }
        cycle += u64::from(length);
    }
    if let Some(event) = sent.next() {
        bail!("the device sends one event more: {event:?}");
    }
    let counted = [sensed.report.statistics, sensed.report.blocks];
    let expected = engine.statistics();
    ensure!(counted == expected, "{counted:?}, not {expected:?}");
    let [pixels, blocks] = expected;
    let photons = pixels.photons();
    ensure!(photons == made, "{photons} of {made} photons counted");
    let events = pixels.events + blocks.events;
    ensure!(
        events == sensed.events.len() as u64,
        "{events} events counted"
    );
    Ok(())
}

/// The photons of the device.
fn scene() -> impl FnMut(u16, &mut Photons) -> Polled {
    let mut scene = simulated::scene();
    move |cycles, photons| scene.laser_cycles(cycles, photons)
}

/// Fails if bytes were lost. A pause of this computer may repeat a message.
fn loses_nothing(sensed: &Sensed) -> Result<()> {
    let report = &sensed.report;
    for link in [&report.link, &sensed.here] {
        ensure!(
            link.corrupt + link.oversized + link.foreign == 0,
            "{link:?}"
        );
    }
    let put_off = report.statistics.deferred + report.blocks.deferred;
    let unheard = u64::from(report.overrun + report.unknown + report.sensor_errors);
    ensure!(put_off + unheard + report.unaddressed == 0, "{report:?}");
    Ok(())
}

/// Runs the laser cycles and compares the results with this computer's.
fn runs_alike(name: &str, image: &Path, settings: &Settings, cycles: u64) -> Result<Sensed> {
    let sensed = on_device(image, settings, cycles)?;
    compare(&sensed, settings, scene())?;
    loses_nothing(&sensed)?;
    stack::check(image, &[sensed.stack])?;
    let Sensed { report, here, .. } = &sensed;
    let (photons, seconds) = (report.statistics.photons(), sensed.length.as_secs_f64());
    println!(
        "soak: device: {name}: {photons} photons, {} events, {} of them of blocks, identical; \
         {} messages repeated; {seconds:.0} s, {:.2} million photons/s; {} bytes of stack",
        sensed.events.len(),
        report.blocks.events,
        report.link.retransmitted + here.retransmitted,
        photons as f64 / seconds / 1e6,
        sensed.stack
    );
    Ok(sensed)
}

/// Passes photons on, with one of them in another bin.
struct Altered<'a> {
    photons: &'a mut Photons,
    until: &'a mut u32,
}

impl PhotonSink for Altered<'_> {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        // In the middle of the pulse of pixel 0.
        let is_signal = pixel.raw() == 0 && code == 21;
        *self.until = self.until.wrapping_sub(u32::from(is_signal));
        let is_altered = is_signal && *self.until == 0;
        let code = if is_altered { code + 1 } else { code };
        self.photons.photon(pixel, code);
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        self.photons.end_laser_cycles(cycles);
    }
    fn begin_frame(&mut self, _: u32) {}
    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {}
}

#[test]
fn a_device_as_fast_as_it_goes_decides_alike_and_one_other_photon_would_show() -> Result<()> {
    let Some(_alone) = enabled("photons made on mps2-an386", &[QEMU]) else {
        return Ok(());
    };
    let image = BOARD.image(&[])?;
    let settings = settings();
    let sensed = runs_alike("the paper's rule", &image, &settings, 20_000)?;
    runs_alike(ALL, &image, &with_all(), 20_000)?;
    any_difference_shows(sensed, &settings)
}

/// Wrong photons, events and counts are found.
fn any_difference_shows(mut sensed: Sensed, settings: &Settings) -> Result<()> {
    let differs = |sensed: &Sensed| compare(sensed, settings, scene()).is_err();
    // One photon, in the next bin.
    let (mut all, mut until) = (simulated::scene(), 1_000);
    let altered = compare(&sensed, settings, |cycles, photons| {
        let until = &mut until;
        all.laser_cycles(cycles, &mut Altered { photons, until })
    });
    let error = altered.unwrap_err().to_string();
    ensure!(error.starts_with("the device sends Depth("), "{error}");
    // Other random numbers.
    let mut late = scene();
    late(1, &mut Photons::new(PIXELS));
    ensure!(compare(&sensed, settings, late).is_err());
    // A lost event, a repeated one, two in the wrong order.
    let sent = sensed.events.clone();
    let middle = sent.len() / 2;
    sensed.events.remove(middle);
    ensure!(differs(&sensed));
    sensed.events.clone_from(&sent);
    sensed.events.insert(middle, sent[middle]);
    ensure!(differs(&sensed));
    sensed.events.clone_from(&sent);
    sensed.events.swap(middle, middle + 1);
    ensure!(differs(&sensed));
    // The first and the last one.
    for (first, length) in [(1, sent.len()), (0, sent.len() - 1)] {
        sensed.events = sent[first..length].to_vec();
        ensure!(differs(&sensed));
    }
    // A wrong count.
    sensed.events = sent;
    ensure!(!differs(&sensed));
    sensed.report.statistics.expired += 1;
    ensure!(differs(&sensed));
    Ok(())
}

#[test]
#[ignore = "takes minutes: `.ci/long soak` runs it"]
fn a_hundred_million_photons_of_a_device_are_decided_on_alike() -> Result<()> {
    let Some(_alone) = enabled("10^8 photons on mps2-an386", &[QEMU]) else {
        return Ok(());
    };
    let image = BOARD.image(&[])?;
    let seldom = |settings: Settings| settings.configured(|array| array.l1 = 100);
    let sensed = runs_alike("the paper's rule", &image, &seldom(settings()), 8_800_000)?;
    let photons = sensed.report.statistics.photons();
    ensure!(photons >= 100_000_000, "{photons} photons");
    runs_alike(ALL, &image, &seldom(with_all()), 880_000)?;
    Ok(())
}

/// The rules that are newer than the paper. The scene's TDC has no dead time, which the rule does not know. A window of 7 bins
/// reaches the photons of the next pixel, whose surface is 6 bins farther.
///
/// A dither is not among them: this sensor has none, and no decision depends on it, since a TDC code counts from its own
/// laser pulse. `pico.rs` has it, at the pins of an emulated Pico.
#[test]
#[ignore = "takes minutes: `.ci/long soak` runs it"]
fn a_hundred_million_photons_are_decided_on_alike_by_the_newer_rules() -> Result<()> {
    let Some(_alone) = enabled("10^8 photons of the newer rules on mps2-an386", &[QEMU]) else {
        return Ok(());
    };
    let image = BOARD.image(&[])?;
    let narrow = BOARD.image(&["--count8"])?;
    let wide = WindowRule::new(7, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    let with_neighbours = settings().configured(|array| {
        array.rule = wide.into();
        array.neighbours = Neighbours::new(8);
    });
    let counters_of_8_bits = Settings {
        counter_bits: 8,
        ..settings().configured(|array| array.l1 = 1000)
    };
    let mut photons = 0;
    let mut run = |name, image, settings: &Settings, cycles| {
        let sensed = runs_alike(name, image, settings, cycles)?;
        photons += sensed.report.statistics.photons();
        anyhow::Ok(sensed)
    };
    let name = "dead time, tracking, two echoes";
    run(name, &image, &with_dead_time(), 1_050_000)?;
    let sensed = run("neighbours", &image, &with_neighbours, 2_000_000)?;
    let is_confirmed = |event: &&Event| matches!(event, Event::Depth(event) if event.flags.contains(Flags::CONFIRMED));
    let confirmed = sensed.events.iter().filter(is_confirmed).count();
    let name = "once per bin, blocks, tracking, two echoes";
    let sensed = run(name, &image, &once_per_bin(), 2_700_000)?;
    let repeated = sensed.report.statistics.repeated;
    let sensed = run("8-bit counters", &narrow, &counters_of_8_bits, 3_050_000)?;
    let full = sensed.report.statistics.ended_full;
    println!(
        "soak: device: newer rules: {photons} photons in all; {confirmed} events confirmed, {repeated} photons \
         repeated, {full} exposures ended full"
    );
    ensure!(confirmed > 0 && repeated > 0 && full > 0);
    ensure!(photons >= 100_000_000, "{photons} photons");
    Ok(())
}

//! `dtof calibrate --device` on the firmware's sidecar with a simulated sensor, behind a TCP port
//! of this computer.

use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::common::{Scratch, assert_contains, names};
use crate::device::wall_sensor::{
    BACKGROUND, BRIGHT, HOT, LONG, PIXELS, POSITION, SIGMA, WALL, WHOLE_BIN_PS, WallSensor, device,
    photons,
};
use crate::device::{client, settings};
use dtof_core::fixed::types::U16F16;
use dtof_data::photons::MM_PER_PS;
use dtof_device::HostTimeout;
use dtof_device::histograms::{Collected, SoFar, collect};

fn number(toml: &str, key: &str) -> f64 {
    let line = toml
        .lines()
        .find(|line| line.starts_with(&format!("{key} = ")));
    let value = line.unwrap_or_else(|| panic!("no {key} in {toml}"));
    let value = value.split(['=', '#']).nth(1).unwrap();
    value.trim().parse().unwrap()
}

#[test]
fn the_sensor_on_the_desk_is_found_and_then_watched() {
    let scratch = Scratch::new();
    let name = device(WallSensor::new(WALL), LONG);
    let line = format!("calibrate --device {name} --seconds 4 --target-mm 2000 --glass no");
    let printed = scratch.printed(&format!("{line} --out dtof.toml"));
    assert_contains(&printed, "a pixel");
    let toml = scratch.read("dtof.toml");
    let is_near = |key, truth: f64, within: f64| {
        let found = number(&toml, key);
        assert!(
            (found - truth).abs() <= within,
            "{key}: {found}, not {truth}"
        );
    };
    let background = BACKGROUND / 128.0;
    is_near("background", background, 0.05 * background);
    is_near("sigma_bins", SIGMA, 0.05 * SIGMA);
    let bin_mm = 250.0 * MM_PER_PS;
    is_near("offset_mm", 2000.0 - POSITION * bin_mm, 0.1 * bin_mm);
    is_near("bin_width_ps", 250.0, 0.0);
    is_near("bins", 128.0, 0.0);
    is_near("columns", 4.0, 0.0);
    assert_contains(&toml, &format!("masked = [{HOT}]"));
    assert!(!toml.contains("gate = "), "{toml}");

    // The settings work: events are at the wall.
    let line = format!("monitor --device {name} --settings dtof.toml --seconds 1");
    let events = scratch.printed(&line);
    let mut rows = events.lines();
    let head: Vec<&str> = rows.next().unwrap().split(',').collect();
    let column = |name| head.iter().position(|&column| column == name).unwrap();
    let (range, pixel) = (column("range_mm"), column("pixel"));
    let mut ranges = Vec::new();
    for row in rows {
        let cells: Vec<&str> = row.split(',').collect();
        assert_ne!(cells[pixel], HOT.to_string());
        ranges.push(cells[range].parse::<f64>().unwrap());
    }
    assert!(ranges.len() > 100, "{}", ranges.len());
    ranges.sort_by(f64::total_cmp);
    let median = ranges[ranges.len() / 2];
    assert!((median - 2000.0).abs() < 0.1 * bin_mm, "{median}");

    // The report compares older settings.
    let line = format!("calibrate --device {name} --seconds 1 --target-mm 2500 --glass no");
    let printed = scratch.printed(&format!("{line} --settings dtof.toml --out newer.toml"));
    assert_contains(&printed, "Since the older settings:");
    assert_eq!(
        names(&scratch.path("")),
        ["dtof.html", "dtof.toml", "newer.html", "newer.toml"]
    );
}

fn collected(name: &str, bin_width_ps: U16F16, seconds: f64) -> Collected {
    let settings = settings().configured(|array| array.bin_width_ps = bin_width_ps);
    let length = Duration::from_secs_f64(seconds);
    let done = |so_far: &SoFar| so_far.elapsed >= length;
    let timeout = HostTimeout::default();
    collect(&mut client(name), &settings, PIXELS, timeout, done).unwrap()
}

/// Photons a laser cycle of some bins of a pixel, within four standard deviations.
#[track_caller]
fn has_rate(collected: &Collected, pixel: u16, bins: std::ops::Range<usize>, rate: f64) {
    let pixel = usize::from(pixel);
    let photons: u64 = collected.histograms[pixel][bins].iter().sum();
    let expected = rate * collected.cycles[pixel] as f64;
    let off = (photons as f64 - expected).abs() / expected.sqrt();
    assert!(
        off < 4.0,
        "pixel {pixel}: {photons} photons, not {expected}"
    );
}

#[test]
fn photons_and_laser_cycles_are_those_of_the_sensor_however_bright_it_is() {
    for rates in [WALL, BRIGHT] {
        let collected = collected(
            &device(WallSensor::new(rates), LONG),
            U16F16::lit("250"),
            2.5,
        );
        assert_eq!(collected.full, 0);
        for pixel in 0..PIXELS {
            let (signal, background) = rates(pixel);
            has_rate(&collected, pixel, 0..128, signal + background);
            has_rate(&collected, pixel, 60..128, background * 68.0 / 128.0);
            // Of 50,000 laser cycles.
            let cycles = collected.cycles[usize::from(pixel)];
            assert!(cycles > 5_000, "{:?}", collected.cycles);
        }
    }
}

/// Exposures are long then, and a counter fills at once.
#[test]
fn light_that_becomes_brighter_makes_exposures_shorter() {
    let suddenly = WallSensor {
        later: Some(photons(BRIGHT)),
        ..WallSensor::new(|_| (0.02, 0.02))
    };
    let collected = collected(&device(suddenly, LONG), U16F16::lit("250"), 3.0);
    assert!(collected.full > 0);
    // Of 3.75 photons a laser cycle in two of the three seconds.
    let photons: u64 = collected.histograms[0].iter().sum();
    let rate = photons as f64 / collected.cycles[0] as f64;
    assert!((1.0..3.7).contains(&rate), "{rate}");
}

#[test]
fn whole_histograms_add_up_and_so_do_their_laser_cycles() {
    let whole = WallSensor {
        histogram_cycles: Some((500, 0)),
        ..WallSensor::new(WALL)
    };
    let name = device(whole, LONG);
    let collected = collected(&name, WHOLE_BIN_PS, 2.0);
    for pixel in 0..PIXELS {
        let (signal, background) = WALL(pixel);
        has_rate(&collected, pixel, 0..128, signal + background);
        // Three histograms of at least 500 laser cycles.
        let cycles = collected.cycles[usize::from(pixel)];
        assert!(cycles >= 1_500, "{cycles}");
    }

    let scratch = Scratch::new();
    let line = format!("calibrate --device {name} --seconds 3 --out dtof.toml");
    scratch.printed(&line);
    let toml = scratch.read("dtof.toml");
    assert!((number(&toml, "bin_width_ps") - 100.0).abs() < 1e-9);
    assert!(
        (number(&toml, "laser_hz") - 20_000.0).abs() < 1e-9,
        "{toml}"
    );
    let ratio = number(&toml, "background") / (BACKGROUND / 128.0);
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
    let refused = scratch.run(&format!("{line} --recorded-cycles 510"));
    scratch.refused(&refused, &["this device counts its laser cycles"]);
}

#[test]
fn it_ends_when_there_are_photons_enough() {
    let scratch = Scratch::new();
    let name = device(WallSensor::new(WALL), LONG);
    let line = format!("calibrate --device {name} --seconds 500 --photons 3000 --out dtof.toml");
    scratch.printed(&line);
    assert!(number(&scratch.read("dtof.toml"), "background") > 0.0);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_with_what_there_is() {
    let scratch = Scratch::new();
    let name = device(WallSensor::new(WALL), LONG);
    let line = format!("calibrate --device {name} --seconds 500 --out dtof.toml");
    let mut calibrate = scratch
        .command(&line)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_secs(2));
    let id = calibrate.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(sent.success());
    assert!(calibrate.wait().unwrap().success());
    assert!(number(&scratch.read("dtof.toml"), "background") > 0.0);
}
